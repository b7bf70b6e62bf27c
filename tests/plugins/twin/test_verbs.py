"""`lupin twin`: what the store has, listed, exported and drawn; and what is said when that cannot be."""

from __future__ import annotations

import io
import json
import math
import os
import sqlite3
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from lupin_cli.main import main
from lupin_twin.field import FieldGrid, OccupancyMap
from lupin_twin.missions import MissionRecord, select
from lupin_twin.picture import Label, _grid, _labels, _range, _source, _title, picture
from lupin_twin.place import store_path
from lupin_twin.records import Bloom, Discovery, Flowers, Pin, Reading
from lupin_twin.state import Twin
from lupin_twin.store import Store, StoredRecord, StoreError, read

T = 1_790_000_000.0
Run = Callable[..., tuple[int, str, str]]


def reading(tag: str, x: float, value: float, mission: str = "m1", time: float = T) -> Reading:
    values = (("temperature", value), ("soil_moisture", 0.25))
    return Reading(tag, time, mission, "InspectionMission", values, Pin(x, 1.0, 0.0, 1.0))


@pytest.fixture
def path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A store in the user's state folder: two missions, three tags and a map."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    monkeypatch.delenv("ROS_DOMAIN_ID", raising=False)
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "lupin" / "twin.sqlite"
    store = Store(str(path))
    bloom = Bloom(1.0, 1.2, 0.0, "tulip_red", 0.5, False)
    store.add(Discovery("10", Pin(2.0, 2.0, 0.0, 1.0)), T)
    store.add(reading("5", 1.0, 20.0), T)
    store.add(reading("5", 1.0, 21.0, "m2", T + 60.0), T + 60.0)
    store.add(Flowers("5", T + 61.0, "m2", "aggregator", "tulip_red", 0.75, True, (bloom,)), T + 61.0)
    store.add(reading("6", 2.0, 24.0, "m2", T + 70.0), T + 70.0)
    cells = np.zeros((30, 30), np.int8)
    cells[:, :5], cells[0, :] = -1, 100
    store.keep_map(OccupancyMap(-1.0, -1.0, 0.1, 0.2, cells))
    store.close()
    return path


@pytest.fixture
def run(path: Path, capfd: pytest.CaptureFixture[str]) -> Run:
    """Call `lupin twin` and return exit code, output and errors."""

    def call(*arguments: str) -> tuple[int, str, str]:
        code = main(["twin", *arguments])
        told = capfd.readouterr()
        return code, told.out, told.err

    return call


# --- show and missions --------------------------------------------------------------------------------------


