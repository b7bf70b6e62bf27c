"""What the twin makes of messages, and the table that it adds up: without ROS."""

from __future__ import annotations

import json
import math
from array import array
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lupin_twin import state as state_module
from lupin_twin import wire
from lupin_twin.records import (
    Anomaly,
    Bloom,
    BoxOutline,
    Discovery,
    Flowers,
    Pin,
    Reading,
    Record,
    from_json,
    to_json,
)
from lupin_twin.state import REPORTS, Twin, TwinReport

NO_ROTATION = (0.0, 0.0, 0.0, 1.0)
NEVER_FILLED_IN = (0.0, 0.0, 0.0, 0.0)
SQUARE = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0))


# --- messages, as far as the twin looks at them -------------------------------------------------------------


def pose(x: float = 0.0, y: float = 0.0, q: tuple[float, ...] = NO_ROTATION) -> Any:
    position = SimpleNamespace(x=x, y=y, z=0.0)
    return SimpleNamespace(
        position=position, orientation=SimpleNamespace(**dict(zip("xyzw", q, strict=True)))
    )


def stamped(frame: str, what: Any) -> Any:
    return SimpleNamespace(header=SimpleNamespace(frame_id=frame), pose=what)


def observation(kind: int = 0, frame: str = "map", sec: int = 100, **payload: Any) -> Any:
    header = SimpleNamespace(
        frame_id=frame, stamp=SimpleNamespace(sec=sec, nanosec=500_000_000 if sec else 0)
    )
    parts = {"status": 0, "mission_id": "m1", "source": "InspectionMission"} | payload
    return SimpleNamespace(header=header, kind=kind, **parts)


def tag_reading(tag_id: str = "5", q: tuple[float, ...] = NO_ROTATION, **rest: Any) -> Any:
    values = rest.pop("values", {"temperature": 21.0})
    sensors = [SimpleNamespace(name=name, value=value) for name, value in values.items()]
    reading = SimpleNamespace(tag_id=tag_id, readings=sensors)
    return observation(0, tag_reading=reading, tag_pose_in_map=pose(1.0, 2.0, q), **rest)


def flower(tag_id: str = "5", pose_frame: str = "map", confidence: float = 0.75, **rest: Any) -> Any:
    point = SimpleNamespace(
        position=SimpleNamespace(x=1.5, y=2.5, z=0.0), species="tulip_red", confidence=0.5, anomaly=False
    )
    told = SimpleNamespace(
        tag_id=tag_id,
        pose=stamped(pose_frame, pose(1.0, 2.0)),
        species="tulip_red",
        confidence=confidence,
        anomaly=True,
        flowers=[point],
        box_footprint=SimpleNamespace(points=[SimpleNamespace(x=x, y=y, z=0.0) for x, y in SQUARE]),
    )
    return observation(1, flower=told, **rest)


def report(pose_frame: str = "map", x: float = 3.0) -> Any:
    told = SimpleNamespace(pose=stamped(pose_frame, pose(x, 4.0)), description="fallen plant", severity=2)
    return observation(2, anomaly=told)


def seen(*tags: tuple[str, Any], frame: str = "map") -> Any:
    nothing = {"sightings": 3, "species": "", "species_confidence": 0.0, "anomaly": False}
    entries = [SimpleNamespace(tag_id=tag_id, pose_in_map=place, **nothing) for tag_id, place in tags]
    return SimpleNamespace(header=SimpleNamespace(frame_id=frame), tags=entries)


def read(message: Any) -> Record | None:
    return wire.observed(message, "map", now=77.0)


# --- what messages tell ------------------------------------------------------------------


def test_a_tag_reading_is_read() -> None:
    pin = Pin(1.0, 2.0, 0.0, 1.0)
    expected = Reading("5", 100.5, "m1", "InspectionMission", (("temperature", 21.0),), pin)
    assert read(tag_reading()) == expected


