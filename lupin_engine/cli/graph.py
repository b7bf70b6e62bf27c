"""`lupin graph`: who publishes, subscribes, serves and calls what, now."""

from __future__ import annotations

from typing import Any

import click

from lupin_engine.cli import options


@click.command()
@click.argument("words", nargs=-1)
@options.domain
@click.option("--all", "everything", is_flag=True, help="Also what every node has: parameters, logs.")
@click.option("--mermaid", is_flag=True, help="Print the map as a Mermaid flowchart, for a page.")
@click.option("--json", "as_json", is_flag=True, help="Print the map as JSON.")
def graph(**given: Any) -> int:
    """Show the live map: who publishes, subscribes, serves and calls what.

    WORDS choose: only what has one of them in its name, its type or the name of a node is shown.

    Exit code: 0; 1 when something that is sent does not arrive, or arrives twice; 2 when nobody is there.
    """
    from lupin_engine.cli.tasks.graph import work

    return work(**given)
