"""Offers all services of the arm on one node: only one process may command the arm.

Clients know services by name, so the node's name does not matter to them.
"""

from __future__ import annotations

from collections.abc import Sequence

from lupin_arm.node.arm import Arm
from lupin_arm.node.calibration.procedure import serve_calibration
from lupin_arm.node.gates import Gates, HardwareGate, MissionGate
from lupin_arm.node.library import serve_library
from lupin_arm.node.operator_services import serve_presets, serve_sliders, serve_torque
from lupin_arm.node.settings import PARAMETERS
from lupin_greenhouse import WATCHDOG_TIMEOUT, WATCHED, SilenceWatchdog
from lupin_ros.adapter import RosNode


def main(arguments: Sequence[str]) -> int:
    """Run the node until it is stopped; `arguments` are the ROS arguments."""
    with RosNode("lupin_arm", arguments, PARAMETERS, managed=True) as ros:
        serve_all(ros)
        ros.spin()
    return 0


def serve_all(ros: RosNode) -> Arm:
    """Offer all services of the arm on a node that has its parameters; return the arm."""
    values = ros.parameters()
    hardware = HardwareGate(ros, values["hardware"])
    arm = Arm(ros, values)
    serve_presets(ros, arm, values["preset_duration"])
    serve_sliders(ros, arm, values["init_duration"])
    serve_torque(ros, arm)
    watchdog = SilenceWatchdog(ros.steady_timer, values[WATCHDOG_TIMEOUT], arm.halt, WATCHED)
    mission = MissionGate(ros, values["mission_state_topic"], watchdog)
    serve_library(ros, arm, mission, values["library_path"])
    serve_calibration(ros, arm, Gates(hardware, mission), values)
    return arm