def test_flowers_are_read() -> None:
    bloom = Bloom(1.5, 2.5, 0.0, "tulip_red", 0.5, False)
    pin = Pin(1.0, 2.0, 0.0, 1.0)
    origin = ("5", 100.5, "m1", "InspectionMission")
    assert read(flower()) == Flowers(*origin, "tulip_red", 0.75, True, (bloom,), SQUARE, pin)


@pytest.mark.parametrize("wrong", [math.nan, math.inf, -math.inf])
def test_a_bloom_or_a_corner_without_a_place_is_none(wrong: float) -> None:
    """A panel would draw it at the origin of the map: what is no number arrives there as nothing."""
    message = flower()
    strange = SimpleNamespace(
        position=SimpleNamespace(x=1.0, y=wrong, z=0.0), species="tulip_pink", confidence=wrong, anomaly=False
    )
    message.flower.flowers.append(strange)
    message.flower.box_footprint.points[2].x = wrong
    record = read(message)
    assert isinstance(record, Flowers)
    assert [bloom.species for bloom in record.blooms] == ["tulip_red"]
    assert record.footprint == ()


def test_a_confidence_that_is_no_number_is_none() -> None:
    message = flower(confidence=math.nan)
    message.flower.flowers[0].confidence = math.inf
    record = read(message)
    assert isinstance(record, Flowers)
    assert (record.confidence, record.blooms[0].confidence) == (0.0, 0.0)


def test_an_anomaly_report_is_read() -> None:
    expected = Anomaly(100.5, "m1", "InspectionMission", 3.0, 4.0, 0.0, "fallen plant", 2)
    assert read(report()) == expected


@pytest.mark.parametrize(
    ("message", "reason"),
    [
        (observation(kind=3), "observation of unknown kind 3 dropped"),
        (observation(kind=255, status=1), "observation of unknown kind 255 dropped"),
        (observation(status=4), "observation of unknown status 4 dropped"),
        (tag_reading(tag_id=""), "tag reading without a tag id dropped"),
        (tag_reading(tag_id=" "), "tag reading without a tag id dropped"),
        (flower(tag_id=""), "flower observation without a tag id dropped"),
        (
            tag_reading(tag_id="5" * 100_000),
            "tag reading dropped: a name of 100000 letters, at most 64 are one",
        ),
        (
            tag_reading(values={"x" * 65: 1.0}),
            "reading of a sensor dropped: a name of 65 letters, at most 64 are one",
        ),
        (
            tag_reading(frame="o" * 100_000),
            f"tag reading in frame '{'o' * 40}...' dropped, expected 'map'",
        ),
        (tag_reading(frame="odom"), "tag reading in frame 'odom' dropped, expected 'map'"),
        (flower(pose_frame="odom"), "flower observation in frame 'odom' dropped, expected 'map'"),
        (flower(pose_frame="", frame="odom"), "flower observation in frame 'odom' dropped, expected 'map'"),
        (report(pose_frame="base_link"), "anomaly report in frame 'base_link' dropped, expected 'map'"),
        (report(x=math.nan), "anomaly report without a place dropped"),
    ],
)
def test_what_cannot_be_used_is_dropped_with_a_reason(message: Any, reason: str) -> None:
    with pytest.raises(wire.Dropped) as dropped:
        read(message)
    assert str(dropped.value) == reason


@pytest.mark.parametrize("status", [1, 2, 3])
def test_where_nothing_was_measured_nothing_is_learnt(status: int) -> None:
    assert read(tag_reading(status=status)) is None
    assert read(flower(status=status)) is None


@pytest.mark.parametrize("frame", ["", "map", "/map"])
def test_no_frame_is_the_expected_frame(frame: str) -> None:
    assert isinstance(read(tag_reading(frame=frame)), Reading)
    assert isinstance(read(flower(frame="", pose_frame=frame)), Flowers)


def test_an_observation_without_a_stamp_is_of_now() -> None:
    record = read(tag_reading(sec=0))
    assert isinstance(record, Reading)
    assert record.stamp == 77.0


def test_a_pose_that_was_never_filled_in_is_none() -> None:
    assert wire.pin_of(pose(1.0, 2.0, NEVER_FILLED_IN)) is None
    assert wire.pin_of(pose(math.nan, 2.0)) is None
    assert wire.pin_of(pose(1.0, 2.0, (0.0, 0.0, math.nan, 1.0))) is None


