"""The greenhouse profile (`profile.py`), and shared models: frames, poses, layout, messages, the stop.

Pure Python and numpy, in metres, radians and seconds. Only `node` knows ROS.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
