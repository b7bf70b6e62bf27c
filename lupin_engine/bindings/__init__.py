"""The second language: a plugin that is written down, for what somebody offers over ROS already."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
