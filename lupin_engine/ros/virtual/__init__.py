"""What pages show that is no robot, in the words of one; needs no ROS."""
