"""Commands on a ROS domain of their own, as in tests/lupin_ros/launch."""

from tests.lupin_ros.launch.conftest import lupin

__all__ = ["lupin"]
