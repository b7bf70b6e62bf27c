"""Loads missions: YAML with positions, models, and one composed, checked chart."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
