"""What the orchestrator tells of itself, for programs: its steps, what is possible, and the chart."""

from __future__ import annotations

import json
import shutil
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from std_msgs.msg import String

from lupin_engine.missions.folders import default_missions_folder
from lupin_engine.missions.selection import load_missions
from lupin_engine.plugin.registry import load_catalog
from lupin_greenhouse.profile import PROFILE
from lupin_ros.adapter.node import Qos
from lupin_ros.service.names import CHART_TOPIC, POSSIBLE_TOPIC, STEPS_TOPIC
from tests.lupin_ros.world import Operator, World

pytestmark = pytest.mark.timeout(180)


class Listener(Operator):
    """An operator who keeps what a program would read."""

    def __init__(self) -> None:
        super().__init__("listener")
        self.heard: dict[str, list[dict[str, Any]]] = {}
        self.listen(STEPS_TOPIC, Qos.BACKLOG)
        self.listen(POSSIBLE_TOPIC, Qos.LATCHED)
        self.listen(CHART_TOPIC, Qos.LATCHED)

    def listen(self, topic: str, qos: Qos) -> None:
        """Keep what a topic says from here on."""
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


Requests = dict[tuple[str, str], dict[str, Any]]


def requests(told: dict[str, Any]) -> Requests:
    """Return what is told of each request and mission."""
    return {(one["request"], one["mission"]): one for one in told["requests"]}


@pytest.mark.core
def test_what_is_possible_is_told_and_changes_with_a_mission(world: World, listener: Listener) -> None:
    """An entry for every service; what is told is what the service answers; who comes late is told, too."""
    world.start_all()
    listener.in_state("READY")
    start = ("mission.start", "InspectionMission")
    ready = listener.newest(POSSIBLE_TOPIC, lambda told: requests(told)[start]["possible"])
    verbs = [*PROFILE.requests]
    missions = load_missions((), load_catalog())
    assert [*requests(ready)] == [
        *((f"operator.{verb}", "") for verb in verbs),
        *(("mission.start", mission) for mission in missions.names),
    ]
    assert ready["chart"] == missions.hash
    pause = requests(ready)["operator.pause", ""]
    assert (pause["code"], pause["reason"]) == ("not_running", listener.ask("pause").message)
    listener.hit(1, "stall")
    assert listener.start("1").accepted
    running = listener.newest(POSSIBLE_TOPIC, lambda told: requests(told)["operator.pause", ""]["possible"])
    assert requests(running)["operator.pause", ""]["engages"] == ["pause"]
    assert running["sequence"] > ready["sequence"]
    assert requests(running)[start]["reason"] == listener.start("1").error_message
    assert listener.ask("pause").success
    listener.newest(
        POSSIBLE_TOPIC, lambda told: requests(told)["operator.abort", ""]["releases"] == ["pause"]
    )
    late = Listener()
    try:
        known = late.newest(POSSIBLE_TOPIC, lambda told: True)
        assert known == listener.heard[POSSIBLE_TOPIC][-1]
        assert len(late.heard[POSSIBLE_TOPIC]) == 1
    finally:
        late.ros.close()


def test_the_chart_is_told_again_when_missions_are_loaded(
    world: World, listener: Listener, tmp_path: Path
) -> None:
    """Who shows it needs neither the files nor the engine; records of steps name the chart by its hash."""
    folder = tmp_path / "missions"
    shutil.copytree(default_missions_folder(), folder)
    (folder / "exploration.yaml").unlink()
    world.start_all(missions_path=folder)
    told = listener.newest(CHART_TOPIC, lambda told: told["svg"])
    assert [bool(each["svg"]) for each in listener.heard[CHART_TOPIC]] in ([False, True], [True])
    step = listener.newest(STEPS_TOPIC, lambda record: True)
    assert (told["hash"], told["boot"]) == (step["chart"], step["boot"])
    assert told["missions"] == ["InspectionMission"]
    assert told["files"]["lifecycle.yaml"] == (folder / "lifecycle.yaml").read_text(encoding="utf-8")
    assert str(folder) not in json.dumps(told)
    listener.in_state("READY")
    shutil.copy(default_missions_folder() / "exploration.yaml", folder)
    anew = listener.newest(CHART_TOPIC, lambda other: other["hash"] != told["hash"])
    assert anew["missions"] == ["ExplorationMission", "InspectionMission"]
    assert "MISSION.ExplorationMission.MONITORING" in anew["states"]
    listener.newest(POSSIBLE_TOPIC, lambda possible: possible["chart"] == anew["hash"])
    listener.newest(STEPS_TOPIC, lambda record: record["chart"] == anew["hash"])
