"""The engine's side of the bridge: what becomes of every answer."""

from __future__ import annotations

import math
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="ROS 2 is not installed here")

from lupin_bridge.catalog import PLUGIN
from lupin_bridge.client import BridgeClient
from lupin_msgs.msg import SensorReading, TagReading
from lupin_msgs.srv import GetTagReading
from lupin_ros.adapter.node import CallFailure
from tests.plugins.fakes import FakeOutlet, FakeRos, defaults

OK = GetTagReading.Response.STATUS_OK


def asked(answer: Any) -> Any:
    """Return the report of an attempt to read tag 7 that is answered so."""
    ros, outlet = FakeRos(), FakeOutlet()
    client = BridgeClient(ros, outlet, defaults(PLUGIN))  # type: ignore[arg-type]
    client.start("a1", "read_tag", {"tag_id": "7"})
    (call,) = ros.remote.calls
    assert call.request.tag_id == "7"
    call.done(answer)
    return outlet.reports[-1]


@pytest.mark.parametrize("named", ["7", ""])
def test_a_reading_is_of_the_tag_that_was_asked_for(named: str) -> None:
    """Also where a bridge does not say which one it is."""
    reading = TagReading(tag_id=named, readings=[SensorReading(name="co2", value=431.0)])
    kind, _, result = asked(GetTagReading.Response(status=OK, reading=reading))
    assert kind == "done"
    assert result["reading"]["tag_id"] == "7"
    assert result["reading"]["readings"] == [{"name": "co2", "value": 431.0}]


def test_a_sensor_that_tells_no_number_has_read_nothing() -> None:
    """Of a bridge that is not ours; the other sensors have."""
    told = {"temperature": math.nan, "co2": 431.0, "light": -math.inf}
    readings = [SensorReading(name=name, value=value) for name, value in told.items()]
    reading = TagReading(tag_id="7", readings=readings)
    _, _, result = asked(GetTagReading.Response(status=OK, reading=reading))
    assert result["reading"]["readings"] == [{"name": "co2", "value": 431.0}]


@pytest.mark.parametrize(
    ("answer", "code", "detail"),
    [
        (
            GetTagReading.Response(status=OK, reading=TagReading(tag_id="8")),
            "scan_failed",
            "the bridge answered with tag '8'",
        ),
        (GetTagReading.Response(status=1, error_message="who?"), "unknown_tag", "who?"),
        (GetTagReading.Response(status=2, error_message="too old"), "scan_failed", "too old"),
        (GetTagReading.Response(status=200), "scan_failed", "bridge_status_200"),
        (CallFailure("timeout", "no answer within 5 s"), "scan_failed", "no answer within 5 s"),
    ],
)
def test_what_is_no_reading_fails_with_the_reason(answer: Any, code: str, detail: str) -> None:
    """Codes of a later interface as well."""
    assert asked(answer) == ("failed", "a1", code, detail)
