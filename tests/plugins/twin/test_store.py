"""The twin's records on disk: written before anything else, whole after a crash, and never overwritten."""

from __future__ import annotations

import contextlib
import hashlib
import os
import signal
import sqlite3
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lupin_twin.field import OccupancyMap
from lupin_twin.records import (
    Anomaly,
    BoxOutline,
    Discovery,
    Flowers,
    Pin,
    Reading,
    Record,
    from_json,
    to_json,
)
from lupin_twin.state import Twin
from lupin_twin.store import MAX_WAITING, NOWHERE, Store, StoredRecord, StoreError, read

PIN = Pin(1.0, 2.0, 0.0, 1.0)
RECORDS: list[Record] = [
    Discovery("5", PIN),
    Reading("5", 1.5, "m", "s", (("temperature", 20.0),), PIN),
    Flowers("5", 2.5, "m", "s", "tulip_red", 0.5, True),
    BoxOutline("5", ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0))),
    Anomaly(3.5, "m", "s", 1.0, 2.0, 0.0, "obstacle", 1),
]


@pytest.fixture
def path(tmp_path: Path) -> str:
    return str(tmp_path / "folder" / "in it" / "twin.sqlite")


def fill(path: str, *records: Record) -> None:
    store = Store(path)
    for number, record in enumerate(records):
        assert store.add(record, float(number))
    store.close()


def content(path: str) -> list[StoredRecord]:
    store = Store(path)
    rows = list(store.rows())
    store.close()
    return rows


def test_records_come_back_in_their_order(path: str) -> None:
    fill(path, *RECORDS)
    assert content(path) == [StoredRecord(record, float(number)) for number, record in enumerate(RECORDS)]


def test_an_observation_that_arrives_again_is_kept_once(path: str) -> None:
    fill(path, RECORDS[1])
    store = Store(path)
    assert not store.add(RECORDS[1], 99.0)
    assert store.add(Reading("5", 1.6, "m", "s", (("temperature", 20.0),), PIN), 99.0)
    store.close()
    assert [row.received for row in content(path)] == [0.0, 99.0]


def test_a_box_that_comes_back_to_what_it_was_is_kept(path: str) -> None:
    first, second = BoxOutline("5", ((0.0, 0.0),)), BoxOutline("5", ((1.0, 0.0),))
    fill(path, first, second, first)
    assert [row.record for row in content(path)] == [first, second, first]


