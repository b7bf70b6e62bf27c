"""What the aggregator does besides missions: it reads the climate while idle, and outlives its own death."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from builtin_interfaces.msg import Time
from rosgraph_msgs.msg import Clock

from lupin_engine.plugin.wire import time_fields
from lupin_msgs.msg import Observation, SensorReading
from lupin_msgs.srv import GetTagReading
from lupin_perception.node.aggregator import HEAR_S, RECALL_S
from lupin_ros.adapter.node import Qos, RosNode
from tests.lupin_ros.plugins.perception.test_node import BUG, RED, Scene, Unheard

MakeNode = Callable[..., RosNode]

#: Looks often, so that no test waits for the next look.
SOON = ["-p", "passive_climate:=true", "-p", "tick_period_s:=0.05", "-p", "attribute_when_idle:=false"]


class Bridge:
    """A bridge in the scene's world; `answers` says what comes for which tag, else a temperature."""

    def __init__(self, scene: Scene) -> None:
        self.asked: list[str] = []
        self.answers: dict[str, tuple[int, str]] = {}
        scene.world.serve(GetTagReading, "/greenhouse_bridge/get_tag_reading", self._answer)

    def _answer(self, request: Any, response: Any) -> Any:
        self.asked.append(request.tag_id)
        response.status, response.reading.tag_id = self.answers.get(request.tag_id, (0, request.tag_id))
        response.reading.readings = [SensorReading(name="temperature", value=20.0)]
        return response


def discover(scene: Scene, *tags: int) -> None:
    for tag in tags:
        scene.place(tag)
        scene.see(tag, times=3)


def test_without_a_mission_each_tag_is_read_once(make_node: MakeNode) -> None:
    """War story 25: a map that stays empty until a mission comes by."""
    scene = Scene(make_node, *SOON)
    bridge = Bridge(scene)
    discover(scene, 5, 6)
    told = scene.told(2)
    assert sorted(bridge.asked) == ["5", "6"]
    assert sorted(o.tag_reading.tag_id for o in scene.observations) == ["5", "6"]
    assert (told.source, told.mission_id, told.kind) == ("passive_observer", "", Observation.KIND_TAG_READING)
    assert (told.status, told.header.frame_id) == (Observation.STATUS_OK, "map")
    assert (told.tag_pose_in_map.position.x, told.tag_pose_in_map.orientation.w) == pytest.approx(
        (2.0, 0.5**0.5)
    )
    assert [(r.name, r.value) for r in told.tag_reading.readings] == [("temperature", 20.0)]


def test_a_period_reads_them_again_and_again(make_node: MakeNode) -> None:
    scene = Scene(make_node, *SOON, "-p", "refresh_period_s:=0.05")
    bridge = Bridge(scene)
    discover(scene, 5)
    for count in (1, 2, 3):
        scene.told(count)
        assert bridge.asked == ["5"] * count
        scene.wait(0.06)


def test_a_mission_reads_for_itself(make_node: MakeNode) -> None:
    """While it is under way nobody else asks; afterwards what is left."""
    scene = Scene(make_node, *SOON)
    bridge = Bridge(scene)
    scene.mission("INSPECTING", "NAVIGATING", "5")
    discover(scene, 5)
    scene.next_list()
    assert bridge.asked == []
    scene.mission("DONE")
    assert scene.told(1).tag_reading.tag_id == "5"


def test_what_the_greenhouse_does_not_know_or_mixes_up_is_not_published(make_node: MakeNode) -> None:
    """An unknown tag is asked for once; the reading of another tag would stand on the wrong plant."""
    scene = Scene(make_node, *SOON)
    bridge = Bridge(scene)
    unknown = GetTagReading.Response.STATUS_UNKNOWN_TAG
    bridge.answers = {"5": (unknown, ""), "6": (0, "7"), "7": (2, "7")}
    discover(scene, 5, 6, 7, 8)
    assert scene.told(1).tag_reading.tag_id == "8"
    assert sorted(bridge.asked) == ["5", "6", "7", "8"]


def test_an_absent_bridge_is_told_once_and_waited_for(make_node: MakeNode) -> None:
    scene = Scene(make_node, *SOON)
    discover(scene, 5)
    scene.until(lambda: scene.log.warnings, "the warning")
    scene.next_list()
    assert scene.log.warnings == ["tags are known but nobody reads them"]
    Bridge(scene)
    assert scene.told(1).tag_reading.tag_id == "5"


def test_it_can_be_switched_off(make_node: MakeNode) -> None:
    scene = Scene(make_node, *SOON, "-p", "passive_climate:=false")
    bridge = Bridge(scene)
    discover(scene, 5)
    scene.next_list()
    assert (bridge.asked, scene.log.warnings) == ([], [])


