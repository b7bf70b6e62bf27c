"""What an orchestrator offers and tells, as plain data: real or simulated, for any display. Needs no ROS."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