def test_show_lists_the_tags(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("lupin_twin.commands.time.time", lambda: T + 3730.0)
    code, out, _ = run("show")
    assert code == 0
    assert [" ".join(line.split()) for line in out.splitlines()] == [
        "tag at species blooms readings age",
        "5 1.00, 1.00 tulip_red 75% pest 1 temperature 21 °C soil_moisture 0.25 1 h 1 min",
        "6 2.00, 1.00 temperature 24 °C soil_moisture 0.25 1 h 1 min",
        "10 2.00, 2.00 never read",
    ]


def test_show_tells_programs_the_same(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("lupin_twin.commands.time.time", lambda: T + 100.0)
    code, out, _ = run("show", "--json")
    told = json.loads(out)
    assert code == 0
    assert told["observations"] == 4
    assert [tag["tag_id"] for tag in told["tags"]] == ["5", "6", "10"]
    first, _, unread = told["tags"]
    assert first["readings"] == {"temperature": 21.0, "soil_moisture": 0.25}
    assert first["place"] == {"x": 1.0, "y": 1.0, "heading": 0.0}
    assert (first["species"], first["pest"], len(first["blooms"])) == ("tulip_red", True, 1)
    assert (first["observed_at"], first["age_s"]) == ("2026-09-21T14:14:21.000000Z", 39.0)
    assert (unread["observed_at"], unread["age_s"], unread["readings"]) == (None, None, {})


def test_missions_are_listed(run: Run) -> None:
    code, out, _ = run("missions")
    assert code == 0
    assert [" ".join(line.split()) for line in out.splitlines()] == [
        "mission source first last readings flowers anomalies",
        "m1 InspectionMission 2026-09-21 14:13:20 2026-09-21 14:13:20 1 0 0",
        "m2 InspectionMission 2026-09-21 14:14:20 2026-09-21 14:14:30 2 1 0",
    ]
    assert [mission["mission_id"] for mission in json.loads(run("missions", "--json")[1])["missions"]] == [
        "m1",
        "m2",
    ]


def test_an_empty_store_is_no_mistake(run: Run, path: Path) -> None:
    path.unlink()
    Store(str(path)).close()
    assert run("show")[:2] == (0, "no tag is known yet\n")
    assert run("missions")[:2] == (0, "no mission has observed anything yet\n")
    nothing = "lupin: nothing has been observed yet: run a mission, or let a twin listen to one\n"
    assert run("export", "-o", "x.csv") == (2, "", nothing)


def test_what_came_over_the_wire_gives_no_orders_to_the_terminal(run: Run, path: Path) -> None:
    store = Store(str(path))
    store.add(reading("9" * 5000, 1.0, 20.0), T)
    store.add(reading("[red]\x1b[2J", 1.0, 20.0), T)
    store.close()
    code, out, _ = run("show")
    assert code == 0
    assert "[red]" in out
    assert "\x1b" not in out


# --- export -------------------------------------------------------------------------------------------------


def test_the_name_of_the_file_says_the_format(run: Run, tmp_path: Path) -> None:
    assert run("export", "-o", "m.csv") == (0, "", "wrote m.csv-metadata.json\nwrote m.csv\n")
    assert run("export", "-o", "m.geojson", "--origin", "52,4") == (0, "", "wrote m.geojson\n")
    assert "m2" in (tmp_path / "m.csv").read_text()
    assert "m1" not in (tmp_path / "m.csv").read_text()
    assert json.loads((tmp_path / "m.csv-metadata.json").read_text())["url"] == "m.csv"
    assert json.loads((tmp_path / "m.geojson").read_text())["type"] == "FeatureCollection"


def test_an_export_can_be_printed(run: Run) -> None:
    code, out, err = run("export", "--format", "geojson", "--mission", "m1", "-o", "-", "--origin", "52,4")
    assert (code, err) == (0, "")
    found = json.loads(out)
    assert found["lupin"]["missions"] == ["m1"]
    assert [one["id"] for one in found["features"]] == ["urn:lupin:tag:5", "urn:lupin:reading:1"]


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (
            ["-o", "record"],
            "'record' says no format: end it in .csv, .geojson, or add --format",
        ),
        (
            ["-o", "m.geojson"],
            "geojson has longitude and latitude, and the map is in metres from its own origin: "
            "say where that is with --origin LATITUDE,LONGITUDE or LATITUDE,LONGITUDE,DIRECTION in degrees",
        ),
        (["-o", "m.csv", "--origin", "52,4"], "csv has metres on the map: leave --origin out"),
        (
            ["-o", "m.csv", "--mission", "m3"],
            "no mission 'm3' has observed anything; allowed: 'all', 'latest', 'm1', 'm2'",
        ),
    ],
)
def test_what_cannot_be_exported_is_told(run: Run, tmp_path: Path, arguments: list[str], reason: str) -> None:
    before = sorted(os.listdir(tmp_path))
    code, out, err = run("export", *arguments)
    assert (code, out, err) == (2, "", f"lupin: {reason}\n")
    assert sorted(os.listdir(tmp_path)) == before


def test_a_folder_that_is_not_there_is_told(run: Run) -> None:
    assert run("export", "-o", "no/such/m.geojson", "--origin", "52,4") == (
        1,
        "",
        "lupin: cannot write 'no/such/m.geojson': No such file or directory\n",
    )


def test_a_full_disk_leaves_the_old_file(path: Path, tmp_path: Path) -> None:
    """No file may grow beyond 40 kB, which stops a write in its middle as a full disk does."""
    store = Store(str(path))
    for n in range(200):
        store.add(reading(str(n), 1.0, 20.0, "m2", T + 100.0), T + 100.0)
    store.close()
    old = tmp_path / "m.geojson"
    old.write_text("the old one")
    code = (
        "import resource, signal, sys\n"
        "from lupin_cli.main import main\n"
        "signal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (40_000, 40_000))\n"
        "sys.exit(main(['twin', 'export', '-o', 'm.geojson', '--origin', '52,4']))\n"
    )
    done = subprocess.run(
        [sys.executable, "-B", "-c", code], cwd=tmp_path, capture_output=True, text=True, timeout=60
    )
    assert (done.returncode, done.stderr) == (1, "lupin: cannot write 'm.geojson': File too large\n")
    assert old.read_text() == "the old one"
    assert sorted(os.listdir(tmp_path)) == ["lupin", "m.geojson"]


