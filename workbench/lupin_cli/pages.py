"""Serving people's pages on what is no robot: which plugin does it, and what is told on the terminal."""

from __future__ import annotations

import importlib

import click

from lupin_engine.errors import UsageError
from lupin_engine.plugin import Catalog, PageSource, ServePages


def find_server(catalog: Catalog) -> ServePages:
    """Return what serves pages.

    Raises:
        UsageError: no plugin does, or what it needs is not installed.
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

    def told(text: str) -> None:
        click.echo(f"{source.about()['mode']} of {source.about()['title']}: {text}; Ctrl-C ends it")

    server(source, port, told)
    return 0
