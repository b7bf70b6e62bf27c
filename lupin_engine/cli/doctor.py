"""`lupin doctor`: what this machine has, and what to do about what it lacks."""

from __future__ import annotations

from typing import Any

import click


@click.command()
@click.option("--json", "as_json", is_flag=True, help="Print the findings as JSON.")
def doctor(**given: Any) -> int:
    """Look at this machine and say what is missing.

    Exit code: 0 when missions can be run, 1 when something must be mended first.
    """
    from lupin_engine.cli.tasks.doctor import work

    return work(**given)
