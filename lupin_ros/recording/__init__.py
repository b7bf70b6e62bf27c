"""Recordings: every topic of a run in an MCAP file, with the definitions of its messages."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
