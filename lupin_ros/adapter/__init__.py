"""rclpy made safe: nodes, calls, actions and parameters for all who talk to ROS 2; knows no mission."""