# --- the store ----------------------------------------------------------------------------------------------


def test_each_domain_has_a_store_of_its_own(
    run: Run, path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", "0")
    assert store_path() == str(path)
    monkeypatch.setenv("ROS_DOMAIN_ID", "7")
    other = tmp_path / "lupin" / "twin-7.sqlite"
    assert store_path() == str(other)
    assert run("show", "--domain", "0")[0] == 0
    told = f"lupin: there is no store {other}; a twin makes it: lupin run, or lupin node lupin_twin\n"
    assert run("show", "--domain", "7") == (1, "", told)
    assert run("show", "--domain", "7", "--store", str(path))[0] == 0


def test_the_store_follows_the_users_state_folder(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.delenv("ROS_DOMAIN_ID", raising=False)
    monkeypatch.setenv("XDG_STATE_HOME", "relative")
    monkeypatch.setenv("HOME", str(tmp_path))
    assert store_path() == str(tmp_path / ".local" / "state" / "lupin" / "twin.sqlite")
    assert store_path("~/here.sqlite") == str(tmp_path / "here.sqlite")


def test_the_store_is_read_while_a_twin_writes_to_it(run: Run, path: Path) -> None:
    twin = Store(str(path))
    twin.add(reading("7", 3.0, 22.0, "m3", T + 90.0), T + 90.0)
    assert [tag["tag_id"] for tag in json.loads(run("show", "--json")[1])["tags"]] == ["5", "6", "7", "10"]
    assert twin.add(reading("8", 3.0, 22.0, "m3", T + 91.0), T + 91.0)
    assert run("export", "-o", "m.csv")[0] == 0
    twin.close()


def test_reading_changes_nothing(path: Path) -> None:
    before = path.read_bytes()
    content = read(str(path))
    assert (len(content.rows), content.unreadable) == (5, [])
    assert content.map is not None
    assert content.map.cells.shape == (30, 30)
    assert path.read_bytes() == before


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b"nonsense" * 1000, "file is not a database"),
        (b"", "another program's database"),
        (b"SQLite format 3\0" + b"\xff" * 4096, "file is not a database"),
    ],
)
def test_a_file_that_is_no_store_is_told_and_left_alone(
    run: Run, tmp_path: Path, content: bytes, reason: str
) -> None:
    file = tmp_path / "other.sqlite"
    file.write_bytes(content)
    told = f"lupin: {file} is not a store of the twin, or is damaged: {reason}\n"
    assert run("show", "--store", str(file)) == (1, "", told)
    assert file.read_bytes() == content


def test_damage_in_the_middle_is_told(path: Path) -> None:
    store = Store(str(path))
    for n in range(50):
        store.add(Reading(str(n), T, "m", "s", (("co2", 1.0),) * 50), T)
    store.close()
    data = bytearray(path.read_bytes())
    data[12288:20480] = b"\xa5" * 8192
    path.write_bytes(data)
    with pytest.raises(StoreError, match="is not a store of the twin, or is damaged: "):
        read(str(path))
    assert path.read_bytes() == bytes(data)


def test_a_damaged_row_and_map_are_left_out_and_named(run: Run, path: Path) -> None:
    with sqlite3.connect(path) as db:
        db.execute("UPDATE record SET json = '{}' WHERE number = 2")
        db.execute("UPDATE map SET cells = x'00'")
    db.close()
    code, out, err = run("show", "--json")
    assert code == 0
    assert json.loads(out)["observations"] == 3
    first, second = err.splitlines()
    assert first.startswith(f"lupin: {path}: row 2 left out: not a record of the twin: text: ")
    assert second.startswith(f"lupin: {path}: the map left out: Error -5 while decompressing data")


