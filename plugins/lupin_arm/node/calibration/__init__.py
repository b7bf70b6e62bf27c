"""The calibration of the servos over ROS: its service, its chart, and the driver of the chart's
operations."""
