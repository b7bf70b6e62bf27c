"""`lupin up`: the nodes of missions, without starting one: that is left to the operator."""

from __future__ import annotations

from typing import Any

import click

from lupin_engine.cli import options


@click.command(short_help="Start the nodes of missions; an operator starts the missions.")
@click.argument("missions", nargs=-1)
@options.bring_up
def up(**given: Any) -> int:
    """Start the nodes of missions; an operator starts the missions.

    MISSIONS are names or files; without any, all missions of the folder. Ctrl-C stops what was started.

    Exit code: 0 ended by Ctrl-C, 2 not started, or ended by what went wrong.
    """
    from lupin_engine.cli.tasks.up import work

    return work(**given)
