"""Output of `lupin simulate`: the story, the timeline, the figures, the last line, JSON."""

from __future__ import annotations

import shutil
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.text import Text

from lupin_cli.options import PNG
from lupin_cli.terminal.colours import styled
from lupin_cli.terminal.view import counts_text, results_table
from lupin_engine.errors import UsageError
from lupin_engine.machine import Visit
from lupin_engine.plugin import EXECUTION_CODE, Profile, TargetResult
from lupin_engine.replay import (
    Attempted,
    Columns,
    RunSummary,
    Timeline,
    columns_for,
    laid_out,
    lasting,
    summarise,
)
from lupin_engine.runtime import command_record, step_record, view_record
from lupin_engine.sim import Run, StepLine, narrate
from lupin_ros.launch import ALL_VISITED, NOT_DONE, SOME_MISSED

#: How wide the output is where there is no terminal, in cells.
WIDTH = 120


def make_console() -> Console:
    """Return the console: as wide as the terminal, or a readable width for files."""
    return Console(highlight=False, width=shutil.get_terminal_size((WIDTH, 24)).columns)


def draw(lanes: Timeline, file: Path) -> None:
    """Write a timeline as a picture.

    Raises:
        UsageError: the file cannot be written.
    """
    from lupin_engine.diagram import png
    from lupin_engine.replay import svg

    text = svg(lanes)
    content = png(text) if file.suffix == PNG else text.encode()
    try:
        file.write_bytes(content)
    except OSError as problem:
        raise UsageError(f"cannot write {str(file)!r}: {problem.strerror}") from problem


def print_story(run: Run, console: Console, wait: Callable[[float], None]) -> None:
    """Print the story line by line; `wait` is called with the virtual time between two lines."""
    lines = narrate(run.chart, run.history)
    print_lines(lines, columns_for(lines, console.width), console, wait)


def print_lines(
    lines: Iterable[StepLine], columns: Columns, console: Console, wait: Callable[[float], None]
) -> None:
    """Print lines of a story; `wait` as for `print_story`."""
    now = 0.0
    for line in lines:
        if line.time > now:
            wait(line.time - now)
            now = line.time
        for row in laid_out(line, columns):
            console.print(styled(row), soft_wrap=True)
    console.print()


def show_timeline(lanes: Timeline, console: Console) -> None:
    """Draw the timeline in the terminal."""
    from lupin_engine.replay import ASCII, UNICODE, text

    for row in text(lanes, console.width, ASCII if console.options.ascii_only else UNICODE):
        console.print(styled(row), soft_wrap=True)
    console.print()


def show_outcome(run: Run, lanes: Timeline, wall: float, console: Console) -> None:
    """Print the table of visits, the figures and the last line."""
    profile = run.chart.profile
    closed = [_result(visit, profile) for visit in run.visits if visit.status]
    if closed:
        console.print(results_table(closed, profile))
    for name, text in figures(summarise(run, lanes), wall):
        indented = Text(f"{name:<12}", "bold") + Text(text)
        console.print(indented, soft_wrap=True)
    console.print(last_line(run), soft_wrap=True)


def figures(found: RunSummary, wall: float) -> list[tuple[str, str]]:
    """Return the figures of a run, each with its label; empty ones are left out."""
    rows = [
        ("states", _times(found.states)),
        ("phases", _times(found.phases)),
        ("operations", ", ".join(_attempted(one) for one in found.operations)),
        ("holds", _times(found.held)),
        ("refused", str(found.refused) if found.refused else ""),
        *(
            ("error", text if count == 1 else f"{text} ({count} times)")
            for text, count in found.errors.items()
        ),
        ("dropped", f"{found.dropped} late results" if found.dropped else ""),
        ("computed", f"in {wall:.2f} s"),
    ]
    return [(name, text) for name, text in rows if text]


