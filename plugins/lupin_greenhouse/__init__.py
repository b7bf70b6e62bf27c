"""The profile of greenhouse robots (`profile.py`), and what several plugins know of their world.

Places and turns, the layout, what `lupin_msgs` mean, when a mission is under way: pure Python and numpy, in
metres, radians and seconds. Only `node` knows ROS.
"""
