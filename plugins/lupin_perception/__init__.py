"""What the cameras know: whether the tag in front of the robot is the expected one."""
