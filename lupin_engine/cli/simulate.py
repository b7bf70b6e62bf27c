"""`lupin simulate`: a mission in virtual time: told as a story, drawn as a timeline, or worked by hand."""

from __future__ import annotations

from typing import Any

import click

from lupin_engine.cli import options


@click.command(short_help="Run a mission in virtual time, without ROS.")
@click.argument("mission")
@options.tags
@click.option("--goal", type=click.IntRange(min=0), default=0, help="How many tags to discover.")
@click.option(
    "--set",
    "settings",
    metavar="NAME=VALUE",
    multiple=True,
    help="A parameter, such as nav_timeout_s='90 s'.",
)
@click.option(
    "--until",
    metavar="DURATION|STATE",
    help="Stop after so much virtual time, such as '20 min', or when a state is entered.",
)
@click.option("--seed", type=click.IntRange(min=0), help="What is drawn from where chance has a part.")
@click.option(
    "--speed",
    type=click.FloatRange(min=0.0),
    default=0.0,
    metavar="FACTOR",
    help="Tell the story as time goes by, so many times as fast; default: at once.",
)
@click.option(
    "--timeline",
    "picture",
    metavar="FILE",
    help="Draw states and operations over time into FILE.svg or FILE.png; - draws in the terminal.",
)
@click.option("--interactive", "-i", is_flag=True, help="Work the simulation by hand; help tells how.")
@click.option("--json", "as_json", is_flag=True, help="Print all that came of it as one JSON object.")
@click.option("--quiet", "-q", is_flag=True, help="Print the summary only.")
def simulate(**given: Any) -> int:
    """Run a mission in virtual time, without ROS, and tell what happens.

    MISSION is the name of a mission (inspection, InspectionMission), a mission file, or a scenario file,
    whose mocks and happenings are then used. The plugins answer as their mocks say: everything succeeds.

    Exit code: 0 all targets visited, or stopped where --until says; 1 some missed; 2 fault, not started
    or not ended; 130 interrupted.
    """
    from lupin_engine.cli.tasks.simulate import work

    return work(**given)
