"""A run as a file that anybody can open: every topic, as MCAP with the definitions of its messages."""