def _times(times: Mapping[str, float]) -> str:
    return ", ".join(f"{name} {lasting(seconds)}" for name, seconds in times.items())


def _attempted(one: Attempted) -> str:
    outcomes = [f"{count} {outcome}" for outcome, count in one.outcomes.items() if outcome != "done"]
    retries = [f"{one.retries} {'retry' if one.retries == 1 else 'retries'}"] if one.retries else []
    details = ", ".join(outcomes + retries)
    return f"{one.operation} {one.attempts}" + (f" ({details})" if details else "")


def _result(visit: Visit, profile: Profile) -> TargetResult:
    values = profile.values_of(visit.reading) if isinstance(visit.reading, Mapping) else {}
    return TargetResult(visit.target, visit.status, visit.detail or visit.code, values)


def verdict(run: Run) -> int:
    """Return the exit code: all visited or stopped where wanted, some missed, or not done as written."""
    if run.history.errors:
        return NOT_DONE
    if run.stopped:
        return ALL_VISITED
    if not run.ended:
        return NOT_DONE
    return (
        ALL_VISITED if all(run.chart.profile.is_good(visit.status) for visit in run.visits) else SOME_MISSED
    )


def last_line(run: Run) -> Text:
    """Return how it ended, how many of each where there are targets, how long it took."""
    code = verdict(run)
    text = Text(run.view.lifecycle or "not started", ("bold green", "bold yellow", "bold red")[code])
    if run.visits:
        counted = counts_text(run.chart.profile, Counter(visit.status for visit in run.visits))
        text.append(f": {counted or 'nothing visited'} of {len(run.visits)} targets", "not bold")
    text.append(f" in {run.seconds:.1f} s of virtual time", "not bold")
    for remark in _remarks(run, code):
        text.append(f"; {remark}", "not bold yellow")
    return text


def _remarks(run: Run, code: int) -> Iterable[str]:
    """Yield the reasons for the outcome."""
    if run.cut_off:
        yield f"stopped at {run.limit}"
    elif run.stopped:
        yield "stopped where --until says"
    elif code == NOT_DONE and not run.ended and run.view.paused:
        yield "it waits for an operator"
    errors = len(run.history.errors)
    if errors:
        yield "an expression or action failed" if errors == 1 else f"{errors} expressions or actions failed"
    for step in run.history.refused[-1:]:
        if step.refusal:
            yield step.refusal.text
    if run.view.code not in ("", EXECUTION_CODE) and code:
        yield f"last: {run.view.code}" + (f" ({run.view.detail})" if run.view.detail else "")


# -- for programs -----------------------------------------------------------------------------------------


def record(run: Run, lanes: Timeline, seed: int) -> dict[str, Any]:
    """Return a run as JSON data."""
    mission = run.chart.missions.get(run.view.mission)
    return {
        "mission": run.view.mission,
        "file": "" if mission is None else mission.file,
        "seconds": run.seconds,
        "seed": seed,
        "parameters": dict(run.parameters),
        "cut_off": run.cut_off,
        "limit": run.limit,
        "stopped": run.stopped,
        "exit_code": verdict(run),
        "lifecycles": run.history.lifecycles,
        "summary": asdict(summarise(run, lanes)),
        "view": view_record(run.view, run.chart),
        "context": dict(run.context),
        "visits": [asdict(visit) for visit in run.visits],
        "published": [
            {"time": step.time, **command_record(publish)} for step, publish in run.history.published
        ],
        "held": [{"time": at, "held": list(held)} for at, held in run.history.held],
        "broken": [{"time": step.time, "invariant": name} for step, name in run.history.broken],
        "never_happened": [str(happening.effect) for happening in run.unfired],
        "steps": [step_record(step) for step in run.steps],
        "timeline": _lanes(lanes),
    }


def _lanes(lanes: Timeline) -> dict[str, Any]:
    found = asdict(lanes)
    return {name: found[name] for name in found if name not in ("title", "seconds")}
