"""A recording as a greenhouse: what is read at which moment, and what is said of a file with mistakes."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from pathlib import Path

import pytest

from lupin_bridge.backend import Clocks, ReadingFailed, Sensors, UnknownTag
from lupin_bridge.recorded import SINCE_START, Recorded, ReplaySettings
from lupin_bridge.recording import load_recording
from lupin_engine.errors import LupinError

HEADER = "tag_id,sensor,value,stamp"


@pytest.fixture(autouse=True)
def dutch_time(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Local times mean the same on every machine, with a change to summer time."""
    monkeypatch.setenv("TZ", "CET-1CEST,M3.5.0,M10.5.0/3")
    time.tzset()
    yield
    monkeypatch.undo()
    time.tzset()


@dataclass
class Now:
    """Clocks that a test moves."""

    wall: float = field(default_factory=lambda: datetime(2026, 7, 1, 12, 0).timestamp())
    steady: float = 500.0

    def clocks(self) -> Clocks:
        return Clocks(lambda: self.wall, lambda: self.steady)

    def at(self, text: str) -> None:
        self.wall = datetime.fromisoformat(text).timestamp()


@dataclass
class Bench:
    """A folder for recordings."""

    folder: Path
    now: Now

    def write(self, *rows: str, header: str = HEADER) -> str:
        file = self.folder / "day.csv"
        file.write_text("\n".join((header, *rows, "")), encoding="utf-8")
        return str(file)

    def replay(self, *rows: str, **settings: object) -> Recorded:
        given = ReplaySettings(self.write(*rows), **settings)  # type: ignore[arg-type]
        return Recorded(given, None, self.now.clocks())


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    return Bench(tmp_path, Now())


def read(backend: Recorded, tag: str = "7") -> dict[str, float]:
    return {one.sensor: one.value for one in backend.read(tag).sensors}


DAY = (
    "7,temperature,18,2026-05-01T08:00:00",
    "7,temperature,21.5,2026-05-01T12:00:00",
    "7,humidity,60,2026-05-01T11:55:00",
    "9,co2,420,2026-05-01T12:00:00",
)


def test_what_was_measured_at_this_time_of_day_is_served(bench: Bench) -> None:
    backend = bench.replay(*DAY)
    assert backend.tags == ("7", "9")
    bench.now.at("2026-07-01T12:05:00")
    values = backend.read("7")
    found = [(one.sensor, one.value, one.unit, one.age) for one in values.sensors]
    assert sorted(found) == [("humidity", 60.0, "%", 600.0), ("temperature", 21.5, "°C", 300.0)]
    assert values.time_of_day == 12 * 3600.0 + 300.0
    assert read(backend, "9") == {"co2": 420.0}


def test_a_tag_that_was_not_recorded_is_unknown(bench: Bench) -> None:
    with pytest.raises(UnknownTag, match=r"^unknown tag '8'; the recording has 2 tags$"):
        bench.replay(*DAY).read("8")


def test_a_value_is_neither_kept_for_long_nor_made_up(bench: Bench) -> None:
    backend = bench.replay(*DAY)
    bench.now.at("2026-07-01T10:00:00")
    with pytest.raises(ReadingFailed) as refused:
        backend.read("7")
    assert str(refused.value) == (
        "tag '7': nothing measured in the last 900 s (temperature is 7200 s old, no humidity);"
        " the recording is at 2026-05-01 10:00:00"
    )


def test_one_sensor_that_is_silent_leaves_the_others(bench: Bench) -> None:
    backend = bench.replay(*DAY)
    bench.now.at("2026-07-01T12:12:00")
    assert read(backend) == {"temperature": 21.5}


def test_an_empty_value_is_a_gap(bench: Bench) -> None:
    rows = ("7,light,900,2026-05-01T12:00", "7,light,,2026-05-01T12:04", "7,light,910,2026-05-01T12:08")
    backend = bench.replay(*rows)
    bench.now.at("2026-07-01T12:03:00")
    assert read(backend) == {"light": 900.0}
    bench.now.at("2026-07-01T12:05:00")
    with pytest.raises(ReadingFailed, match="no light"):
        backend.read("7")
    bench.now.at("2026-07-01T12:09:00")
    assert read(backend) == {"light": 910.0}


