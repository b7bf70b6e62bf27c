"""`lupin test`: scenarios against missions, one line each, failures explained, and what was not reached."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click


@click.command(short_help="Run scenarios against missions, without ROS.")
@click.argument("paths", nargs=-1, type=click.Path(path_type=Path))
@click.option("-k", "words", metavar="TEXT", multiple=True, help="Only scenarios whose path contains TEXT.")
@click.option("--jobs", "-j", type=click.IntRange(min=0), default=0, help="Processes; 0: as many as pay off.")
@click.option("--seed", type=int, default=0, help="Added to the seeds of random scenarios.")
@click.option(
    "--seeds", type=click.IntRange(min=1), default=1, help="Run random scenarios with so many seeds."
)
@click.option(
    "--junit", "junit_file", type=click.Path(dir_okay=False, path_type=Path), help="Write JUnit XML."
)
@click.option("--coverage", "covers", is_flag=True, help="Tell what no scenario reached.")
@click.option(
    "--min-coverage", type=click.FloatRange(0, 100), metavar="PERCENT", help="Fail when less was reached."
)
@click.option(
    "--coverage-diagram",
    "drawing",
    metavar="FILE.svg",
    type=click.Path(dir_okay=False, path_type=Path),
    help="Draw the mission coloured by what was reached; of several missions each into FILE-MISSION.svg.",
)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
@click.option("--quiet", "-q", is_flag=True, help="Print failures and the last line only.")
@click.option(
    "--record",
    "recording",
    type=click.Path(exists=True, dir_okay=False, path_type=Path),
    help="Make a scenario of a recorded run: the output of 'lupin simulate --json', or steps.",
)
@click.option("-o", "output", type=click.Path(path_type=Path), help="The scenario that --record makes.")
def test(**given: Any) -> int:
    """Run scenarios against missions, without ROS.

    PATHS are scenario files (*.scenario.yaml) or folders of them; without any, the folder scenarios or
    tests/scenarios is taken.

    Exit code: 0 when every scenario holds and enough was reached, else 1; 2 when there is nothing to run.
    """
    from lupin_engine.cli.tasks.test import work

    return work(**given)
