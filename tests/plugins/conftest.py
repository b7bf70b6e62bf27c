"""The fixtures of the ROS tests, where there is a ROS."""

from __future__ import annotations

from importlib.util import find_spec

if find_spec("rclpy") is not None:
    from tests.ros.conftest import make_node, pytest_configure, ros_domain

    __all__ = ["make_node", "pytest_configure", "ros_domain"]
