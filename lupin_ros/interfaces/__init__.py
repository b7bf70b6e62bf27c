"""The interfaces of ROS that a run uses, as types for programs that speak to it through rosbridge."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
