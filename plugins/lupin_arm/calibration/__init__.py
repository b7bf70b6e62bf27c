"""Setting the zero of the servos: a chart of its own, run by the engine in the arm's process.

`lifecycle.yaml` and `calibration.yaml` say what happens when, `catalog` what they can do, `offsets` what is
reckoned. Loads without ROS.
"""
