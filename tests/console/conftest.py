"""The console on what is no robot; the pages in a browser need one."""

from __future__ import annotations

import importlib.util

if importlib.util.find_spec("playwright") is not None:
    from tests.browsing import browser, context

    __all__ = ["browser", "context"]