# --- a new process


def remembering(make_node: MakeNode, file: Path) -> Scene:
    return Scene(make_node, *kept_in(file))


def left_behind(make_node: MakeNode, folder: Path) -> Path:
    """Return what a search that found tag 5 has left; whoever told of the mission is gone, too."""
    file = folder / "memory.json"
    first = remembering(make_node, file)
    first.mission("EXPLORING")
    discover(first, 5)
    first.until(lambda: file.exists() and '"5"' in file.read_text(), "it is kept")
    first.node.close()
    first.world.close()
    return file


def kept_in(file: Path) -> list[str]:
    return ["-p", f"memory_file:={file}", "-p", "tag_in_sight_s:=0.1"]


def test_a_node_that_was_killed_knows_its_mission_again(make_node: MakeNode, tmp_path: Path) -> None:
    """Tags, places, species and reported pests: nothing of what is published goes back."""
    file = tmp_path / "state" / "memory.json"
    first = remembering(make_node, file)
    first.mission("MONITORING", "SCANNING", "5")
    discover(first, 5, 6)
    first.flowers(RED)
    first.told(1)
    first.place(9, robot=7.0)
    first.mission("EXPLORING")
    first.wait(0.2)  # until no tag is in sight
    for _ in range(3):
        first.flowers(BUG)
    before = first.told(2)
    assert before.kind == Observation.KIND_ANOMALY
    first.until(lambda: file.exists() and "7.0" in file.read_text(), "it is kept")
    poses = {tag.tag_id: tag.pose_in_map for tag in first.next_list().tags}
    first.node.close()

    second = Unheard(make_node, *kept_in(file))  # but for the first one's mission, which is still told
    second.until(lambda: second.lists, "the first list")
    assert all(told.tags for told in second.lists), "never an empty list, which would take the finds away"
    assert {tag.tag_id: tag.pose_in_map for tag in second.lists[0].tags} == poses
    assert [tag.species for tag in second.lists[0].tags] == ["tulip_red", ""]
    answer = second.confirm("5")
    assert answer.error_message == "tag '5' stale: not seen since this node began, allowed 5 s"
    second.place(9, robot=7.0)
    for _ in range(4):
        second.flowers(BUG)
    second.next_list()
    assert second.observations == [], "reported already"


def test_a_scan_that_a_node_was_killed_in_goes_on(make_node: MakeNode, tmp_path: Path) -> None:
    """A pest that was told in it would otherwise be gone from every display, because the arm has moved on."""
    file = tmp_path / "memory.json"
    first = remembering(make_node, file)
    first.mission("MONITORING", "SCANNING", "5")
    discover(first, 5, 6)
    first.flowers(RED, BUG)
    first.told(1)
    first.until(lambda: '"scanned": "5"' in file.read_text(), "it is kept")
    first.node.close()
    first.world.close()
    second = remembering(make_node, file)
    second.mission("MONITORING", "SCANNING", "5")
    second.flowers(RED)
    assert second.told(1).flower.anomaly
    second.mission("MONITORING", "NAVIGATING", "5")
    second.mission("MONITORING", "SCANNING", "5")
    second.flowers(RED)
    assert not second.told(2).flower.anomaly, "another visit begins with nothing"


def test_a_scan_that_has_ended_meanwhile_does_not_go_on(make_node: MakeNode, tmp_path: Path) -> None:
    file = tmp_path / "memory.json"
    first = remembering(make_node, file)
    first.mission("MONITORING", "SCANNING", "5")
    discover(first, 5)
    first.flowers(RED, BUG)
    first.until(lambda: '"scanned": "5"' in file.read_text(), "it is kept")
    first.node.close()
    first.world.close()
    second = remembering(make_node, file)
    second.mission("MONITORING", "NAVIGATING", "5")
    second.mission("MONITORING", "SCANNING", "5")
    second.flowers(RED)
    assert not second.told(1).flower.anomaly


