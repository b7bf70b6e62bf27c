"""The node `lupin_arm`: presets, sliders, library and calibration of the arm; no other node commands it."""

from __future__ import annotations

from lupin_arm.node.services import main
from lupin_arm.node.settings import PARAMETERS

__all__ = ["PARAMETERS", "main"]
