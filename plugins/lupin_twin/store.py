"""The store: SQLite with a write-ahead log, one row for each record, in the order of arrival.

A record is on disk when `add` returns. The twin's state is the fold of the rows, so only the latest map is
stored besides. A file that is no store is quarantined, never overwritten. Records that cannot be written wait
in memory (at most 10,000, the oldest are dropped) and are retried with the next one.

`read` is for other programs: it reads a store that a twin may be writing to, and changes nothing.
"""

from __future__ import annotations

import fcntl
import hashlib
import os
import shutil
import sqlite3
import zlib
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple
from urllib.parse import quote

import numpy as np

from lupin_engine.errors import LupinError
from lupin_twin.field import OccupancyMap
from lupin_twin.records import Anomaly, Flowers, Reading, Record, from_json, to_json

#: The path that means: keep nothing.
NOWHERE = ":memory:"

#: Version of the table; a file of a later one is left alone.
VERSION = 1

#: Records that wait in memory while they cannot be written; the oldest are given up first.
MAX_WAITING = 10_000

#: Bytes that SQLite needs beside a store to open it.
LEAST_ROOM = 65_536

#: Seconds to wait for a program that reads or copies the file.
BUSY_S = 2.0

#: `digest` identifies repeated observations, which latecomers' backlogs cause.
_TABLE = f"""
    BEGIN;
    CREATE TABLE record (
        number INTEGER PRIMARY KEY,
        received REAL NOT NULL,
        digest BLOB UNIQUE,
        json TEXT NOT NULL
    );
    PRAGMA user_version = {VERSION};
    COMMIT;
"""

#: The latest map, if any; `cells` are compressed, row by row, one signed byte each.
_MAP = """
    CREATE TABLE IF NOT EXISTS map (
        number INTEGER PRIMARY KEY CHECK (number = 1),
        x REAL NOT NULL,
        y REAL NOT NULL,
        yaw REAL NOT NULL,
        resolution REAL NOT NULL,
        width INTEGER NOT NULL,
        height INTEGER NOT NULL,
        cells BLOB NOT NULL
    )
"""

_INSERT = "INSERT OR IGNORE INTO record (received, digest, json) VALUES (?, ?, ?)"
_KEEP_MAP = "INSERT OR REPLACE INTO map VALUES (1, ?, ?, ?, ?, ?, ?, ?)"


class StoreError(LupinError):
    """The store cannot be used now; the text has the file and the reason."""


class _CorruptStore(Exception):
    """The file is no store."""


class StoredRecord(NamedTuple):
    """A record, and its time of arrival in seconds."""

    record: Record
    received: float


@dataclass(frozen=True)
class StoreContent:
    """Records in the order of arrival, the latest map, and descriptions of damaged rows."""

    rows: list[StoredRecord]
    map: OccupancyMap | None
    unreadable: list[str]


