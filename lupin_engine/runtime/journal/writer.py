"""The writer's thread: flushes all queued records together (group commit).

The loop's thread only queues, so no disk can delay a stop. Records that are not urgent, and for which no call
waits, are written after up to `LAZY_S` seconds; a process that is killed loses these.
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import os
import threading
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Protocol

from lupin_engine.runtime.journal.frames import MAGIC

#: How long a record that nobody waits for may stay in memory, in seconds.
LAZY_S = 0.5
#: How often it is looked whether the file is still there, at least, in seconds.
CHECK_S = 0.5

#: In every folder that is written to: who holds it is the only one that does.
LOCK = "lock"


class FrameWriter(Protocol):
    """Receives a journal's frames."""

    def open(self, path: Path, cut: int | None = None) -> None:
        """Write into another file from here on: a new one, or after the first `cut` bytes of one there."""

    def append(self, data: bytes, *, urgent: bool) -> None:
        """Write a frame; an `urgent` one at once, others soon."""

    def do(self, work: Callable[[], None]) -> None:
        """Queue other work with the disk."""

    def when_flushed(self, then: Callable[[], None]) -> None:
        """Call `then` on the loop's thread when everything queued is durable."""

    @property
    def waits(self) -> float:
        """How long a call has waited for the disk, in seconds."""

    def give_up(self) -> list[Callable[[], None]]:
        """Return the waiting calls, and drop them here."""

    def close(self) -> None:
        """Flush the queue, and end."""


class MemoryWriter:
    """Keeps one file, the newest, in memory, at once: for simulations."""

    def __init__(self) -> None:
        self.data = MAGIC
        self.waits = 0.0

    def open(self, path: Path, cut: int | None = None) -> None:
        """Begin with an empty file, or after the first `cut` bytes."""
        self.data = MAGIC if cut is None else self.data[:cut]

    def append(self, data: bytes, *, urgent: bool) -> None:
        """Add the bytes to the file in memory."""
        self.data += data

    def do(self, work: Callable[[], None]) -> None:
        """Do nothing: there is no disk."""

    def when_flushed(self, then: Callable[[], None]) -> None:
        """Call `then` at once: everything is kept already."""
        then()

    def give_up(self) -> list[Callable[[], None]]:
        """Return []: no call waits."""
        return []

    def close(self) -> None:
        """Do nothing: no file is open."""


class WriterOwner(Protocol):
    """The owner of a writer: it gets the writer's calls on its thread."""

    def post(self, call: Callable[[], None]) -> None:
        """Run a call on the loop's thread."""

    def failed(self, reason: str, waiting: list[Callable[[], None]]) -> None:
        """Take that the disk fails, and the calls that wait for it; on the loop's thread."""


