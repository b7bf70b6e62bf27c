"""`lupin replay`: replays a mission of the journal, or shows a recording in the console."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import click

from lupin_cli import options
from lupin_cli.exit_codes import not_done
from lupin_cli.options import TERMINAL
from lupin_engine.errors import Problems, UsageError
from lupin_engine.plugin import load_catalog, load_profiles

if TYPE_CHECKING:
    from lupin_engine.machine import Machine
    from lupin_engine.missions import LoadedMissions
    from lupin_engine.replay import LivedStep, RunRecord


@click.command(short_help="Run a mission of the journal again; show a recording in the console.")
@click.argument("what", required=False, default="")
@click.option("--until", metavar="DURATION|STATE", help="Stop there: after '20 min', or in a state.")
@click.option("--timeline", "picture", metavar="FILE", help="Draw it into FILE.svg or FILE.png; - here.")
@click.option("--interactive", "-i", is_flag=True, help="Go on by hand from there, in simulation.")
@click.option("--to-scenario", "scenario", type=click.Path(path_type=Path), help="Make a scenario of it.")
@click.option("--against", "changed", type=click.Path(path_type=Path), help="Would this mission differ?")
@options.domain
@options.journal
@options.hmi
@options.pages_port
@not_done()
def replay(
    what: str,
    until: str | None,
    picture: str | None,
    interactive: bool,
    scenario: Path | None,
    changed: Path | None,
    domain: int | None,
    journal: Path | None,
    hmi: bool,
    port: int,
) -> int:
    """Run a mission again as the journal has it, and tell its story. WHAT is its id; default: the newest.

    The machine takes the same steps, which are compared with the journal's snapshots. With --hmi, WHAT is a
    file of `lupin record`, which is shown in the console until Ctrl-C; a truncated one up to its end, with
    the journal of --journal.

    Exit code: 0 replayed, written or ended by Ctrl-C; 1 the mission of --against would do otherwise; 2 the
    journal or the file cannot be used.
    """
    if hmi or Path(what).is_file():
        if until or picture or interactive or scenario or changed or not hmi:
            raise UsageError(f"a recording is shown in the console: `lupin replay {what} --hmi`")
        return _show(Path(what), port, journal, domain)
    if sum((interactive, scenario is not None, changed is not None)) > 1:
        raise UsageError("--interactive, --to-scenario and --against do not go together")
    from lupin_engine.replay import chart_of, recording_of, replay_run, run_called, runs_of
    from lupin_engine.runtime import journal_folder

    run = run_called(runs_of(journal or journal_folder(domain=domain)), what)
    for problem in run.problems:
        click.echo(problem, err=True)
    loaded = chart_of(run, load_catalog())
    lived, machine = replay_run(run, loaded.chart)
    shown = _cut(loaded, lived, until)
    if not (interactive or scenario or changed):
        _print_run(loaded, shown, machine, picture, is_whole=len(shown) == len(lived))
        return 0
    kept = lived if interactive else shown  # by hand one goes on in the world as it answered
    again = _Again(loaded, recording_of(run, loaded.chart, kept), run.mission_id)
    if scenario is not None:
        return again.write(scenario)
    return again.compare(changed) if changed is not None else again.go_on(shown[-1].step.time)


def _show(file: Path, port: int, journal: Path | None, domain: int | None) -> int:
    from lupin_cli.pages import find_server, serve
    from lupin_cli.recording import open_recording
    from lupin_engine.runtime import journal_folder

    recording, catalog = open_recording(file), load_catalog()
    from lupin_ros.recording import RecordedPages  # needs the packages that were just looked for

    server = find_server(catalog)
    folder = journal or journal_folder(domain=domain)
    return serve(RecordedPages(recording, load_profiles(), catalog, folder), server, port)


def _cut(loaded: LoadedMissions, lived: list[LivedStep], until: str | None) -> list[LivedStep]:
    """Return the steps up to a time or a state; all where the run did not reach it.

    Raises:
        UsageError: `until` is neither a duration nor a state.
    """
    from lupin_cli.verbs.simulate import read_until
    from lupin_engine.sim import is_named

    end = read_until(loaded.chart, until)
    for index, each in enumerate(lived):
        if isinstance(end, str) and any(is_named(state, end) for state in each.step.entered):
            return lived[: index + 1]
        if isinstance(end, float) and each.step.time > end:
            return lived[:index]
    return lived


def _print_run(
    loaded: LoadedMissions, lived: list[LivedStep], machine: Machine, picture: str | None, is_whole: bool
) -> None:
    from lupin_cli.terminal import outcome
    from lupin_engine.replay import as_run, timeline

    run = as_run(loaded.chart, lived, machine)
    lanes, console = timeline(run), outcome.make_console()
    if picture not in (None, TERMINAL):
        outcome.draw(lanes, Path(picture or ""))
    outcome.print_story(run, console, lambda seconds: None)
    if picture == TERMINAL:
        outcome.show_timeline(lanes, console)
    if is_whole:
        console.print(outcome.last_line(run), soft_wrap=True)


@dataclass(frozen=True)
class _Again:
    """A mission that was run, in a simulation of the world as it answered."""

    loaded: LoadedMissions
    recording: RunRecord
    mission_id: str

    def write(self, file: Path) -> int:
        """Make a scenario.

        Raises:
            UsageError: the file exists or has another ending, or the run does not come out again as recorded.
        """
        from lupin_cli.files import write_text
        from lupin_engine.replay import scenario_text
        from lupin_engine.sim import SUFFIX, Missions, is_scenario

        problems = Problems(UsageError)
        if not is_scenario(file.name):
            problems.add(f"{str(file)!r} must end in {SUFFIX}")
        if file.exists():
            problems.add(f"{str(file)!r} exists; remove it, or choose another name")
        problems.raise_any()
        promise = f"{self.recording.mission} as {self.mission_id} was run"
        missions = Missions(self.loaded.chart.catalog)
        write_text(file, scenario_text(self.recording, promise, file, missions))
        click.echo(f"wrote {file}")
        return 0

    def compare(self, changed: Path) -> int:
        """Print whether another mission would have done otherwise; return the exit code, 1 where it would."""
        from lupin_engine.missions import load_missions
        from lupin_engine.replay import would_differ
        from lupin_engine.sim import Missions

        catalog = self.loaded.chart.catalog
        (other,) = load_missions([str(changed)], catalog).files
        found = would_differ(self.recording, other, Missions(catalog))
        if found:
            click.echo(f"{changed} would do otherwise: {found}")
        else:
            click.echo(f"{changed} would have done the same")
        return int(bool(found))

    def go_on(self, time: float) -> int:
        """Go on by hand from a time; return the exit code. UsageError: the run cannot be made again."""
        from lupin_cli.settings import read_value
        from lupin_cli.terminal.debugger import Debugger
        from lupin_cli.terminal.interactive import interact
        from lupin_cli.terminal.outcome import make_console
        from lupin_engine.replay import as_scenario
        from lupin_engine.sim import Missions

        missions, console = Missions(self.loaded.chart.catalog), make_console()
        scenario = as_scenario(self.recording, self._file(), missions)
        world = missions.world(scenario.chart, scenario.parameters)
        debugger = Debugger(scenario.chart, scenario.script, world, read_value, console.width)
        debugger.do(f"run {time + 1e-6:.6f} s")
        return interact(debugger, console)

    def _file(self) -> Path:
        return next(f for f in self.loaded.files if self.recording.mission in _names(self.loaded, f))


def _names(loaded: LoadedMissions, file: Path) -> set[str]:
    """Return the missions that a file has."""
    return {m.name for m in loaded.chart.missions.values() if Path(m.file) == file}
