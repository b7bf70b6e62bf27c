"""The requirements of a node on this machine: an importable rclpy."""

from __future__ import annotations

from lupin_engine.errors import UsageError
from lupin_ros.adapter import environment

#: How to get ROS 2, in the words that every message uses.
INSTALL_ROS = (
    "install it with `pip install 'lupin-engine[ros]'` (Linux x86-64, Python 3.10 to 3.13), or source an apt "
    "ROS 2 Jazzy; in a checkout `make run` does everything"
)
#: What to do about a ROS 2 whose libraries are not found.
SOURCE_ROS = "source the setup.bash of its installation in this shell"


def prepare_ros() -> None:
    """Prepare this process to import rclpy.

    Raises:
        UsageError: ROS 2 is not installed or not sourced, or two installations are mixed, with advice.
    """
    if environment.rclpy_source() is None:
        raise UsageError(f"ROS 2 is not installed for this Python; {INSTALL_ROS}")
    environment.prepare()
    problem = environment.rclpy_problem()
    if problem:
        raise UsageError(f"ROS 2 is there, but cannot be used: {problem}; {SOURCE_ROS}")
