"""The ROS side of bindings: operations of plain services, actions and topics."""
