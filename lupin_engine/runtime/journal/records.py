"""The records of a journal: JSON lists that begin with their kind.

What entered the machine, each with the machine's time: `start`, `event`, `value` (an event too; `shorthand`
says how these and progress are written), `timer`, `loaded` (a machine of another chart goes on), `resumed`
(another process goes on). What was told the world: `outcome` before it is published, `published` after,
`answered` what came of a command with an id. And for whoever reads: `head` first, `wall` when the clock on
the wall was set, `refused` how many more requests were refused like those before, `snapshot`, `end`.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from lupin_engine.errors import LupinError
from lupin_engine.machine.event import Event
from lupin_engine.runtime.journal.frames import FAMILY, MAGIC, read_frames
from lupin_engine.runtime.journal.shorthand import SHORT_PROGRESS, SHORT_VALUE, Shorthand, progress_of

HEAD, START, EVENT, VALUE, TIMER = "head", "start", "event", "value", "timer"
LOADED, RESUMED = "loaded", "resumed"
OUTCOME, PUBLISHED, ANSWERED = "outcome", "published", "answered"
WALL, SNAPSHOT, END, REFUSED = "wall", "snapshot", "end", "refused"
#: Those that are inputs of the machine, or make another one.
INPUTS = frozenset({START, EVENT, VALUE, TIMER, LOADED, RESUMED})


class JournalError(LupinError):
    """A journal cannot be used; the text names the file and the reason."""


@dataclass(frozen=True)
class JournalHead:
    """What a file begins with: which machine it is about, and its memory then ("" for one not started).

    `chart` is the hash of the files, `chart_name` the lifecycle's. `ahead_ns` is how far the clock on the
    wall, in POSIX time, is ahead of the machine's. `part` counts the files of one mission from 1.
    `mission_id` is empty while no mission is under way. `boot` names the start of the process, `engine` its
    version. `files` are the missions, in the folder that keeps the chart's files. `outcomes` is how many were
    told before, `lineage` what the ids of goals are made of.
    """

    boot: str
    engine: str
    chart: str
    chart_name: str
    profile: str
    parameters: Mapping[str, Any]
    time: float
    ahead_ns: int
    files: tuple[str, ...] = ()
    lineage: str = ""
    mission: str = ""
    mission_id: str = ""
    part: int = 1
    seed: int = 0
    snapshot: str = ""
    outcomes: int = 0


@dataclass(frozen=True)
class JournalRecord:
    """One record: its kind, the machine's time, what the clock on the wall showed (POSIX), and the rest.

    `number` counts from 0, the head; `end` is the place in the file where it ends.
    """

    number: int
    kind: str
    time: float
    wall: float
    data: tuple[Any, ...]
    end: int

    @property
    def event(self) -> Event:
        """The event of an `event` or a `value`."""
        if self.kind == VALUE:
            name, value, stamp = self.data
            return Event("value", {"name": name, "value": value, "stamp": stamp})
        return Event(self.data[0], self.data[1])

    @property
    def origin(self) -> Mapping[str, str]:
        """Who asked for it, and by which id, as far as that was told."""
        return self.data[2] if self.kind == EVENT and len(self.data) > 2 else {}


@dataclass(frozen=True)
class JournalFile:
    """A file that was read: its head, its records, how many bytes can be used, and what the rest is."""

    path: Path
    head: JournalHead
    records: list[JournalRecord] = field(repr=False)
    good: int
    torn: int
    damaged: bool

    @property
    def problem(self) -> str:
        """What is wrong with it, in words; '' for nothing."""
        if self.damaged:
            place = f"{self.path} is damaged at byte {self.good}"
            return f"{place}: the {self.torn} bytes from there on are not used"
        broken = f"{self.path}: the last {self.torn} bytes are a record that was broken off, and are cut"
        return broken if self.torn else ""

    @cached_property
    def is_ended(self) -> bool:
        """Whether its mission has ended."""
        return any(record.kind == END for record in self.records)


def encoded(kind: str, *data: Any) -> bytes:
    """Return the content of a record.

    Raises:
        TypeError: something in it is no plain data.
        ValueError: it contains itself.
    """
    return _ENCODER.encode((kind, *data)).encode()


def encoded_head(head: JournalHead) -> bytes:
    """Return the content of a head; errors as for `encoded`."""
    return encoded(HEAD, asdict(head))


def read_journal(path: Path) -> JournalFile:
    """Return what is in a file.

    Raises:
        JournalError: it cannot be read, or has no head.
    """
    try:
        data = path.read_bytes()
    except OSError as problem:
        raise JournalError(f"{path} cannot be read: {problem.strerror}") from None
    return journal_of(path, data)


def journal_of(path: Path, data: bytes) -> JournalFile:
    """Return what is in the bytes of a file; errors as for `read_journal`."""
    found = read_frames(data)
    if data.startswith(FAMILY) and not data.startswith(MAGIC):
        raise JournalError(f"{path} was written by another version of the engine; this one does not read it")
    if not found.contents:
        raise JournalError(f"{path} is no journal, or was broken off at its first record")
    try:
        head = _head(json.loads(found.contents[0]))
        records = _records(found.contents, found.ends, head)
    except (ValueError, TypeError, IndexError, KeyError) as problem:
        raise JournalError(f"{path} is no journal of this version: {problem}") from None
    return JournalFile(path, head, records, found.good, found.torn, found.damaged)


def read_head(path: Path) -> JournalHead | None:
    """Return the head of a file without reading the rest; None where there is none."""
    try:
        with path.open("rb") as file:
            found = read_frames(file.read(65_536))
            if not found.contents:  # one with a long snapshot
                file.seek(0)
                found = read_frames(file.read())
        return _head(json.loads(found.contents[0])) if found.contents else None
    except (OSError, ValueError, TypeError, IndexError):
        return None


def _head(record: Any) -> JournalHead:
    if not isinstance(record, list) or record[0] != HEAD:
        raise ValueError("the first record is no head")
    return JournalHead(**{**record[1], "files": tuple(record[1]["files"])})


def _records(contents: list[bytes], ends: list[int], head: JournalHead) -> list[JournalRecord]:
    ahead, time = head.ahead_ns * 1e-9, head.time
    records, short = [], Shorthand()
    for number, (content, end) in enumerate(zip(contents, ends, strict=True)):
        kind, *data = json.loads(content)
        if kind == WALL:
            ahead = data[0] * 1e-9
        elif kind == RESUMED:
            time, ahead = data[0], data[1]["ahead_ns"] * 1e-9
            data, short = data[1:], Shorthand()
        elif kind == SHORT_VALUE:
            time = short.read_time(data[0])
            kind, data = VALUE, short.read_value(time, data[1:])
        elif kind == SHORT_PROGRESS:
            time = short.read_time(data[0])
            kind, data = EVENT, progress_of(data[1:])
        elif kind in INPUTS:
            time, *data = data
        short.time = time
        records.append(JournalRecord(number, kind, time, time + ahead, tuple(data), end))
    return records


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return dict(value)
    raise TypeError(f"{type(value).__name__} is no plain data")


_ENCODER = json.JSONEncoder(separators=(",", ":"), default=_plain)
