"""`lupin run`: a mission over ROS 2 with everything that it needs, watched, and everything stopped again."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from lupin_engine.cli import options


@click.command(short_help="Run a mission over ROS 2 and watch it.")
@click.argument("mission")
@options.tags
@click.option("--goal", type=click.IntRange(min=0, max=65535), default=0, help="How many tags to discover.")
@options.bring_up
@click.option(
    "--patience",
    type=click.FloatRange(min=0.0),
    metavar="SECONDS",
    help="How long the mission may wait for an operator; "
    f"default: {options.PATIENCE_S:g}, on a terminal for ever.",
)
@click.option("--json", "as_json", is_flag=True, help="Write one JSON object a line.")
@click.option(
    "--save-svg",
    type=click.Path(dir_okay=False, path_type=Path),
    help="Save a picture from the middle of the run.",
)
def run(**given: Any) -> int:
    """Run a mission over ROS 2 and watch it.

    MISSION is the name of a mission (inspection, InspectionMission) or a file. What is missing of its nodes
    is started; what runs already is used and left alone. Ctrl-C aborts the mission, lets the robot drive home
    and ends everything that was started; a second one stops the robot on the way, a third one forces.

    Exit code: 0 all targets visited, 1 some missed, 2 fault or not started, 130 interrupted, or
    nobody reads any more.
    """
    from lupin_engine.cli.tasks.run import work

    return work(**given)
