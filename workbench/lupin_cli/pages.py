"""Serves pages of a simulation or a recording, by the plugin that can, and prints their addresses."""

from __future__ import annotations

import importlib

import click

from lupin_engine.errors import UsageError
from lupin_engine.plugin import Catalog, PageSource, ServePages


def find_server(catalog: Catalog) -> ServePages:
    """Return the function of the plugin that serves pages.

    Raises:
        UsageError: no plugin does, or its requirements are not installed.
    """
    plugin = next((plugin for plugin in catalog.plugins.values() if plugin.pages), None)
    if plugin is None:
        raise UsageError("--hmi: none of the installed plugins serves pages")
    module, _, name = plugin.pages.partition(":")
    try:
        found: ServePages = getattr(importlib.import_module(module), name)
    except ImportError as problem:
        raise UsageError(f"--hmi: {problem}; pages need `pip install 'lupin-engine[hmi]'`") from problem
    return found


def serve(source: PageSource, server: ServePages, port: int) -> int:
    """Serve pages until Ctrl-C; returns the exit code 0."""

    def show(text: str) -> None:
        click.echo(f"{source.about()['mode']} of {source.about()['title']}: {text}; Ctrl-C ends it")

    server(source, port, show)
    return 0
