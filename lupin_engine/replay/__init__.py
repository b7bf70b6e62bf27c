"""Analysis of a run: story, timeline, coverage, figures, explanations, and a scenario made of it."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
