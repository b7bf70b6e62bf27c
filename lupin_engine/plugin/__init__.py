"""The contract with the outside world: what plugins offer, as typed data that loads without ROS."""
