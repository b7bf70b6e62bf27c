"""The node `perception_aggregator`: fuses the detectors' frames into tags, flowers and pests."""

from __future__ import annotations

from lupin_perception.node.aggregator import NAME, PARAMETERS, Aggregator, main
from lupin_perception.node.settings import check

__all__ = ["NAME", "PARAMETERS", "Aggregator", "check", "main"]
