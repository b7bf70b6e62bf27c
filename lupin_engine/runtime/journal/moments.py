"""Restores the machine at any moment of a journal, by replay from a snapshot before it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from lupin_engine.chart.model import Chart
from lupin_engine.machine.machine import Machine
from lupin_engine.runtime.journal.journal import journal_files
from lupin_engine.runtime.journal.records import (
    INPUTS,
    RESUMED,
    JournalError,
    JournalFile,
    read_head,
    read_journal,
)
from lupin_engine.runtime.journal.replay import replay, tail
from lupin_engine.runtime.setup import make_world


class JournalMoments:
    """The machines of a journal, each at any moment of its life; `folder` may have other processes, too."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        heads = ((path, read_head(path)) for path in journal_files(folder))
        #: When each file begins, in POSIX time.
        self._begins = [(path, head.time + head.ahead_ns * 1e-9) for path, head in heads if head is not None]
        self._last: JournalFile | None = None

    def at(
        self, chart: Chart, chart_hash: str, boot: str, wall: float, before: int | None
    ) -> tuple[Machine, float]:
        """Return the machine of a process at a moment, and the time of its clock.

        Args:
            chart: that it ran, made of the files of `chart_hash`.
            boot: the name of the process.
            wall: the moment, in POSIX time.
            before: the number of a step that it had not taken yet.

        Raises:
            JournalError: it is not in this journal; or its replay differs from the record.
        """
        found = self._file(wall)
        if found is None or boot not in _boots(found) or found.head.chart != chart_hash:
            raise JournalError(
                f"what could happen at this moment is not known: its journal is not in {self._folder}"
            )
        later = (record.number for record in found.records if record.kind in INPUTS and record.wall > wall)
        return _lived(_until(found, next(later, None)), chart, wall, before)

    def _file(self, wall: float) -> JournalFile | None:
        """Return the file that was written at a time of the wall clock; None before the first.

        Raises:
            JournalError: it cannot be read.
        """
        path = next((path for path, begin in reversed(self._begins) if begin <= wall), None)
        if path is None:
            return None
        if self._last is None or self._last.path != path:
            self._last = read_journal(path)
        return self._last


def _boots(found: JournalFile) -> set[str]:
    resumed = (record.data[0]["boot"] for record in found.records if record.kind == RESUMED)
    return {found.head.boot, *resumed}


def _until(found: JournalFile, number: int | None) -> JournalFile:
    """Return a file up to the record of a number, without that."""
    return replace(found, records=found.records[:number])


def _lived(found: JournalFile, chart: Chart, wall: float, before: int | None) -> tuple[Machine, float]:
    for each in replay(tail(found), make_world(chart, found.head.parameters)):
        record, machine = each.record, each.machine
        if each.step is not None and before is not None and each.step.sequence >= before:
            return _lived(_until(found, record.number), chart, wall, before)
    return machine, record.time + max(0.0, wall - record.wall)
