"""Lists the runs in a journal, and replays one by its machine; a replay that differs is an error."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lupin_engine.chart.model import Chart
from lupin_engine.errors import LupinError, nearest
from lupin_engine.machine.event import observed
from lupin_engine.machine.machine import Machine
from lupin_engine.machine.snapshot import restore
from lupin_engine.missions.load import LoadedMissions
from lupin_engine.missions.selection import load_missions
from lupin_engine.plugin.profile import START
from lupin_engine.plugin.registry import Catalog
from lupin_engine.replay.why import GuardWitness, LivedStep
from lupin_engine.runtime.history import History
from lupin_engine.runtime.journal.journal import CHARTS, journal_files
from lupin_engine.runtime.journal.records import (
    END,
    INPUTS,
    REFUSED,
    RESUMED,
    JournalError,
    JournalFile,
    read_journal,
)
from lupin_engine.runtime.journal.replay import replay
from lupin_engine.runtime.setup import make_world

if TYPE_CHECKING:  # slow to import, and seldom used: imported where used
    from lupin_engine.replay.reconstruction import RunRecord
    from lupin_engine.sim.simulation import Run


@dataclass(frozen=True)
class JournaledRun:
    """A mission in a journal, or the time between two (`mission_id` is empty): its files in order."""

    files: tuple[JournalFile, ...]

    @property
    def mission_id(self) -> str:
        """The mission's id; '' for the time between missions."""
        return self.files[0].head.mission_id

    @property
    def mission(self) -> str:
        """The name of the mission."""
        return self.files[0].head.mission

    @property
    def began(self) -> float:
        """When it began, in POSIX time."""
        head = self.files[0].head
        return head.time + head.ahead_ns * 1e-9

    @property
    def heard(self) -> float:
        """When its machine got the first event, in POSIX time; infinity: never."""
        inputs = (record.wall for file in self.files for record in file.records if record.kind in INPUTS)
        return next(inputs, math.inf)

    @property
    def last(self) -> float:
        """When the last record was made, in POSIX time."""
        return self.files[-1].records[-1].wall

    @property
    def end(self) -> Mapping[str, Any] | None:
        """Its end: published state, code, counts; None while it has not ended."""
        ends = (record.data[0] for file in self.files for record in file.records if record.kind == END)
        return next(ends, None)

    @property
    def restarts(self) -> int:
        """How often another process continued it."""
        return sum(record.kind == RESUMED for file in self.files for record in file.records)

    @property
    def problems(self) -> list[str]:
        """The problems of its files."""
        return [file.problem for file in self.files if file.problem]


def runs_of(folder: Path, left_out: Callable[[str], object] = lambda problem: None) -> list[JournaledRun]:
    """Return the runs in a journal, the oldest first; `left_out` gets the problem of an unreadable file.

    Raises:
        JournalError: there is no journal.
    """
    files: list[JournalFile] = []
    paths = journal_files(folder)
    if not paths:
        raise JournalError(f"there is no journal in {folder}; the orchestrator writes it while it runs")
    for path in paths:
        try:
            files.append(read_journal(path))
        except JournalError as problem:
            left_out(str(problem))
    found: list[list[JournalFile]] = []
    for file in files:
        same = file.head.mission_id and found and found[-1][0].head.mission_id == file.head.mission_id
        if same:
            found[-1].append(file)
        else:
            found.append([file])
    return [JournaledRun(tuple(files)) for files in found]


def run_called(runs: Sequence[JournaledRun], mission_id: str) -> JournaledRun:
    """Return the mission with an id, or the only one whose id ends so; '' is the newest mission.

    Raises:
        JournalError: there is none, or there are several.
    """
    missions = [run for run in runs if run.mission_id]
    if not missions:
        raise JournalError("no mission is in this journal")
    if not mission_id:
        return missions[-1]
    found = [run for run in missions if run.mission_id == mission_id]
    found = found or [run for run in missions if run.mission_id.endswith(mission_id)]
    if len(found) > 1:
        names = ", ".join(run.mission_id for run in found)
        raise JournalError(f"{len(found)} missions end in {mission_id!r}; say which: {names}")
    if not found:
        known = nearest(mission_id, [run.mission_id for run in missions])
        raise JournalError(f"no mission {mission_id!r} in this journal; {known}")
    return found[0]