def test_several_days_follow_each_other_and_begin_anew(bench: Bench) -> None:
    rows = [f"7,temperature,{20 + day},2026-05-0{day}T12:00:00" for day in (1, 2, 3)]
    backend = bench.replay(*rows)
    found = []
    for _ in range(4):
        found.append(read(backend)["temperature"])
        bench.now.wall = (datetime.fromtimestamp(bench.now.wall) + timedelta(days=1)).timestamp()
    assert found == [21.0, 22.0, 23.0, 21.0]


def test_a_value_of_before_midnight_is_served_after_it(bench: Bench) -> None:
    """On the next recorded day; the first one begins with nothing, also when it comes again."""
    backend = bench.replay("7,light,1,2026-05-01T23:58:00", "7,light,2,2026-05-02T12:00:00")
    bench.now.at("2026-07-01T23:59:59.5")
    assert backend.read("7").time_of_day == 86399.5
    bench.now.at("2026-07-02T00:02:00")
    values = backend.read("7")
    assert (values.sensors[0].value, values.sensors[0].age, values.time_of_day) == (1.0, 240.0, 120.0)
    bench.now.at("2026-07-03T00:02:00")
    with pytest.raises(ReadingFailed, match=r"\(no light\); the recording is at 2026-05-01 00:02:00$"):
        backend.read("7")


def test_the_time_of_day_holds_over_the_change_to_summer_time(bench: Bench) -> None:
    backend = bench.replay("7,light,1,2026-03-28T12:00:00", "7,light,2,2026-03-29T12:00:00")
    bench.now.at("2026-07-02T12:01:00")
    values = backend.read("7")
    assert (values.sensors[0].value, values.sensors[0].age, values.time_of_day) == (2.0, 60.0, 43260.0)


def test_a_replay_since_the_start_runs_as_fast_as_it_is_told(bench: Bench) -> None:
    backend = bench.replay(*DAY, clock=SINCE_START, speed=60.0)
    assert read(backend) == {"temperature": 18.0}
    bench.now.steady += 4 * 60.0
    assert read(backend) == {"temperature": 21.5, "humidity": 60.0}
    bench.now.steady += 60.0
    with pytest.raises(ReadingFailed, match=r"the recording is at 2026-05-01 13:00:00, after its end$"):
        backend.read("7")


def test_a_wall_clock_that_is_set_does_not_move_a_replay_since_the_start(bench: Bench) -> None:
    backend = bench.replay(*DAY, clock=SINCE_START)
    bench.now.wall += 1e6
    assert read(backend) == {"temperature": 18.0}


def test_the_time_of_day_can_stand_still_at_midnight(bench: Bench) -> None:
    backend = bench.replay("7,light,1,2026-05-01T00:00:00", "7,light,2,2026-05-01T12:00:00", fixed_hour=0.0)
    bench.now.at("2026-07-03T12:00:00")
    assert (read(backend), backend.read("7").time_of_day) == ({"light": 1.0}, 0.0)


@pytest.mark.parametrize(("hour", "expected"), [(12.0, 21.5), (8.1, 18.0)])
def test_the_time_of_day_can_stand_still(bench: Bench, hour: float, expected: float) -> None:
    backend = bench.replay(*DAY, fixed_hour=hour)
    bench.now.at("2026-07-03T03:00:00")
    assert read(backend)["temperature"] == expected
    assert backend.read("7").time_of_day == pytest.approx(hour * 3600.0)


@pytest.mark.parametrize("speed", [1e12, 1e308])
def test_a_replay_of_any_speed_ends_with_a_sentence(bench: Bench, speed: float) -> None:
    backend = bench.replay(*DAY, clock=SINCE_START, speed=speed, max_age=1e300)
    bench.now.steady += 1e6
    assert backend.read("7").time_of_day < 86400.0
    backend = bench.replay(*DAY, clock=SINCE_START, speed=speed)
    bench.now.steady += 1e6
    with pytest.raises(ReadingFailed, match=r"; the recording is at 20\d\d-.*, after its end$"):
        backend.read("7")


