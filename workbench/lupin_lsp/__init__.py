"""Editor support: JSON Schemas of the language, and a language server."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
