"""The gateway: pages in a browser speak rosbridge's protocol to the robot, and none can hold it up."""
