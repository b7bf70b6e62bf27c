"""Properties of every step: those that always hold, and those that the author of a mission wrote."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
