"""Properties of every step: the built-in ones, and those that a mission's author wrote."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