def chart_of(run: JournaledRun, catalog: Catalog) -> LoadedMissions:
    """Load the chart of a run, from the files that the journal keeps.

    Raises:
        JournalError: they are missing, or the installed plugins cannot load them any more.
    """
    head = run.files[0].head
    if not head.chart:
        raise JournalError(f"the chart of {head.mission_id} is not known: {run.files[0].problem}")
    folder = run.files[0].path.parent / CHARTS / head.chart
    try:
        return load_missions([str(folder / name) for name in head.files], catalog)
    except LupinError as problem:
        raise JournalError(
            f"the chart of {head.mission_id or 'this run'} cannot be loaded: {problem}"
        ) from None


def replay_run(run: JournaledRun, chart: Chart) -> tuple[list[LivedStep], Machine]:
    """Replay the recorded events by the machine; times are seconds since the beginning.

    Raises:
        JournalError: a step differs from the recorded one.
    """
    witness = GuardWitness()
    watched, lived, machine = witness.prepare(chart), list[LivedStep](), None
    shift, wall = None, run.began
    for file in run.files:
        world = make_world(watched, file.head.parameters)
        for each in replay(file, world):
            record, machine = each.record, each.machine
            if shift is None or record.kind == RESUMED:
                shift = wall - run.began - record.time + (max(0.0, record.wall - wall))
            wall = max(wall, record.wall)
            if each.step is not None:
                step = replace(each.step, time=max(0.0, record.time + shift))
                held = tuple(machine.memory.held)
                by = str(record.origin.get("by", ""))
                lived.append(LivedStep(step, record.wall, by, held, witness.of(each.step)))
            elif record.kind == REFUSED:
                _note_more(lived, *record.data)
    assert machine is not None, "a file that was read has a head"
    return lived, machine


def _note_more(lived: list[LivedStep], request: str, code: str, more: int) -> None:
    """Note at the last recorded request with this refusal how many like it were counted only."""
    for index in reversed(range(len(lived))):
        step = lived[index].step
        if step.event.name.startswith(request) and step.refusal is not None and step.refusal.code == code:
            noted = replace(step, notes=(*step.notes, f"and {more} more like it"))
            lived[index] = replace(lived[index], step=noted)
            return


def as_run(chart: Chart, lived: Iterable[LivedStep], machine: Machine) -> Run:
    """Return replayed steps as a run, for story and pictures.

    Live values that changed nothing are left out: a journal has them all.
    """
    from lupin_engine.sim.simulation import Run

    history = History()
    for each in lived:
        if each.step.event.name != "value" or each.step.changed or each.step.notes:
            history.take(each.step, each.held)
    seconds = history.steps[-1].time if history.steps else 0.0
    visits = tuple(machine.memory.outcomes)
    return Run(chart, history, visits, machine.view, seconds, cut_off=False, unfired=())


def recording_of(run: JournaledRun, chart: Chart, lived: Sequence[LivedStep]) -> RunRecord:
    """Return a mission as a record for a scenario, with a simulated boot before it.

    Inputs that were known when the mission began are reported right before its start.

    Raises:
        JournalError: this was no mission.
    """
    from lupin_engine.replay.reconstruction import RunRecord
    from lupin_engine.sim.simulation import Script, simulate

    if not run.mission_id:
        raise JournalError("this was no mission: nothing was started in it")
    head = run.files[0].head
    known = restore(chart, head.snapshot).inputs if head.snapshot else {}
    given = {
        name: value
        for name, value in head.parameters.items()
        if name in chart.parameters and value != chart.parameters[name].default
    }
    before = list(simulate(chart, Script(head.mission), given).steps)
    start = next(index for index, step in enumerate(before) if step.event.name == START)
    ready = before[start].time
    reports = [
        replace(before[start - 1], event=observed(chart.inputs[name].value, one.value, ready), **_NOTHING)
        for name, one in known.items()
        if name in chart.inputs and one.reported
    ]
    mission = [replace(each.step, time=each.step.time + ready) for each in lived]
    return RunRecord((*before[:start], *reports, *mission), given, head.seed, name=run.files[0].path.name)


#: A step by which nothing moved.
_NOTHING: Mapping[str, Any] = {"taken": (), "exited": (), "entered": (), "commands": (), "trail": ()}


def covering(runs: Sequence[JournaledRun], wall: float) -> JournaledRun:
    """Return the run at a moment in POSIX time: the last one whose machine had an event by then.

    Raises:
        JournalError: the journal does not go back so far.
    """
    begun: Iterator[JournaledRun] = (run for run in reversed(runs) if run.heard <= wall)
    found = next(begun, None)
    if found is None:
        raise JournalError("this journal does not go back so far")
    return found
