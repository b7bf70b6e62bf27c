"""Recovery: replays the journal of a process that has ended into its machine and unreported outcomes.

It begins at the last snapshot but one, and ends before damage or the first record that replays differently,
with the problem as text.
"""

from __future__ import annotations

import json
import time
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from lupin_engine.machine.event import RESUMED, Event
from lupin_engine.machine.machine import Machine
from lupin_engine.machine.scope import World
from lupin_engine.machine.step import Step
from lupin_engine.plugin.profile import Publish
from lupin_engine.runtime.journal.journal import journal_files, mission_in_name
from lupin_engine.runtime.journal.records import (
    ANSWERED,
    INPUTS,
    OUTCOME,
    PUBLISHED,
    SNAPSHOT,
    TARGETS,
    JournalError,
    JournalFile,
    JournalRecord,
    NothingWritten,
    read_journal,
)
from lupin_engine.runtime.journal.replay import KeptWatch, ReplayError, replay, tail

#: How many files are read for outcomes: a mission's, and the one that follows.
MAX_FILES_READ = 2
#: So many of the newest outcomes are published again: messages died with their publisher, and subscribers
#: that came later lack them. A repeat is the same message.
BACKLOG = 50


@dataclass(frozen=True)
class KeptCommand:
    """A command with an id: its arrival in POSIX time, its name, and its answer, if any."""

    wall: float
    what: str = ""
    answer: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Leftover:
    """The newest readable file of a journal, and outcomes and commands of the newest `MAX_FILES_READ` files.

    `newest` has the fields of up to `BACKLOG` outcomes, published or not, by number; `outcomes` is the number
    of the last one. `commands` are by id, in their order.
    """

    file: JournalFile
    newest: Mapping[int, Mapping[str, Any]] = field(default_factory=dict)
    outcomes: int = 0
    commands: Mapping[str, KeptCommand] = field(default_factory=dict)

    @property
    def last(self) -> JournalRecord | None:
        """The last input of the machine; None where no input is recorded."""
        return next((r for r in reversed(self.file.records) if r.kind in INPUTS), None)

    def away(self, wall: float) -> float:
        """Return for how many seconds no process has run, at a time of the wall clock."""
        return max(0.0, wall - (self.last.wall if self.last else self.file.records[0].wall))

    def shift(self, now: float, wall: float) -> float:
        """Return how far a clock that says `now` is ahead of the one that the file goes by."""
        last = self.last.time if self.last else self.file.head.time
        return round(now - last - self.away(wall), 6)


@dataclass(frozen=True)
class Recovered:
    """A recovered machine, and outcomes that its steps wanted published but did not write.

    `problem` says why it cannot go on; '' where it can.
    """

    machine: Machine
    unreported: tuple[tuple[JournalRecord, Publish], ...]
    problem: str = ""


def leftover(folder: Path) -> tuple[Leftover | None, list[str], str]:
    """Return the newest files of a folder (None: none is readable), their problems, and the lost mission.

    The mission of an unreadable newest file is lost: its id with the reason; '' where it was read.
    """
    found: list[JournalFile] = []
    problems: list[str] = []
    lost, is_newest = "", True
    for path in reversed(journal_files(folder)):
        try:
            found.append(read_journal(path))
        except NothingWritten as problem:
            problems.append(str(problem))
            continue
        except JournalError as problem:
            problems.append(str(problem))
            if is_newest and mission_in_name(path):
                lost = f"{mission_in_name(path)}: {problem}"
        else:
            problems += [found[-1].problem] if found[-1].problem else []
        is_newest = False
        if len(found) == MAX_FILES_READ:
            break
    if not found:
        return None, problems, lost
    records = [record for file in reversed(found) for record in file.all]
    written = {record.data[0]: record.data[2] for record in records if record.kind == OUTCOME}
    newest = dict(list(written.items())[-BACKLOG:])
    outcomes = max([*(file.head.outcomes for file in found), *written])
    return Leftover(found[0], newest, outcomes, _commands(records)), problems, lost


def _commands(records: list[JournalRecord]) -> dict[str, KeptCommand]:
    """Return the commands by id; one without an answer may have been carried out all the same."""
    found: dict[str, KeptCommand] = {}
    for record in records:
        if record.kind == ANSWERED:
            command_id, what, answer = record.data
            found[command_id] = KeptCommand(record.wall, what, answer)
        elif command_id := record.origin.get("command_id", ""):
            found[command_id] = KeptCommand(record.wall)
    return found


