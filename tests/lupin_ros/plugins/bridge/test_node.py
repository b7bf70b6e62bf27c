"""The greenhouse bridge over real DDS: its node, and the engine's side of it."""

from __future__ import annotations

import json
import re
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("greenhouse_sim", reason="mdp-greenhouse is not installed here")

from lupin_bridge.catalog import PLUGIN, READING
from lupin_bridge.client import BridgeClient
from lupin_bridge.node import PARAMETERS, STATUS_READING_FAILED, BridgeNode
from lupin_engine.plugin.types import convert
from lupin_msgs.srv import GetTagReading
from lupin_ros.adapter.node import RosNode
from tests.lupin_ros.helpers import PATIENCE, spin_for, spin_until
from tests.plugins.fakes import FakeOutlet, defaults

MakeNode = Callable[..., RosNode]

TAGS = {
    "7": {"x": 1.0, "y": 1.0, "sensors": ["light", "temperature"]},
    "9": {"x": 1.0, "y": 2.0, "sensors": ["radiation"]},
}


class Bridge:
    """A bridge over a layout of two tags, and the engine's client of it."""

    def __init__(self, make_node: MakeNode, tmp_path: Path) -> None:
        layout = tmp_path / "layout.json"
        layout.write_text(json.dumps({"tags": TAGS, "tables": {}}))
        arguments = ["--ros-args", "-p", f"tag_file:={layout}", "-p", "debug_time_of_day:=6"]
        self.server = make_node("greenhouse_bridge", arguments, PARAMETERS)
        BridgeNode(self.server)
        self.engine = make_node("engine")
        self.outlet = FakeOutlet()
        self.driver = BridgeClient(self.engine, self.outlet, defaults(PLUGIN))

    def until(self, condition: Callable[[], Any]) -> None:
        spin_until([self.server, self.engine], condition)

    def read(self, tag: str) -> tuple[Any, ...]:
        self.until(lambda: not self.driver.missing())
        self.driver.start("a1", "read_tag", {"tag_id": tag})
        self.until(lambda: len(self.outlet.reports) == 2)
        assert self.outlet.reports[0] == ("accepted", "a1")
        return self.outlet.reports[1]


@pytest.fixture
def bridge(make_node: MakeNode, tmp_path: Path) -> Bridge:
    return Bridge(make_node, tmp_path)


def test_a_tag_is_read(bridge: Bridge) -> None:
    before = bridge.server.now()
    kind, _, result = bridge.read("7")
    reading = result["reading"]
    assert kind == "done"
    assert convert(reading, READING) == reading
    assert (reading["tag_id"], reading["sim_time_of_day_seconds"]) == ("7", 6 * 3600.0)
    assert [sensor["name"] for sensor in reading["readings"]] == ["light", "temperature"]
    assert before <= reading["stamp"] <= bridge.server.now()


def test_an_unknown_tag_is_an_error_of_its_own(bridge: Bridge) -> None:
    report = bridge.read("8")
    assert report == ("failed", "a1", "unknown_tag", "unknown tag '8'; the layout has 2 tags")


def test_a_failing_simulator_is_an_answer_and_the_bridge_lives_on(bridge: Bridge) -> None:
    kind, _, code, detail = bridge.read("9")
    assert (kind, code) == ("failed", "scan_failed")
    assert "radiation" in detail
    bridge.outlet.reports.clear()
    assert bridge.read("7")[0] == "done"


def test_the_response_of_a_failed_reading_is_empty(bridge: Bridge) -> None:
    caller, answers = bridge.engine.service(GetTagReading, "/greenhouse_bridge/get_tag_reading"), []
    bridge.until(caller.ready)
    caller.call(GetTagReading.Request(tag_id="9"), 5.0, answers.append)
    bridge.until(lambda: answers)
    assert answers[0].status == STATUS_READING_FAILED
    assert answers[0].reading.tag_id == ""


def test_a_stale_request_is_answered_with_the_reason(bridge: Bridge, monkeypatch: pytest.MonkeyPatch) -> None:
    """The robot's clock is behind: without an answer every reading would end as one that never came."""
    bridge.until(lambda: not bridge.driver.missing())
    now = time.time_ns
    monkeypatch.setattr(time, "time_ns", lambda: now() + 60_000_000_000)
    kind, _, code, detail = bridge.read("7")
    assert (kind, code) == ("failed", "scan_failed")
    age = re.search(r"refused: the request is (\d+\.\d) s old", detail)
    assert age is not None
    assert 60.0 <= float(age[1]) < 60.0 + PATIENCE


def test_a_status_without_a_text_is_told_by_its_number(make_node: MakeNode) -> None:
    server, engine, outlet = make_node("server"), make_node("engine"), FakeOutlet()

    def answer(_: Any, response: GetTagReading.Response) -> GetTagReading.Response:
        response.status = 7
        return response

    server.serve(GetTagReading, "/greenhouse_bridge/get_tag_reading", answer)
    driver = BridgeClient(engine, outlet, defaults(PLUGIN))
    spin_until([server, engine], lambda: not driver.missing())
    driver.start("a1", "read_tag", {"tag_id": "1"})
    spin_until([server, engine], lambda: len(outlet.reports) == 2)
    assert outlet.reports[1] == ("failed", "a1", "scan_failed", "bridge_status_7")


def test_a_cancelled_attempt_says_nothing_more(bridge: Bridge) -> None:
    bridge.until(lambda: not bridge.driver.missing())
    bridge.driver.start("a1", "read_tag", {"tag_id": "7"})
    bridge.driver.cancel("a1")
    bridge.driver.cancel("a1")
    bridge.driver.cancel("unheard of")
    spin_for([bridge.server, bridge.engine], 0.1)
    assert bridge.outlet.kinds("a1") == ["accepted", "cancelled"]


def test_without_a_bridge_an_attempt_fails(make_node: MakeNode) -> None:
    engine, outlet = make_node("engine"), FakeOutlet()
    driver = BridgeClient(engine, outlet, defaults(PLUGIN))
    assert driver.missing() == ["service /greenhouse_bridge/get_tag_reading"]
    driver.start("a1", "read_tag", {"tag_id": "7"})
    spin_until([engine], lambda: len(outlet.reports) == 2)
    assert outlet.reports[1][:3] == ("failed", "a1", "scan_failed")
    driver.start("a2", "read_tag", {"tag_id": "7"})
    driver.close()
    spin_for([engine], 0.05)
    assert outlet.kinds("a2") == ["accepted"]


def test_every_status_that_is_answered_has_its_constant() -> None:
    text = (Path(__file__).parents[4] / "lupin_msgs/srv/GetTagReading.srv").read_text(encoding="utf-8")
    declared = dict(re.findall(r"^uint8 STATUS_(\w+)=(\d+)", text, re.MULTILINE))
    assert declared == {"OK": "0", "UNKNOWN_TAG": "1", "READING_FAILED": str(STATUS_READING_FAILED)}
