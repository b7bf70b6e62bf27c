"""The ROS 2 edge: everything that knows rclpy, and what a process needs before it may import it."""