def recover(found: JournalFile, world: World, watch: KeptWatch | None = None) -> Recovered:
    """Replay a file to its end, or to the record before its first problem; `watch` judges the steps.

    Raises:
        JournalError: no machine can be made of it.
    """
    problem = found.problem if found.damaged else ""
    try:
        return _replayed(found, world, problem, watch)
    except ReplayError as wrong:
        before = replace(found, records=found.records[: wrong.record.number])
        return _replayed(before, world, str(wrong), watch)


def _replayed(found: JournalFile, world: World, problem: str, watch: KeptWatch | None) -> Recovered:
    machine: Machine | None = None
    waiting: list[tuple[JournalRecord, Publish]] = []
    for each in replay(tail(found), world, watch):
        machine = each.machine
        if each.step is not None:
            waiting += [(each.record, outcome) for outcome in outcomes_of(each.step)]
        elif each.record.kind == OUTCOME and waiting:
            waiting.pop(0)
    assert machine is not None, "a file that was read has a head"
    behind = {record.data[1]["target"] for record in found.behind if record.kind == OUTCOME}
    unreported = [one for one in waiting if one[1].target not in behind]
    return Recovered(machine, tuple(unreported[_published_without_record(found) :]), problem)


def _published_without_record(found: JournalFile) -> int:
    """Return how many outcomes were published whose own records are damaged; they are the oldest."""
    written = {record.data[0] for record in found.all if record.kind == OUTCOME}
    marked = {record.data[0] for record in found.behind if record.kind == PUBLISHED}
    return sum(number > found.head.outcomes for number in marked - written)


def outcomes_of(step: Step) -> list[Publish]:
    """Return the outcomes that a step publishes."""
    return [command for command in step.commands if isinstance(command, Publish)]


def open_targets(found: JournalFile, recovered: Recovered | None) -> list[str]:
    """Return the targets of a mission without an outcome, for a file whose inputs cannot all be run any more.

    Each is known from its own record, and from the steps or the snapshots: no single damage hides it.
    """
    mission_id = found.head.mission_id
    recorded = [record.data[1:] for record in found.all if record.kind == TARGETS]
    shots = [record.data[0] for record in found.all if record.kind == SNAPSHOT]
    left = [target for of, targets in recorded if of == mission_id for target in targets]
    left += _open_in(shots[-1] if shots else found.head.snapshot, mission_id)
    closed = {record.data[1]["target"] for record in found.all if record.kind == OUTCOME}
    if recovered is not None:
        closed |= {outcome.target for _, outcome in recovered.unreported}
        memory = recovered.machine.memory
        visits = memory.outcomes if memory.mission_id == mission_id else ()
        closed |= {visit.target for visit in visits if visit.closed}
        left += [visit.target for visit in visits]
    return [target for target in dict.fromkeys(left) if target not in closed]


def _open_in(shot: str, mission_id: str) -> list[str]:
    try:
        memory = json.loads(shot)["memory"]
        walks = memory["itineraries"].values() if memory["mission_id"] == mission_id else ()
        visits = [visit for walk in walks for visit in walk["visits"]]
        return [str(visit["target"]) for visit in visits if not visit["status"]]
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return []


def goes_on(machine: Machine) -> bool:
    """Say whether a recovered machine is to go on, by its lifecycle."""
    lifecycle = machine.view.lifecycle
    return bool(lifecycle) and lifecycle not in machine.chart.profile.stages.begins_anew


def resumed_event(left: Leftover, machine: Machine, wall: float) -> Event:
    """Return the event that informs a recovered machine, at a time of the wall clock."""
    since = time.strftime("%Y-%m-%d %H:%M:%S UTC", time.gmtime(left.last.wall if left.last else wall))
    away = left.away(wall)
    detail = f"nobody watched since {since}, {away:.1f} s; under way: {under_way(machine)}"
    held = machine.view.lifecycle not in machine.chart.profile.stages.without_mission
    return Event(RESUMED, {"detail": detail, "held": held, "away": round(away, 6)})


def under_way(machine: Machine) -> str:
    """Return the machine's phase, target and operations as text."""
    view = machine.view
    where = " ".join(filter(None, (view.lifecycle, view.phase)))
    target = f", at {view.target}" if view.target else ""
    doing = ", ".join(attempt.operation for attempt in view.attempts)
    return f"{where}{target}{f': {doing}' if doing else ''}"
