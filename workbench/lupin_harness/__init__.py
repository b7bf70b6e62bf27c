"""The harness: what every plugin must keep, as checks that anybody can run against theirs.

`cases` has the test classes for pytest; `rules` needs no ROS, what `live` demands is tried over ROS 2.
"""
