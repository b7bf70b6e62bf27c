"""What always holds, whatever the world does: properties, and the ways to look for their breach."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
