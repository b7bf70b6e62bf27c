"""The greenhouse's parts that need ROS: the stop listener and the watchdog."""
