"""Runs a chart: one pure step from (configuration, event, time) to (configuration, commands)."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
