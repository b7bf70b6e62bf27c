"""The perception aggregator over real DDS: frames and transforms in, tags and observations out."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from typing import Any

import pytest
from builtin_interfaces.msg import Time
from geometry_msgs.msg import TransformStamped
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from tf2_msgs.msg import TFMessage

from lupin_engine.errors import LupinError, shortened
from lupin_greenhouse.frames import Frames
from lupin_msgs.msg import DiscoveredTags, MissionState, Observation
from lupin_msgs.srv import ConfirmTag
from lupin_perception import sightings
from lupin_perception.node import NAME, PARAMETERS, Aggregator
from lupin_perception.node import aggregator as module
from lupin_ros.adapter.node import Qos, RosNode
from tests.lupin_ros.helpers import PATIENCE, spin_until

MakeNode = Callable[..., RosNode]

#: Often, so that no test waits for the next list.
OFTEN = ["-p", "publish_rate_hz:=50.0"]
#: Nothing outlives a test, and nothing is read without a mission, but where a test says so.
QUIET = ["-p", "memory_file:=none", "-p", "passive_climate:=false", "-p", "detection_delay_s:=0.0"]
#: Facing +X: the tag's +Z along the map's X.
FACING_X = (0.0, math.sqrt(0.5), 0.0, math.sqrt(0.5))
FLAT = (0.0, 0.0, 0.0, 1.0)


class Log:
    """Keeps what the node says."""

    def __init__(self) -> None:
        self.warnings: list[str] = []

    def warning(self, text: str, **_: Any) -> None:
        self.warnings.append(text)

    def info(self, text: str, **_: Any) -> None:
        """Good news."""


class Scene:
    """The aggregator, and somebody who is camera, arm, mission and audience at once.

    The aggregator's time stands still unless a test lets it pass: what is in sight, fresh or under way stays
    so, however long the machine takes. Lists and looks come by real time.
    """

    def __init__(self, make_node: MakeNode, *arguments: str) -> None:
        self.node = make_node(NAME, ["--ros-args", *OFTEN, *QUIET, *arguments], PARAMETERS)
        self.log = Log()
        self.node.log = self.log  # type: ignore[assignment]
        self.now = 0.0
        self.taken: dict[str, int] = {}
        self._hold_the_time()
        self._count_what_is_taken_in()
        self.aggregator = Aggregator(self.node)
        self.world = world = make_node("world")
        self.lists: list[Any] = []
        self.observations: list[Any] = []
        heard = (
            world.subscribe(DiscoveredTags, "/perception/discovered_tags", Qos.LATCHED, self.lists.append),
            world.subscribe(Observation, "/floranova/observations", Qos.BACKLOG, self.observations.append),
        )
        self.tag_frames = world.publisher(String, "/camera/tag_detections_json", Qos.DETECTION)
        self.flower_frames = world.publisher(String, "/yolo/detections", Qos.DETECTION)
        self.transforms = world.publisher(TFMessage, "/tf", Qos.TRANSFORMS)
        self.states = world.publisher(MissionState, "/mission/state", Qos.LATCHED)
        self.joints = world.publisher(JointState, "/joint_states", Qos.DETECTION)
        self.box_frames: Any = None
        self.confirmer = world.service(ConfirmTag, "/perception/confirm_tag")
        outlets = (self.tag_frames, self.flower_frames, self.transforms, self.states, self.joints)
        self.until(lambda: all(outlet.get_subscription_count() == 1 for outlet in outlets), "its ears")
        self.until(lambda: all(topic.get_publisher_count() == 1 for topic in heard), "its topics")
        self.until(self.confirmer.ready, "its service")
        self.greet()

    def greet(self) -> None:
        """Be there as an orchestrator at rest."""
        self.mission("READY", mission_id="")

    def _hold_the_time(self) -> None:
        """Let the aggregator's time be ours."""
        self.node.elapsed = lambda: self.now  # type: ignore[method-assign]

    def _count_what_is_taken_in(self) -> None:
        """Count the messages of each topic once the aggregator is through with them."""
        subscribe = self.node.subscribe

        def counting(kind: Any, topic: str, qos: Qos, callback: Callable[[Any], None]) -> None:
            def take(message: Any) -> None:
                callback(message)
                self.taken[topic] = self.taken.get(topic, 0) + 1

            subscribe(kind, topic, qos, take)

        self.node.subscribe = counting  # type: ignore[method-assign]

    def until(self, condition: Callable[[], Any], what: str = "") -> None:
        spin_until([self.node, self.world], condition, what=what)

    def wait(self, seconds: float) -> None:
        """Let so much time pass."""
        self.now += seconds

    def send(self, outlet: Any, message: Any) -> None:
        """Publish, and wait until the aggregator has had it."""
        count = self.taken.get(outlet.topic_name, 0)
        outlet.publish(message)
        self.until(lambda: self.taken.get(outlet.topic_name, 0) > count, f"{outlet.topic_name} taken in")

    def place(
        self,
        tag: int,
        x: float = 2.0,
        y: float = 0.0,
        q: tuple[float, ...] = FACING_X,
        robot: float = 3.0,
        ahead: int = 0,
    ) -> None:
        """Say by transforms that the robot is at (robot, 0) and sees a tag at (x, y), `ahead` s from now."""
        moving = [
            transform("map", "odom", (0.0, 0.0, 0.0), FLAT),
            transform("odom", "base_link", (robot, 0.0, 0.0), FLAT),
            transform("base_link", f"tag_{tag}", (x - robot, y, 0.1), q),
        ]
        stamp = self.world.stamp()
        for stamped in moving:
            stamped.header.stamp = stamp
        moving[-1].header.stamp = Time(sec=stamp.sec + ahead, nanosec=stamp.nanosec)
        self.send(self.transforms, TFMessage(transforms=moving))

    def see(self, *tags: int, dist: float = 1.0, times: int = 1) -> None:
        text = json.dumps([{"id": tag, "corners": [], "dist": dist} for tag in tags])
        for _ in range(times):
            self.send(self.tag_frames, String(data=text))

    def discover(self, tag: int = 5) -> None:
        self.place(tag)
        self.see(tag, times=3)

    def flowers(self, *found: tuple[str, float, float]) -> None:
        """A frame of (class, confidence, bearing)."""
        self.raw_flowers(json.dumps([flower(*one) for one in found]))

    def raw_flowers(self, text: str) -> None:
        self.send(self.flower_frames, String(data=text))

    def mission(self, lifecycle: str, phase: str = "", target: str = "", mission_id: str = "m1") -> None:
        state = MissionState(mission_id=mission_id, lifecycle_state=lifecycle)
        state.mission_phase, state.current_target = phase, target
        self.send(self.states, state)

    def tell_boxes(self, text: str) -> None:
        if self.box_frames is None:
            self.box_frames = self.world.publisher(String, "/perception/box_geometry_json", Qos.LATCHED)
            self.until(lambda: self.box_frames.get_subscription_count() == 1)
        self.send(self.box_frames, String(data=text))

    def tags(self) -> dict[str, int]:
        """The tags of the last list with their sightings."""
        return {tag.tag_id: tag.sightings for tag in self.lists[-1].tags} if self.lists else {}

    def next_list(self) -> Any:
        """A list that was made after this moment: the second to come, the first may be under way."""
        count = len(self.lists)
        self.until(lambda: len(self.lists) >= count + 2, "two lists")
        return self.lists[-1]

    def told(self, count: int) -> Any:
        """Wait until there are `count` observations, and no more by the next list; returns the last."""
        self.until(lambda: len(self.observations) >= count, f"{count} observations")
        self.next_list()
        assert len(self.observations) == count
        return self.observations[-1]

    def confirm(self, tag_id: str) -> Any:
        answers: list[Any] = []
        self.confirmer.call(ConfirmTag.Request(expected_tag_id=tag_id), PATIENCE, answers.append)
        self.until(lambda: answers, "an answer")
        return answers[0]