def test_a_half_turn_on_the_wire_survives() -> None:
    pin = wire.pin_of(pose(1.0, 2.0, (0.0, 0.0, 1.0, 1e-9)))
    assert pin is not None
    assert (pin.z, pin.w) == (pytest.approx(1.0), pytest.approx(0.0, abs=1e-8))


@given(st.floats(-3.1, 3.1), st.floats(-1.5, 1.5))
def test_of_a_rotation_the_turn_about_the_vertical_is_kept(yaw: float, tilt: float) -> None:
    # A turn about z after a tilt about x: (z, w) shrink with the tilt, their ratio does not.
    cz, sz, cx, sx = math.cos(yaw / 2), math.sin(yaw / 2), math.cos(tilt / 2), math.sin(tilt / 2)
    pin = wire.pin_of(pose(0.0, 0.0, (cz * sx, sz * sx, sz * cx, cz * cx)))
    assert pin is not None
    assert math.hypot(pin.z, pin.w) == pytest.approx(1.0)
    assert 2.0 * math.atan2(pin.z, pin.w) == pytest.approx(yaw)


def test_discovered_tags_are_read() -> None:
    half_turn = (0.0, 0.0, 1.0, 0.0)
    message = seen(
        ("5", pose(1.0, 2.0)),
        ("6", pose(3.0, 4.0, NEVER_FILLED_IN)),
        ("7", pose(5.0, 6.0, half_turn)),
        ("8", pose(7.0, 8.0, (1.0, 0.0, 0.0, 0.0))),
        ("9", pose(math.inf, 0.0)),
        ("", pose(0.0, 0.0)),
    )
    assert wire.discoveries(message, "map") == [
        Discovery("5", Pin(1.0, 2.0, 0.0, 1.0), 3),
        Discovery("6", Pin(3.0, 4.0, 0.0, 1.0), 3),
        Discovery("7", Pin(5.0, 6.0, 1.0, 0.0), 3),
        Discovery("8", Pin(7.0, 8.0, 0.0, 1.0), 3),
    ]


def test_what_was_seen_to_grow_at_a_discovered_tag_is_read() -> None:
    message = seen(("5", pose(1.0, 2.0)))
    told = {"sightings": 40, "species": "tulip_red", "species_confidence": math.nan, "anomaly": True}
    vars(message.tags[0]).update(told)
    assert wire.discoveries(message, "map") == [
        Discovery("5", Pin(1.0, 2.0, 0.0, 1.0), 40, "tulip_red", 0.0, True)
    ]


def test_discovered_tags_of_another_frame_are_dropped() -> None:
    with pytest.raises(wire.Dropped, match=r"^discovered tags in frame 'odom' dropped, expected 'map'$"):
        wire.discoveries(seen(("5", pose()), frame="odom"), "map")


@pytest.mark.parametrize("form", ["list", "object"])
def test_boxes_are_read(form: str) -> None:
    entry = {"x": 2.0, "y": 1.0, "yaw": 0.0, "width": 1.0, "depth": 0.5, "height": 0.3}
    entries = [{"id": 5, **entry}, {"box_id": "6", **entry, "yaw": math.pi / 2}]
    first, second = wire.boxes(json.dumps(entries if form == "list" else {"boxes": entries}))
    assert first == BoxOutline("5", ((2.25, 1.5), (2.25, 0.5), (1.75, 0.5), (1.75, 1.5)))
    assert second.tag_id == "6"
    assert np.allclose(second.footprint, ((1.5, 1.25), (2.5, 1.25), (2.5, 0.75), (1.5, 0.75)))


