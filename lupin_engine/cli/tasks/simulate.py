"""What `lupin simulate` does."""

from __future__ import annotations

import json
import shutil
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import click
from rich.console import Console
from rich.text import Text

from lupin_engine.chart.model import Chart
from lupin_engine.cli.colours import styled
from lupin_engine.cli.exit_codes import not_done
from lupin_engine.cli.options import PNG, SVG, TERMINAL
from lupin_engine.cli.settings import read_value, settings_in
from lupin_engine.cli.view import readings_table
from lupin_engine.errors import Problems, UsageError, nearest
from lupin_engine.machine.environment import World
from lupin_engine.machine.memory import Visit
from lupin_engine.plugin.registry import load_catalog
from lupin_engine.plugin.types import DURATION, convert
from lupin_engine.replay.story import columns_for, laid_out
from lupin_engine.replay.summary import Attempted, Summary, summarise
from lupin_engine.replay.timeline import Timeline, timeline
from lupin_engine.replay.timeline_rows import lasting
from lupin_engine.ros.launch.folders import writable
from lupin_engine.ros.launch.mission import check_fields, load_missions
from lupin_engine.ros.launch.story import ALL_VISITED, INTERRUPTED, NOT_DONE, SOME_MISSED, STATUSES, Reading
from lupin_engine.runtime.record import command_record, step_record, view_record
from lupin_engine.runtime.setup import make_world
from lupin_engine.sim.narration import tell
from lupin_engine.sim.scenario import is_scenario, load_scenario
from lupin_engine.sim.simulation import LIMIT, Run, Script, is_named
from lupin_engine.sim.simulation import simulate as run_script

WORDS = dict(zip(STATUSES, ("visited", "unreachable", "failed", "skipped"), strict=True))
#: How wide the output is where there is no terminal, in cells.
WIDTH = 120


@not_done()
def work(
    mission: str,
    tags: tuple[str, ...],
    goal: int,
    settings: tuple[str, ...],
    until: str | None,
    seed: int | None,
    speed: float,
    picture: str | None,
    interactive: bool,
    as_json: bool,
    quiet: bool,
) -> int:
    """Do what the options of `lupin simulate` say, and return the exit code.

    Raises:
        LupinError: nothing was simulated; the text has everything that is wrong with the options.
    """
    problems = Problems(UsageError)
    if interactive and (as_json or quiet or speed or picture or until is not None):
        problems.add("--interactive goes with --tags, --goal, --set and --seed only")
    with problems.collecting():
        _check_picture(picture)
    with problems.collecting():
        subject = _subject(problems, mission, tags, goal, settings, until)
    problems.tell()
    if seed is not None:
        subject = replace(subject, script=replace(subject.script, seed=seed))
    if interactive:
        return _interact(subject)
    began = time.perf_counter()
    run = subject.run()
    wall = time.perf_counter() - began
    lanes = timeline(run)
    if picture not in (None, TERMINAL):
        _draw(lanes, Path(picture or ""))
    if as_json:
        click.echo(json.dumps(record(run, lanes, subject.script.seed), default=str))
        return verdict(run)
    console = make_console()
    try:
        if not quiet:
            tell_story(run, console, _pacing(speed))
    except KeyboardInterrupt:
        console.print()
        return INTERRUPTED
    if picture == TERMINAL:
        show_timeline(lanes, console)
    show_outcome(run, lanes, wall, console)
    return verdict(run)


# -- what is simulated ------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Subject:
    """What is to be simulated, at most `until` a time or a state: a mission that is requested, a scenario."""

    chart: Chart
    script: Script
    world: World
    until: float | str | None

    def run(self) -> Run:
        """Simulate it; errors as for `simulation.simulate`."""
        if isinstance(self.until, str):
            return run_script(self.chart, replace(self.script, stop_at=self.until), world=self.world)
        if self.until is None:
            return run_script(self.chart, self.script, world=self.world)
        run = run_script(self.chart, replace(self.script, limit=self.until), world=self.world)
        # Who names a time is not cut off by it.
        return replace(run, cut_off=False, stopped=True) if run.cut_off else run