class Store:
    """The store at `path`, created if missing; locked against a second twin.

    `put_aside` describes a file that was quarantined ("" for none), and `unreadable` damaged rows, for
    people.

    Raises:
        StoreError: the file cannot be opened, another twin has it, or it was written by a later version.
    """

    def __init__(self, path: str) -> None:
        self.path = path
        self.put_aside = ""
        self.unreadable: list[str] = []
        self._waiting: deque[tuple[float, bytes | None, str]] = deque(maxlen=MAX_WAITING)
        self._lock: int | None = None
        if path != NOWHERE:
            self._make_folder()
            self._lock = _locked(path)
        try:
            self._open()
        except BaseException:
            self._unlock()
            raise

    def _open(self) -> None:
        path = self.path
        try:
            self._db = _opened(path)
        except _CorruptStore as reason:
            moved = self._move_aside()
            self.put_aside = f"{path} is not a store of the twin ({reason}): kept as {moved}, a new one begun"
            self._db = _opened(path)

    def _make_folder(self) -> None:
        try:
            Path(self.path).parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise StoreError(f"the folder of {self.path} cannot be made: {error.strerror}") from None

    def _move_aside(self) -> str:
        """Rename the file and its log; return the new name of the file. StoreError: that is not possible."""
        free = (f"{self.path}.corrupt-{number}" for number in range(1, 10_000))
        moved = next(name for name in free if not os.path.lexists(name))
        try:
            # The file last: a log that is left beside a new one would be taken for its own.
            for suffix in ("-wal", "-shm", ""):
                if os.path.exists(self.path + suffix):
                    os.rename(self.path + suffix, moved + suffix)
        except OSError as error:
            raise StoreError(f"{self.path} is corrupt and cannot be put aside: {error.strerror}") from None
        return moved

    def rows(self) -> Iterator[StoredRecord]:
        """Yield all records in the order of arrival; damaged rows go to `unreadable`."""
        yield from _rows(self._db, self.path, self.unreadable)

    def map(self) -> OccupancyMap | None:
        """Return the stored map; None without one, or where it is damaged (see `unreadable`)."""
        return _map(self._db, self.path, self.unreadable)

    def keep_map(self, occupancy: OccupancyMap) -> bool:
        """Replace the stored map; always returns True.

        Raises:
            StoreError: it could not be written.
        """
        height, width = occupancy.cells.shape
        cells = zlib.compress(occupancy.cells.astype(np.int8).tobytes(), level=1)
        place = occupancy.x, occupancy.y, occupancy.yaw, occupancy.resolution
        try:
            with self._db:
                self._db.execute(_KEEP_MAP, (*place, width, height, cells))
        except sqlite3.Error as error:
            raise StoreError(f"{self.path}: {error}; the map is in memory only") from None
        return True

    @property
    def waiting(self) -> int:
        """The number of records in memory only."""
        return len(self._waiting)

    def add(self, record: Record, received: float) -> bool:
        """Write a record to disk; return False for an observation that is stored already.

        Raises:
            StoreError: it could not be written, and waits in memory.
        """
        text = to_json(record)
        is_unique = isinstance(record, (Reading, Flowers, Anomaly))
        digest = hashlib.sha256(text.encode()).digest() if is_unique else None
        self._waiting.append((received, digest, text))
        return self.flush()

    def flush(self) -> bool:
        """Write the waiting records; return whether the last one was new.

        Raises:
            StoreError: nothing could be written; they keep waiting.
        """
        new = False
        try:
            with self._db:
                for row in self._waiting:
                    new = self._db.execute(_INSERT, row).rowcount > 0
        except sqlite3.Error as error:
            raise StoreError(f"{self.path}: {error}; {self.waiting} records are in memory only") from None
        self._waiting.clear()
        return new

    def close(self) -> None:
        """Close the file."""
        self._db.close()
        self._unlock()

    def _unlock(self) -> None:
        lock, self._lock = self._lock, None
        if lock is not None:
            os.close(lock)


def _locked(path: str) -> int:
    """Return a descriptor with a lock on the file, which ends with the process, however that ends.

    Two twins would each take the other's records for repetitions of its own.

    Raises:
        StoreError: another twin has it.
    """
    try:
        descriptor = os.open(f"{path}.lock", os.O_CREAT | os.O_RDWR, 0o666)
    except OSError as error:
        raise StoreError(f"{path} cannot be opened: {error.strerror}") from None
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(descriptor)
        raise StoreError(f"{path} is used by another twin; give this one a store_file of its own") from None
    return descriptor


def _opened(path: str) -> sqlite3.Connection:
    """Return a connection to a valid store.

    Raises:
        _CorruptStore: the file holds something else.
        StoreError: it cannot be opened.
    """
    db = None
    try:
        db = sqlite3.connect(path, timeout=BUSY_S)
        db.execute("PRAGMA journal_mode = WAL")
        # Every commit reaches the disk: a robot is switched off by its main switch.
        db.execute("PRAGMA synchronous = FULL")
        _check(db, path)
    except sqlite3.OperationalError as error:
        # Locked, not allowed, no room: the file itself may be sound.
        _close(db)
        raise StoreError(f"{path} cannot be opened: {_reason(path, error)}") from None
    except sqlite3.DatabaseError as error:
        _close(db)
        raise _CorruptStore(str(error)) from None
    except BaseException:
        _close(db)
        raise
    return db


def _reason(path: str, error: sqlite3.Error) -> str:
    """Return why a file cannot be opened: SQLite calls a full disk a broken file."""
    has_room = shutil.disk_usage(Path(path).parent).free >= LEAST_ROOM
    return str(error) if has_room else "no room is left on its disk"


def _check(db: sqlite3.Connection, path: str) -> None:
    """Create the tables in an empty file; check any other one."""
    version, tables = _state(db)
    if version == 0 and not tables:
        db.executescript(_TABLE)
    else:
        _check_ours(db, path, version, tables)
    db.execute(_MAP)


