"""Lupin engine: robot missions as YAML statecharts, checked, simulated and run over ROS 2."""

import sys

from lupin_engine.moved import MovedFinder

__version__ = "0.1.0"

# First: below a moved package the finder of paths would load a second copy of each module.
sys.meta_path.insert(0, MovedFinder())