def _subject(
    problems: Problems,
    mission: str,
    tags: tuple[str, ...],
    goal: int,
    settings: tuple[str, ...],
    until: str | None,
) -> Subject:
    """Return what is to be simulated; `problems` gets what is wrong with options.

    Raises:
        LupinError: there is no such mission or scenario, or it cannot be used.
    """
    catalog = load_catalog()
    if is_scenario(mission):
        if tags or goal or settings:
            problems.add(
                "a scenario names its own request and parameters; --tags, --goal and --set are for missions"
            )
        scenario = load_scenario(mission, catalog)
        chart, script, parameters = scenario.chart, scenario.script, scenario.parameters
    else:
        loaded = load_missions([mission], catalog)
        chart = loaded.chart
        script = Script(loaded.names[0], {"tag_sequence": list(tags), "discovery_goal": goal}, limit=LIMIT)
        with problems.collecting():
            check_fields(loaded, tags, goal)
        parameters, wrong = settings_in("--set", settings, chart.parameters)
        problems.add(*wrong)
    end: float | str | None = None
    with problems.collecting():
        end = _until(chart, until)
    return Subject(chart, script, make_world(chart, parameters), end)


def _until(chart: Chart, text: str | None) -> float | str | None:
    """Read when to stop: a duration, in seconds; what does not begin like one is the name of a state."""
    if text is None:
        return None
    if text[:1].isdigit():
        try:
            return float(convert(text, DURATION))
        except ValueError as problem:
            hint = "write a duration such as '90 s' or '20 min'"
            raise UsageError(f"--until: {problem}; {hint}") from None
    names = [state for state in chart.states if state]
    if not any(is_named(state, text) for state in names):
        local = {state.rpartition(".")[2] for state in names}
        raise UsageError(f"--until: no state {text!r}; {nearest(text, local)}")
    return text


def _check_picture(name: str | None) -> None:
    """Look whether a timeline can be drawn there."""
    if name is None or name == TERMINAL:
        return
    if Path(name).suffix not in (SVG, PNG):
        raise UsageError(
            f"--timeline: {name!r} ends in neither {SVG} nor {PNG}; {TERMINAL} draws in the terminal"
        )
    writable(Path(name).parent, "picture")


def _interact(subject: Subject) -> int:
    from lupin_engine.cli.interactive import interact
    from lupin_engine.replay.debugger import Debugger

    # Of a mission the start is the first thing that one does; a scenario does as it says.
    script = subject.script if subject.script.happenings else replace(subject.script, starts=False)
    console = make_console()
    debugger = Debugger(subject.chart, script, subject.world, read_value, console.width)
    return interact(debugger, console)


# -- how it is told ---------------------------------------------------------------------------------------


def make_console() -> Console:
    """Return the console: as wide as the terminal, or as is good to read in a file."""
    return Console(highlight=False, width=shutil.get_terminal_size((WIDTH, 24)).columns)


def _pacing(speed: float) -> Callable[[float], None]:
    """Return what waits for so many seconds of virtual time to go by."""
    return (lambda seconds: time.sleep(seconds / speed)) if speed else (lambda seconds: None)


def tell_story(run: Run, console: Console, wait: Callable[[float], None]) -> None:
    """Print what happened, line by line; `wait` lets the time pass that is between two of them."""
    lines = list(tell(run.chart, run.steps))
    columns = columns_for(lines, console.width)
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
    from lupin_engine.replay.timeline_text import ASCII, UNICODE, text

    for row in text(lanes, console.width, ASCII if console.options.ascii_only else UNICODE):
        console.print(styled(row), soft_wrap=True)
    console.print()


def show_outcome(run: Run, lanes: Timeline, wall: float, console: Console) -> None:
    """Print the table of visits, the figures and the last line."""
    closed = [_reading(visit) for visit in run.visits if visit.status]
    if closed:
        console.print(readings_table(closed))
    for name, text in figures(summarise(run, lanes), wall):
        indented = Text(f"{name:<12}", "bold") + Text(text)
        console.print(indented, soft_wrap=True)
    console.print(last_line(run), soft_wrap=True)


