"""The simulated robot over real DDS: what the engine's navigation client and a test operator see."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import pytest
from action_msgs.srv import CancelGoal
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped
from nav2_msgs.action import NavigateToPose
from nav_msgs.msg import OccupancyGrid, Path
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters
from sensor_msgs.msg import BatteryState
from std_msgs.msg import Bool, String
from tf2_msgs.msg import TFMessage

from lupin_engine.errors import LupinError
from lupin_msgs.msg import MissionState
from lupin_ros.adapter.node import Goal, GoalCallbacks, Qos, RosNode
from lupin_sim.detector import CLASSES, blooms_of
from lupin_sim.node import PARAMETERS, SimNode
from lupin_sim.node.senses import PUBLISH_S
from lupin_sim.robot import FloorPose
from tests.lupin_ros.helpers import PATIENCE, spin_until

MakeNode = Callable[..., RosNode]

#: Where the cameras tell their frames.
TAGS, FLOWERS = "/camera/tag_detections_json", "/yolo/detections"
#: Fast, so that no test waits for wheels.
FAST = ["-p", "speed:=10.0"]


class Drive:
    """A goal sent to the simulated robot, and what came back."""

    def __init__(self) -> None:
        self.accepted = self.rejected = False
        self.feedback: list[Any] = []
        self.ended: list[tuple[int, int, str]] = []
        self.goal: Goal | None = None

    @property
    def over(self) -> bool:
        return self.rejected or bool(self.ended)


class Scene:
    """The simulated robot and an observer."""

    def __init__(self, make_node: MakeNode, *arguments: str) -> None:
        self.robot = make_node("lupin_sim", ["--ros-args", *FAST, *arguments], PARAMETERS)
        self.node = SimNode(self.robot)
        self.observer = make_node("observer")
        self.poses: list[Any] = []
        self.batteries: list[Any] = []
        self.estops: list[bool] = []
        self.transforms: list[Any] = []
        self.observer.subscribe(PoseWithCovarianceStamped, "/amcl_pose", Qos.LATCHED, self.poses.append)
        self.observer.subscribe(BatteryState, "/io/power/power_watcher", Qos.EVENT, self.batteries.append)
        self.observer.subscribe(Bool, "/e_stop_state", Qos.EVENT, lambda m: self.estops.append(m.data))
        self.observer.subscribe(TFMessage, "/tf", Qos.EVENT, self.transforms.append)
        self.navigation = self.observer.action(NavigateToPose, "navigate_to_pose")
        self.setter = self.observer.service(SetParameters, "/lupin_sim/set_parameters")
        self.until(lambda: self.navigation.ready() and self.setter.ready())

    def until(self, condition: Callable[[], Any], what: str = "") -> None:
        spin_until([self.robot, self.observer], condition, what=what)

    def drive(self, x: float, y: float, frame: str = "map") -> Drive:
        """Send a goal and wait until it is taken or refused."""
        drive, request = Drive(), NavigateToPose.Goal()
        request.pose.header.frame_id = frame
        request.pose.pose.position.x, request.pose.pose.position.y = x, y
        request.pose.pose.orientation.w = 1.0
        drive.goal = self.navigation.send(
            request,
            GoalCallbacks(
                accepted=lambda: setattr(drive, "accepted", True),
                feedback=drive.feedback.append,
                ended=lambda status, r: drive.ended.append((status, r.error_code, r.error_msg)),
                rejected=lambda: setattr(drive, "rejected", True),
            ),
        )
        self.until(lambda: drive.accepted or drive.rejected)
        return drive

    def end_of(self, drive: Drive) -> int:
        """Wait for the end of a drive; returns its status, 0 when it was rejected."""
        self.until(lambda: drive.over)
        return drive.ended[0][0] if drive.ended else 0

    def set(self, **values: Any) -> list[Any]:
        """Set parameters over the plain parameter service; returns the results."""
        kinds = {
            bool: (ParameterType.PARAMETER_BOOL, "bool_value"),
            int: (ParameterType.PARAMETER_INTEGER, "integer_value"),
            float: (ParameterType.PARAMETER_DOUBLE, "double_value"),
            str: (ParameterType.PARAMETER_STRING, "string_value"),
        }
        request, answers = SetParameters.Request(), []
        for name, value in values.items():
            kind, slot = kinds[type(value)]
            request.parameters.append(Parameter(name=name, value=ParameterValue(type=kind, **{slot: value})))
        self.setter.call(request, PATIENCE, answers.append)
        self.until(lambda: answers, "an answer")
        return list(answers[0].results)

    @property
    def place(self) -> tuple[float, float]:
        position = self.poses[-1].pose.pose.position
        return position.x, position.y


def test_a_standing_robot_tells_where_and_how_it_is(make_node: MakeNode) -> None:
    scene = Scene(make_node, "-p", "battery:=0.75")
    scene.until(lambda: scene.poses and scene.batteries and scene.estops and scene.transforms)
    pose = scene.poses[-1]
    assert scene.place == (0.5, 0.5)
    assert pose.header.frame_id == "map"
    variances = [pose.pose.covariance[axis * 7] for axis in range(6)]
    assert [variances[axis] for axis in (0, 1, 5)] == [0.01] * 3
    assert min(variances[2:5]) > 100.0
    battery = scene.batteries[-1]
    assert (battery.percentage, battery.power_supply_status) == (
        0.75,
        BatteryState.POWER_SUPPLY_STATUS_DISCHARGING,
    )
    assert battery.voltage == pytest.approx(11.7)
    assert battery.current < 0.0, "as long as it discharges"
    fields = battery.get_fields_and_field_types()
    numbers = {name: getattr(battery, name) for name, kind in fields.items() if kind == "float"}
    assert all(map(math.isfinite, numbers.values())), numbers
    assert scene.estops[-1] is False
    frames = [(t.header.frame_id, t.child_frame_id) for t in scene.transforms[-1].transforms]
    assert frames[:2] == [("map", "odom"), ("odom", "base_link")]
    assert not scene.node._moving.running


def test_the_robot_drives_to_a_goal_and_knows_where_it_is(make_node: MakeNode) -> None:
    scene = Scene(make_node, "-p", "speed:=0.5")
    drive = scene.drive(0.6, 7.5)
    scene.until(lambda: len(drive.feedback) >= 2, "two words on the way")
    scene.set(speed=10.0)
    assert scene.end_of(drive) == 4
    scene.until(lambda: scene.place == (0.6, 7.5))
    remaining = [f.distance_remaining for f in drive.feedback]
    assert remaining == sorted(remaining, reverse=True)
    assert drive.feedback[-1].navigation_time.nanosec > 0
    assert not scene.node._moving.running


def test_a_new_goal_aborts_the_old_one(make_node: MakeNode) -> None:
    scene = Scene(make_node, "-p", "speed:=0.5")
    old = scene.drive(0.6, 7.5)
    scene.set(speed=10)  # an integer for a number
    new = scene.drive(0.5, 3.0)
    assert scene.end_of(old) == 6
    assert scene.end_of(new) == 4


def test_a_cancelled_goal_ends_and_the_robot_stands(make_node: MakeNode) -> None:
    scene = Scene(make_node, "-p", "speed:=0.2")
    drive = scene.drive(0.6, 7.5)
    scene.until(lambda: scene.node._robot.pose.y > 0.6)
    assert drive.goal is not None
    drive.goal.cancel()
    assert scene.end_of(drive) == 5
    assert scene.node._robot.arrived
    assert 0.5 < scene.node._robot.pose.y < 3.0


def test_a_place_without_a_path_is_aborted(make_node: MakeNode) -> None:
    scene = Scene(make_node)
    drive = scene.drive(-3.0, 0.0)
    assert scene.end_of(drive) == 6
    assert drive.ended[0][1:] == (208, "no path")


@pytest.mark.parametrize(("x", "frame"), [(math.nan, "map"), (1.0, "odom")])
def test_a_goal_that_is_no_pose_in_map_is_rejected(make_node: MakeNode, x: float, frame: str) -> None:
    assert Scene(make_node).drive(x, 1.0, frame).rejected


def test_counted_faults_hit_the_next_goals_only(make_node: MakeNode) -> None:
    scene = Scene(make_node)
    scene.set(fault_count=1, fault="reject")
    assert scene.drive(0.5, 1.0).rejected
    scene.until(lambda: scene.robot.parameters()["fault"] == "none")
    assert scene.end_of(scene.drive(0.5, 1.0)) == 4
    scene.set(fault="abort")
    assert scene.end_of(scene.drive(0.5, 1.5)) == 6
    assert scene.end_of(scene.drive(0.5, 1.5)) == 4


def test_a_running_goal_can_be_aborted(make_node: MakeNode) -> None:
    scene = Scene(make_node, "-p", "speed:=0.2")
    drive = scene.drive(0.6, 7.5)
    scene.set(fault="abort")
    assert scene.end_of(drive) == 6
    assert scene.end_of(scene.drive(0.6, 7.5)) == 6


def test_a_stalled_robot_keeps_its_goal_until_the_fault_is_lifted(make_node: MakeNode) -> None:
    scene = Scene(make_node, "-p", "fault:=stall")
    drive = scene.drive(0.6, 7.5)
    scene.until(lambda: len(drive.feedback) >= 3)
    assert {f.distance_remaining for f in drive.feedback} == {drive.feedback[0].distance_remaining}
    scene.set(fault="none")
    assert scene.end_of(drive) == 4


def test_a_goal_whose_cancel_is_refused_is_driven_to_its_end(make_node: MakeNode) -> None:
    scene = Scene(make_node, "-p", "fault:=refuse_cancel", "-p", "speed:=0.5")
    drive = scene.drive(0.5, 1.0)
    scene.until(lambda: drive.feedback)
    drive.goal.cancel()
    assert scene.end_of(drive) == 4


def test_lost_localization_freezes_the_pose_and_its_variance_grows(make_node: MakeNode) -> None:
    scene = Scene(make_node)
    scene.until(lambda: scene.poses)
    scene.set(fault="lose_localization")
    assert scene.end_of(scene.drive(0.5, 2.0)) == 4
    scene.until(lambda: scene.poses[-1].pose.covariance[0] == 4.0)
    assert scene.place == (0.5, 0.5)
    assert "odom" not in [t.child_frame_id for t in scene.transforms[-1].transforms]
    scene.set(fault="none")
    scene.until(lambda: scene.poses[-1].pose.covariance[0] == 0.01)
    assert scene.place == (0.5, 2.0)


def test_both_emergency_stops_hold_the_robot(make_node: MakeNode) -> None:
    scene = Scene(make_node)
    hmi = scene.observer.publisher(Bool, "/lupin/hmi/estop", Qos.EVENT)
    scene.until(lambda: hmi.get_subscription_count() == 1)
    hmi.publish(Bool(data=True))
    scene.until(lambda: scene.estops and scene.estops[-1])
    scene.set(estop=True)
    hmi.publish(Bool(data=False))
    scene.until(lambda: not scene.node._stops.engaged)
    drive = scene.drive(0.5, 1.0)
    scene.until(lambda: len(drive.feedback) >= 2)
    assert not drive.over
    assert scene.place == (0.5, 0.5)
    scene.set(estop=False)
    assert scene.end_of(drive) == 4
    scene.until(lambda: not scene.estops[-1])


def test_the_battery_drains_and_can_be_set(make_node: MakeNode) -> None:
    scene = Scene(make_node, "-p", "drain_per_s:=0.1")
    scene.until(lambda: scene.batteries and scene.batteries[-1].percentage < 1.0)
    scene.set(battery=0.1)
    scene.until(lambda: scene.batteries[-1].percentage <= 0.1)


def test_bad_settings_are_refused(make_node: MakeNode) -> None:
    scene = Scene(make_node)
    assert "expected one of none, reject, abort" in scene.set(fault="explode")[0].reason
    assert "out of range" in scene.set(battery=2.0)[0].reason
    assert "read at the start" in scene.set(tag_locations_file="x")[0].reason
    with pytest.raises(LupinError, match="parameter 'fault': expected one of"):
        SimNode(make_node("other", ["--ros-args", "-p", "fault:=explode"], PARAMETERS))


# --- what displays show and ask


class Clicked(Scene):
    """The same, with a display that shows the way and lets somebody click on the map."""

    def __init__(self, make_node: MakeNode, *arguments: str) -> None:
        super().__init__(make_node, *arguments)
        self.plans: list[Any] = []
        self.observer.subscribe(Path, "/plan", Qos.LATCHED, self.plans.append)
        self.clicks = self.observer.publisher(PoseStamped, "/goal_pose", Qos.EVENT)
        self.cancel_all = self.observer.service(CancelGoal, "/navigate_to_pose/_action/cancel_goal")
        self.until(lambda: self.clicks.get_subscription_count() == 1 and self.cancel_all.ready())
        self.until(lambda: self.poses)

    def click(self, x: float, y: float) -> None:
        pose = PoseStamped()
        pose.header.frame_id = "map"
        pose.pose.position.x, pose.pose.position.y = x, y
        pose.pose.orientation.w = 1.0
        self.clicks.publish(pose)


def test_a_click_on_the_map_drives_the_robot_and_the_plan_shows_how(make_node: MakeNode) -> None:
    scene = Clicked(make_node, "-p", "speed:=0.1", "-p", "start_pose:=[0.5, 0.5, 1.5708]")
    scene.click(0.5, 1.5)
    scene.until(lambda: len(scene.plans) >= 2, "a second plan, on the way")
    first, last = scene.plans[:2]
    assert first.header.frame_id == "map"
    places = [(p.pose.position.x, p.pose.position.y) for p in first.poses]
    assert places == [(0.5, 0.5), (0.5, 1.5)]
    # It heads along the way, and ends as the click said.
    headings = [2.0 * math.atan2(p.pose.orientation.z, p.pose.orientation.w) for p in first.poses]
    assert headings == pytest.approx([math.pi / 2, 0.0])
    late: list[Any] = []
    scene.observer.subscribe(Path, "/plan", Qos.LATCHED, late.append)
    scene.until(lambda: late, "the plan, by a page that is opened on the way")
    # Told again while it drives: of what is left.
    assert last.poses[0].pose.position.y > 0.5
    assert last.poses[-1].pose.position.y == 1.5
    scene.set(speed=10.0)
    scene.until(lambda: scene.place == (0.5, 1.5), "there")


def test_a_click_is_a_goal_like_any_other(make_node: MakeNode) -> None:
    """One that is no place moves nothing; whoever cancels all goals ends it; a new goal takes its place."""
    scene = Clicked(make_node, "-p", "speed:=0.02")
    scene.click(math.nan, 1.0)
    scene.click(0.5, 1.5)
    scene.until(lambda: scene.plans, "under way")
    answers: list[Any] = []
    scene.cancel_all.call(CancelGoal.Request(), PATIENCE, answers.append)
    scene.until(lambda: answers and scene.node._goal is None, "cancelled")
    assert len(answers[0].goals_canceling) == 1
    assert scene.place[1] < 1.5
    scene.click(0.5, 1.5)
    scene.until(lambda: scene.node._goal is not None, "under way again")
    back = scene.drive(0.5, 0.5)
    scene.set(speed=10.0)
    assert scene.end_of(back) == 4
    assert scene.place == (0.5, 0.5)


def test_a_stop_ends_the_drive_to_a_click(make_node: MakeNode, capfd: pytest.CaptureFixture[str]) -> None:
    """Letting go of it moves nothing, nor does a click while it is engaged; a later one does."""
    scene = Clicked(make_node, "-p", "speed:=0.1")
    scene.click(0.5, 1.5)
    scene.until(lambda: scene.plans, "under way")
    scene.set(estop=True)
    scene.until(lambda: scene.node._goal is None, "the end of the drive")
    rest = scene.place
    scene.click(0.5, 1.5)
    told: list[str] = []
    scene.until(lambda: told.extend(capfd.readouterr()) or "click while the stop" in "".join(told), "no")
    scene.set(estop=False, speed=10.0)
    back = scene.drive(0.5, 0.5)
    assert scene.end_of(back) == 4
    assert scene.place == (0.5, 0.5)
    assert rest[1] < 1.5
    plans = len(scene.plans)
    scene.click(0.5, 1.5)
    scene.until(lambda: scene.place == (0.5, 1.5), "there")
    assert len(scene.plans) > plans


# --- what the robot senses


class Sensed(Scene):
    """The same, with ears for the map and the cameras, and a mission that a test tells of."""

    def __init__(self, make_node: MakeNode, *arguments: str) -> None:
        super().__init__(make_node, *arguments)
        self.maps: list[Any] = []
        self.tag_frames: list[Any] = []
        self.flower_frames: list[Any] = []
        self.observer.subscribe(OccupancyGrid, "/map", Qos.LATCHED, self.maps.append)
        self.observer.subscribe(
            String, TAGS, Qos.DETECTION, lambda m: self.tag_frames.append(json.loads(m.data))
        )
        self.observer.subscribe(
            String, FLOWERS, Qos.DETECTION, lambda m: self.flower_frames.append(json.loads(m.data))
        )
        self.states = self.observer.publisher(MissionState, "/mission/state", Qos.LATCHED)
        self.until(lambda: self.states.get_subscription_count() == 1)

    def mission(self, mission_id: str, lifecycle: str) -> None:
        self.states.publish(MissionState(mission_id=mission_id, lifecycle_state=lifecycle))

    def known(self) -> int:
        """How many cells of the last map are known."""
        return sum(1 for value in self.maps[-1].data if value != -1) if self.maps else 0


def test_the_map_is_latched_and_grows_as_the_robot_drives(make_node: MakeNode) -> None:
    scene = Sensed(make_node)
    scene.until(lambda: scene.maps)
    first = scene.maps[0]
    assert (first.header.frame_id, first.info.resolution) == ("map", pytest.approx(0.05))
    assert (first.info.width, first.info.height, len(first.data)) == (82, 162, 82 * 162)
    corner = first.info.origin.position
    assert (corner.x, corner.y, first.info.origin.orientation.w) == (-0.05, -0.05, 1.0)
    assert set(first.data) == {-1, 0, 100}
    before = scene.known()
    assert scene.end_of(scene.drive(0.6, 7.5)) == 4
    scene.until(lambda: scene.known() > 3 * before, "the left aisle is known")
    late = make_node("late")
    heard: list[Any] = []
    late.subscribe(OccupancyGrid, "/map", Qos.LATCHED, heard.append)
    spin_until([scene.robot, late], lambda: heard)
    assert len(heard[-1].data) == len(first.data)


def test_a_map_without_news_is_not_sent_again(make_node: MakeNode, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("lupin_sim.node.senses.REPUBLISH_S", math.inf)
    scene = Sensed(make_node)
    scene.until(lambda: scene.maps)
    seen = len(scene.maps)
    end = scene.observer.elapsed() + 2.2 * PUBLISH_S
    scene.until(lambda: scene.observer.elapsed() > end, "two chances to tell it")
    assert len(scene.maps) == seen


def test_a_map_without_news_is_told_again_for_those_who_hear_nothing_latched(
    make_node: MakeNode, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("lupin_sim.node.senses.REPUBLISH_S", 0.6)
    scene = Sensed(make_node)
    scene.until(lambda: len(scene.maps) >= 2, "the map once more")
    assert scene.maps[-1].data == scene.maps[-2].data


def test_the_cameras_tell_every_frame_and_the_place_of_each_tag_in_it(make_node: MakeNode) -> None:
    """In front of tag 19, which hangs on the left end of its table."""
    scene = Sensed(make_node, "-p", "start_pose:=[0.9, 0.6, 0.0]")
    scene.until(lambda: scene.tag_frames and scene.flower_frames and scene.transforms, "a frame of each")
    assert [tag["id"] for tag in scene.tag_frames[-1]] == [19]
    assert {flower["class_name"] for flower in scene.flower_frames[-1]} == {CLASSES[blooms_of("19")[0].kind]}
    chain = {t.child_frame_id: t for t in scene.transforms[-1].transforms}
    assert {name: chain[name].header.frame_id for name in ("camera_link", "tag_19")} == {
        "camera_link": "base_link",
        "tag_19": "camera_link",
    }
    assert chain["tag_19"].transform.translation.x == pytest.approx(0.6)
    assert chain["tag_19"].header.stamp == chain["base_link"].header.stamp


def test_where_other_detectors_are_the_simulated_ones_are_switched_off(make_node: MakeNode) -> None:
    scene = Sensed(make_node, "-p", "detector:=false", "-p", "start_pose:=[0.9, 0.6, 0.0]")
    scene.until(lambda: scene.maps and scene.transforms)
    assert [scene.observer.node.count_publishers(topic) for topic in (TAGS, FLOWERS)] == [0, 0]
    assert [t.child_frame_id for t in scene.transforms[-1].transforms] == ["odom", "base_link"]


def test_the_robot_leaves_to_the_aggregator_what_the_aggregator_tells(make_node: MakeNode) -> None:
    """One topic has one source."""
    scene = Sensed(make_node)
    scene.until(lambda: scene.maps)
    names = {name for name, _ in scene.observer.node.get_topic_names_and_types()}
    assert {name for name in names if name.startswith(("/perception", "/floranova"))} == set()


def test_a_pest_without_a_place_is_refused(make_node: MakeNode) -> None:
    with pytest.raises(LupinError, match="parameter 'pests': expected x and y of each place, got 3 numbers"):
        SimNode(make_node("other", ["--ros-args", "-p", "pests:=[1.0, 2.0, 3.0]"], PARAMETERS))


def test_a_fast_robot_looks_around_as_often_on_its_way_as_a_slow_one(
    make_node: MakeNode, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("lupin_sim.node.robot.LOOKS_WITHIN_S", math.inf)  # however long this machine stands
    scene = Sensed(make_node)
    looks: list[FloorPose] = []
    monkeypatch.setattr(scene.node._senses, "look", looks.append)
    assert scene.end_of(scene.drive(0.5, 7.5)) == 4
    gaps = [math.dist((a.x, a.y), (b.x, b.y)) for a, b in pairwise(looks)]
    assert looks[-1].y == 7.5
    assert max(gaps) < 0.11


def test_the_robot_has_looked_at_what_it_stands_before_when_it_says_that_it_has_arrived(
    make_node: MakeNode, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A tag counts at its third sighting, and who asks for its place does so on arrival."""
    scene = Sensed(make_node)
    looks: list[FloorPose] = []
    monkeypatch.setattr(scene.node._senses, "look", looks.append)
    drive = scene.drive(0.5, 7.5)
    scene.until(lambda: scene.node._goal is None, "arrived, by the robot's own account")
    assert looks[-3:] == [FloorPose(0.5, 7.5, 0.0)] * 3
    assert scene.end_of(drive) == 4


def test_a_new_mission_begins_with_no_map(make_node: MakeNode) -> None:
    scene = Sensed(make_node)
    scene.mission("m1", "EXPLORING")
    assert scene.end_of(scene.drive(0.5, 7.5)) == 4
    scene.until(lambda: scene.known() > 3000)
    scene.mission("m1", "DONE")
    scene.mission("", "READY")
    scene.mission("m2", "PREPARE")
    scene.until(lambda: 0 < scene.known() < 3000, "the map begins anew, from where the robot stands")
