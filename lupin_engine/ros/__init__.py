"""The engine on ROS 2: the node that runs missions, and the operator's side of it."""
