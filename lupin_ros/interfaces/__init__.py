"""The interfaces of ROS that a run uses, as types for programs that speak to it through rosbridge."""