def figures(found: Summary, wall: float) -> list[tuple[str, str]]:
    """Return the figures of a run, each with its label; what was none of is left out."""
    rows = [
        ("states", _times(found.states)),
        ("phases", _times(found.phases)),
        ("operations", ", ".join(_attempted(one) for one in found.operations)),
        ("holds", _times(found.held)),
        ("refused", str(found.refused) if found.refused else ""),
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


def _reading(visit: Visit) -> Reading:
    sensors = (visit.reading or {}).get("readings", ()) if isinstance(visit.reading, Mapping) else ()
    values = {str(sensor["name"]): float(sensor["value"]) for sensor in sensors}
    return Reading(visit.target, visit.status, visit.detail or visit.code, values)


def verdict(run: Run) -> int:
    """Return the exit code: all visited or stopped where wanted, some missed, or not done."""
    if run.stopped:
        return ALL_VISITED
    if not run.ended:
        return NOT_DONE
    return ALL_VISITED if all(visit.status == "OK" for visit in run.visits) else SOME_MISSED


def last_line(run: Run) -> Text:
    """Return how it ended, how many of each, how long it took."""
    code = verdict(run)
    text = Text(run.view.lifecycle or "not started", ("bold green", "bold yellow", "bold red")[code])
    counts = {status: sum(1 for visit in run.visits if visit.status == status) for status in STATUSES}
    counted = ", ".join(f"{count} {WORDS[status]}" for status, count in counts.items() if count)
    text.append(f": {counted or 'nothing visited'} of {len(run.visits)} targets", "not bold")
    text.append(f" in {run.seconds:.1f} s of virtual time", "not bold")
    for remark in _remarks(run, code):
        text.append(f"; {remark}", "not bold yellow")
    return text


def _remarks(run: Run, code: int) -> Iterable[str]:
    """Yield why it ended like that."""
    if run.cut_off:
        yield "stopped at the time limit"
    elif run.stopped:
        yield "stopped where --until says"
    elif code == NOT_DONE and run.view.paused:
        yield "it waits for an operator"
    for step in run.refused[-1:]:
        if step.refusal:
            yield step.refusal.text
    if run.view.code and code:
        yield f"last: {run.view.code}" + (f" ({run.view.detail})" if run.view.detail else "")


# -- for programs -----------------------------------------------------------------------------------------


def record(run: Run, lanes: Timeline, seed: int) -> dict[str, Any]:
    """Return a run as JSON data."""
    return {
        "mission": run.view.mission,
        "seconds": run.seconds,
        "seed": seed,
        "parameters": dict(run.parameters),
        "cut_off": run.cut_off,
        "stopped": run.stopped,
        "exit_code": verdict(run),
        "lifecycles": list(run.lifecycles),
        "summary": asdict(summarise(run, lanes)),
        "view": view_record(run.view),
        "context": dict(run.context),
        "visits": [asdict(visit) for visit in run.visits],
        "published": [{"time": at, **command_record(publish)} for at, publish in run.published],
        "held": [{"time": at, "held": list(held)} for at, held in run.held],
        "broken": [{"time": step.time, "invariant": name} for step, name in run.broken],
        "never_happened": [str(happening.effect) for happening in run.unfired],
        "steps": [step_record(step) for step in run.steps],
        "timeline": _lanes(lanes),
    }


def _lanes(lanes: Timeline) -> dict[str, Any]:
    found = asdict(lanes)
    return {name: found[name] for name in found if name not in ("title", "seconds")}


def _draw(lanes: Timeline, file: Path) -> None:
    """Write the timeline as a picture."""
    from lupin_engine.diagram.png import png
    from lupin_engine.replay.timeline_svg import svg

    text = svg(lanes)
    content = png(text) if file.suffix == PNG else text.encode()
    try:
        file.write_bytes(content)
    except OSError as problem:
        raise UsageError(f"cannot write {str(file)!r}: {problem.strerror}") from problem
