"""The node `lupin_sim`: the topics and the action of the real robot, over the simulated one."""

from __future__ import annotations

from lupin_sim.node.robot import PARAMETERS, SimNode, check, main

__all__ = ["PARAMETERS", "SimNode", "check", "main"]