def test_a_record_is_on_the_disk_when_it_has_been_added(path: str) -> None:
    code = (
        "import os, signal, sys\n"
        "from lupin_twin.records import Discovery, Pin\n"
        "from lupin_twin.store import Store\n"
        "store = Store(sys.argv[1])\n"
        "for n in range(20):\n"
        "    store.add(Discovery(str(n), Pin(1.0, 2.0, 0.0, 1.0)), float(n))\n"
        "os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    done = subprocess.run([sys.executable, "-c", code, path], timeout=60)
    assert done.returncode == -signal.SIGKILL
    assert content(path) == [StoredRecord(Discovery(str(n), PIN), float(n)) for n in range(20)]


def test_the_file_can_be_read_while_the_twin_writes(path: str) -> None:
    store = Store(path)
    reader = sqlite3.connect(path)
    reader.execute("BEGIN")
    assert reader.execute("SELECT count(*) FROM record").fetchone() == (0,)
    assert store.add(RECORDS[0], 0.0)
    reader.close()
    store.close()


def test_commits_reach_the_disk_through_a_write_ahead_log(path: str) -> None:
    store = Store(path)
    assert store._db.execute("PRAGMA journal_mode").fetchone() == ("wal",)
    assert store._db.execute("PRAGMA synchronous").fetchone() == (2,)
    store.close()


def test_nothing_need_be_kept() -> None:
    store = Store(NOWHERE)
    assert store.add(RECORDS[1], 1.0)
    assert list(store.rows()) == [StoredRecord(RECORDS[1], 1.0)]
    store.close()
    assert not Path(NOWHERE).exists()


tags = st.sampled_from(["1", "2", "3"])
numbers = st.floats(-100.0, 100.0)
pins = st.builds(Pin, numbers, numbers, st.just(0.0), st.just(1.0))
maybe_pins = st.none() | pins
corners = st.lists(st.tuples(numbers, numbers), max_size=4).map(tuple)
values = st.lists(st.tuples(st.sampled_from(["co2", "light"]), numbers), max_size=2).map(tuple)
names = st.text(max_size=3)
anything = st.one_of(
    st.builds(Reading, tags, numbers, names, names, values, maybe_pins),
    st.builds(
        Flowers, tags, numbers, names, names, names, numbers, st.booleans(), st.just(()), corners, maybe_pins
    ),
    st.builds(Anomaly, numbers, names, names, numbers, numbers, numbers, names, st.integers(0, 255)),
    st.builds(Discovery, tags, pins),
    st.builds(BoxOutline, tags, corners),
)


@given(st.lists(anything, max_size=30))
def test_what_is_kept_adds_up_to_what_was_known(records: list[Record]) -> None:
    store, live, restarted = Store(NOWHERE), Twin(), Twin()
    for time, record in enumerate(records):
        if live.is_news(record) and store.add(record, float(time)):
            live.apply(record, float(time))
    for row in store.rows():
        restarted.apply(row.record, row.received)
    store.close()
    assert list(restarted.tags.items()) == list(live.tags.items())
    assert restarted.reports == live.reports
    assert restarted.observation_count == live.observation_count


# --- what goes wrong ---------------------------------------------------------------------------------


@pytest.mark.parametrize("garbage", [b"no database at all" * 100, b"SQLite format 3\0" + b"\xff" * 4096])
def test_a_file_that_is_no_database_is_put_aside(path: str, garbage: bytes) -> None:
    Path(path).parent.mkdir(parents=True)
    Path(path).write_bytes(garbage)
    store = Store(path)
    reason = "file is not a database"
    assert store.put_aside == (
        f"{path} is not a store of the twin ({reason}): kept as {path}.corrupt-1, a new one begun"
    )
    assert Path(f"{path}.corrupt-1").read_bytes() == garbage
    assert store.add(RECORDS[0], 1.0)
    store.close()
    assert content(path) == [StoredRecord(RECORDS[0], 1.0)]


def test_damage_in_the_middle_is_noticed(path: str) -> None:
    fill(path, *(Reading(str(n), 1.0, "m", "s", (("co2", 1.0),) * 50, PIN) for n in range(50)))
    data = bytearray(Path(path).read_bytes())
    data[8192:16384] = b"\xa5" * 8192
    Path(path).write_bytes(data)
    store = Store(path)
    assert store.put_aside.endswith(f"kept as {path}.corrupt-1, a new one begun")
    assert list(store.rows()) == []
    store.close()
    assert Path(f"{path}.corrupt-1").read_bytes() == bytes(data)


def test_what_cannot_be_put_aside_is_told_and_left_alone(path: str, monkeypatch: pytest.MonkeyPatch) -> None:
    Path(path).parent.mkdir(parents=True)
    Path(path).write_bytes(b"nonsense" * 1000)

    def refuse(*_: object) -> None:
        raise PermissionError(13, "Permission denied")

    with monkeypatch.context() as patch:
        patch.setattr(os, "rename", refuse)
        with pytest.raises(StoreError) as refused:
            Store(path)
    assert str(refused.value) == f"{path} is corrupt and cannot be put aside: Permission denied"
    assert Path(path).read_bytes() == b"nonsense" * 1000
    later = Store(path)
    assert later.put_aside.endswith(f"kept as {path}.corrupt-1, a new one begun"), "nobody holds its lock"
    later.close()


def test_what_was_put_aside_is_never_overwritten(path: str) -> None:
    Path(path).parent.mkdir(parents=True)
    for garbage in (b"first" * 100, b"second" * 100):
        Path(path).write_bytes(garbage)
        Store(path).close()
    assert Path(f"{path}.corrupt-1").read_bytes() == b"first" * 100
    assert Path(f"{path}.corrupt-2").read_bytes() == b"second" * 100


def test_another_programs_database_is_put_aside(path: str) -> None:
    Path(path).parent.mkdir(parents=True)
    with sqlite3.connect(path) as other:
        other.execute("CREATE TABLE theirs (x)")
    other.close()
    store = Store(path)
    assert "(another program's database): kept as" in store.put_aside
    store.close()


def test_a_store_of_a_later_version_is_left_alone(path: str) -> None:
    fill(path, RECORDS[0])
    with sqlite3.connect(path) as db:
        db.execute("PRAGMA user_version = 2")
    db.close()
    with pytest.raises(StoreError) as refused:
        Store(path)
    assert str(refused.value) == f"{path} was written by a later version of the twin (2, known: 1)"
    assert not os.path.exists(f"{path}.corrupt-1")


#: A store as version 1 has always written it: whoever changes records or tables must still read this one.
VERSION_1 = """
    CREATE TABLE record (
        number INTEGER PRIMARY KEY, received REAL NOT NULL, digest BLOB UNIQUE, json TEXT NOT NULL
    );
    CREATE TABLE map (
        number INTEGER PRIMARY KEY CHECK (number = 1), x REAL NOT NULL, y REAL NOT NULL, yaw REAL NOT NULL,
        resolution REAL NOT NULL, width INTEGER NOT NULL, height INTEGER NOT NULL, cells BLOB NOT NULL
    );
    INSERT INTO map VALUES (1, 1.0, 2.0, 0.5, 0.05, 2, 1, X'780163F80F0001010100');
    PRAGMA user_version = 1;
"""
WRITTEN = (
    '{"tag_id":"5","pin":{"x":1.0,"y":2.0,"z":0.0,"w":1.0},"kind":"discovery"}',
    '{"tag_id":"5","stamp":1.5,"mission_id":"m","source":"s","readings":[["temperature",20.0],["co2",NaN]],'
    '"pin":null,"kind":"reading"}',
    '{"tag_id":"5","stamp":2.5,"mission_id":"m","source":"s","species":"tulip_red","confidence":0.5,'
    '"anomaly":true,"blooms":[{"x":1.0,"y":2.0,"z":0.0,"species":"","confidence":0.0,"anomaly":true}],'
    '"footprint":[[0.0,0.0],[1.0,0.0]],"pin":null,"kind":"flowers"}',
    '{"stamp":3.5,"mission_id":"m","source":"s","x":1.0,"y":2.0,"z":0.0,"description":"pest","severity":1,'
    '"kind":"anomaly"}',
    '{"tag_id":"5","footprint":[[0.0,0.0],[1.0,0.0]],"kind":"box"}',
)


def test_a_store_of_an_earlier_engine_is_read_as_it_was_written(path: str) -> None:
    Path(path).parent.mkdir(parents=True)
    with sqlite3.connect(path) as db:
        db.executescript(VERSION_1)
        for number, text in enumerate(WRITTEN):
            told_again = text.endswith(('"discovery"}', '"box"}'))
            digest = None if told_again else hashlib.sha256(text.encode()).digest()
            db.execute("INSERT INTO record VALUES (?, ?, ?, ?)", (number + 1, float(number), digest, text))
    db.close()
    store = Store(path)
    rows, occupancy = list(store.rows()), store.map()
    assert (store.put_aside, store.unreadable) == ("", [])
    assert [row.record for row in rows[2:]] == [from_json(text) for text in WRITTEN[2:]]
    assert to_json(rows[1].record) == WRITTEN[1], "what was measured is known again by its text"
    assert rows[0].record == Discovery("5", PIN), "what it does not tell is unknown"
    assert occupancy is not None
    assert occupancy.cells.tolist() == [[0, -1]]
    assert not store.add(rows[1].record, 9.0), "an observation that arrives again is known by what it says"
    store.close()


def test_a_damaged_row_is_left_out_and_named(path: str) -> None:
    fill(path, RECORDS[0])
    with sqlite3.connect(path) as db:
        db.execute("INSERT INTO record (received, json) VALUES (1.0, '{}')")
    db.close()
    fill(path, RECORDS[1])
    store = Store(path)
    assert [row.record for row in store.rows()] == RECORDS[:2]
    (problem,) = store.unreadable
    assert problem.startswith(f"{path}: row 2 left out: not a record of the twin: text: ")
    store.close()


def test_a_flipped_bit_costs_one_row_and_not_the_twin(path: str) -> None:
    """SQLite has no checksums: the page is whole, what stands in it is no text any more."""
    fill(path, *RECORDS[:3])
    data = bytearray(Path(path).read_bytes())
    data[data.rindex(b'"source":"s"') + 10] ^= 0x80
    Path(path).write_bytes(data)
    store = Store(path)
    assert store.put_aside == ""
    assert [row.record for row in store.rows()] == [RECORDS[0], RECORDS[2]]
    (problem,) = store.unreadable
    reason = "not a record of the twin: text: Invalid JSON: invalid unicode code point"
    assert problem.startswith(f"{path}: row 2 left out: {reason}")
    assert store.add(RECORDS[3], 9.0)
    store.close()
    assert len(read(path).rows) == 3


def test_a_time_that_is_no_number_any_more_costs_one_row(path: str) -> None:
    fill(path, RECORDS[0])
    with sqlite3.connect(path) as db:
        db.execute("INSERT INTO record (received, json) VALUES ('soon', ?)", (to_json(RECORDS[3]),))
    db.close()
    store = Store(path)
    assert [row.record for row in store.rows()] == RECORDS[:1]
    assert store.unreadable == [f"{path}: row 2 left out: its time is no number but str"]
    store.close()


def test_a_folder_that_cannot_be_made_is_told(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    path = str(tmp_path / "file" / "twin.sqlite")
    with pytest.raises(StoreError) as refused:
        Store(path)
    assert str(refused.value) == f"the folder of {path} cannot be made: File exists"


def test_a_file_that_cannot_be_opened_is_told(tmp_path: Path) -> None:
    folder = tmp_path / "folder"
    folder.mkdir()
    for _ in range(2):  # what was locked for it is free again
        with pytest.raises(StoreError) as refused:
            Store(str(folder))
        assert str(refused.value) == f"{folder} cannot be opened: unable to open database file"


def test_a_lock_that_cannot_be_made_is_told(tmp_path: Path) -> None:
    path = tmp_path / "twin.sqlite"
    (tmp_path / "twin.sqlite.lock").mkdir()
    with pytest.raises(StoreError) as refused:
        Store(str(path))
    assert str(refused.value) == f"{path} cannot be opened: Is a directory"


def test_one_file_is_for_one_twin(path: str) -> None:
    first = Store(path)
    with pytest.raises(StoreError) as refused:
        Store(path)
    assert str(refused.value) == f"{path} is used by another twin; give this one a store_file of its own"
    assert first.add(RECORDS[0], 1.0)
    first.close()
    Store(path).close()


def fill_the_disk(store: Store, pages: int) -> None:
    """Let the file have no more than so many pages; 0 for as many as it likes."""
    store._db.execute(f"PRAGMA max_page_count = {pages or 2**30}")


def big(n: int) -> Reading:
    return Reading(str(n), float(n), "m", "s", tuple((f"sensor_{k}", 1.0) for k in range(300)))


def test_with_a_full_disk_records_wait_and_are_written_when_there_is_room(path: str) -> None:
    store = Store(path)
    fill_the_disk(store, 5)
    fits = 0
    with contextlib.suppress(StoreError):
        for fits in range(10):
            store.add(big(fits), 0.0)
    assert 0 < fits < 9
    with pytest.raises(StoreError) as full:
        store.add(big(10), 10.0)
    assert str(full.value) == f"{path}: database or disk is full; 2 records are in memory only"
    fill_the_disk(store, 0)
    assert store.add(big(20), 20.0)
    assert store.waiting == 0
    tags = [row.record.tag_id for row in store.rows() if isinstance(row.record, Reading)]
    assert tags == [*map(str, range(fits + 1)), "10", "20"]
    store.close()


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A disk of 512 kB, which only root may have."""
    folder = tmp_path / "disk"
    folder.mkdir()
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=512k", "tmpfs", str(folder)], capture_output=True, timeout=60
    )
    if mounted.returncode:
        pytest.skip("mounting a disk is not allowed here")
    yield folder
    subprocess.run(["umount", str(folder)], check=True, timeout=60)


def test_on_a_disk_that_is_really_full_nothing_is_lost(small_disk: Path) -> None:
    store = Store(str(small_disk / "twin.sqlite"))
    assert store.add(big(0), 0.0)
    ballast = small_disk / "ballast"
    with contextlib.suppress(OSError), ballast.open("wb", buffering=0) as file:
        while True:
            file.write(b"x" * 1024)
    told: list[str] = []
    for n in range(1, 20):
        try:
            store.add(big(n), float(n))
        except StoreError as full:
            told.append(str(full))
    assert told[-1] == f"{store.path}: database or disk is full; {store.waiting} records are in memory only"
    noise = np.random.default_rng(1).integers(0, 99, (200, 200), np.int8)
    with pytest.raises(StoreError, match="database or disk is full; the map is in memory only"):
        store.keep_map(OccupancyMap(0.0, 0.0, 0.0, 1.0, noise))
    ballast.unlink()
    assert store.flush()
    assert store.waiting == 0
    store.close()
    assert [row.record for row in content(str(small_disk / "twin.sqlite"))] == [big(n) for n in range(20)]


@pytest.mark.parametrize("records", [[], RECORDS])
def test_on_a_full_disk_no_twin_begins_and_the_store_is_left_as_it_is(
    small_disk: Path, records: list[Record]
) -> None:
    """One that went on without its records would tell a greenhouse that nobody has ever seen."""
    path = str(small_disk / "twin.sqlite")
    if records:
        fill(path, *records)
    ballast = small_disk / "ballast"
    with contextlib.suppress(OSError), ballast.open("wb", buffering=0) as file:
        while True:
            file.write(b"x" * 512)
    with pytest.raises(StoreError) as refused:
        Store(path)
    assert str(refused.value) == f"{path} cannot be opened: no room is left on its disk"
    ballast.unlink()
    assert [row.record for row in content(path)] == records


def test_the_latest_map_is_kept(path: str) -> None:
    store = Store(path)
    assert store.map() is None
    for value in (100, -1):
        store.keep_map(OccupancyMap(1.0, 2.0, 0.5, 0.05, np.full((2, 3), value, np.int8)))
    store.close()
    again = Store(path)
    kept = again.map()
    again.close()
    assert kept is not None
    assert (kept.x, kept.y, kept.yaw, kept.resolution) == (1.0, 2.0, 0.5, 0.05)
    assert kept.cells.tolist() == [[-1] * 3] * 2


def test_all_that_is_read_is_of_one_moment(path: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A twin that goes on meanwhile: records and map that never were together would be told."""
    twin = Store(path)
    before, after = (OccupancyMap(x, 0.0, 0.0, 1.0, np.zeros((1, 1), np.int8)) for x in (1.0, 2.0))
    twin.add(RECORDS[0], 1.0)
    twin.keep_map(before)

    def meanwhile(text: bytes) -> Record:
        twin.add(RECORDS[1], 2.0)
        twin.keep_map(after)
        return from_json(text)

    with monkeypatch.context() as patch:
        patch.setattr("lupin_twin.store.from_json", meanwhile)
        found = read(path)
    assert [row.record for row in found.rows] == RECORDS[:1]
    assert found.map is not None
    assert found.map.same_as(before)
    assert len(read(path).rows) == 2
    twin.close()


def test_a_damaged_map_costs_the_map_only(path: str) -> None:
    fill(path, RECORDS[0])
    with sqlite3.connect(path) as db:
        db.execute("INSERT INTO map VALUES (1, 0.0, 0.0, 0.0, 1.0, 2, 2, X'00')")
    db.close()
    store = Store(path)
    assert [row.record for row in store.rows()] == RECORDS[:1]
    assert store.map() is None
    (problem,) = store.unreadable
    assert problem.startswith(f"{path}: the map left out: Error -")
    store.close()


def test_a_store_from_before_there_were_maps_gets_one(path: str) -> None:
    fill(path, RECORDS[0])
    with sqlite3.connect(path) as db:
        db.execute("DROP TABLE map")
    db.close()
    store = Store(path)
    assert store.put_aside == ""
    assert store.keep_map(OccupancyMap(0.0, 0.0, 0.0, 1.0, np.zeros((1, 1), np.int8)))
    store.close()


@pytest.mark.parametrize("with_log", [False, True])
def test_a_store_that_may_not_be_written_is_told(path: str, with_log: bool) -> None:
    """As another user, because root may write everything."""
    fill(path, *RECORDS)
    if os.getuid() != 0:
        pytest.skip("only root can become another user")
    code = (
        "import os, sys\n"
        "from lupin_twin.store import Store, StoreError, read\n"
        "os.setuid(65534)\n"
        "try:\n"
        "    Store(sys.argv[1])\n"
        "except StoreError as error:\n"
        "    print(error)\n"
        "try:\n"
        "    print(len(read(sys.argv[1]).rows))\n"
        "except StoreError as error:\n"
        "    print(error)\n"
    )
    folder = Path(path).parent
    if with_log:  # a twin was killed, and what it wrote last is in the log
        Path(f"{path}-wal").touch()
    for file in folder.parents:
        if file == Path(tempfile.gettempdir()):
            break
        file.chmod(0o755)
    done = subprocess.run([sys.executable, "-c", code, path], capture_output=True, text=True, timeout=60)
    assert done.stderr == ""
    refused, found = done.stdout.splitlines()
    assert refused == f"{path} cannot be opened: Permission denied"
    assert found == (f"{path} cannot be read: unable to open database file" if with_log else "5")


def test_what_waits_is_bounded(path: str, monkeypatch: pytest.MonkeyPatch) -> None:
    assert MAX_WAITING == 10_000
    monkeypatch.setattr("lupin_twin.store.MAX_WAITING", 3)
    store = Store(path)
    fill_the_disk(store, 2)
    for n in range(8):
        with pytest.raises(StoreError, match=f"; {min(n + 1, 3)} records are in memory only"):
            store.add(big(n), float(n))
    fill_the_disk(store, 0)
    assert store.flush()
    assert [row.received for row in store.rows()] == [5.0, 6.0, 7.0]
    store.close()
