"""The harness: the contract of plugins as tests that authors run against their plugins.

`cases` has the test classes for pytest; `rules` needs no ROS, `live` tests drivers over ROS 2.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
