"""Imports and makes the drivers of plugins."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping
from typing import Any

from lupin_engine.errors import PluginError
from lupin_engine.plugin.contract import Driver, Outlet, Plugin
from lupin_engine.plugin.discovery import told


def make_client(plugin: Plugin, ros: Any, outlet: Outlet, parameters: Mapping[str, Any]) -> Driver:
    """Import the driver of a plugin and make one on a node, a `RosNode`.

    Raises:
        PluginError: that fails; the text has the exception and its place.
    """
    module, _, name = plugin.client.partition(":")
    try:
        make: Callable[..., Driver] = getattr(importlib.import_module(module), name)
        return make(ros, outlet, parameters)
    except Exception as problem:  # foreign code: whatever it raises is its author's
        why = told(problem, module)
        raise PluginError(f"plugin {plugin.name!r}: {plugin.client} cannot be made: {why}") from problem
