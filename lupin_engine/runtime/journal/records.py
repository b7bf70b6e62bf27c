"""The records of a journal: JSON lists that begin with their kind.

Inputs of the machine, each with the machine's time: `start`, `event`, `value` (an event too; `shorthand`
compresses these and progress), `timer`, `loaded` (hot reload), `resumed` (a process has recovered it).
Outputs: `outcome` before it is published, `published` after, `answered` with the answer to a command that has
an id. For readers: `head` first, `wall` when the wall clock was set, `refused` with the number of further
refused requests of one kind, `snapshot`, `end`, and `targets` of the mission, which makes them known even
where the file is damaged.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field
from functools import cache, cached_property
from pathlib import Path
from types import NoneType
from typing import Any

from pydantic import TypeAdapter

from lupin_engine.errors import LupinError
from lupin_engine.machine.event import FORMER_NAMES, Event
from lupin_engine.runtime.journal.frames import FAMILY, MAGIC, read_frames
from lupin_engine.runtime.journal.shorthand import SHORT_PROGRESS, SHORT_VALUE, Shorthand, progress_of

HEAD, START, EVENT, VALUE, TIMER = "head", "start", "event", "value", "timer"
LOADED, RESUMED = "loaded", "resumed"
OUTCOME, PUBLISHED, ANSWERED = "outcome", "published", "answered"
WALL, SNAPSHOT, END, REFUSED, TARGETS = "wall", "snapshot", "end", "refused", "targets"
#: Those that are inputs of the machine, or make another one.
INPUTS = frozenset({START, EVENT, VALUE, TIMER, LOADED, RESUMED})

_ANY = (NoneType, bool, int, float, str, list, dict)
_NUMBER = (int, float)
#: Kind -> the types of what follows it, and of what may follow these.
_SHAPES: Mapping[str, tuple[tuple[tuple[type, ...], ...], tuple[tuple[type, ...], ...]]] = {
    HEAD: (((dict,),), ()),
    START: ((_NUMBER, (*_NUMBER, NoneType)), ()),
    EVENT: ((_NUMBER, (str,), (dict,)), ((dict,),)),
    SHORT_VALUE: ((_NUMBER, (int, str), (int, NoneType)), (_ANY, _NUMBER)),
    SHORT_PROGRESS: ((_NUMBER, (str,), (str,)), ()),
    TIMER: ((_NUMBER,), ()),
    LOADED: ((_NUMBER,), ()),
    RESUMED: ((_NUMBER, (dict,)), ()),
    OUTCOME: (((int,), (dict,), (dict,)), ()),
    PUBLISHED: (((int,),), ()),
    ANSWERED: (((str,), (str,), (dict,)), ()),
    WALL: (((int,),), ()),
    SNAPSHOT: (((str,),), ((dict,),)),
    END: (((dict,),), ()),
    REFUSED: (((str,), (str,), (int,)), ()),
    TARGETS: (((str,), (str,), (list,)), ()),
}
#: No clock shows more seconds.
_END_OF_TIME = 1e11
#: What a record makes its reader raise that has another shape.
_WRONG = (ValueError, TypeError, LookupError, OverflowError, RecursionError)


class JournalError(LupinError):
    """A journal cannot be used; the text names the file and the reason."""


class NothingWritten(JournalError):
    """The first write of a file was torn: its mission had not begun, and the file before counts."""


@dataclass(frozen=True)
class JournalHead:
    """The first record of a file: identifies the machine, with its snapshot ("" for one not started).

    `chart` is the hash of the files, `chart_name` the lifecycle's. `ahead_ns` is how far the wall clock, in
    POSIX time, is ahead of the machine's. `part` counts the files of one mission from 1. `mission_id` is
    empty between missions. `boot` names the process, `engine` its version. `files` are the missions, in the
    folder of the chart's files. `outcomes` counts those before this file, `lineage` is the prefix of the
    goals' ids. `watched` is what the watch over the properties remembers (see `properties.LiveMonitor.kept`).
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
    watched: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class JournalRecord:
    """One record: its kind, the machine's time, the wall clock's time (POSIX), and the data.

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
        return Event(FORMER_NAMES.get(self.data[0], self.data[0]), self.data[1])

    @property
    def origin(self) -> Mapping[str, str]:
        """The requester and its command id, as far as they are recorded."""
        return self.data[2] if self.kind == EVENT and len(self.data) > 2 else {}


@dataclass(frozen=True)
class JournalFile:
    """A file that was read: its head, its records, the number of usable bytes, and the rest.

    `behind` are records after the damage: each is whole, but the machine's steps there are unknown.
    """

    path: Path
    head: JournalHead
    records: list[JournalRecord] = field(repr=False)
    good: int
    torn: int
    damaged: bool
    behind: list[JournalRecord] = field(default_factory=list, repr=False)

    @property
    def problem(self) -> str:
        """The damage or the torn tail, in words; '' where there is none."""
        if self.damaged:
            place = f"{self.path} is damaged at byte {self.good}"
            return f"{place}: the {self.torn} bytes from there on are not used"
        broken = f"{self.path}: the last {self.torn} bytes are a record that was broken off, and are cut"
        return broken if self.torn else ""

    @cached_property
    def is_ended(self) -> bool:
        """Whether its mission has ended."""
        return any(record.kind == END for record in self.all)

    @property
    def all(self) -> list[JournalRecord]:
        """Every record that could be read."""
        return [*self.records, *self.behind]


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
    """Read a file.

    Raises:
        JournalError: it cannot be read, or has no head.
    """
    try:
        data = path.read_bytes()
    except OSError as problem:
        raise JournalError(f"{path} cannot be read: {problem.strerror}") from None
    return journal_of(path, data)


def journal_of(path: Path, data: bytes) -> JournalFile:
    """Read the bytes of a file; errors as for `read_journal`.

    A record of another shape is damage, like one with a wrong checksum. A lost head is replaced by one with
    the mission of `targets` alone, without a chart.
    """
    found = read_frames(data)
    if data.startswith(FAMILY) and not (data.startswith(MAGIC) or found.behind):
        raise JournalError(f"{path} was written by another version of the engine; this one does not read it")
    if not (found.contents or found.behind or found.damaged):
        raise NothingWritten(f"{path} was broken off at its first record")
    reason = "is no journal"
    head: JournalHead | None = None
    records: list[JournalRecord] = []
    try:
        if found.contents:
            head = _head(found.contents[0])
            sequence = _Records(head)
            for content, end in zip(found.contents, found.ends, strict=True):
                records.append(sequence.read(content, end))
    except _WRONG as problem:
        reason = f"is no journal of this version: {problem}"
    rest = [*found.contents[len(records) :], *found.behind]
    if head is None:
        head = _head_behind(rest)
        if head is None:
            raise JournalError(f"{path} {reason}")
        records = [_Records(head).read(encoded_head(head), 0)]
    good = records[-1].end
    damaged = found.damaged or good < found.good
    return JournalFile(path, head, records, good, len(data) - good, damaged, _out_of_sequence(rest, head))


def read_head(path: Path) -> JournalHead | None:
    """Return the head of a file without reading the rest; None where there is none."""
    try:
        with path.open("rb") as file:
            found = read_frames(file.read(65_536))
            if not found.contents:  # one with a long snapshot
                file.seek(0)
                found = read_frames(file.read())
        return _head(found.contents[0]) if found.contents else None
    except (OSError, *_WRONG):
        return None


@cache
def _head_type() -> TypeAdapter[JournalHead]:
    return TypeAdapter(JournalHead)


def _head(content: bytes) -> JournalHead:
    kind, *data = json.loads(content)
    if kind != HEAD:
        raise ValueError("the first record is no head")
    return _head_type().validate_python(*data)


def _head_behind(contents: Iterable[bytes]) -> JournalHead | None:
    """Return the head among records, or one that knows the mission alone; None where nothing names one."""
    named: JournalHead | None = None
    for content in contents:
        try:
            kind, *data = json.loads(content)
            if kind == HEAD:
                return _head(content)
            if kind == TARGETS:
                _check(kind, data)
                about = {"mission": data[0], "mission_id": data[1]}
                named = named or JournalHead("", "", "", "", "", {}, 0.0, 0, **about)
        except _WRONG:
            continue
    return named


class _Records:
    """Decodes the records of a file in sequence, with the state that each leaves for the next."""

    def __init__(self, head: JournalHead) -> None:
        self._ahead, self._time = head.ahead_ns * 1e-9, head.time
        self._short = Shorthand()
        self._number = 0

    def read(self, content: bytes, end: int, *, alone: bool = False) -> JournalRecord:
        """Return the next record; one that is read `alone` may not refer to those before.

        Raises:
            ValueError, TypeError, LookupError, OverflowError, RecursionError: it has another shape.
        """
        kind, *data = json.loads(content)
        _check(kind, data)
        short, time, ahead = self._short, self._time, self._ahead
        if alone and kind in (SHORT_VALUE, SHORT_PROGRESS):
            raise ValueError("it refers to the records before")
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
        if not max(abs(time), abs(ahead)) <= _END_OF_TIME:
            raise ValueError(f"no clock shows {time!r} s")
        self._short, self._time, self._ahead = short, time, ahead
        short.time = time
        self._number += 1
        return JournalRecord(self._number - 1, kind, time, time + ahead, tuple(data), end)


def _out_of_sequence(contents: Iterable[bytes], head: JournalHead) -> list[JournalRecord]:
    """Return the records that say something by themselves."""
    sequence, records = _Records(head), []
    for content in contents:
        try:
            records.append(sequence.read(content, 0, alone=True))
        except _WRONG:
            continue
    return records


def _check(kind: str, data: list[Any]) -> None:
    """Raise ValueError, TypeError or LookupError for a record of another shape."""
    needed, more = _SHAPES[kind]
    shape = (*needed, *more)
    fits = len(needed) <= len(data) <= len(shape)
    if not (fits and all(type(one) in kinds for one, kinds in zip(data, shape, strict=False))):
        raise ValueError(f"a record {kind!r} of another shape")
    texts: list[Any] = []
    if kind == OUTCOME:
        texts = [data[1]["mission_id"], data[1]["target"]]
    elif kind == TARGETS:
        texts = data[2]
    elif kind == EVENT:
        texts = [text for origin in data[3:] for text in origin.values()]
    elif kind == RESUMED:
        texts = [data[1]["boot"]]
        if not abs(data[1]["shift"]) <= _END_OF_TIME or type(data[1]["ahead_ns"]) is not int:
            raise ValueError("a record 'resumed' of another shape")
    if not all(isinstance(text, str) for text in texts):
        raise ValueError(f"a record {kind!r} without a text")


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return dict(value)
    raise TypeError(f"{type(value).__name__} is no plain data")


_ENCODER = json.JSONEncoder(separators=(",", ":"), default=_plain)
