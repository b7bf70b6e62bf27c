"""rclpy made safe: nodes, calls, actions and parameters for all who talk to ROS 2; knows no mission."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
