"""What a message of a sensor says, and that no message whatever says anything else."""

from __future__ import annotations

import json
import math
from datetime import datetime
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lupin_bridge.backend import Clocks
from lupin_bridge.latest import MAX_SENSORS, MAX_TAGS, Latest
from lupin_bridge.topics import MAX_PAYLOAD, Rejected, SensorSample, Template, samples
from lupin_bridge.units import given_units
from lupin_engine.errors import LupinError

STAMP = datetime.fromisoformat("2026-05-01T12:00:00+02:00").timestamp()


@pytest.mark.parametrize(
    ("template", "subscription", "topic", "names"),
    [
        ("greenhouse/{tag}/{sensor}", "greenhouse/+/+", "greenhouse/7/co2", ("7", "co2")),
        ("a/tag_{tag}/b/{sensor}/v", "a/+/b/+/v", "a/tag_12/b/light/v", ("12", "light")),
        ("{sensor}/{tag}", "+/+", "light/7", ("7", "light")),
        ("zigbee2mqtt/{tag}", "zigbee2mqtt/+", "zigbee2mqtt/7", ("7", "")),
        ("g.h/{tag}-{sensor}", "g.h/+", "g.h/7-co2", ("7", "co2")),
    ],
)
def test_a_template_says_what_to_listen_to_and_whose_it_is(
    template: str, subscription: str, topic: str, names: tuple[str, str]
) -> None:
    read = Template(template)
    assert read.filter == subscription
    assert read.names(topic) == names


@pytest.mark.parametrize(
    ("template", "told"),
    [
        ("greenhouse", "expected {tag} once, and {sensor} at most once, such as greenhouse/{tag}/{sensor}"),
        ("{sensor}", "expected {tag} once"),
        ("{tag}/{tag}", "expected {tag} once"),
        ("{tag}/{sensors}", "expected {tag} once"),
        ("{tag}/{}", "expected {tag} once"),
        ("+/{tag}", "wildcards are made of {tag} and {sensor}; leave + and # out"),
        ("{tag}/#", "leave + and # out"),
    ],
)
def test_what_is_no_template_is_refused(template: str, told: str) -> None:
    with pytest.raises(LupinError) as refused:
        Template(template)
    assert str(refused.value).startswith(f"mqtt_topic {template!r}: ")
    assert told in str(refused.value)


@pytest.mark.parametrize(
    ("topic", "told"),
    [
        ("greenhouse/7", "topic of another form"),
        ("greenhouse/7/co2/raw", "topic of another form"),
        ("greenhouseX7Xco2", "topic of another form"),
        ("greenhouse/ 7/co2", "no name of a tag or sensor: ' 7'"),
        ("greenhouse/7/co2\n", r"no name of a tag or sensor: 'co2\n'"),
        (f"greenhouse/{'7' * 65}/co2", f"no name of a tag or sensor: '{'7' * 40}...'"),
    ],
)
def test_other_topics_are_not_read(topic: str, told: str) -> None:
    with pytest.raises(Rejected) as refused:
        Template("greenhouse/{tag}/{sensor}").names(topic)
    assert str(refused.value) == told


@pytest.mark.parametrize(
    ("payload", "sample"),
    [
        (b"21.5", SensorSample("temperature", 21.5)),
        (b" 21 \n", SensorSample("temperature", 21.0)),
        (b'{"value": 21.5}', SensorSample("temperature", 21.5)),
        (b'{"value": 295.15, "unit": "K"}', SensorSample("temperature", pytest.approx(22.0))),
        (b'{"value": 70.7, "unit": "\xc2\xb0F"}', SensorSample("temperature", pytest.approx(21.5))),
        (b'{"value": 1, "stamp": "2026-05-01T10:00:00Z"}', SensorSample("temperature", 1.0, STAMP)),
        (b'{"value": 1, "stamp": 1777629600}', SensorSample("temperature", 1.0, STAMP)),
        (b'{"value": 1, "stamp": 1777629600000, "battery": 9}', SensorSample("temperature", 1.0, STAMP)),
        (b'{"value": 1, "stamp": null}', SensorSample("temperature", 1.0)),
    ],
)
def test_a_payload_is_a_number_or_an_object(payload: bytes, sample: SensorSample) -> None:
    assert samples(payload, "temperature") == ([sample], [])