class Unheard(Scene):
    """The same where nobody tells of a mission."""

    def greet(self) -> None:
        """Say nothing."""


def transform(parent: str, child: str, place: tuple[float, ...], turn: tuple[float, ...]) -> TransformStamped:
    message = TransformStamped(child_frame_id=child)
    message.header.frame_id = parent
    shift, q = message.transform.translation, message.transform.rotation
    shift.x, shift.y, shift.z = place
    q.x, q.y, q.z, q.w = turn
    return message


def flower(name: str, confidence: float, bearing: float) -> dict[str, Any]:
    middle = (bearing / 2.0 + 0.5) * 640.0
    classes = ["tulip_red", "tulip_white", "tulip_pink", "bug"]
    box = [middle - 10.0, 0.0, middle + 10.0, 20.0]
    return {"class": classes.index(name), "confidence": confidence, "bbox_xyxy": box, "track_id": None}


RED, BUG = ("tulip_red", 0.9, 0.0), ("bug", 0.8, 0.0)


# --- tags


def test_a_tag_is_told_with_its_place_on_the_map_at_its_third_sighting(make_node: MakeNode) -> None:
    scene = Scene(make_node)
    scene.place(5, x=2.0, y=1.0)
    scene.see(5, times=2)
    assert scene.next_list().tags == []
    scene.see(5)
    (tag,) = scene.next_list().tags
    place, q = tag.pose_in_map.position, tag.pose_in_map.orientation
    assert scene.lists[-1].header.frame_id == "map"
    assert (tag.tag_id, tag.sightings, tag.species) == ("5", 3, "")
    assert (place.x, place.y, place.z) == pytest.approx((2.0, 1.0, 0.1))
    assert (q.x, q.y, q.z, q.w) == pytest.approx(FACING_X)


