"""Replay: the same inputs at the same times give the same memory; recorded snapshots are compared with it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Protocol

from lupin_engine.errors import LupinError
from lupin_engine.machine.machine import Machine
from lupin_engine.machine.scope import EvaluationScope, World
from lupin_engine.machine.snapshot import restore, shift
from lupin_engine.machine.step import Step
from lupin_engine.runtime.engine import StepWatch
from lupin_engine.runtime.journal.records import (
    EVENT,
    LOADED,
    RESUMED,
    SNAPSHOT,
    START,
    TIMER,
    VALUE,
    JournalError,
    JournalFile,
    JournalHead,
    JournalRecord,
)


class ReplayError(JournalError):
    """A replay differs from the recording: `record` is the first that does not fit."""

    def __init__(self, path: Path, record: JournalRecord, how: str) -> None:
        where = f"{path}, record {record.number} ({record.kind} at {record.time:g} s)"
        super().__init__(f"{where}: the machine of now does not come to what was recorded: {how}")
        self.record = record


class KeptWatch(StepWatch, Protocol):
    """A watch over the properties that a new process goes on with."""

    def begin(self, kept: Mapping[str, Any], scope: EvaluationScope) -> None:
        """Go on from what was kept, with a machine of then."""

    def shift(self, seconds: float) -> None:
        """Go on by a clock that is so many seconds ahead."""


@dataclass(frozen=True)
class Replayed:
    """A record, the step that its input led to (None: it is no input), and the machine after it."""

    record: JournalRecord
    step: Step | None
    machine: Machine


def replay(found: JournalFile, world: World, watch: KeptWatch | None = None) -> Iterator[Replayed]:
    """Run the inputs of a file through a machine of its chart, one record after the other.

    Args:
        found: the file.
        world: of the chart and the parameters that the head names; the head's seed counts.
        watch: judges the steps, from what the head remembers on.

    Raises:
        ReplayError: the machine comes to something else than was recorded, or takes no such input.
        JournalError: no machine can be made of the head.
    """
    head = found.head
    world = replace(world, seed=head.seed)
    machine = _begun(found.path, head, world)
    if watch is not None:
        watch.begin(head.watched, machine.scope)
    for record in found.records:
        try:
            step, machine = _run(machine, record)
        except Exception as problem:  # whatever a record makes it raise that no orchestrator of now writes
            raise ReplayError(found.path, record, str(problem) or type(problem).__name__) from None
        if watch is not None and record.kind == RESUMED:
            watch.shift(record.data[0]["shift"])
        if watch is not None and step is not None:
            watch.take(step, machine.scope)
        yield Replayed(record, step, machine)


def _run(machine: Machine, record: JournalRecord) -> tuple[Step | None, Machine]:
    """Return the step of a record, None where it is no input, and the machine after it.

    Raises:
        ValueError: the machine comes to something else.
    """
    step: Step | None = None
    if record.kind in (EVENT, VALUE):
        step = machine.handle(record.event, record.time)
    elif record.kind == TIMER:
        step = machine.advance(record.time)
        if step is None:
            raise ValueError("no deadline is due there")
    elif record.kind == START:
        if machine.memory.sequence:
            raise ValueError("it is started already")
        step = machine.start(record.time, record.data[0])
    elif record.kind == LOADED:
        step = machine.go_on(record.time)
    elif record.kind == RESUMED:
        machine = resumed(machine, record.data[0]["shift"])
    elif record.kind == SNAPSHOT and machine.snapshot() != record.data[0]:
        raise ValueError("its memory is another one")
    return step, machine


def tail(found: JournalFile) -> JournalFile:
    """Return a file from its last snapshot but one on, so that a replay is compared with the last one."""
    shots = [record for record in found.records if record.kind == SNAPSHOT]
    if len(shots) < 2:
        return found
    begin = shots[-2]
    watched = begin.data[1] if len(begin.data) > 1 else {}
    head = replace(found.head, snapshot=begin.data[0], time=begin.time, watched=watched)
    return replace(found, head=head, records=found.records[begin.number :])


def resumed(machine: Machine, seconds: float) -> Machine:
    """Return a machine on another one's memory, by a clock that is so many seconds ahead."""
    memory = restore(machine.chart, machine.snapshot())
    shift(memory, seconds)
    return Machine(machine.world, memory)


def _begun(path: Path, head: JournalHead, world: World) -> Machine:
    if not head.snapshot:
        return Machine(world)
    try:
        return Machine(world, restore(world.chart, head.snapshot))
    except LupinError as problem:
        raise JournalError(f"{path}: {problem}") from None
