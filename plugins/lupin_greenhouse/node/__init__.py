"""The side of the greenhouse that talks to ROS."""
