"""`lupin node`: one node as a process, with ordinary ROS arguments."""

from __future__ import annotations

import click

from lupin_engine.plugin import Catalog, load_catalog
from lupin_ros.adapter import end_with_supervisor
from lupin_ros.launch import close_the_doors, find_node, nodes_of, prepare_ros


@click.command(
    # Everything after the name belongs to ROS, `--help` and unknown options included.
    context_settings={"ignore_unknown_options": True, "allow_interspersed_args": False},
)
@click.argument("name", required=False)
@click.argument("arguments", nargs=-1, type=click.UNPROCESSED)
def node(name: str | None, arguments: tuple[str, ...]) -> int:
    """Run one node, with ROS arguments; without a name, list the nodes.

    Example: lupin node NAME --ros-args -p rate:=5.0
    """
    catalog = load_catalog()
    if name is None:
        _list(catalog)
        return 0
    found = find_node(name, catalog)
    close_the_doors()
    prepare_ros()
    end_with_supervisor()
    return found.run(list(arguments))  # rclpy.init takes no tuple


def _list(catalog: Catalog) -> None:
    nodes = nodes_of(catalog)
    width = max(len(name) for name in nodes)
    for name, found in nodes.items():
        click.echo(f"{name:<{width}}  {found.doc}")
