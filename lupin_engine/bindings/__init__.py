"""The second language: a plugin that is written down, for what somebody offers over ROS already."""
