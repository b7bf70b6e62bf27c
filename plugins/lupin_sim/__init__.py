"""A simulated robot for machines without Nav2: drives in the greenhouse, and fails on request.

`floor` plans around the tables, `robot` moves and drains, `faults` says what goes wrong: plain Python with
time as an argument. `node` puts them behind the topics and the action that the real robot has.
"""
