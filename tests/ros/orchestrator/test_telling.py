"""What the orchestrator tells of itself, for programs: its steps, what is possible, and the chart."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from std_msgs.msg import String

from lupin_engine.missions.selection import load_missions
from lupin_engine.plugin.registry import load_catalog
from lupin_engine.ros.adapter.node import Qos
from lupin_engine.ros.names import STEPS_TOPIC
from tests.ros.world import Operator, World

pytestmark = pytest.mark.timeout(180)


class Listener(Operator):
    """An operator who keeps what a program would read."""

    def __init__(self) -> None:
        super().__init__("listener")
        self.heard: dict[str, list[dict[str, Any]]] = {}
        self._listen(STEPS_TOPIC, Qos.BACKLOG)

    def _listen(self, topic: str, qos: Qos) -> None:
        kept = self.heard[topic] = []
        self.ros.subscribe(String, topic, qos, lambda message: kept.append(json.loads(message.data)))

    def newest(self, topic: str, wanted: Callable[[dict[str, Any]], Any]) -> dict[str, Any]:
        """Wait until the newest of a topic is as wanted, and return it."""
        heard = self.heard[topic]
        self.until(lambda: heard and wanted(heard[-1]), topic)
        return heard[-1]


@pytest.fixture
def listener(ros_domain: int) -> Iterator[Listener]:
    """A listener on the same domain."""
    listener = Listener()
    yield listener
    listener.ros.close()


def test_a_record_says_when_and_of_which_start_and_chart(world: World, listener: Listener) -> None:
    """After another start the name is another one; the chart, and its hash, are the same."""
    before = time.time_ns()
    world.start("mission_orchestrator")
    first = listener.newest(STEPS_TOPIC, lambda record: True)
    assert before < first["wall_ns"] < time.time_ns()
    assert first["wall_ns"] / 1e9 == pytest.approx(first["stamp"], abs=1.0)
    assert first["chart"] == load_missions((), load_catalog()).hash
    node = world.processes["mission_orchestrator"]
    node.terminate()
    assert node.wait(60.0) == 0
    assert {record["boot"] for record in listener.heard[STEPS_TOPIC]} == {first["boot"]}
    world.start("mission_orchestrator")
    second = listener.newest(STEPS_TOPIC, lambda record: record["boot"] != first["boot"])
    assert second["chart"] == first["chart"]
    assert second["wall_ns"] > first["wall_ns"]
