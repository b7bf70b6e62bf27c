"""`lupin node`: runs one node, or several composed ones, with ordinary ROS arguments."""

from __future__ import annotations

from itertools import takewhile

import click

from lupin_engine.plugin import Catalog, load_catalog
from lupin_ros.adapter import end_with_supervisor
from lupin_ros.launch import close_the_doors, find_node, nodes_of, prepare_ros, run_composed


@click.command(
    # Everything after the name belongs to ROS, `--help` and unknown options included.
    context_settings={"ignore_unknown_options": True, "allow_interspersed_args": False},
)
@click.argument("names", metavar="[NAME]... [ARGUMENTS]", nargs=-1, type=click.UNPROCESSED)
def node(names: tuple[str, ...]) -> int:
    """Run one node, with ROS arguments; without a name, list the nodes.

    Several names: they share this process, where their plugins allow it, and end together.

    Example: lupin node NAME --ros-args -p rate:=5.0

    Exit code: that of the node; 2 no such node, or no usable ROS 2.
    """
    catalog = load_catalog()
    if not names:
        _list(catalog)
        return 0
    count = len(list(takewhile(lambda word: not word.startswith("-"), names)))
    found = [find_node(name, catalog) for name in names[:count] or names[:1]]
    arguments = list(names[len(found) :])  # rclpy.init takes no tuple
    close_the_doors()
    prepare_ros()
    end_with_supervisor()
    return run_composed(found, catalog, arguments) if len(found) > 1 else found[0].run(arguments)


def _list(catalog: Catalog) -> None:
    nodes = nodes_of(catalog)
    width = max(len(name) for name in nodes)
    for name, found in nodes.items():
        click.echo(f"{name:<{width}}  {found.doc}")