@pytest.mark.parametrize(
    ("payload", "told"),
    [
        (b"", "payload is neither a number nor JSON: ''"),
        (b"warm", "payload is neither a number nor JSON: 'warm'"),
        (b"21,5", "payload is neither a number nor JSON: '21,5'"),
        (b"\xff\xfe2", "payload is not UTF-8"),
        ("21.5".encode("utf-16"), "payload is not UTF-8"),
        (b"NaN", "value cannot be: nan is no measurement"),
        (b"-Infinity", "value cannot be: -inf is no measurement"),
        (b"1e999", "value cannot be: inf is no measurement"),
        (b"9" * 4000, "value cannot be: inf is no measurement"),
        (b"9" * 5000, "payload too long: 5000 bytes, at most 4096"),
        (b"[" * 4000, f"payload is neither a number nor JSON: '{'[' * 40}...'"),
        (b"true", "value is no number: True"),
        (b'"21.5"', "value is no number: '21.5'"),
        (b"null", "value is no number: None"),
        (b"[21.5]", "value is no number: [21.5]"),
        (b"500", "value cannot be: 500 °C is outside of -60 ... 100 °C"),
        (b"{}", "no 'value' in it"),
        (b'{"value": null}', "value is no number: None"),
        (b'{"value": {"value": 1}}', "value is no number: {'value': 1.0}"),
        (b'{"value": 1, "unit": 1}', "unit is no text"),
        (
            b'{"value": 1, "unit": "C.", "stamp": 1}',
            "value cannot be: 'C.' is no unit of temperature; allowed: ",
        ),
        (b'{"value": 1, "stamp": "now"}', "stamp is no time: 'now' is no time: expected seconds since 1970"),
        (b'{"value": 1, "stamp": -5}', "stamp is no time: -5 is no time: expected seconds since 1970"),
        (b'{"value": 1, "stamp": [1]}', "stamp is no time: [1.0]"),
    ],
)
def test_what_says_nothing_is_rejected_with_a_reason(payload: bytes, told: str) -> None:
    with pytest.raises(Rejected) as refused:
        samples(payload, "temperature")
    assert str(refused.value).startswith(told)


def test_one_message_may_carry_several_sensors() -> None:
    payload = b'{"temperature": 21.5, "humidity": null, "co2": "high", "battery": 80, "stamp": 1777629600}'
    found, wrong = samples(payload, "")
    assert found == [SensorSample("temperature", 21.5, STAMP)]
    assert [str(reason) for reason in wrong] == ["value is no number: 'high'"]
    assert samples(payload, "", ("battery", "light")) == ([SensorSample("battery", 80.0, STAMP)], [])


@pytest.mark.parametrize("dead", [b"nan", b"-nan", b"NaN", b"inf", b"null"])
def test_a_dead_sensor_leaves_the_others_their_values(dead: bytes) -> None:
    """Firmware writes what C's printf makes of no number, which is no JSON."""
    found, _ = samples(b'{"temperature":' + dead + b',"humidity":61}', "")
    assert found == [SensorSample("humidity", 61.0)]


def test_a_sensor_may_have_a_unit_of_its_own() -> None:
    """Soil in per cent: refused with what to write, and then a share, also where it would be possible."""
    payload = b'{"soil_moisture": 37, "battery": 87}'
    _, wrong = samples(payload, "")
    assert [str(reason) for reason in wrong] == [
        "value cannot be: 37 is outside of 0 ... 1; if it is in %, write soil_moisture=% into mqtt_units"
    ]
    units = given_units(["soil_moisture=%"])
    assert samples(payload, "", None, units) == ([SensorSample("soil_moisture", 0.37)], [])
    assert samples(b"1", "soil_moisture", None, units) == ([SensorSample("soil_moisture", 0.01)], [])
    said = b'{"value": 0.4, "unit": "1"}'
    assert samples(said, "soil_moisture", None, units) == ([SensorSample("soil_moisture", 0.4)], [])
    with pytest.raises(LupinError) as refused:
        given_units(["soil=%", "co2=kg", "light"])
    assert str(refused.value).splitlines() == [
        "mqtt_units 'soil=%': expected SENSOR=UNIT; did you mean 'soil_moisture'?",
        "mqtt_units 'co2=kg': 'kg' is no unit of co2; allowed: '%', 'ppm'",
        "mqtt_units 'light': expected SENSOR=UNIT; "
        "sensors are temperature, humidity, co2, light, soil_moisture",
    ]