def test_a_layout_says_which_sensors_a_tag_has_and_in_which_order(bench: Bench) -> None:
    layout: Sensors = {"7": ("temperature", "light", "humidity"), "8": ("co2",), "10": ()}
    backend = Recorded(ReplaySettings(bench.write(*DAY)), layout, bench.now.clocks())
    bench.now.at("2026-07-01T12:05:00")
    assert backend.tags == ("7", "8", "10")
    assert list(read(backend)) == ["temperature", "humidity"]
    with pytest.raises(ReadingFailed, match=r"\(no co2\)"):
        backend.read("8")
    with pytest.raises(UnknownTag, match=r"^unknown tag '9'; the layout has 3 tags$"):
        backend.read("9")
    with pytest.raises(ReadingFailed, match=r"^tag '10': the layout gives it no sensors; "):
        backend.read("10")


def test_units_are_converted_and_the_order_of_columns_is_free(bench: Bench) -> None:
    file = bench.write(
        "2026-05-01T12:00:00,295.15,K,temperature,x,7",
        "2026-05-01T12:00:00,45,%,soil_moisture,x,7",
        "2026-05-01T12:00:00,3,furlong,wind,x,7",
        header="stamp,value,unit,sensor,remark,tag_id",
    )
    backend = Recorded(ReplaySettings(file, fixed_hour=12.0), None)
    found = {one.sensor: (one.value, one.unit) for one in backend.read("7").sensors}
    assert found == {
        "temperature": (pytest.approx(22.0), "°C"),
        "soil_moisture": (pytest.approx(0.45), "1"),
        "wind": (3.0, ""),
    }


def test_a_row_may_be_a_reading_of_several_sensors(bench: Bench) -> None:
    file = bench.write(
        "7,2026-05-01T12:00,21.5,,3",
        "7,2026-05-01T12:01,,60,",
        "7,2026-05-01T12:02,NaN,,",
        header="tag_id,stamp,temperature,humidity,sensor x",
    )
    own = load_recording(file).series["7"]
    assert {name: one.values for name, one in own.items()} == {
        "temperature": [21.5, None],
        "humidity": [60.0],
        "x": [3.0],
    }


def test_columns_of_the_twin_that_are_no_sensors_are_none_whatever_is_in_them(bench: Bench) -> None:
    others = "kind,mission_id,source,x,y,heading,species,species_confidence,pest,blooms,description,severity"
    file = bench.write(
        "7,2026-05-01T12:00,21.5,reading,m1,robot,1,2,3,4,0.5,1,6,7,8",
        "7,2026-05-01T12:01,99,flowers,m1,robot,1,2,3,4,0.5,1,6,7,8",
        header=f"tag_id,observed_at,temperature,{others}",
    )
    assert {name: one.values for name, one in load_recording(file).series["7"].items()} == {
        "temperature": [21.5]
    }


def test_mistakes_in_readings_of_several_sensors_have_their_place(bench: Bench) -> None:
    file = bench.write(
        '"7",2026-05-01T12:00,"two\nlines",warm,INF',
        ",then,,1,2",
        header="tag_id,observed_at,description,temperature,wind",
    )
    with pytest.raises(LupinError) as refused:
        load_recording(file)
    assert str(refused.value).splitlines() == [
        f"{file}:3:8: temperature: 'warm' is no number",
        f"{file}:3:13: wind: inf is no measurement",
        f"{file}:4:1: no tag_id",
        f"{file}:4:2: 'then' is no time: expected seconds since 1970, or such as 2026-05-01T14:30:00",
    ]


@pytest.mark.parametrize(
    "written", ["1777629600", "1777629600.0", "1777629600000", "2026-05-01T10:00:00Z", "2026-05-01 12:00"]
)
def test_a_stamp_is_seconds_or_iso_8601(bench: Bench, written: str) -> None:
    recording = load_recording(bench.write(f"7,co2,500,{written}"))
    assert recording.first == datetime.fromisoformat("2026-05-01T12:00:00+02:00").timestamp()


