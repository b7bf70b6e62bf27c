"""Commands on a ROS domain of their own, as in tests/ros/launch."""

from tests.ros.launch.conftest import lupin

__all__ = ["lupin"]