@pytest.mark.parametrize(
    ("payload", "told"),
    [
        (b"21.5", "no JSON object: the topic has no {sensor}, so the payload must name them"),
        (b'{"battery": 80}', "no sensor in it"),
        (b'{"temperature": null}', "no sensor in it"),
    ],
)
def test_a_message_of_several_sensors_must_name_one(payload: bytes, told: str) -> None:
    with pytest.raises(Rejected) as refused:
        samples(payload, "")
    assert str(refused.value) == told


ANYTHING = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(),
    lambda inner: (
        st.lists(inner) | st.dictionaries(st.sampled_from(["value", "unit", "stamp", "co2"]), inner)
    ),
    max_leaves=6,
)


@given(
    payload=st.binary() | ANYTHING.map(lambda data: json.dumps(data).encode()),
    sensor=st.sampled_from(["co2", "", "wind"]),
)
def test_any_payload_is_samples_that_can_be_or_a_reason(payload: bytes, sensor: str) -> None:
    found: list[SensorSample] = []
    told = ""
    try:
        found, _ = samples(payload, sensor)
    except Rejected as reason:
        told = str(reason)
    assert len(told) < 300
    assert len(payload) <= MAX_PAYLOAD or told.startswith("payload too long")
    assert all(math.isfinite(one.value) and abs(one.value) < 1e9 for one in found)
    assert all(one.stamp is None or one.stamp >= 0.0 for one in found)


@given(topic=st.text() | st.builds("{}/{}".format, st.text(), st.text()))
def test_any_topic_is_two_names_or_a_reason(topic: str) -> None:
    try:
        names: Any = Template("{tag}/{sensor}").names(topic)
    except Rejected:
        return
    assert "/".join(names) == topic


class Moment:
    """Clocks that a test moves apart."""

    def __init__(self) -> None:
        self.wall, self.steady = 1_000_000.0, 50.0
        self.clocks = Clocks(lambda: self.wall, lambda: self.steady)


def test_a_value_grows_old_by_the_steady_clock() -> None:
    """War story 68: a wall clock that is set makes nothing older or younger."""
    now = Moment()
    latest = Latest(now.clocks)
    latest.put("7", SensorSample("co2", 400.0))
    latest.put("7", SensorSample("light", 900.0, now.wall - 30.0))
    now.steady += 10.0
    now.wall -= 3600.0
    found = latest.of("7")
    assert (found["co2"].age, found["light"].age) == (10.0, 40.0)
    assert (found["co2"].stamp, found["light"].stamp) == (1_000_000.0, 999_970.0)
    assert (found["co2"].unit, found["light"].unit) == ("ppm", "lx")


def test_a_stamp_of_the_future_counts_as_now() -> None:
    now = Moment()
    latest = Latest(now.clocks)
    latest.put("7", SensorSample("co2", 400.0, now.wall + 1e6))
    assert (latest.of("7")["co2"].age, latest.of("7")["co2"].stamp) == (0.0, now.wall)


def test_what_was_measured_earlier_and_comes_later_replaces_nothing() -> None:
    now = Moment()
    latest = Latest(now.clocks)
    latest.put("7", SensorSample("co2", 400.0, now.wall - 10.0))
    now.steady, now.wall = now.steady + 5.0, now.wall + 5.0
    latest.put("7", SensorSample("co2", 300.0, now.wall - 16.0))
    assert latest.of("7")["co2"].value == 400.0
    latest.put("7", SensorSample("co2", 500.0, now.wall - 14.0))
    assert latest.of("7")["co2"].value == 500.0


def test_there_is_room_for_so_many_names_and_no_more() -> None:
    latest = Latest(Moment().clocks)
    assert all(latest.put("0", SensorSample(str(n), 1.0)) for n in range(MAX_SENSORS))
    assert not latest.put("0", SensorSample("another", 1.0))
    assert latest.put("0", SensorSample("0", 2.0))
    assert all(latest.put(str(n), SensorSample("co2", 1.0)) for n in range(1, MAX_TAGS))
    assert not latest.put("another", SensorSample("co2", 1.0))
    assert (len(latest.tags()), latest.of("another")) == (MAX_TAGS, {})
    assert latest.of("0")["0"].value == 2.0
