"""`lupin plugin`: which plugins are installed, what they offer, whether they keep the contract; new ones."""

from __future__ import annotations

from typing import Any

import click


@click.group()
def plugin() -> None:
    """List, show and check plugins, and begin new ones."""


as_json = click.option("--json", "as_json", is_flag=True, help="Print it as JSON.")


@plugin.command("list")
@as_json
def list_plugins(**given: Any) -> int:
    """List the plugins that are installed, and who brought them.

    Exit code: 1 when one of them is refused, which is told with the reason.
    """
    from lupin_engine.cli.tasks.plugin import list_work

    return list_work(**given)


@plugin.command()
@click.argument("name")
@as_json
def show(**given: Any) -> int:
    """Show what a plugin offers: operations, functions, live values, parameters with units and ranges.

    NAME may also be a binding of the missions in the current folder, or its file.

    Example: lupin plugin show nav
    """
    from lupin_engine.cli.tasks.plugin import show_work

    return show_work(**given)


@plugin.command()
@click.argument("name", required=False)
@click.option("--live", is_flag=True, help="Try its driver too, over ROS 2, with the nodes that it brings.")
@as_json
def check(**given: Any) -> int:
    """Check that a plugin keeps the contract; without a NAME, all that are installed.

    NAME may be a folder with a pyproject.toml: the plugins that it declares are checked, installed or not.
    """
    from lupin_engine.cli.tasks.plugin_check import work

    return work(**given)


@plugin.command()
@click.argument("name")
@click.argument("folder", required=False)
@click.option("--no-node", is_flag=True, help="Without a node: the server is there already.")
def new(**given: Any) -> int:
    """Begin a plugin: a package of its own, with a catalog, a client, a node and tests.

    NAME is how missions call it, such as lamp. It is written into FOLDER, by default lupin-NAME; what exists
    is never written over.

    Example: lupin plugin new lamp
    """
    from lupin_engine.cli.tasks.plugin_new import work

    return work(**given)
