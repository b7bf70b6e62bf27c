"""Calibrates the zero of the servos by a chart of its own, run by the engine in the arm's process.

`lifecycle.yaml` and `calibration.yaml` are the chart, `catalog` its operations, `offsets` the computation.
Loads without ROS.
"""