def _check_ours(db: sqlite3.Connection, path: str, version: int, tables: list[str]) -> None:
    """Check that a file that is not empty is a complete store.

    Raises:
        StoreError: a later version of the twin wrote it.
        _CorruptStore: it is another program's, or damaged.
    """
    if "record" not in tables or version == 0:
        raise _CorruptStore("another program's database")
    if version > VERSION:
        raise StoreError(f"{path} was written by a later version of the twin ({version}, known: {VERSION})")
    verdict = db.execute("PRAGMA quick_check(1)").fetchone()[0]
    if verdict != "ok":
        raise _CorruptStore(verdict)


def _state(db: sqlite3.Connection) -> tuple[int, list[str]]:
    """Return the version and the names of the tables."""
    version = db.execute("PRAGMA user_version").fetchone()[0]
    return version, [name for (name,) in db.execute("SELECT name FROM sqlite_master WHERE type = 'table'")]


def _rows(db: sqlite3.Connection, path: str, unreadable: list[str]) -> Iterator[StoredRecord]:
    # As bytes: what is no text any more is one damaged row, and not the end of reading.
    written = db.execute("SELECT number, received, CAST(json AS BLOB) FROM record ORDER BY 1")
    for number, received, text in written:
        try:
            yield StoredRecord(from_json(text), _moment(received))
        except ValueError as error:
            unreadable.append(f"{path}: row {number} left out: {error}")


def _moment(received: object) -> float:
    """Return a record's time of arrival, in seconds.

    Raises:
        ValueError: it is no number.
    """
    if not isinstance(received, float):
        raise ValueError(f"its time is no number but {type(received).__name__}")
    return received


def _map(db: sqlite3.Connection, path: str, unreadable: list[str]) -> OccupancyMap | None:
    """Return the stored map; None without one, or with a problem in `unreadable`."""
    found = db.execute("SELECT x, y, yaw, resolution, width, height, cells FROM map").fetchone()
    if found is None:
        return None
    x, y, yaw, resolution, width, height, cells = found
    try:
        grid = np.frombuffer(zlib.decompress(cells), dtype=np.int8).reshape(height, width)
    except (ValueError, TypeError, zlib.error) as error:
        unreadable.append(f"{path}: the map left out: {error}")
        return None
    return OccupancyMap(x, y, yaw, resolution, grid)


def read(path: str) -> StoreContent:
    """Return the content of a store, also while a twin writes to it; nothing is changed.

    Raises:
        StoreError: there is no store, or it cannot be read; the text says why.
    """
    if not os.path.isfile(path):
        raise StoreError(f"there is no store {path}; a twin makes it: lupin run, or lupin node lupin_twin")
    try:
        db = _opened_for_reading(path)
    except sqlite3.OperationalError as error:
        raise StoreError(f"{path} cannot be read: {error}") from None
    except sqlite3.DatabaseError as error:
        raise _not_ours(path, error) from None
    try:
        _check_ours(db, path, *_state(db))
        unreadable: list[str] = []
        rows = list(_rows(db, path, unreadable))
        has_map = "map" in _state(db)[1]
        return StoreContent(rows, _map(db, path, unreadable) if has_map else None, unreadable)
    except (_CorruptStore, sqlite3.DatabaseError) as error:
        raise _not_ours(path, error) from None
    finally:
        db.close()


def _not_ours(path: str, reason: Exception) -> StoreError:
    return StoreError(f"{path} is not a store of the twin, or is damaged: {reason}")


def _opened_for_reading(path: str) -> sqlite3.Connection:
    """Return a read-only connection.

    SQLite wants to create its index of the log beside the file. Where that is not allowed, and there is no
    log, no process is writing, and the file is opened as immutable.
    """
    place = f"file:{quote(os.path.abspath(path))}"
    db = sqlite3.connect(f"{place}?mode=ro", uri=True, timeout=BUSY_S)
    try:
        db.execute("BEGIN")  # all that is read is of one moment
        db.execute("SELECT 1 FROM sqlite_master").fetchone()
    except sqlite3.OperationalError:
        db.close()
        if os.path.exists(f"{path}-wal"):
            raise
        return sqlite3.connect(f"{place}?mode=ro&immutable=1", uri=True)
    except BaseException:
        db.close()
        raise
    return db


def _close(db: sqlite3.Connection | None) -> None:
    if db is not None:
        db.close()
