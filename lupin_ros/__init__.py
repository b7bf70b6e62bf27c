"""The engine on ROS 2."""