@pytest.mark.parametrize(
    "text",
    [
        *("", "nonsense", "5", "[5]", "{}", '[{"id": 5}]', '{"boxes": null}', "[" * 100_000),
        '[{"id": 5, "x": NaN, "y": 0, "yaw": 0, "width": 1, "depth": 1}]',
        '[{"id": 5, "x": 1e300, "y": 0, "yaw": 0, "width": 1, "depth": 1}]',
        '[{"id": "", "x": 0, "y": 0, "yaw": 0, "width": 1, "depth": 1}]',
        '[{"id": "\\ud800", "x": 0, "y": 0, "yaw": 0, "width": 1, "depth": 1}]',
        '[{"id": 5, "x": ' + "9" * 400 + ', "y": 0, "yaw": 0, "width": 1, "depth": 1}]',
        '[{"id": "' + "5" * 100_000 + '", "x": 0, "y": 0, "yaw": 0, "width": 1, "depth": 1}]',
        '[{"id": 5, "x": "' + "9" * 100_000 + 'x", "y": 0, "yaw": 0, "width": 1, "depth": 1}]',
    ],
)
def test_boxes_that_are_something_else_are_dropped(text: str) -> None:
    with pytest.raises(wire.Dropped, match=r"^box geometry dropped: (\w+Error: |a name of )") as dropped:
        wire.boxes(text)
    assert len(str(dropped.value)) < 200


@pytest.mark.parametrize("place", [(1e7, 0.0), (10_001.0, 0.0), (8e3, 8e3)])
def test_a_box_without_sense_is_named(place: tuple[float, float]) -> None:
    """What is kept of a box and what is exported end at the same distance: 10 km."""
    x, y = place
    told = json.dumps([{"id": "5", "x": x, "y": y, "yaw": 0, "width": 1, "depth": 1}])
    with pytest.raises(wire.Dropped) as dropped:
        wire.boxes(told)
    why = "box '5' has no id, or no place and size in this greenhouse"
    assert str(dropped.value) == f"box geometry dropped: ValueError: {why}"


def occupancy(data: list[int], frame: str = "map", yaw: float = 0.0, **info: Any) -> Any:
    turn = (0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2))
    told = {"width": 2, "height": 1, "resolution": 0.5, "origin": pose(1.0, 2.0, turn)} | info
    header = SimpleNamespace(frame_id=frame)
    return SimpleNamespace(header=header, info=SimpleNamespace(**told), data=array("b", data))


def test_the_map_is_read() -> None:
    read_map = wire.occupancy(occupancy([0, -1], yaw=1.0), "map")
    place = read_map.x, read_map.y, read_map.yaw, read_map.resolution
    assert place == (1.0, 2.0, pytest.approx(1.0), 0.5)
    assert read_map.cells.tolist() == [[0, -1]]


@pytest.mark.parametrize(
    ("message", "reason"),
    [
        (occupancy([0, 0], frame="odom"), "map in frame 'odom' dropped, expected 'map'"),
        (occupancy([0]), "map dropped: 2 x 1 cells of 0.5 m, 1 told"),
        (occupancy([], width=0), "map dropped: 0 x 1 cells of 0.5 m, 0 told"),
        (occupancy([0, 0], resolution=0.0), "map dropped: 2 x 1 cells of 0 m, 2 told"),
        (occupancy([0, 0], resolution=math.nan), "map dropped: 2 x 1 cells of nan m, 2 told"),
        (occupancy([0, 0], origin=pose(math.nan)), "map dropped: it has no finite origin"),
    ],
)
def test_a_map_that_makes_no_sense_is_dropped(message: Any, reason: str) -> None:
    with pytest.raises(wire.Dropped) as dropped:
        wire.occupancy(message, "map")
    assert str(dropped.value) == reason


RECORDS = [
    Reading("5", 1.5, "m", "s", (("temperature", 20.0), ("co2", math.inf)), None),
    Flowers("5", 1.5, "m", "s", "tulip", 0.5, True, (Bloom(1.0, 2.0, 0.0, "", 0.0, True),), SQUARE),
    Anomaly(1.5, "m", "s", 1.0, 2.0, 0.0, "wasserfleck \N{SNOWMAN}\n", 3),
    Discovery("5", Pin(1.0, 2.0, 1.0, 0.0)),
    BoxOutline("5", SQUARE),
]


