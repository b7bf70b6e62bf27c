"""Starting, watching and stopping the processes of a run, and following the mission that they carry out."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
