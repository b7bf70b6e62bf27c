"""Bindings: YAML files that make a plugin of existing ROS services, actions and topics."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