class JournalWriter:
    """Writes frames to one file after the other."""

    def __init__(
        self,
        owner: WriterOwner,
        sync: Callable[[int], None] = os.fdatasync,
    ) -> None:
        self._owner = owner
        self._sync = sync
        self._ready = threading.Condition()
        self._queue: list[bytes | Callable[[], None]] = []
        self._waiting: list[Callable[[], None]] = []
        self._urgent = self._ended = False
        self._file: int | None = None
        self._path = Path()
        #: Whether nothing of a new file has been written as a whole yet.
        self._is_fresh = False
        self._lock: int | None = None
        self._since: float | None = None
        #: How many bytes were written, and how often a disk was waited for.
        self.written = self.syncs = 0
        self._thread = threading.Thread(target=self._run, name="journal", daemon=True)
        self._thread.start()

    def open(self, path: Path, cut: int | None = None) -> None:
        """Write into another file from here on: a new one, or after the first `cut` bytes of one there."""
        self._add(partial(self._open, path, cut), urgent=True)

    def do(self, work: Callable[[], None]) -> None:
        """Do something else with the disk in its turn; an OSError is a failure of the journal."""
        self._add(work, urgent=False)

    def append(self, data: bytes, *, urgent: bool) -> None:
        """Write a frame; an `urgent` one at once, others soon."""
        self._add(data, urgent=urgent)

    def when_flushed(self, then: Callable[[], None]) -> None:
        """Call `then` on the loop's thread when everything queued is durable."""
        with self._ready:
            self._waiting.append(then)
            self._urgent = True
            self._since = self._since or time.monotonic()
            self._ready.notify()

    @property
    def waits(self) -> float:
        """How long a call has waited for the disk, in seconds."""
        since = self._since
        return 0.0 if since is None else time.monotonic() - since

    def give_up(self) -> list[Callable[[], None]]:
        """Return the waiting calls, and drop them here."""
        with self._ready:
            given, self._waiting, self._since = self._waiting, [], None
        return given

    def close(self, limit: float = 2.0) -> None:
        """Flush the queue, and end; wait at most `limit` seconds for the disk."""
        with self._ready:
            self._ended = True
            self._ready.notify()
        self._thread.join(limit)

    def _add(self, item: bytes | Callable[[], None], urgent: bool) -> None:
        with self._ready:
            self._queue.append(item)
            if urgent:
                self._urgent = True
                self._ready.notify()
            elif len(self._queue) == 1:
                self._ready.notify()

    # -- the thread -------------------------------------------------------------------------------------

    def _wait_for_work(self) -> None:
        is_woken = self._queue or self._waiting or self._ended or self._ready.wait(CHECK_S)
        if is_woken and not (self._urgent or self._ended):
            self._ready.wait_for(lambda: self._urgent or self._ended, LAZY_S)

    def _run(self) -> None:
        while True:
            with self._ready:
                self._wait_for_work()
                queue, self._queue = self._queue, []
                waiting, self._waiting = self._waiting, []
                self._urgent, ended = False, self._ended
            try:
                self._write(queue, wait=bool(waiting) or ended)
            except Exception as problem:  # whatever it is: without this thread nothing that waits goes on
                self._fail(getattr(problem, "strerror", None) or str(problem), waiting)
            else:
                self._notify(waiting)
            if ended:
                self._close_file()
                if self._lock is not None:
                    os.close(self._lock)
                return

    def _notify(self, waiting: list[Callable[[], None]]) -> None:
        if not waiting:
            return
        with self._ready:
            self._since = time.monotonic() if self._waiting else None
        self._owner.post(partial(_call, waiting))

    def _fail(self, reason: str, waiting: list[Callable[[], None]]) -> None:
        self._close_file()
        if self._is_fresh:  # on a full disk one would be left at each try, and hide the last good one
            self._is_fresh = False
            with contextlib.suppress(OSError):
                self._path.unlink()
        with self._ready:
            self._since = None
        self._owner.post(lambda: self._owner.failed(reason, waiting))

    def _write(self, queue: list[bytes | Callable[[], None]], wait: bool) -> None:
        if self._file is not None and not self._path.exists():
            raise OSError(errno.ENOENT, "its file was removed")
        data: list[bytes] = []
        for item in queue:
            if isinstance(item, bytes):
                data.append(item)
                continue
            self._put(b"".join(data))
            data.clear()
            item()
        self._put(b"".join(data))
        if wait and self._file is not None:
            self.syncs += 1
            self._sync(self._file)
        self._is_fresh = False

    def _put(self, data: bytes) -> None:
        if self._file is None:
            return  # it has failed, and what is written goes on in another file
        self.written += len(data)
        while data:
            data = data[os.write(self._file, data) :]

    def _open(self, path: Path, cut: int | None) -> None:
        if self._file is not None:
            self._sync(self._file)
        self._close_file()
        self._take(path.parent)
        made = os.O_CREAT | os.O_EXCL if cut is None else 0
        self._path = path
        self._file = os.open(path, os.O_WRONLY | os.O_APPEND | os.O_CLOEXEC | made, 0o600)
        self._is_fresh = cut is None
        if cut is None:
            self._put(MAGIC)
            _sync_folder(path.parent)
        else:
            os.ftruncate(self._file, cut)

    def _take(self, folder: Path) -> None:
        """Lock a folder against other processes; OSError where one holds it, or it cannot be made."""
        if self._lock is not None:
            if _is_file(self._lock, folder / LOCK):
                return
            os.close(self._lock)  # the folder was removed
            self._lock = None
        folder.mkdir(parents=True, exist_ok=True)
        lock = os.open(folder / LOCK, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(lock)
            raise OSError(0, f"another process writes to {folder}") from None
        self._lock = lock

    def _close_file(self) -> None:
        if self._file is not None:
            os.close(self._file)
        self._file = None


def _call(waiting: list[Callable[[], None]]) -> None:
    for then in waiting:
        then()


def _is_file(descriptor: int, path: Path) -> bool:
    """Say whether an open file is still the one at a path."""
    try:
        return os.path.samestat(os.fstat(descriptor), path.stat())
    except FileNotFoundError:
        return False


def _sync_folder(folder: Path) -> None:
    """Make the name of a new file durable as well."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
