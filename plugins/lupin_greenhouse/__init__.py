"""What several plugins know of the world, each without the others: places and turns, and the layout.

Pure Python and numpy; nothing here knows a mission, a plugin or ROS. Metres, radians, seconds.
"""
