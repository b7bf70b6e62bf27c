"""Verbs about who may do what: signed missions, permissions of ROS 2."""