@pytest.mark.parametrize("record", RECORDS, ids=lambda record: record.kind)
def test_records_can_be_written_and_read(record: Record) -> None:
    assert from_json(to_json(record)) == record


@pytest.mark.parametrize(
    ("written", "record"),
    [
        (
            '{"tag_id":"5","stamp":1.5,"mission_id":"m","source":"s","readings":[["co2",400.0]],'
            '"pin":{"x":1.0,"y":2.0,"z":1.0,"w":0.0},"kind":"reading"}',
            Reading("5", 1.5, "m", "s", (("co2", 400.0),), Pin(1.0, 2.0, 1.0, 0.0)),
        ),
        (
            '{"tag_id":"5","stamp":1.5,"mission_id":"m","source":"s","species":"tulip","confidence":0.5,'
            '"anomaly":true,"blooms":[{"x":1.0,"y":2.0,"z":0.0,"species":"","confidence":0.0,"anomaly":true}],'
            '"footprint":[[0.0,1.0]],"pin":null,"kind":"flowers"}',
            Flowers(
                *("5", 1.5, "m", "s", "tulip", 0.5, True),
                (Bloom(1.0, 2.0, 0.0, "", 0.0, True),),
                ((0.0, 1.0),),
            ),
        ),
        (
            '{"stamp":1.5,"mission_id":"m","source":"s","x":1.0,"y":2.0,"z":0.0,"description":"fallen",'
            '"severity":3,"kind":"anomaly"}',
            Anomaly(1.5, "m", "s", 1.0, 2.0, 0.0, "fallen", 3),
        ),
        (
            '{"tag_id":"5","pin":{"x":1.0,"y":2.0,"z":1.0,"w":0.0},"sightings":7,"species":"tulip",'
            '"confidence":0.5,"anomaly":true,"kind":"discovery"}',
            Discovery("5", Pin(1.0, 2.0, 1.0, 0.0), 7, "tulip", 0.5, True),
        ),
        ('{"tag_id":"5","footprint":[[0.0,1.0]],"kind":"box"}', BoxOutline("5", ((0.0, 1.0),))),
    ],
    ids=lambda given: given.kind if not isinstance(given, str) else "",
)
def test_a_record_is_written_as_it_always_was(written: str, record: Record) -> None:
    """Stores of last year are to be read next year."""
    assert from_json(written) == record
    assert to_json(record) == written


def test_a_value_that_is_no_number_is_written_and_read() -> None:
    back = from_json(to_json(Reading("5", 1.0, "", "", (("co2", math.nan),))))
    assert isinstance(back, Reading)
    assert math.isnan(dict(back.readings)["co2"])


def test_what_is_no_record_is_told() -> None:
    with pytest.raises(
        ValueError, match=r"^not a record of the twin: box\.tag_id: Input should be a valid string$"
    ):
        from_json('{"kind":"box","tag_id":4,"footprint":[]}')
    with pytest.raises(ValueError, match=r"^not a record of the twin: text: Invalid JSON"):
        from_json("{")


# --- the table ------------------------------------------------------------------

HERE, THERE = Pin(1.0, 2.0, 0.0, 1.0), Pin(8.0, 9.0, 1.0, 0.0)


def reading(tag: str = "5", stamp: float = 10.0, pin: Pin | None = None, **values: float) -> Reading:
    return Reading(tag, stamp, "m", "s", tuple(values.items()), pin)


def flowers(tag: str = "5", stamp: float = 10.0, **rest: Any) -> Flowers:
    given = {"species": "tulip_red", "confidence": 0.5, "anomaly": False} | rest
    return Flowers(tag, stamp, "m", "s", **given)


def state_of(*records: Record, received: float = 1000.0, history: int = 32) -> Twin:
    state = Twin(history)
    for record in records:
        state.apply(record, received)
    return state


def test_nothing_is_known_at_the_start() -> None:
    state = Twin()
    assert (dict(state.tags), state.reports, state.observation_count) == ({}, [], 0)
    assert tuple(state.sensors) == ("temperature", "humidity", "co2", "light", "soil_moisture")