def test_every_mistake_is_told_with_its_place(bench: Bench) -> None:
    file = bench.write(
        "7,temperature,warm,yesterday",
        '"7",temperature,nan,2026-05-01T12:00:00',
        ",humidity,101 %,2026-05-01T12:00:00",
        '"a,b",humidity,300,2026-05-01T12:00:00',
        "7,co2,400",
        "",
        "7,co2,400,2026-05-01T12:00:00",
        "7,co2,400,2026-05-01T12:00:00",
        "7,co2,401,2026-05-01T12:00:00",
        "7,co2,400,-1",
        "7,co2,4_01,1_700_000_000",
    )
    with pytest.raises(LupinError) as refused:
        load_recording(file)
    iso = "expected seconds since 1970, or such as 2026-05-01T14:30:00"
    assert str(refused.value).splitlines() == [
        f"{file}:2:15: 'warm' is no number",
        f"{file}:2:20: 'yesterday' is no time: {iso}",
        f"{file}:3:17: nan is no measurement",
        f"{file}:4:1: no tag_id",
        f"{file}:4:11: '101 %' is no number",
        f"{file}:5:16: 300 % is outside of 0 ... 110 %",
        f"{file}:6:1: expected 4 cells as in the header, got 3",
        f"{file}:10:1: co2 of tag '7' has another value at this time in line 8",
        f"{file}:11:11: -1 is no time: expected seconds since 1970",
        f"{file}:12:7: '4_01' is no number",
        f"{file}:12:12: '1_700_000_000' is no time: {iso}",
    ]


def test_a_unit_of_something_else_is_told(bench: Bench) -> None:
    file = bench.write("7,light,3,2026-05-01T12:00:00,ppm", header=f"{HEADER},unit")
    with pytest.raises(LupinError, match=r":2:9: 'ppm' is no unit of light; allowed: 'klx', 'lux', 'lx'$"):
        load_recording(file)


def test_of_many_mistakes_the_first_hundred_are_told(bench: Bench) -> None:
    with pytest.raises(LupinError) as refused:
        load_recording(bench.write(*["7,co2,x,1"] * 130))
    lines = str(refused.value).splitlines()
    assert (len(lines), lines[-1]) == (101, "and 30 more")


@pytest.mark.parametrize(
    ("content", "told"),
    [
        (b"", "FILE:1:1: no header; expected such as tag_id,sensor,value,stamp,unit"),
        (HEADER.encode(), "recording FILE has no readings"),
        (
            b"tag;sensor;value;stamp",
            "FILE:1:1: no column 'tag_id'; cells are separated by commas, not by semicolons",
        ),
        (
            b"tag,sensor,value,stamp",
            "FILE:1:1: no column 'tag_id'; the file has 'tag', 'sensor', 'value', 'stamp'",
        ),
        (b"tag_id,stamp,co2,co2", "FILE:1:1: more than one column 'co2'"),
        (b"tag_id,sensor\xff", "recording FILE is not in UTF-8: byte 13"),
        (
            b"tag_id," + b"x" * 200_000,
            "FILE:1:1: this and what follows is no CSV: field larger than field limit (131072)",
        ),
    ],
)
def test_a_file_that_is_no_recording_is_refused(bench: Bench, content: bytes, told: str) -> None:
    file = Path(bench.write())
    file.write_bytes(content)
    with pytest.raises(LupinError) as refused:
        load_recording(str(file))
    assert told.replace("FILE", str(file)) in str(refused.value).splitlines()


def test_a_byte_order_mark_of_a_spreadsheet_is_no_mistake(bench: Bench) -> None:
    file = Path(bench.write())
    file.write_bytes(b"\xef\xbb\xbf" + f"{HEADER}\r\n7,co2,400,1\r\n".encode())
    assert list(load_recording(str(file)).series["7"]) == ["co2"]


def test_columns_without_a_name_are_left_alone_while_they_are_empty(bench: Bench) -> None:
    """Spreadsheets write some at the end; a value in one of them is of no sensor."""
    header = "tag_id,stamp,co2,,"
    assert list(load_recording(bench.write("7,1,400,,", header=header)).series["7"]) == ["co2"]
    file = bench.write("7,1,400,,", "7,2,400,,21.5", header=header)
    with pytest.raises(LupinError) as refused:
        load_recording(file)
    assert str(refused.value) == f"{file}:3:10: this column has no name in the header"


def test_a_file_must_be_given_and_exist() -> None:
    with pytest.raises(
        LupinError, match=r"^backend 'recorded' needs the parameter recording_file, a CSV file$"
    ):
        load_recording("")
    with pytest.raises(LupinError, match=r"^recording nowhere\.csv: No such file or directory$"):
        load_recording("nowhere.csv")
