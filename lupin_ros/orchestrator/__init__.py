"""The node that runs missions: a machine, its plugins' clients, the journal, and the operator's services."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
