"""The write-ahead log of one domain: a folder with a file for each mission, and files for the time between.

A file's head has a snapshot; more follow, so that recovery replays little. Old files are deleted. When the
disk fails, waiting calls proceed and the failure is reported. Called on the loop's thread only;
`JournalWriter` has one of its own.
"""

from __future__ import annotations

import calendar
import contextlib
import os
import re
import shutil
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Protocol

from lupin_engine.machine.event import Event
from lupin_engine.machine.machine import Machine
from lupin_engine.plugin.files import user_folder
from lupin_engine.plugin.profile import Publish
from lupin_engine.plugin.robot import state_key
from lupin_engine.runtime.journal.frames import frame
from lupin_engine.runtime.journal.records import (
    ANSWERED,
    END,
    EVENT,
    LOADED,
    OUTCOME,
    PUBLISHED,
    REFUSED,
    RESUMED,
    SNAPSHOT,
    START,
    TARGETS,
    TIMER,
    WALL,
    JournalFile,
    JournalHead,
    encoded,
    encoded_head,
    read_head,
)
from lupin_engine.runtime.journal.shorthand import Shorthand
from lupin_engine.runtime.journal.writer import FrameWriter, JournalWriter

#: What files of a journal end with, and what those begin with that are about no mission.
SUFFIX, IDLE = ".journal", "idle"
#: The folder in which the files of charts are kept, each chart's under its hash.
CHARTS = "charts"
#: After so many bytes, and so many times its size, another snapshot is written: replay begins at one.
SNAPSHOT_BYTES, SNAPSHOT_TIMES = 262_144, 8
#: A file is followed by another part of the same mission, which begins with a snapshot, in bytes.
PART_BYTES, IDLE_BYTES = 16_777_216, 1_048_576
#: How many files about no mission are kept.
MAX_IDLE_FILES = 3
#: A disk that has not answered for so many seconds counts as failed. Memory cards pause for seconds now and
#: then; what must be on the disk first waits meanwhile, and stops never do.
PATIENCE_S = 10.0
#: The clock on the wall was set when it moved by so much against the machine's, in nanoseconds.
_WALL_NS = 5_000_000
#: How the name of a file begins: UTC and milliseconds.
_MOMENT, _STAMP = "%Y%m%dT%H%M%S", re.compile(r"(\d{8}T\d{6})\.(\d{3})Z")


@dataclass(frozen=True)
class Keep:
    """The limits of the files of missions: their number, their age in days, their bytes together."""

    missions: int = 200
    days: float = 60.0
    size: int = 1_000_000_000


class JournalOwner(Protocol):
    """The loop whose inputs are recorded."""

    def post(self, call: Callable[[], None]) -> None:
        """Run a call on the loop's thread."""

    def disk_changed(self, problem: str) -> None:
        """The disk fails, then waiting calls proceed; or it works again, where `problem` is ''."""


