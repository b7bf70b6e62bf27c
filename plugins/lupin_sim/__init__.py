"""A simulated robot for machines without Nav2: drives in the greenhouse, and fails on request.

`floor` plans around the tables, `robot` moves and drains, `faults` injects faults: plain Python with time as
an argument. `node` offers them as the real robot's topics and action.
"""
