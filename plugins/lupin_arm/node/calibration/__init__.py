"""The calibration of the servos: its service, its chart, and what the chart does to the servos."""
