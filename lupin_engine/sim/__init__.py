"""The loop between a machine and its plugins in virtual time: scripted servers, and scenarios."""

import lazy_loader

#: What scenario files end in. It stands here for those who look for such files and need no more of this room.
SUFFIX = ".scenario.yaml"

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