def test_the_first_place_stays_and_readings_follow() -> None:
    state = state_of(reading(pin=HERE, temperature=20.0, co2=400.0), reading(pin=THERE, temperature=22.0))
    assert state.tags["5"].pin == HERE
    assert list(state.tags["5"].readings.items()) == [("temperature", 22.0), ("co2", 400.0)]
    assert state.observation_count == 2


def test_a_place_may_come_later() -> None:
    state = state_of(reading(temperature=20.0), reading(pin=HERE, temperature=21.0))
    assert state.tags["5"].pin == HERE
    assert state_of(reading(temperature=20.0), flowers(pin=THERE)).tags["5"].pin == THERE
    assert state_of(reading(temperature=20.0), Discovery("5", HERE)).tags["5"].pin == HERE


def test_a_discovered_tag_has_a_place_and_nothing_else() -> None:
    state = state_of(Discovery("5", HERE), Discovery("5", THERE))
    tag = state.tags["5"]
    assert (tag.pin, tag.readings, tag.last_observed, tag.stale_seconds(1000.0)) == (HERE, {}, None, 1e9)
    assert (tag.species, tag.confidence, tag.anomaly, tag.blooms, tag.footprint) == ("", 0.0, False, (), ())
    assert state.observation_count == 0


def test_a_tag_that_was_never_read_does_not_look_fresh() -> None:
    """`last_observed` is zero then, so it is as old as the clock; also by a clock that has just begun."""
    tag = state_of(Discovery("5", HERE)).tags["5"]
    assert (tag.stale_seconds(12.0), tag.stale_seconds(1.8e9)) == (1e9, 1.8e9)


def test_what_was_seen_to_grow_at_a_discovered_tag_is_known() -> None:
    state = state_of(Discovery("5", HERE), flowers(species="tulip_red", confidence=0.5, anomaly=True))
    tag = state.tags["5"]
    pink = Discovery("5", HERE, 3, "tulip_pink", 0.9, False)
    assert state.is_news(pink)
    state.apply(pink, 1000.0)
    assert (tag.species, tag.confidence, tag.anomaly) == ("tulip_pink", 0.9, False)
    assert not state.is_news(pink)
    unseen = Discovery("5", HERE, 3)
    assert not state.is_news(unseen), "a new mission has not looked yet"
    state.apply(unseen, 1000.0)
    assert tag.species == "tulip_pink"


def test_a_later_better_place_corrects_an_earlier_one() -> None:
    """A reading may come with the robot's place; the camera then tells that of the plate, ever nearer."""
    state = state_of(reading(temperature=20.0, pin=HERE))
    nearer = Pin(THERE.x + 0.2, THERE.y, THERE.z, THERE.w)
    for seen_at, sightings, corrected in (
        (THERE, 3, True),
        (nearer, 3, False),  # not seen more often
        (nearer, 9, True),
        (Pin(nearer.x + 0.04, nearer.y, nearer.z, nearer.w), 20, False),  # the same place
        (HERE, 4, False),  # a new mission, from afar
    ):
        told = Discovery("5", seen_at, sightings)
        assert state.is_news(told) is corrected
        state.apply(told, 1000.0)
        assert (state.tags["5"].pin == seen_at) is corrected
    state.apply(reading(temperature=20.0, pin=HERE), 1000.0)
    assert state.tags["5"].pin == nearer, "the robot's place corrects nothing"


def test_tags_keep_the_order_in_which_they_came() -> None:
    state = state_of(reading("15"), Discovery("3", HERE), flowers("7"), reading("3"))
    assert list(state.tags) == ["15", "3", "7"]


def test_flowers_are_the_latest_and_leave_readings_alone() -> None:
    bloom = Bloom(1.0, 1.0, 0.0, "tulip_red", 0.5, True)
    first = flowers(anomaly=True, blooms=(bloom,), footprint=SQUARE)
    state = state_of(reading(temperature=20.0), first)
    tag = state.tags["5"]
    assert (tag.species, tag.confidence, tag.anomaly, tag.blooms) == ("tulip_red", 0.5, True, (bloom,))
    assert (tag.footprint, tag.readings) == (SQUARE, {"temperature": 20.0})
    state.apply(flowers(species="tulip_pink", confidence=0.9), 1000.0)
    assert (tag.species, tag.confidence, tag.anomaly, tag.blooms) == ("tulip_pink", 0.9, False, ())
    assert state.observation_count == 3