def test_who_comes_late_gets_the_last_list_at_once(make_node: MakeNode) -> None:
    scene = Scene(make_node)
    scene.discover()
    scene.next_list()
    late, heard = make_node("late"), []
    late.subscribe(DiscoveredTags, "/perception/discovered_tags", Qos.LATCHED, heard.append)
    spin_until([late], lambda: heard, what="the list")  # the aggregator does not get its turn to tell another
    assert [tag.tag_id for tag in heard[0].tags] == ["5"]


def test_a_tag_is_told_at_once_when_it_is_discovered(
    make_node: MakeNode, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Who has just come to it says where it is with its reading, and the next list would be too late."""
    scene = Scene(make_node, "-p", "publish_rate_hz:=0.2")
    told: list[Any] = []
    monkeypatch.setattr(scene.aggregator._lists, "publish", told.append)
    scene.discover()
    assert [(tag.tag_id, tag.sightings) for tag in told[-1].tags] == [("5", 3)]


def test_a_list_without_news_keeps_its_stamp(make_node: MakeNode) -> None:
    scene = Scene(make_node)
    scene.discover()
    first = scene.next_list().header.stamp
    assert scene.next_list().header.stamp == first
    scene.see(5)
    again = scene.next_list().header.stamp
    assert (again.sec, again.nanosec) > (first.sec, first.nanosec)


def test_a_tag_too_far_away_never_counts(make_node: MakeNode) -> None:
    scene = Scene(make_node)
    scene.place(5)
    scene.see(5, dist=9.0, times=5)
    assert scene.next_list().tags == []
    assert not scene.confirm("5").detected


def test_half_a_turn_is_never_told_as_an_orientation_that_nobody_filled_in(make_node: MakeNode) -> None:
    scene = Scene(make_node)
    scene.place(5, q=(math.sqrt(0.5), 0.0, math.sqrt(0.5), 0.0))
    scene.see(5, times=3)
    (tag,) = scene.next_list().tags
    assert tag.pose_in_map.orientation.w != 0.0


def test_a_new_mission_begins_with_no_tags_and_a_finished_one_keeps_them(make_node: MakeNode) -> None:
    """War story A17."""
    scene = Scene(make_node)
    scene.mission("EXPLORING")
    scene.discover()
    scene.mission("DONE")
    scene.next_list()
    assert scene.tags() == {"5": 3}
    scene.mission("PREPARE", mission_id="m2")
    assert scene.next_list().tags == []


def test_tags_that_cannot_be_placed_are_told_of_once_with_what_is_missing(make_node: MakeNode) -> None:
    """War story 22: otherwise an exploration finds nothing, and nobody knows why."""
    scene = Scene(make_node)
    scene.see(5, times=4)
    assert scene.log.warnings == [], "transforms may come a moment later"
    scene.see(5, times=4)
    text = (
        "tags are seen but none can be placed: no transform leads from tag_5 to map: nothing says where tag_5"
        " is; is the camera calibrated, the robot localized?"
    )
    assert scene.log.warnings == [text]
    scene.discover()
    scene.see(6, times=6)
    assert scene.log.warnings == [text, text.replace("tag_5", "tag_6")]


def test_a_sighting_waits_for_a_transform_that_comes_a_moment_later(make_node: MakeNode) -> None:
    """They come by two topics; a fast robot sees a tag three times and has driven on."""
    scene = Scene(make_node)
    for _ in range(3):
        scene.see(5)
        scene.place(5)
        scene.aggregator._sightings._frames = Frames()
    scene.next_list()
    assert scene.tags() == {"5": 3}
    scene.place(5)
    scene.next_list()
    assert scene.tags() == {"5": 3}, "each counts once"


def test_a_camera_whose_clock_is_ahead_is_told_apart_from_one_without_transforms(make_node: MakeNode) -> None:
    """Nothing is placed by a guess; in step again, it goes on."""
    scene = Scene(make_node)
    scene.place(5, ahead=3600)
    scene.see(5, times=5)
    (text,) = scene.log.warnings
    assert "no moment has all transforms from tag_5 to map: those of base_link end 3600.0 s before" in text
    assert "or two clocks disagree" in text
    scene.discover()
    scene.next_list()
    assert scene.tags() == {"5": 4}, "with the one that waited"


def test_an_old_transform_places_no_new_sighting(
    make_node: MakeNode, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A detector that goes on, beside transforms that do not: the robot has driven on meanwhile."""
    scene = Scene(make_node)
    scene.discover()
    monkeypatch.setattr(sightings, "LATE_S", 0.1)
    scene.wait(0.2)
    scene.see(5, times=6)
    scene.next_list()
    assert scene.tags() == {"5": 3}
    (text,) = scene.log.warnings
    assert "none can be placed: the transforms of tag_5, base_link, odom have ceased; " in text
    scene.place(5)
    scene.next_list()
    assert scene.tags() == {"5": 4}, "with the one that waited"


def test_a_tag_is_confirmed_while_it_is_in_sight(make_node: MakeNode) -> None:
    scene = Scene(make_node, "-p", "freshness_s:=0.2")
    unknown = scene.confirm("5")
    assert (unknown.detected, unknown.error_message) == (False, "tag '5' not discovered")
    assert unknown.tag_pose_in_map.orientation.w == 0.0
    scene.discover()
    found = scene.confirm("5")
    assert (found.detected, found.detection_confidence, found.error_message) == (True, 1.0, "")
    assert found.tag_pose_in_map.position.x == pytest.approx(2.0)
    scene.wait(0.3)
    stale = scene.confirm("5")
    assert (stale.detected, stale.error_message) == (
        False,
        "tag '5' stale: last seen 0.3 s ago, allowed 0.2 s",
    )


# --- flowers


def test_flowers_of_the_scanned_tag_are_told_in_their_box(make_node: MakeNode) -> None:
    scene = Scene(make_node)
    scene.mission("MONITORING", "SCANNING", "5")
    scene.discover()
    scene.flowers(("tulip_red", 0.9, -0.8), ("tulip_pink", 0.6, 0.8), ("bug", 0.7, 0.8))
    told = scene.told(1)
    assert (told.kind, told.status) == (Observation.KIND_FLOWER, Observation.STATUS_OK)
    assert (told.mission_id, told.source, told.header.frame_id) == ("m1", "perception_aggregator", "map")
    assert told.tag_pose_in_map.position.x == pytest.approx(2.0)
    bed = told.flower
    assert (bed.tag_id, bed.species, bed.anomaly) == ("5", "tulip_red", True)
    assert bed.confidence == pytest.approx(0.9)
    assert (bed.pose.header.frame_id, bed.pose.pose) == ("map", told.tag_pose_in_map)
    corners = [(point.x, point.y) for point in bed.box_footprint.points]
    assert corners == [pytest.approx(c) for c in ((2.0, 0.4), (2.0, -0.4), (1.6, -0.4), (1.6, 0.4))]
    left, right = bed.flowers
    assert (left.species, left.anomaly, right.species, right.anomaly) == (
        "tulip_red",
        False,
        "tulip_pink",
        True,
    )
    assert left.position.y < 0.0 < right.position.y
    assert all(1.6 < bloom.position.x < 2.0 and bloom.position.z == 0.0 for bloom in bed.flowers)
    (tag,) = scene.next_list().tags
    assert (tag.species, tag.anomaly) == ("tulip_red", True)
    assert tag.species_confidence == pytest.approx(0.9)


def test_what_the_classifier_is_unsure_of_is_not_told(make_node: MakeNode) -> None:
    """War story 52: whatever filled the picture was a white tulip."""
    scene = Scene(make_node)
    scene.mission("MONITORING", "SCANNING", "5")
    scene.discover()
    scene.flowers(("tulip_white", 0.34, 0.0))
    scene.next_list()
    assert scene.observations == []
    scene.flowers(("tulip_red", 0.36, 0.0), ("tulip_white", 0.34, 0.1))
    bed = scene.told(1).flower
    assert (bed.species, [bloom.species for bloom in bed.flowers]) == ("tulip_red", ["tulip_red"])


def test_what_is_told_again_is_news(make_node: MakeNode) -> None:
    scene = Scene(make_node)
    scene.mission("MONITORING", "SCANNING", "5")
    scene.discover()
    for _ in range(3):
        scene.flowers(RED)
    scene.told(1)
    scene.flowers(RED, BUG)
    assert scene.told(2).flower.anomaly


def test_a_pest_of_the_last_pot_is_not_told_of_the_next(make_node: MakeNode) -> None:
    """War story 51."""
    scene = Scene(make_node)
    scene.mission("MONITORING", "SCANNING", "5")
    scene.discover(5)
    scene.discover(6)
    scene.flowers(RED, BUG)
    scene.mission("MONITORING", "NAVIGATING", "6")
    scene.flowers(RED, BUG)
    scene.mission("MONITORING", "SCANNING", "6")
    scene.flowers(("tulip_white", 0.7, 0.0))
    second = scene.told(2)
    assert (second.flower.tag_id, second.flower.species, second.flower.anomaly) == ("6", "tulip_white", False)


def test_what_comes_late_is_of_no_scan_and_no_find_beside_one(make_node: MakeNode) -> None:
    """A detection has no stamp: what was seen at the last pot looks like the next one's if it comes late."""
    scene = Scene(make_node, "-p", "detection_delay_s:=0.3", "-p", "tag_in_sight_s:=0.2")
    scene.mission("MONITORING", "SCANNING", "5")
    scene.discover(5)
    scene.discover(6)
    scene.now = 0.3
    scene.flowers(RED)
    assert scene.told(1).flower.tag_id == "5"
    scene.mission("MONITORING", "SCANNING", "6")
    scene.now = 0.5
    scene.flowers(RED, BUG)
    scene.now = 0.6
    scene.flowers(("tulip_white", 0.7, 0.0))
    second = scene.told(2).flower
    assert (second.tag_id, second.species, second.anomaly) == ("6", "tulip_white", False)
    scene.mission("MONITORING", "NAVIGATING", "5")
    scene.now = 0.8
    for _ in range(3):
        scene.flowers(BUG)
    scene.told(2)
    scene.now = 0.9
    for _ in range(3):
        scene.flowers(BUG)
    assert scene.told(3).kind == Observation.KIND_ANOMALY


def test_each_visit_tells_anew(make_node: MakeNode) -> None:
    scene = Scene(make_node)
    scene.discover()
    for count in (1, 2):
        scene.mission("MONITORING", "SCANNING", "5")
        if count == 1:
            scene.discover()  # the mission has begun with none
        scene.flowers(RED)
        assert scene.told(count).flower.tag_id == "5"
        scene.mission("MONITORING", "NAVIGATING", "5")


def test_a_box_that_turns_out_to_be_elsewhere_is_told_again(make_node: MakeNode) -> None:
    """War story 53: the overlay stayed where the first, distant view had put it."""
    scene = Scene(make_node)
    scene.mission("MONITORING", "SCANNING", "5")
    scene.place(5, x=2.0)
    scene.see(5, dist=2.0, times=3)
    scene.flowers(RED)
    scene.told(1)
    scene.place(5, x=2.2)
    scene.see(5, dist=0.5)
    scene.flowers(RED)
    assert scene.told(2).flower.box_footprint.points[0].x == pytest.approx(2.2)


def test_a_neighbours_flowers_are_left_out_by_the_arms_pan(make_node: MakeNode) -> None:
    """War story 50. The box is told by another node, in either of two forms."""
    scene = Scene(make_node, "-p", "register_layout:=false")
    scene.mission("MONITORING", "SCANNING", "5")
    scene.discover()
    scene.tell_boxes('{"boxes": [{"box_id": 5, "x": 1.875, "y": 0, "yaw": 0, "width": 1.1, "depth": 0.25}]}')
    strange = JointState(name=["wrist", "shoulder_pan_joint"], position=[0.3, math.nan])
    pan = JointState(name=["wrist", "shoulder_pan_joint"], position=[0.3, 1.6])
    scene.send(scene.joints, pan)
    scene.send(scene.joints, strange)
    scene.flowers(RED, BUG)
    scene.next_list()
    assert scene.observations == []
    scene.send(scene.joints, JointState(name=["shoulder_pan_joint"], position=[0.0]))
    scene.flowers(RED)
    told = scene.told(1).flower
    assert not told.anomaly
    corners = [(point.x, point.y) for point in told.box_footprint.points]
    assert corners == [pytest.approx(c) for c in ((2.0, 0.55), (2.0, -0.55), (1.75, -0.55), (1.75, 0.55))]


def test_hostile_boxes_are_told_once_and_change_nothing(make_node: MakeNode) -> None:
    scene = Scene(make_node, "-p", "register_layout:=false")
    bad = ["{", "{}", '[{"id": "5"}]', '[{"id": "5", "x": NaN, "y": 0, "yaw": 0, "width": 1, "depth": 1}]']
    bad.append('[{"id": "5", "x": 0, "y": 0, "yaw": 0, "width": -1, "depth": 1}]')
    for text in [*bad, *bad]:
        scene.tell_boxes(text)
    assert scene.log.warnings == [
        f"/perception/box_geometry_json: {reason}"
        for reason in (
            "no JSON",
            "no list",
            "a box has no id, or x, y, yaw, width and depth are not all finite numbers",
            "a box has no area",
        )
    ]
    scene.mission("MONITORING", "SCANNING", "5")
    scene.discover()
    scene.flowers(RED)
    assert len(scene.told(1).flower.box_footprint.points) == 4, "the box behind the tag"


def test_a_scanned_tag_that_lies_on_its_back_has_flowers_but_no_box(make_node: MakeNode) -> None:
    scene = Scene(make_node)
    scene.mission("INSPECTING", "SCANNING", "5")
    scene.place(5, q=FLAT)
    scene.see(5, times=3)
    scene.flowers(RED)
    bed = scene.told(1).flower
    assert (bed.species, list(bed.flowers), list(bed.box_footprint.points)) == ("tulip_red", [], [])


def test_flowers_seen_before_their_tag_is_discovered_are_told_as_soon_as_it_is(make_node: MakeNode) -> None:
    scene = Scene(make_node)
    scene.mission("INSPECTING", "SCANNING", "5")
    scene.flowers(RED)
    assert scene.next_list().tags == []
    assert scene.observations == []
    scene.discover()
    assert scene.told(1).flower.species == "tulip_red", "without a further frame: there may be none"


def test_while_the_robot_drives_flowers_belong_to_nobody(make_node: MakeNode) -> None:
    scene = Scene(make_node)
    scene.mission("EXPLORING", "", "5")
    scene.discover()
    scene.flowers(RED)
    scene.next_list()
    assert scene.observations == []


@pytest.mark.parametrize(("idle", "count"), [("true", 1), ("false", 0)])
def test_without_a_mission_flowers_belong_to_the_nearest_tag_in_sight(
    make_node: MakeNode, idle: str, count: int
) -> None:
    """War story 64: an idle robot refused to see flowers."""
    scene = Scene(make_node, "-p", f"attribute_when_idle:={idle}", "-p", "tag_in_sight_s:=60.0")
    scene.mission("READY", mission_id="")
    scene.place(6)
    scene.see(6, dist=2.0, times=3)
    scene.place(5)
    scene.see(5, dist=1.0, times=3)
    scene.flowers(RED)
    scene.next_list()
    assert [told.flower.tag_id for told in scene.observations] == ["5"] * count


def test_a_node_that_has_just_begun_waits_to_hear_of_a_mission(make_node: MakeNode) -> None:
    """Started again in a mission it hears the detectors first, and would credit what is seen on the way."""
    scene = Unheard(make_node, "-p", "tag_in_sight_s:=0.1")
    scene.discover()
    scene.flowers(RED)
    scene.wait(1.0)
    for _ in range(4):
        scene.flowers(BUG)
    scene.next_list()
    assert scene.observations == []
    scene.wait(module.HEAR_S)
    scene.see(5)
    scene.flowers(RED)
    assert scene.told(1).flower.tag_id == "5"


def test_a_parked_robot_forgets_what_it_does_not_see_any_more(
    make_node: MakeNode, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A27, and the reverse: a pest that was taken away, and a night of the detector's mistakes."""
    monkeypatch.setattr(module, "IDLE_MEMORY_S", 0.1)
    scene = Scene(make_node, "-p", "tag_in_sight_s:=60.0")
    scene.discover()
    scene.flowers(RED, BUG)
    assert scene.told(1).flower.anomaly
    for _ in range(2):
        scene.wait(0.11)
        scene.flowers(RED)
    assert not scene.told(2).flower.anomaly
    scene.mission("INSPECTING", "SCANNING", "5")
    scene.discover()
    scene.flowers(RED, BUG)
    scene.told(3)
    for _ in range(3):
        scene.wait(0.11)
        scene.flowers(RED)
    assert scene.told(3).flower.anomaly, (
        "a mission's scan has an end: the arm shows one part of a box after another"
    )


def test_what_is_seen_after_a_mission_is_no_part_of_it(make_node: MakeNode) -> None:
    """Its record would otherwise change for as long as the robot stands at the dock."""
    scene = Scene(make_node, "-p", "tag_in_sight_s:=0.3")
    scene.mission("MONITORING", "SCANNING", "5")
    scene.discover()
    scene.flowers(RED)
    assert scene.told(1).mission_id == "m1"
    scene.mission("DONE")
    scene.see(5)
    scene.flowers(RED, BUG)
    assert (scene.told(2).kind, scene.told(2).mission_id) == (Observation.KIND_FLOWER, "")
    scene.wait(0.4)
    scene.place(6)
    for _ in range(3):
        scene.flowers(BUG)
    assert (scene.told(3).kind, scene.told(3).mission_id) == (Observation.KIND_ANOMALY, "")


def test_a_robot_between_two_tags_does_not_tell_of_one_and_the_other_in_turn(make_node: MakeNode) -> None:
    """Distances are noisy; a scan that begins anew with each frame would fill the topic with old news."""
    scene = Scene(make_node, "-p", "tag_in_sight_s:=60.0")
    scene.discover(5)
    scene.discover(6)
    for here, there in ((1.0, 1.02), (1.02, 1.0), (1.0, 1.02), (1.02, 1.0)):
        scene.see(5, dist=here)
        scene.see(6, dist=there)
        scene.flowers(RED)
    assert scene.told(1).flower.tag_id == "5"
    scene.see(6, dist=0.8)
    scene.flowers(RED)
    assert scene.told(2).flower.tag_id == "6"


def test_a_mission_that_went_silent_is_none(make_node: MakeNode) -> None:
    """A killed orchestrator must not leave its last target to collect flowers for ever."""
    scene = Scene(make_node, "-p", "mission_freshness_s:=0.5", "-p", "attribute_when_idle:=false")
    scene.mission("MONITORING", "SCANNING", "5")
    scene.discover()
    scene.wait(0.6)
    scene.flowers(RED)
    scene.next_list()
    assert scene.observations == []


# --- pests at no tag


def test_a_pest_where_no_tag_is_in_sight_is_a_report_of_its_own(make_node: MakeNode) -> None:
    scene = Scene(make_node)
    scene.mission("EXPLORING")
    scene.place(5, robot=3.5)
    for _ in range(4):
        scene.flowers(RED, BUG)
    told = scene.told(1)
    assert (told.kind, told.status, told.mission_id) == (
        Observation.KIND_ANOMALY,
        Observation.STATUS_OK,
        "m1",
    )
    report = told.anomaly
    assert (report.pose.header.frame_id, report.pose.pose.position.x) == ("map", pytest.approx(3.5))
    assert (report.description, report.severity) == (
        "bug seen where no tag is in sight (confidence 0.80)",
        1,
    )
    assert told.tag_pose_in_map.orientation.w == 0.0, "there is no tag"
    scene.mission("EXPLORING", mission_id="m2")
    for _ in range(3):
        scene.flowers(BUG)
    assert scene.told(2).mission_id == "m2"


def test_where_a_robot_was_a_while_ago_is_no_place_for_a_pest(
    make_node: MakeNode, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its localizer or its base has died: the report waits until somebody says again where it is."""
    monkeypatch.setattr(sightings, "LATE_S", 0.1)
    scene = Scene(make_node)
    scene.mission("EXPLORING")
    scene.place(5, robot=3.5)
    scene.wait(0.2)
    for _ in range(4):
        scene.flowers(BUG)
    scene.next_list()
    assert scene.observations == []
    scene.place(5, robot=2.5)
    scene.flowers(BUG)
    assert scene.told(1).anomaly.pose.pose.position.x == pytest.approx(2.5)


def test_a_pest_beside_a_tag_in_sight_waits_for_the_scan(make_node: MakeNode) -> None:
    scene = Scene(make_node, "-p", "tag_in_sight_s:=60.0")
    scene.mission("EXPLORING")
    scene.discover()
    for _ in range(4):
        scene.flowers(BUG)
    scene.next_list()
    assert scene.observations == []


# --- bad input


def test_hostile_frames_are_told_once_and_left_out(make_node: MakeNode) -> None:
    scene = Scene(make_node)
    scene.mission("MONITORING", "SCANNING", "5")
    scene.discover()
    bad = ["[{", "null", "[" * 50_000, "x" * 300_000, '[{"id": 5, "dist": NaN}]', "[7]"]
    for text in [*bad, *bad]:
        scene.send(scene.tag_frames, String(data=text))
        scene.raw_flowers(text.replace('"id"', '"class"'))
    tags = [text for text in scene.log.warnings if text.startswith("/camera/tag_detections_json: ")]
    flowers = [text for text in scene.log.warnings if text.startswith("/yolo/detections: ")]
    assert tags == [
        f"/camera/tag_detections_json: {reason}"
        for reason in (
            "no JSON",
            "no list",
            "more than 262144 characters",
            "a dist is no finite number",
            "an entry is no object",
        )
    ]
    assert len(flowers) == len(set(flowers)) == 6
    scene.next_list()
    assert scene.tags() == {"5": 3}
    assert scene.observations == []
    scene.flowers(RED)
    assert scene.told(1).flower.species == "tulip_red"


def test_transforms_without_numbers_are_left_out_and_told_once(make_node: MakeNode) -> None:
    scene = Scene(make_node)
    for _ in range(2):
        scene.place(5, x=math.nan)
        scene.place(5, q=(0.0, 0.0, 0.0, 0.0))
    assert scene.log.warnings == ["/tf: a transform without a finite place and rotation left out"]
    scene.see(5, times=3)
    assert scene.next_list().tags == []


@pytest.mark.parametrize(
    "wanted", ["", "x" * 100_000, "../../etc/passwd", "5\n", "-5", "NaN", "\u0665", "tag_5"]
)
def test_a_strange_tag_is_not_confirmed_and_the_answer_says_so_briefly(
    make_node: MakeNode, wanted: str
) -> None:
    scene = Scene(make_node)
    scene.discover()
    answer = scene.confirm(wanted)
    assert (answer.detected, answer.detection_confidence) == (False, 0.0)
    assert answer.error_message == f"tag {shortened(wanted)!r} not discovered"
    assert answer.tag_pose_in_map.orientation.w == 0.0
    assert scene.confirm("5").detected


def test_more_tags_than_there_is_room_for_are_told_once(
    make_node: MakeNode, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("lupin_perception.registry.MAX_TAGS", 1)
    monkeypatch.setattr(module, "MAX_TAGS", 1)
    scene = Scene(make_node)
    scene.discover(5)
    scene.discover(6)
    scene.next_list()
    assert scene.tags() == {"5": 3}
    assert scene.log.warnings == ["more than 1 tags; further ones left out"]


def test_a_pest_that_is_none_of_the_classes_ends_the_node_with_what_to_do(make_node: MakeNode) -> None:
    arguments = ["--ros-args", "-p", "anomaly_class_name:=tulip_rad"]
    with pytest.raises(LupinError, match="no 'tulip_rad' in flower_class_names; did you mean 'tulip_red'"):
        Aggregator(make_node(NAME, arguments, PARAMETERS))