def test_a_store_of_a_later_version_is_told(run: Run, path: Path) -> None:
    with sqlite3.connect(path) as db:
        db.execute("PRAGMA user_version = 9")
    db.close()
    told = f"lupin: {path} was written by a later version of the twin (9, known: 1)\n"
    assert run("missions") == (1, "", told)


def test_a_store_without_a_map_is_read(path: Path) -> None:
    with sqlite3.connect(path) as db:
        db.execute("DROP TABLE map")
    db.close()
    assert read(str(path)).map is None


# --- plot ---------------------------------------------------------------------------------------------------


@pytest.fixture
def drawing(monkeypatch: pytest.MonkeyPatch) -> None:
    """Coarse pictures, which are drawn faster."""
    pytest.importorskip("matplotlib")
    monkeypatch.setattr("lupin_twin.picture.DPI", 40)


@pytest.mark.slow
@pytest.mark.usefixtures("drawing")
def test_a_folder_gets_a_picture_of_each_sensor(run: Run, tmp_path: Path) -> None:
    code, _, err = run("plot", "-o", "pictures")
    names = [f"{sensor}{kind}" for sensor in ("temperature", "soil_moisture") for kind in (".png", ".svg")]
    assert (code, err) == (0, "".join(f"wrote pictures/{name}\n" for name in names))
    assert sorted(os.listdir(tmp_path / "pictures")) == sorted(names)
    assert (tmp_path / "pictures" / "temperature.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.slow
@pytest.mark.usefixtures("drawing")
def test_the_same_record_makes_the_same_picture(run: Run, tmp_path: Path) -> None:
    for name in ("a.svg", "b.svg"):
        assert run("plot", "--sensor", "temperature", "-o", name)[0] == 0
    assert (tmp_path / "a.svg").read_bytes() == (tmp_path / "b.svg").read_bytes()


@pytest.mark.usefixtures("drawing")
def test_labels_cover_neither_marks_nor_each_other() -> None:
    """Tags on both sides of a table are a hand's breadth apart; a mark under a label is not seen."""
    twin = Twin()
    places = {"29": (2.40, 7.30), "7": (2.55, 7.40), "21": (1.60, 7.50), "6": (1.50, 7.30), "1": (0.0, 0.0)}
    for tag, (x, y) in places.items():
        twin.apply(Discovery(tag, Pin(x, y, 0.0, 1.0)), T)
    told = _labels(FieldGrid.over(-1.0, 0.0, 5.0, 8.0, 0.1), list(twin.tags.values()))
    right_above = (True, True)
    assert dict(zip(places, told, strict=True)) == {
        "29": (False, True),  # to the right is the mark of 7
        "7": right_above,
        "21": right_above,
        "6": (False, True),
        "1": right_above,
    }


def test_labels_are_in_the_picture() -> None:
    twin = Twin()
    places = {"left": (0.1, 0.1), "right-below": (3.95, 0.1), "right-above": (3.95, 3.95)}
    for tag, (x, y) in places.items():
        twin.apply(Discovery(tag, Pin(x, y, 0.0, 1.0)), T)
    told = _labels(FieldGrid.over(0.0, 0.0, 4.0, 4.0, 0.01), list(twin.tags.values()))
    assert told == [(True, True), (False, True), (False, False)]


def test_where_there_is_no_room_there_is_no_label() -> None:
    """Five tags in one place: the fifth label would make another one unreadable."""
    twin = Twin()
    for tag in "12345":
        twin.apply(Discovery(tag, Pin(1.0, 1.0, 0.0, 1.0)), T)
    told = _labels(FieldGrid.over(0.0, 0.0, 2.0, 2.0, 0.1), list(twin.tags.values()))
    assert told == [(True, True), (False, True), (True, False), (False, False), None]


def rows_of_tags(count: int) -> MissionRecord:
    """Return a record with so many tags in a square, each 1 m from the next; every other one was read."""
    side = math.isqrt(count)
    readings = [
        Reading(str(n), T, "m1", "s", ((sensor, 20.0 + n % side),), Pin(n % side, n // side, 0.0, 1.0))
        for n in range(count)
        for sensor in ("light", "temperature")[: 1 + n % 2]
    ]
    return select([StoredRecord(one, T) for one in readings], "all")


def test_ids_that_would_hide_the_field_are_left_out() -> None:
    def labels(count: int) -> list[Label]:
        tags = list(rows_of_tags(count).twin.tags.values())
        return _labels(_grid(tags, None), tags)

    assert None not in labels(15**2)
    assert set(labels(30**2)) == {None}


@pytest.mark.slow
@pytest.mark.usefixtures("drawing")
def test_a_picture_of_many_tags_shows_the_field() -> None:
    """Each tag by itself took half a minute for 2,000, and ids beside all of them hid the field."""

    def drawn(count: int) -> tuple[int, int, bool]:
        """Return how many lines and texts a picture has, and whether it says that ids are left out."""
        text = picture(rows_of_tags(count), "temperature", None, ".svg").decode()
        told = "filled: read here · hollow: not read · no id: no room" in text
        return text.count('<g id="line2d_'), text.count('<g id="text_'), told

    (few_lines, few_texts, few_told), (lines, texts, told) = drawn(7**2), drawn(44**2)
    assert (few_told, told) == (False, True)
    assert few_texts >= 7**2 > texts
    assert abs(lines - few_lines) < 10  # the ticks of the axes


@pytest.mark.slow
@pytest.mark.usefixtures("drawing")
def test_a_picture_is_of_the_mission_and_distance_that_were_asked_for(run: Run, tmp_path: Path) -> None:
    found = set()
    for more in ([], ["--mission", "m1"], ["--distance", "0.5"]):
        assert run("plot", "--sensor", "temperature", "-o", "p.svg", *more)[0] == 0
        found.add((tmp_path / "p.svg").read_bytes())
    assert len(found) == 3


@pytest.mark.parametrize(
    ("sensor", "values", "title"),
    [
        ("temperature", [-3.2, 1.0], "temperature: -3.2 to 1 °C"),
        ("temperature", [21.3], "temperature: 21.3 °C"),
        ("temperature", [20.0, 20.0 + 1e-9], "temperature: 20 °C"),
        ("light", [500.0, 23490.0], "light: 500 to 23490 lx"),
        ("soil_moisture", [0.21, 0.35], "soil moisture: 0.21 to 0.35"),
        ("p$\n", [6.5], "p\\$\ufffd: 6.5"),
    ],
)
def test_a_picture_says_what_was_read(sensor: str, values: list[float], title: str) -> None:
    assert _title(sensor, np.array(values)) == title


@pytest.mark.parametrize(
    ("values", "ends"),
    [
        ([-3.2, 1.0], (-3.2, 1.0)),
        ([20.0], (19.8, 20.2)),
        ([20.0, 20.1], (19.8495, 20.2505)),
        ([0.0, 0.0], (-0.01, 0.01)),
        ([-1e38, 1e38], (-1e38, 1e38)),
    ],
)
def test_noise_is_not_painted_as_a_difference(values: list[float], ends: tuple[float, float]) -> None:
    assert _range(np.array(values)) == pytest.approx(ends)


def test_a_picture_says_where_when_and_by_whom() -> None:
    first = reading("5", 1.0, 20.0), reading("6", 2.0, 20.0, time=T + 600.0)
    again, later = reading("5", 1.0, 21.0, "m2", T + 660.0), reading("5", 1.0, 22.0, "m2", T + 86400.0)
    lost = Reading("7", T + 9e5, "m1", "", (("temperature", float("nan")),), Pin(1.0, 1.0, 0.0, 1.0))
    elsewhere = Reading("8", T + 9e5, "m1", "", (("temperature", 9.0),))

    def told(*records: Reading) -> str:
        record = select([StoredRecord(one, T + 1e6) for one in records], "all")
        return _source(record, "temperature", len(record.twin.samples("temperature")[1]))

    assert told(first[0]) == "read at 1 tag, mission m1\n2026-09-21 14:13 UTC"
    shown = "read at 2 tags, mission m1\n2026-09-21 14:13 to 14:23 UTC"
    assert told(*first) == told(*first, lost, elsewhere) == shown
    passive = reading("6", 2.0, 21.0, "", T + 600.0)
    assert told(passive) == "read at 1 tag, outside of missions\n2026-09-21 14:23 UTC"
    assert told(*first, passive) == shown.replace("m1", "m1 and outside of missions")
    assert told(*first, again) == "read at 2 tags, 2 missions\n2026-09-21 14:23 to 14:24 UTC"
    assert told(*first, later) == "read at 2 tags, 2 missions\n2026-09-21 14:23 to 2026-09-22 14:13 UTC"


def test_a_single_row_of_tags_is_not_a_line() -> None:
    twin = Twin()
    for n in range(50):
        twin.apply(Discovery(str(n), Pin(2.0 * n, 1.0, 0.0, 1.0)), T)
    grid = _grid(list(twin.tags.values()), None)
    assert grid.height >= 0.2 * grid.width
    assert grid.min_y + grid.height * grid.resolution / 2.0 == pytest.approx(1.0, abs=grid.resolution)


@pytest.mark.slow
@pytest.mark.parametrize("far", [0.0, 1.5, 40.0])
def test_nothing_is_cut_off_at_the_edge_of_a_picture(drawing: None, far: float) -> None:
    from matplotlib.image import imread

    records = (reading("the-tag-on-the-left", 0.0, 20.0), reading("the-tag-on-the-right", far, 24.0))
    record = select([StoredRecord(one, T) for one in records], "all")
    drawn = imread(io.BytesIO(picture(record, "temperature", None, ".png")))[..., :3]
    assert min(edge.min() for edge in (drawn[0], drawn[-1], drawn[:, 0], drawn[:, -1])) == 1.0
    assert drawn.min() < 0.3


@pytest.mark.usefixtures("drawing")
def test_letters_that_no_font_has_are_no_warning(run: Run, path: Path) -> None:
    store = Store(str(path))
    store.add(reading("\u6e29\u5ba4\n1", 3.0, 20.0, "m2", T + 80.0), T + 80.0)
    store.close()
    assert run("plot", "--sensor", "temperature", "-o", "p.png") == (0, "", "wrote p.png\n")


@pytest.mark.slow
@pytest.mark.usefixtures("drawing")
def test_names_from_the_wire_are_neither_paths_nor_formulas(run: Run, path: Path, tmp_path: Path) -> None:
    store = Store(str(path))
    store.add(Reading("$x^", T, "m9", "s", (("../../etc/$p", 1.0),), Pin(1.0, 1.0, 0.0, 1.0)), T + 99.0)
    store.close()
    assert run("plot", "--sensor", "../../etc/$p", "-o", "pictures")[0] == 0
    assert sorted(os.listdir(tmp_path / "pictures")) == ["______etc__p.png", "______etc__p.svg"]


@pytest.mark.usefixtures("drawing")
@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (
            ["-o", "p.png"],
            "one file has one sensor: add --sensor (temperature, soil_moisture), or name a folder",
        ),
        (["-o", "p.gif"], "'p.gif' is no picture: end it in .png or .svg, or name a folder"),
        (
            ["--sensor", "temprature", "-o", "p.png"],
            "no tag with a place has a reading of 'temprature'; did you mean 'temperature'?",
        ),
        (["--distance", "0", "-o", "p"], "--distance 0: must be above 0 m"),
        (["--distance", "nan", "-o", "p"], "--distance nan: must be above 0 m"),
        (
            ["--distance", "-1", "-o", "p.gif"],
            "--distance -1: must be above 0 m\n"
            "'p.gif' is no picture: end it in .png or .svg, or name a folder",
        ),
    ],
)
def test_what_cannot_be_drawn_is_told(run: Run, arguments: list[str], reason: str) -> None:
    assert run("plot", *arguments) == (2, "", f"lupin: {reason}\n")


@pytest.mark.usefixtures("drawing")
def test_tags_that_are_too_far_apart_are_told(run: Run, path: Path) -> None:
    store = Store(str(path))
    store.add(reading("far", 1e7, 20.0), T + 99.0)
    store.close()
    code, _, err = run("plot", "--sensor", "temperature", "-o", "p.png")
    assert code == 1
    assert err == "lupin: the tags are 1e+07 m apart, too far for a picture (at most 1000 m)\n"


def test_without_the_drawing_package_it_is_named(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    told = "lupin: pictures need a package that is not installed: pip install 'lupin-engine[sim]'\n"
    assert run("plot", "--sensor", "temperature", "-o", "p.png") == (1, "", told)
