"""The profile of greenhouse robots (`profile.py`), and what several plugins know of their world.

Places and turns, the layout, what `lupin_msgs` mean, when a mission is under way: pure Python and numpy, in
metres, radians and seconds. Only `node` knows ROS.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
