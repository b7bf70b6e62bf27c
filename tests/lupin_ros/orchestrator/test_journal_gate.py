"""What leaves the orchestrator when the disk fails: the node is a list of calls here."""

from __future__ import annotations

import errno
import itertools
import os
import queue
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import pytest

from lupin_engine.machine.event import Event
from lupin_engine.missions.selection import load_missions
from lupin_engine.plugin.profile import START, Publish
from lupin_engine.runtime.journal.journal import journal_files
from lupin_engine.runtime.journal.records import OUTCOME, PUBLISHED, read_journal
from lupin_engine.runtime.setup import make_machine
from lupin_ros.orchestrator.journal_gate import JOURNAL_PARAMETERS, WHAT_TO_DO, JournalGate
from tests import shipped


class Silent:
    """A log that nobody reads."""

    def __getattr__(self, _: str) -> Callable[..., None]:
        return lambda *_, **__: None


class Node:
    """What the gate uses of a node; each look at the clock is ten seconds later."""

    log = Silent()
    trouble = log.told
    lineage = "l"
    namespace = ""

    def __init__(self, **given: Any) -> None:
        self._given = {name: one.default for name, one in JOURNAL_PARAMETERS.items()} | given
        self._clock = itertools.count(step=10)
        self.posted: queue.Queue[Callable[[], None]] = queue.Queue()
        self.post = self.posted.put

    def parameters(self) -> dict[str, Any]:
        return self._given

    @staticmethod
    def guarded(callback: Callable[..., None]) -> Callable[..., None]:
        return callback

    def elapsed(self) -> float:
        return float(next(self._clock))

    def work_until(self, is_done: Callable[[], bool]) -> None:
        """Do what is posted."""
        end = time.monotonic() + 10.0
        while not is_done():
            self.posted.get(timeout=max(0.01, end - time.monotonic()))()


@pytest.mark.parametrize(
    ("given", "required"),
    [({}, True), ({"may_repeat_outcomes": True}, False), ({"journal_required": False}, False)],
)
def test_what_the_disk_does_not_take_is_published_when_it_does(
    tmp_path: Path, given: dict[str, bool], required: bool
) -> None:
    """Or at once, where outcomes may be repeated: a machine made of it publishes that target once more."""
    node = Node(journal_path=str(tmp_path), **given)
    loaded = load_missions(["inspection"], shipped.catalog())
    machine = make_machine(loaded.chart, {})
    gate = JournalGate(node, "boot", Mock())  # type: ignore[arg-type]
    sent: list[int] = []

    def full(_: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    gate.begin(loaded, machine)
    gate.journal._writer._sync = full  # type: ignore[attr-defined]
    channel = Mock(fields=lambda _: {"status": 0}, publish=lambda fields: sent.append(1))
    gate.publish([Publish("M", "m", "7", "OK")], channel)
    node.work_until(lambda: bool(gate.journal.problem))
    while not node.posted.empty():
        node.posted.get()()
    assert sent == ([] if required else [1])
    start = Event(START, {"mission_type": "InspectionMission"})
    refused = gate.refusal(start, machine.dry_run(start, 0.0), loaded.chart.profile)
    why = f"the journal cannot be written: No space left on device: {tmp_path}; {WHAT_TO_DO}"
    assert (refused and refused.text) == (f"start refused: {why}" if required else None)
    pause = Event("operator.pause")
    assert gate.refusal(pause, machine.dry_run(pause, 0.0), loaded.chart.profile) is None

    gate.journal._writer._sync = os.fdatasync  # type: ignore[attr-defined]
    gate.check_disk(machine)
    node.work_until(lambda: bool(sent))
    gate.close()
    assert sent == [1]
    kinds = [record.kind for record in read_journal(journal_files(tmp_path)[-1]).records]
    assert (OUTCOME in kinds, PUBLISHED in kinds) == (required, required)
