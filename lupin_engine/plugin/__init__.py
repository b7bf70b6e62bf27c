"""The contract with the outside world: the offers of plugins as typed data, which loads without ROS."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
