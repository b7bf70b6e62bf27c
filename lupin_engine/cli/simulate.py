"""`lupin simulate`: a mission in virtual time, told as a story."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import click
from rich.console import Console
from rich.text import Text

from lupin_engine.cli.settings import read_settings
from lupin_engine.cli.view import STATUS_STYLES, readings_table
from lupin_engine.errors import UsageError
from lupin_engine.launch.mission import load_missions
from lupin_engine.launch.story import ALL_VISITED, NOT_DONE, SOME_MISSED, STATUSES, Reading
from lupin_engine.machine.memory import Visit
from lupin_engine.plugin.registry import load_catalog
from lupin_engine.plugin.types import DURATION, convert
from lupin_engine.runtime.record import step_record, view_record
from lupin_engine.sim.scenario import is_scenario, load_scenario
from lupin_engine.sim.simulation import LIMIT, Run, Script
from lupin_engine.sim.simulation import simulate as run_script
from lupin_engine.sim.story import Line, tell

WORDS = dict(zip(STATUSES, ("visited", "unreachable", "failed", "skipped"), strict=True))


def _tags(_: click.Context, __: click.Parameter, text: str | None) -> tuple[str, ...]:
    return tuple(part.strip() for part in (text or "").split(",") if part.strip())


def _duration(_: click.Context, __: click.Parameter, text: str | None) -> float:
    if text is None:
        return LIMIT
    try:
        return float(convert(text, DURATION))
    except ValueError as problem:
        raise click.BadParameter(f"{problem}; write a duration such as '90 s' or '20 min'") from None


@click.command(short_help="Run a mission in virtual time, without ROS.")
@click.argument("mission")
@click.option(
    "--tags", metavar="1,5,12", callback=_tags, help="The tags to visit; default: the mission's own."
)
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
    metavar="DURATION",
    callback=_duration,
    help="Stop after so much virtual time, such as '20 min'.",
)
@click.option(
    "--json", "as_json", is_flag=True, help="Print the steps and the final view as one JSON object."
)
@click.option("--quiet", "-q", is_flag=True, help="Print the summary only.")
def simulate(
    mission: str,
    tags: tuple[str, ...],
    goal: int,
    settings: tuple[str, ...],
    until: float,
    as_json: bool,
    quiet: bool,
) -> int:
    """Run a mission in virtual time, without ROS, and tell what happens.

    MISSION is the name of a mission (inspection, InspectionMission), a mission file, or a scenario file,
    whose mocks and happenings are then used. The plugins answer as their mocks say: everything succeeds.

    Exit code: 0 all targets visited, 1 some missed, 2 fault, start refused or not ended.
    """
    run = _run(mission, tags, goal, settings, until)
    if as_json:
        click.echo(json.dumps(record(run), default=str))
    else:
        show(run, Console(highlight=False, soft_wrap=True), quiet)
    return verdict(run)


command = simulate


def _run(mission: str, tags: tuple[str, ...], goal: int, settings: tuple[str, ...], until: float) -> Run:
    catalog = load_catalog()
    if is_scenario(mission):
        if tags or goal or settings:
            raise UsageError(
                "a scenario names its own request and parameters; --tags, --goal and --set are for missions"
            )
        return load_scenario(mission, catalog).run()
    loaded = load_missions([mission], catalog)
    given = read_settings("--set", settings, loaded.chart.parameters)
    request: dict[str, Any] = {"tag_sequence": list(tags), "discovery_goal": goal}
    return run_script(loaded.chart, catalog, Script(loaded.names[0], request, limit=until), given)


def verdict(run: Run) -> int:
    """Return the exit code: all visited, some missed, or not done."""
    if not run.ended:
        return NOT_DONE
    return ALL_VISITED if all(visit.status == "OK" for visit in run.visits) else SOME_MISSED


def record(run: Run) -> dict[str, Any]:
    """Return a run as JSON data."""
    return {
        "mission": run.view.mission,
        "seconds": run.seconds,
        "cut_off": run.cut_off,
        "lifecycles": list(run.lifecycles),
        "exit_code": verdict(run),
        "view": view_record(run.view),
        "visits": [asdict(visit) for visit in run.visits],
        "steps": [step_record(step) for step in run.steps],
    }


def show(run: Run, console: Console, quiet: bool = False) -> None:
    """Print the story, the table of visits and the summary."""
    if not quiet:
        for line in tell(run.chart, run.steps):
            console.print(_story_line(line))
        console.print()
    if run.visits:
        console.print(readings_table(_reading(visit) for visit in run.visits))
    console.print(summary(run))


def _story_line(line: Line) -> Text:
    text = Text(f"{line.time:8.1f} s  ", "dim")
    text.append(line.event, "bold red" if line.refused else "")
    if line.moved:
        text.append(f"  -> {line.moved}", "bold green")
    for commanded in line.commanded:
        text.append(f"\n{'':14}{commanded}", _style(commanded))
    for note in line.notes:
        text.append(f"\n{'':14}({note})", "yellow")
    return text


def _style(commanded: str) -> str:
    words = commanded.split()
    return STATUS_STYLES.get(words[2], "") if words[0] == "publish" and len(words) > 2 else "cyan"


def _reading(visit: Visit) -> Reading:
    sensors = (visit.reading or {}).get("readings", ()) if isinstance(visit.reading, Mapping) else ()
    values = {str(sensor["name"]): float(sensor["value"]) for sensor in sensors}
    return Reading(visit.target, visit.status or "open", visit.detail or visit.code, values)


def summary(run: Run) -> Text:
    """Return the last line: how it ended, how many of each, how long it took."""
    code = verdict(run)
    text = Text(run.view.lifecycle or "not started", ("bold green", "bold yellow", "bold red")[code])
    counts = {status: sum(1 for visit in run.visits if visit.status == status) for status in STATUSES}
    counted = ", ".join(f"{count} {WORDS[status]}" for status, count in counts.items() if count)
    text.append(f": {counted or 'nothing visited'} of {len(run.visits)} targets", "")
    text.append(f" in {run.seconds:.1f} s of virtual time", "")
    if run.cut_off:
        text.append("; stopped at the time limit", "yellow")
    elif code == NOT_DONE and run.view.paused:
        text.append("; it waits for an operator", "yellow")
    for step in run.refused[-1:]:
        text.append(f"; {step.refusal.text}" if step.refusal else "", "yellow")
    if run.view.code and code:
        text.append(f"; last: {run.view.code}", "yellow")
        text.append(f" ({run.view.detail})" if run.view.detail else "", "yellow")
    return text