class Journal:
    """Writes the journal of one domain into `folder`; a `runtime.engine.InputLog`."""

    def __init__(
        self,
        folder: Path,
        keep: Keep,
        owner: JournalOwner,
        wall_ns: Callable[[], int] = time.time_ns,
        writer: FrameWriter | None = None,
    ) -> None:
        """Make a journal that writes nothing before `begin` or `go_on`.

        Args:
            folder: of the domain; made where it is missing.
            keep: limits; files beyond them are deleted when another one begins.
            owner: runs calls on its thread, and hears the reason when the disk fails, then waiting calls
                proceed; and '' when it works again.
            wall_ns: the wall clock.
            writer: receives the frames, instead of the disk.
        """
        self.folder = folder
        self._keep = keep
        self._owner = owner
        self.wall_ns = wall_ns
        self._writer = writer or JournalWriter(self)
        self.head: JournalHead | None = None
        #: Why the disk fails; '' when it does not.
        self.problem = ""
        self._reported = ""
        self._bytes = self._since_shot = self._shot = 0
        self._short = Shorthand()
        self._outcomes = 0
        #: The stamp of the newest file; None as long as nobody has looked.
        self._newest: int | None = None

    # -- files ------------------------------------------------------------------------------------------

    def begin(self, head: JournalHead) -> None:
        """Begin another file, after flushing the one before."""
        self.head = head = replace(head, outcomes=self._outcomes)
        self.problem = ""
        self._bytes = self._since_shot = 0
        self._short = Shorthand()
        self._shot = len(head.snapshot)
        path = self.folder / self._name(head)
        self._writer.open(path)
        self._put(encoded_head(head), urgent=True)
        self._writer.do(partial(self._make_room, path))
        if self._reported:
            self._writer.when_flushed(self._is_back)

    def go_on(self, found: JournalFile, shift: float, now: float, boot: str) -> None:
        """Append to the file of a process that has ended, after its usable bytes.

        Args:
            found: the file.
            shift: how far the clock of this process is ahead of that one's, in seconds.
            now: the time, of the clock of this process.
            boot: the name of this process.
        """
        ahead = self.wall_ns() - round(now * 1e9)
        self.head = replace(found.head, time=now, ahead_ns=ahead, boot=boot)
        self._bytes, self._since_shot, self._shot = found.good, 0, len(found.head.snapshot)
        self._short = Shorthand()
        self._writer.open(found.path, cut=found.good)
        self._put(encoded(RESUMED, now, {"boot": boot, "ahead_ns": ahead, "shift": shift}), urgent=True)

    def count_from(self, outcomes: int) -> None:
        """Number outcomes from there on, because earlier ones may not be marked as published yet."""
        self._outcomes = outcomes

    def keep_files(self, name: str, files: Mapping[str, bytes]) -> None:
        """Keep the files of a chart, which replay needs, under its name, unless they are there."""
        self._writer.do(partial(_save, self.folder / CHARTS / name, files))

    def close(self) -> None:
        """Flush the queue, and end."""
        self._writer.close()

    def _name(self, head: JournalHead) -> str:
        """Name a file by its time in milliseconds, but after all that are there: clocks are set back, too."""
        wall = (round(head.time * 1e9) + head.ahead_ns) // 1_000_000
        newest = _newest_stamp(self.folder) if self._newest is None else self._newest
        self._newest = stamp = max(wall, newest + 1)
        moment = time.strftime(_MOMENT, time.gmtime(stamp // 1000))
        about = re.sub(r"[^A-Za-z0-9_.-]", "_", head.mission_id)[:80] or IDLE
        return f"{moment}.{stamp % 1000:03d}Z_{about}{SUFFIX}"

    def _make_room(self, current: Path) -> None:
        """Delete files beyond the limits, but never the current one."""
        files = journal_files(self.folder)
        idle = [file for file in files if not mission_in_name(file)]
        missions = [file for file in files if file not in idle and file != current]
        for file in idle[:-MAX_IDLE_FILES]:
            file.unlink(missing_ok=True)
        oldest = self.wall_ns() * 1e-9 - self._keep.days * 86400.0
        size = 0
        for number, file in enumerate(reversed(missions)):
            try:
                about = file.stat()
                size += about.st_size
                many = number >= self._keep.missions - (current not in idle) or size > self._keep.size
                if many or about.st_mtime < oldest:
                    file.unlink()
            except OSError:
                continue  # somebody else removed it
        used = {head.chart for file in journal_files(self.folder) if (head := read_head(file))}
        for folder in self.folder.glob(f"{CHARTS}/*"):
            if folder.name not in used:
                shutil.rmtree(folder, ignore_errors=True)

    # -- inputs of the machine ----------------------------------------------------------------------------

    def started(self, now: float, ahead: float | None) -> None:
        """The machine is started."""
        self._input((START, now, ahead), now)

    def handled(self, now: float, event: Event, origin: Mapping[str, str]) -> None:
        """The machine gets an event; `origin` names who requested it."""
        if self.head is None:
            return
        short = None if origin else self._short.written(now, event)
        if short is not None:
            self._input(short, now, urgent=event.name != "value")
        else:
            self._input((EVENT, now, event.name, event.data, *([origin] if origin else [])), now)

    def fired(self, now: float) -> None:
        """The machine fires its earliest deadline."""
        self._input((TIMER, now), now)

    def loaded(self, now: float) -> None:
        """The machine was replaced by a hot reload."""
        self._input((LOADED, now), now)

    def when_flushed(self, then: Callable[[], None]) -> None:
        """Call `then` when all records are durable; at once while the disk has failed or no file is open."""
        if self.problem or self.head is None:
            then()
        else:
            self._writer.when_flushed(then)

    # -- outputs ------------------------------------------------------------------------------------------

    def outcome(self, outcome: Publish, fields: Mapping[str, Any]) -> int:
        """Write an outcome before it is published, and return its number (transactional outbox)."""
        self._outcomes += 1
        self._put(encoded(OUTCOME, self._outcomes, asdict(outcome), fields), urgent=True)
        return self._outcomes

    def targets(self, mission: str, mission_id: str, targets: list[str]) -> None:
        """Write the targets of a mission: each will get an outcome, also when the mission is closed."""
        self._put(encoded(TARGETS, mission, mission_id, targets), urgent=False)

    def published(self, number: int) -> None:
        """Write that an outcome was published."""
        self._put(encoded(PUBLISHED, number), urgent=True)

    def answered(self, command_id: str, what: str, answer: Mapping[str, Any]) -> None:
        """Write the answer to a command; `what` names the command."""
        self._put(encoded(ANSWERED, command_id, what, answer), urgent=True)

    def refused(self, request: str, code: str, more: int) -> None:
        """Write how many more requests were refused like those that are written."""
        self._put(encoded(REFUSED, request, code, more), urgent=False)

    def ended(self, about: Mapping[str, Any]) -> None:
        """Write that the mission is over."""
        self._put(encoded(END, about), urgent=True)

    def compact(self, machine: Machine, watched: Callable[[], Mapping[str, Any]] = dict) -> bool:
        """Write a snapshot, with the state of the watch, if one is due; return whether a new file is due."""
        limit = PART_BYTES if self.head is not None and self.head.mission_id else IDLE_BYTES
        if self._bytes > max(limit, SNAPSHOT_TIMES * self._shot):
            return True
        if self._since_shot > max(SNAPSHOT_BYTES, SNAPSHOT_TIMES * self._shot):
            shot = machine.snapshot()
            self._put(encoded(SNAPSHOT, shot, watched()), urgent=False)
            self._since_shot, self._shot = 0, len(shot)
        return False

    # -- the disk -----------------------------------------------------------------------------------------

    def check_disk(self) -> None:
        """Detect a disk that does not answer; to be called periodically."""
        if self._writer.waits > PATIENCE_S and not self.problem:
            self.failed(f"the disk has not answered for {PATIENCE_S:g} s", self._writer.give_up())

    def discontinue(self, reason: str) -> None:
        """Stop writing this file, because a replay of it would not lead to the machine's state."""
        self.problem = reason
        self.post(partial(self.failed, reason, []))  # not in the midst of a step

    @property
    def failing(self) -> str:
        """The reason for the disk's failure, until records are durable again; '' where there is none."""
        return self.problem or self._reported

    def post(self, call: Callable[[], None]) -> None:
        """Run a call on the loop's thread; for the writer."""
        self._owner.post(call)

    def failed(self, reason: str, waiting: list[Callable[[], None]]) -> None:
        """Report once that the disk fails, and let the calls proceed that waited; for the writer."""
        self.problem = reason
        if not self._reported:
            self._reported = reason
            self._owner.disk_changed(reason)
        for then in waiting:
            if then != self._is_back:
                then()

    def _is_back(self) -> None:
        self._reported = ""
        self._owner.disk_changed("")

    def _input(self, record: tuple[Any, ...], now: float, urgent: bool = True) -> None:
        head = self.head
        if head is None:
            return
        ahead = self.wall_ns() - round(now * 1e9)
        if abs(ahead - head.ahead_ns) > _WALL_NS:
            self.head = replace(head, ahead_ns=ahead)
            self._put(encoded(WALL, ahead), urgent=False)
        try:
            content = encoded(*record)
        except (TypeError, ValueError) as problem:
            self.discontinue(f"{self._short.name_in(record)} cannot be written: {problem}")
            return
        self._short.time = now
        self._put(content, urgent=urgent)

    def _put(self, content: bytes, urgent: bool) -> None:
        if self.problem or self.head is None:
            return
        data = frame(content)
        self._bytes += len(data)
        self._since_shot += len(data)
        self._writer.append(data, urgent=urgent)


def _save(folder: Path, files: Mapping[str, bytes]) -> None:
    """Write files into a folder that is there as a whole or not at all."""
    if folder.exists():
        return
    making = folder.with_name(f".{folder.name}.{os.getpid()}")
    for name, content in files.items():
        path = making / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
    making.rename(folder)


def _newest_stamp(folder: Path) -> int:
    """Return the milliseconds in the name of the newest file; 0 where there is none."""
    for file in reversed(journal_files(folder)):
        if match := _STAMP.match(file.name):
            with contextlib.suppress(ValueError):  # no date, so none of ours
                return calendar.timegm(time.strptime(match[1], _MOMENT)) * 1000 + int(match[2])
    return 0


def journal_folder(path: str = "", domain: int | None = None, robot: str | None = None) -> Path:
    """Return the folder of the journal of a robot of a ROS domain; or `path`, if given."""
    return domain_folder("journal", path, domain, robot)


def domain_folder(name: str, path: str = "", domain: int | None = None, robot: str | None = None) -> Path:
    """Return `path`, or without one the folder `name` of a ROS domain in the user's state folder.

    `domain` and the namespace `robot` are by default this process's; each robot has a folder of its own.

    Raises:
        UsageError: there is no such domain, or the user has no home folder.
    """
    if path:
        return Path(path)
    key = state_key(domain, robot)
    return user_folder("XDG_STATE_HOME", ".local/state") / name / f"domain-{key}"


def mission_in_name(file: Path) -> str:
    """Return the id of the mission that a file is about, as its name has it; '' for none."""
    about = file.stem.partition("_")[2]
    return "" if about == IDLE else about


def journal_files(folder: Path) -> list[Path]:
    """Return the files of a journal, the oldest first."""
    return sorted(folder.glob(f"*{SUFFIX}"))