class Simulated(Scene):
    """A scene in simulated time, which stands still unless a test lets it go on or jump."""

    def __init__(self, make_node: MakeNode, begin: float, *arguments: str) -> None:
        self.time = begin
        self._clock = make_node("clock").publisher(Clock, "/clock", Qos.EVENT)
        super().__init__(make_node, "-p", "use_sim_time:=true", *arguments)

    def _hold_the_time(self) -> None:
        """Leave it to the simulation."""

    def greet(self) -> None:
        self.jump(0.0)
        super().greet()

    def jump(self, seconds: float) -> None:
        """Let it be so much later or earlier, and wait until the aggregator knows."""
        self.time += seconds

        def heard() -> bool:
            self._tell_time()
            return abs(self.node.now() - self.time) < 0.001

        self.until(heard, "the time")

    def go_on_until(self, condition: Callable[[], Any], what: str) -> None:
        """Let time pass, 20 ms with each look, until a condition holds."""

        def ticking() -> Any:
            self.time += 0.02
            self._tell_time()
            return condition()

        self.until(ticking, what)

    def _tell_time(self) -> None:
        # Again and again: of a clock nothing is kept for a node that is not matched yet.
        self._clock.publish(Clock(clock=Time(**time_fields(self.time))))


def test_who_remembers_a_mission_tells_nothing_else_before_it_has_heard_anything(
    make_node: MakeNode, tmp_path: Path
) -> None:
    """On a busy machine that takes seconds, and meanwhile a tag comes into view."""
    file = left_behind(make_node, tmp_path)
    second = Unheard(make_node, *kept_in(file))
    second.wait(RECALL_S - 1.0)
    second.discover(6)
    second.mission("EXPLORING")
    second.next_list()
    assert [told for told in second.lists if "5" not in {tag.tag_id for tag in told.tags}] == []


def test_in_simulated_time_too_a_new_process_never_tells_an_empty_list(
    make_node: MakeNode, tmp_path: Path
) -> None:
    """The clock is heard of a moment after the start, and is then a thousand seconds on."""
    file = left_behind(make_node, tmp_path)
    second = Simulated(make_node, 1000.0, "-p", f"memory_file:={file}")
    assert second.lists == []
    second.go_on_until(lambda: second.lists, "the first list")
    assert second.lists[0].tags == []
    assert second.time - 1000.0 > HEAR_S, "so long without a mission, and there is none"
    second.mission("EXPLORING")
    second.next_list()
    assert second.tags() == {"5": 3}


def test_a_simulation_that_begins_anew_leaves_nothing_in_sight_for_ever(make_node: MakeNode) -> None:
    """What was seen a thousand seconds before the clock was set back is not of the next thousand."""
    scene = Simulated(make_node, 1000.0, "-p", "freshness_s:=1.0")
    scene.mission("MONITORING", "SCANNING", "5")
    scene.discover()
    assert scene.confirm("5").detected
    scene.jump(-900.0)
    scene.go_on_until(lambda: not scene.confirm("5").detected, "it is stale")
    scene.go_on_until(lambda: not scene.aggregator._is_under_way(), "the mission is silent")
    assert scene.aggregator._sightings.in_sight(scene.node.elapsed()) == {}
    scene.discover()
    assert scene.confirm("5").detected


def test_what_is_remembered_of_another_mission_is_forgotten(make_node: MakeNode, tmp_path: Path) -> None:
    file = tmp_path / "memory.json"
    first = remembering(make_node, file)
    first.mission("EXPLORING", mission_id="m1")
    discover(first, 5)
    first.until(lambda: file.exists() and '"5"' in file.read_text(), "it is kept")
    first.mission("PREPARE", mission_id="m2")
    first.node.close()
    second = Unheard(make_node, *kept_in(file))  # but for the first one's mission, which is still told
    assert second.next_list().tags == []


@pytest.mark.parametrize(
    "text", ["", "[]", "{}", '{"mission_id": "m1", "reported": [], "tags": [{"id": "5"}]}']
)
def test_a_damaged_memory_is_told_and_is_none(make_node: MakeNode, tmp_path: Path, text: str) -> None:
    file = tmp_path / "memory.json"
    file.write_text(text)
    scene = remembering(make_node, file)
    (warning,) = scene.log.warnings
    assert warning.startswith(f"memory_file {str(file)!r} cannot be used: ")
    scene.mission("EXPLORING")
    discover(scene, 5)
    scene.until(lambda: json.loads(file.read_text() or "{}").get("tags"), "it is written anew")
    assert scene.tags() == {"5": 3}


def test_a_memory_that_cannot_be_written_is_told_once_and_nothing_else_happens(
    make_node: MakeNode, tmp_path: Path
) -> None:
    (tmp_path / "file").write_text("")
    scene = remembering(make_node, tmp_path / "file" / "memory.json")
    scene.mission("EXPLORING")
    discover(scene, 5)
    scene.until(lambda: scene.tags() == {"5": 3}, "the tag")
    (warning,) = scene.log.warnings
    assert warning == f"memory_file {str(tmp_path / 'file' / 'memory.json')!r} cannot be written: File exists"
