"""All services of the arm, on one node: only one may command it, and what one does the others must know.

Operators and missions know services by name, so it does not matter to them which node has them.
"""

from __future__ import annotations

from collections.abc import Sequence

from lupin_arm.node import calibration, library, power, presets, sliders
from lupin_arm.node.arm import Arm
from lupin_arm.node.hardware import Hardware
from lupin_arm.node.mission import Mission
from lupin_arm.node.settings import PARAMETERS
from lupin_engine.ros.adapter.node import RosNode


def main(arguments: Sequence[str]) -> int:
    """Run the node until it is told to stop; `arguments` are the ROS arguments."""
    with RosNode("lupin_arm", arguments, PARAMETERS) as ros:
        serve_all(ros)
        ros.spin()
    return 0


def serve_all(ros: RosNode) -> Arm:
    """Offer all services of the arm on a node that has its parameters; return what they all move."""
    values = ros.parameters()
    hardware = Hardware(ros, values["hardware"])
    arm = Arm(ros, values)
    presets.serve(ros, arm, values["preset_duration"])
    sliders.serve(ros, arm, values["init_duration"])
    power.serve(ros, arm)
    mission = Mission(ros, values["mission_state_topic"])
    library.serve(ros, arm, mission, values["library_path"])
    calibration.serve(ros, arm, calibration.Gates(hardware, mission), values)
    return arm
