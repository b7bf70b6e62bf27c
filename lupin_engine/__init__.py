"""Lupin engine: robot missions as YAML statecharts, checked, simulated and run over ROS 2."""

__version__ = "0.1.0"
