"""The loop between a machine and its plugins in virtual time: scripted servers, and scenarios."""

#: What scenario files end in. It stands here for those who look for such files and need no more of this room.
SUFFIX = ".scenario.yaml"
