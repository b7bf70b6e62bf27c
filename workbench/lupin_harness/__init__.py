"""The harness: what every plugin must keep, as checks that anybody can run against theirs.

`cases` has the test classes for pytest; `rules` needs no ROS, what `live` demands is tried over ROS 2.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
