"""Charts by others: imports SCXML and behavior trees as missions, and exports missions as SCXML."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
