"""Lupin engine: robot missions as YAML statecharts, checked, simulated and run over ROS 2."""

import sys

import lazy_loader

from lupin_engine.moved import MovedFinder

__version__ = "0.1.0"

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

# First: below a moved package the finder of paths would load a second copy of each module.
if not any(isinstance(finder, MovedFinder) for finder in sys.meta_path):
    sys.meta_path.insert(0, MovedFinder())
