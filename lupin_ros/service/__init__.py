"""What an orchestrator offers and tells, as plain data: real or simulated, for any display. Needs no ROS."""