def test_blanks_around_an_id_make_no_second_tag() -> None:
    discovered = wire.discoveries(seen((" 5", pose(1.0, 2.0)), ("6 " * 100, pose(1.0, 2.0))), "map")
    told = [read(tag_reading(tag_id="5 ")), read(flower(tag_id=" 5 ")), *discovered]
    assert {getattr(record, "tag_id", "") for record in told} == {"5"}


def test_there_is_no_room_for_tags_and_sensors_without_end(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is known goes on to be told; what is new has no room."""
    monkeypatch.setattr(state_module, "MAX_TAGS", 1)
    monkeypatch.setattr(state_module, "MAX_SENSORS", len(state_module.SENSORS) + 1)
    twin = Twin()
    first, second = read(tag_reading("1", values={"ph": 7.0})), read(tag_reading("2"))
    more = read(tag_reading("1", values={"ec": 1.0}))
    assert first is not None
    assert second is not None
    assert more is not None
    assert twin.has_room(first)
    twin.apply(first, 1.0)
    assert twin.has_room(first)
    assert not twin.has_room(second)
    assert not twin.has_room(BoxOutline("2", SQUARE))
    assert not twin.has_room(more)
    assert twin.has_room(Anomaly(100.5, "m1", "s", 3.0, 4.0, 0.0, "fallen plant", 2))


def test_the_channel_knows_boxes_better_than_flowers() -> None:
    other = ((5.0, 5.0), (6.0, 5.0), (6.0, 6.0))
    state = state_of(flowers(footprint=other), BoxOutline("5", SQUARE), flowers(stamp=11.0, footprint=other))
    assert state.tags["5"].footprint == SQUARE
    state.apply(BoxOutline("5", other), 1000.0)
    assert state.tags["5"].footprint == other
    assert (state.observation_count, state.tags["5"].last_observed) == (2, 11.0)
    assert list(state_of(BoxOutline("9", SQUARE)).tags) == ["9"]


def test_places_and_boxes_told_again_are_no_news() -> None:
    state = state_of(reading(temperature=20.0), flowers("6", footprint=SQUARE))
    assert state.is_news(Discovery("5", HERE))
    assert state.is_news(Discovery("7", HERE))
    assert state.is_news(BoxOutline("6", SQUARE))
    state.apply(Discovery("5", HERE), 0.0)
    state.apply(BoxOutline("6", SQUARE), 0.0)
    assert not state.is_news(Discovery("5", THERE))
    assert not state.is_news(BoxOutline("6", SQUARE))
    assert state.is_news(BoxOutline("6", SQUARE[:3]))
    assert state.is_news(reading())


def test_the_history_keeps_the_newest() -> None:
    state = state_of(*(reading(stamp=float(n)) for n in range(5)), history=3)
    assert [record.stamp for record in state.tags["5"].history] == [2.0, 3.0, 4.0]
    assert state.observation_count == 5


def test_a_tag_grows_stale_by_the_clock_that_is_given() -> None:
    tag = state_of(reading(stamp=10.0)).tags["5"]
    assert (tag.last_observed, tag.stale_seconds(10.0), tag.stale_seconds(25.0)) == (10.0, 0.0, 15.0)
    assert tag.stale_seconds(5.0) == 0.0


def test_a_stamp_from_the_future_counts_from_its_arrival() -> None:
    tag = state_of(reading(stamp=5000.0), received=1000.0).tags["5"]
    assert (tag.last_observed, tag.stale_seconds(1010.0)) == (1000.0, 10.0)


def test_before_simulated_time_begins_a_stamp_counts_as_it_is() -> None:
    assert state_of(reading(stamp=5.0), received=0.0).tags["5"].last_observed == 5.0


def test_a_clock_that_was_set_back_leaves_nothing_fresh_for_ever() -> None:
    """A simulation that begins anew: its tags of an hour ago would be 0 s old for an hour."""
    twin = Twin()
    for tag_id, time in (("old", 2.0), ("new", 3600.0)):
        twin.advance_time(time)
        twin.apply(reading(tag_id, time), time)
    twin.apply(Discovery("seen", HERE), 3600.0)
    revision = twin.revision
    twin.advance_time(10.0)
    ages = {name: tag.stale_seconds(15.0) for name, tag in twin.tags.items()}
    assert ages == {"old": 13.0, "new": 5.0, "seen": 1e9}
    assert twin.revision > revision, "it is told"
    revision = twin.revision
    for now in (0.0, 10.0, 15.0):
        twin.advance_time(now)
    assert twin.revision == revision, "time goes on"
    twin.advance_time(4.0)
    twin.apply(reading("old", 3.0), 4.0)
    assert {name: tag.last_observed for name, tag in twin.tags.items()} == {
        "old": 3.0,
        "new": 4.0,
        "seen": None,
    }


def test_the_time_of_a_new_clock_is_taken_for_what_it_is() -> None:
    twin = state_of(reading("5", 3600.0), received=3600.0)
    twin.advance_time(3600.0)
    twin.forget_time()
    twin.advance_time(10.0)
    assert twin.tags["5"].last_observed == 3600.0


def test_the_latest_observation_is_the_newest_and_not_the_last_to_come() -> None:
    """After an outage the backlog of one publisher comes, and then that of the other."""
    twin = state_of(reading(stamp=60.0), flowers(stamp=30.0))
    assert twin.tags["5"].last_observed == 60.0


def test_samples_need_a_place_and_a_number() -> None:
    state = state_of(
        reading("1", pin=Pin(1.0, 2.0, 0.0, 1.0), temperature=20.0),
        reading("2", temperature=21.0),
        reading("3", pin=HERE, humidity=50.0),
        reading("4", pin=HERE, temperature=math.nan),
        reading("5", pin=HERE, temperature=-math.inf),
        reading("6", pin=HERE, temperature=1e39),
        reading("7", pin=Pin(3.0, 4.0, 0.0, 1.0), temperature=-5.0),
    )
    positions, values = state.samples("temperature")
    assert positions.tolist() == [[1.0, 2.0], [3.0, 4.0]]
    assert values.tolist() == [20.0, -5.0]
    assert [part.shape for part in state.samples("co2")] == [(0, 2), (0,)]


def test_sensors_that_were_read_are_known() -> None:
    assert "radiation" in state_of(reading(radiation=0.1)).sensors


def test_an_anomaly_is_kept_and_knows_the_nearest_tag() -> None:
    anomaly = Anomaly(1.0, "m", "s", 1.0, 1.0, 0.0, "obstacle", 1)
    state = state_of(anomaly, Discovery("far", Pin(1.0, 3.5, 0.0, 1.0)), reading("lost"))
    assert state.reports == [TwinReport(anomaly, "")]
    state.apply(Discovery("mirrored", Pin(-1.0, -1.0, 0.0, 1.0)), 0.0)
    state.apply(Discovery("near", Pin(1.0, 2.5, 0.0, 1.0)), 0.0)
    state.apply(Discovery("nearer", Pin(1.0, 0.5, 0.0, 1.0)), 0.0)
    assert state.reports == [TwinReport(anomaly, "nearer")]
    assert [state.nearest(x, y) for x, y in ((-1.0, -1.1), (1.0, -1.0), (1.0, 5.6))] == [
        "mirrored",
        "nearer",
        "",
    ]
    assert state.observation_count == 1  # the reading of the lost tag


def test_of_many_anomalies_the_latest_are_kept() -> None:
    state = state_of(*(Anomaly(float(n), "", "", 0.0, 0.0, 0.0, "", 0) for n in range(REPORTS + 5)))
    assert [report.anomaly.stamp for report in state.reports][:2] == [5.0, 6.0]
    assert len(state.reports) == REPORTS
