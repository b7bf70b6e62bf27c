"""The data that an orchestrator publishes and answers with, real or simulated. Needs no ROS."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
