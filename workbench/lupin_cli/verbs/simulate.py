"""`lupin simulate`: simulates a mission in virtual time; prints its steps, a timeline, or a debugger."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from lupin_cli import options
from lupin_cli.exit_codes import INTERRUPTED, not_done
from lupin_cli.options import PNG, SVG, TERMINAL
from lupin_engine.errors import Problems, UsageError, nearest
from lupin_engine.plugin import load_catalog

if TYPE_CHECKING:
    from rich.console import Console

    from lupin_engine.chart import Chart
    from lupin_engine.machine import World
    from lupin_engine.missions import LoadedMissions
    from lupin_engine.sim import Run, Script
    from lupin_verify import Rates


@click.command(cls=options.RequestCommand, short_help="Run a mission in virtual time, without ROS.")
@click.argument("mission")
@options.fields
@options.mission_settings
@click.option(
    "--clock",
    metavar="DATE TIME",
    help="What the robot's clock shows at the beginning, such as '2026-11-22 22:00'.",
)
@click.option(
    "--until",
    metavar="DURATION|STATE",
    help="Stop after so much virtual time, such as '20 min', or when a state is entered.",
)
@click.option(
    "--rates",
    type=click.Path(path_type=Path, dir_okay=False),
    help="Servers answer as was learned from a robot, by `lupin learn`.",
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
@options.hmi
@options.pages_port
@click.option("--json", "as_json", is_flag=True, help="Print all that came of it as one JSON object.")
@click.option("--quiet", "-q", is_flag=True, help="Print the summary only.")
@not_done()
def simulate(
    mission: str,
    request: dict[str, Any],
    fields: tuple[str, ...],
    settings: tuple[str, ...],
    clock: str | None,
    until: str | None,
    rates: Path | None,
    seed: int | None,
    speed: float,
    picture: str | None,
    interactive: bool,
    hmi: bool,
    port: int,
    as_json: bool,
    quiet: bool,
) -> int:
    """Run a mission in virtual time, without ROS, and print its steps.

    MISSION is the name of a mission (inspection, InspectionMission), a mission file, or a scenario file,
    whose mocks and happenings are then used. The plugins answer as their mocks say: everything succeeds.

    Exit code: 0 all targets visited, or stopped where --until says; 1 some missed; 2 fault, not started
    or not ended, or an expression or action failed; 130 interrupted.
    """
    from lupin_cli.terminal import outcome
    from lupin_engine.replay import timeline

    problems, allowed = Problems(UsageError), ", ".join((*options.request_options(), "--set"))
    is_printed = bool(as_json or quiet or picture or until is not None)
    if interactive and (speed or is_printed):
        problems.add(f"--interactive goes with {allowed}, --clock and --seed only")
    if hmi and (interactive or is_printed):
        problems.add(f"--hmi goes with {allowed}, --clock, --seed, --speed and --port only")
    with problems.collecting():
        _check_picture(picture)
    with problems.collecting():
        started = not (interactive or hmi)
        subject = simulation_task(problems, mission, request, fields, settings, until, started=started)
    with problems.collecting():
        check_clock(clock)
    problems.raise_any()
    if rates is not None:
        subject, _ = with_rates(subject, mission, rates, settings)
    said: dict[str, Any] = {"seed": seed, "clock": clock}
    script = replace(subject.script, **{name: one for name, one in said.items() if one is not None})
    subject = replace(subject, script=script)
    if hmi:
        return _serve(subject, speed, port)
    if interactive:
        return _interact(subject)
    began = time.perf_counter()
    run = subject.run()
    wall = time.perf_counter() - began
    lanes = timeline(run)
    if picture not in (None, TERMINAL):
        outcome.draw(lanes, Path(picture or ""))
    if as_json:
        click.echo(json.dumps(outcome.record(run, lanes, subject.script.seed), default=str))
        return outcome.verdict(run)
    console = outcome.make_console()
    if not (quiet or _is_story_shown(run, console, speed)):
        return INTERRUPTED
    if picture == TERMINAL:
        outcome.show_timeline(lanes, console)
    outcome.show_outcome(run, lanes, wall, console)
    return outcome.verdict(run)


def _is_story_shown(run: Run, console: Console, speed: float) -> bool:
    """Print the steps of a run; return False where that was interrupted."""
    from lupin_cli.terminal import outcome

    try:
        outcome.print_story(run, console, _pacing(speed))
    except KeyboardInterrupt:
        console.print()
        return False
    return True


# -- what is simulated ------------------------------------------------------------------------------------


@dataclass(frozen=True)
class SimulationTask:
    """A simulation of a mission's request or a scenario, at most until the time or state `until`.

    `is_complete`: the request is complete, so the mission starts by itself.
    """

    loaded: LoadedMissions
    script: Script
    world: World
    until: float | str | None
    is_complete: bool

    @property
    def chart(self) -> Chart:
        """The chart of the mission."""
        return self.loaded.chart

    def run(self) -> Run:
        """Simulate it; errors as for `simulation.simulate`."""
        from lupin_engine.sim import simulate as run_script

        if isinstance(self.until, str):
            return run_script(self.chart, replace(self.script, stop_at=self.until), world=self.world)
        if self.until is None:
            return run_script(self.chart, self.script, world=self.world)
        run = run_script(self.chart, replace(self.script, limit=self.until), world=self.world)
        # A run that reaches the given time has ended as wanted.
        return replace(run, cut_off=False, stopped=True) if run.cut_off else run


def simulation_task(
    problems: Problems,
    mission: str,
    request: dict[str, Any],
    fields: tuple[str, ...],
    settings: tuple[str, ...],
    until: str | None,
    *,
    started: bool,
) -> SimulationTask:
    """Return the simulation of the arguments; `problems` collects errors of options.

    One that is `started` at once must have its whole request; else people start it, by hand or on a page.

    Raises:
        LupinError: there is no such mission or scenario, or it cannot be used.
    """
    from lupin_cli.requests import check_complete, check_fields, request_in
    from lupin_cli.settings import settings_in
    from lupin_engine.missions import load_missions
    from lupin_engine.runtime import make_world
    from lupin_engine.sim import LIMIT, Script, is_scenario, load_scenario

    catalog, is_asked = load_catalog(), any(request.values()) or bool(fields)
    if is_scenario(mission):
        if is_asked or settings:
            names = ", ".join(options.request_options())
            problems.add(
                f"a scenario names its own request and parameters; {names} and --set are for missions"
            )
        scenario = load_scenario(mission, catalog)
        loaded = load_missions([str(scenario.mission)], catalog)
        chart, script, parameters = loaded.chart, scenario.script, scenario.parameters
    else:
        loaded = load_missions([mission], catalog)
        chart = loaded.chart
        with problems.collecting():
            check_fields(loaded, request)
        asked, wrong = request_in(loaded, request, fields)
        problems.add(*wrong)
        with problems.collecting():
            if started:
                check_complete(loaded, asked)
        script = Script(loaded.names[0], asked, limit=LIMIT)
        parameters, wrong = settings_in("--set", settings, chart.parameters)
        problems.add(*wrong)
    is_complete = is_scenario(mission) or is_asked
    end: float | str | None = None
    with problems.collecting():
        end = read_until(chart, until)
    return SimulationTask(loaded, script, make_world(chart, parameters), end, is_complete)


def with_rates(
    subject: SimulationTask, mission: str, file: Path, settings: tuple[str, ...]
) -> tuple[SimulationTask, Rates]:
    """Return the same simulation with the servers of a file of rates, and its parameters below `--set`.

    Raises:
        UsageError: there is no such file, or a scenario is simulated.
        ChartError: with everything that is wrong with the file.
    """
    from lupin_cli.settings import settings_in
    from lupin_engine.runtime import make_world
    from lupin_engine.sim import is_scenario
    from lupin_verify import learned_script, read_rates

    chart, script = subject.chart, subject.script
    if is_scenario(mission):
        raise UsageError("a scenario says how its servers answer; --rates is for missions")
    if not file.is_file():
        raise UsageError(f"--rates: no file {str(file)!r}; 'lupin learn' writes one from the journal")
    rates = read_rates(file, chart)
    given, _ = settings_in("--set", settings, chart.parameters)
    world = make_world(chart, {**rates.parameters, **given})
    return replace(subject, script=learned_script(rates, script.mission, script.request), world=world), rates


def read_until(chart: Chart, text: str | None) -> float | str | None:
    """Read `--until`: a duration, in seconds, or the name of a state; None where it is not given.

    Raises:
        UsageError: it is neither; the text has the nearest state.
    """
    from lupin_engine.plugin import DURATION, convert
    from lupin_engine.sim import is_named

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


def check_clock(text: str | None) -> None:
    """Raise UsageError where a text is no date with a time of day; None is right."""
    from lupin_engine.runtime import UTC, calendar_of

    try:
        if text is not None:
            calendar_of(UTC).moment(text)
    except ValueError as problem:
        raise UsageError(f"--clock: {problem}") from None


def _check_picture(name: str | None) -> None:
    """Raise UsageError where a timeline cannot be drawn into this file; None and `TERMINAL` are right."""
    from lupin_cli.run_folders import writable

    if name is None or name == TERMINAL:
        return
    if Path(name).suffix not in (SVG, PNG):
        raise UsageError(
            f"--timeline: {name!r} ends in neither {SVG} nor {PNG}; {TERMINAL} draws in the terminal"
        )
    writable(Path(name).parent, "picture")


def _interact(subject: SimulationTask) -> int:
    from lupin_cli.settings import read_value
    from lupin_cli.terminal.debugger import Debugger
    from lupin_cli.terminal.interactive import interact
    from lupin_cli.terminal.outcome import make_console

    # The user starts a mission; a scenario starts by itself.
    script = subject.script if subject.script.happenings else replace(subject.script, starts=False)
    console = make_console()
    debugger = Debugger(subject.chart, script, subject.world, read_value, console.width)
    return interact(debugger, console)


def _serve(subject: SimulationTask, speed: float, port: int) -> int:
    from lupin_cli.pages import find_server, serve
    from lupin_cli.settings import read_value
    from lupin_ros.service import SimulatedPages

    server = find_server(subject.chart.catalog)
    script = subject.script if subject.is_complete else replace(subject.script, starts=False)
    pages = SimulatedPages(
        subject.loaded, script, subject.world, read_value, time.monotonic, speed if speed else None
    )
    return serve(pages, server, port)


def _pacing(speed: float) -> Callable[[float], None]:
    """Return a function that waits for so many seconds of virtual time."""
    return (lambda seconds: time.sleep(seconds / speed)) if speed else (lambda seconds: None)
