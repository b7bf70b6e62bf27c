"""What the base's driver makes of everything that servers and sensors can do to it, without a network."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="ROS 2 is not installed here")

from action_msgs.msg import GoalInfo, GoalStatus, GoalStatusArray
from geometry_msgs.msg import PoseWithCovarianceStamped
from sensor_msgs.msg import BatteryState
from std_msgs.msg import Bool
from unique_identifier_msgs.msg import UUID

from lupin_greenhouse.stops import HMI_TOPIC, PAGES_TOPIC
from lupin_nav.goal_status import failure
from lupin_ros.adapter.action_driver import OTHERS_ASKS, OTHERS_PERIOD_S, SERVER_GRACE_S
from lupin_ros.adapter.actions import goal_id
from tests.plugins.fakes import FakeGoal
from tests.plugins.nav.bench import NavBench

SUCCEEDED, CANCELED, ABORTED = 4, 5, 6
POSE = {"x": 1.0, "y": 2.0, "yaw": math.pi / 2}
RESULT = SimpleNamespace(error_code=0, error_msg="")


def amcl(variance: float = 0.01, yaw: float = 0.0, frame: str = "map") -> PoseWithCovarianceStamped:
    message = PoseWithCovarianceStamped()
    message.header.frame_id = frame
    message.pose.pose.position.x, message.pose.pose.position.y = 3.0, 4.0
    message.pose.pose.orientation.z, message.pose.pose.orientation.w = math.sin(yaw / 2), math.cos(yaw / 2)
    message.pose.covariance[0] = variance
    message.pose.covariance[14] = 1e9  # z: left huge by every planar localizer
    return message


class Bench(NavBench):
    """What happens to the driver, in the words of these tests."""

    def pose(self, message: Any) -> None:
        self.ros.subscriptions["/amcl_pose"](message)

    def dock(self, attempt: str = "a1") -> FakeGoal:
        self.client.start(attempt, "dock", {"pose": POSE})
        return self.ros.server.goals[-1]

    def accepted_dock(self, attempt: str = "a1") -> FakeGoal:
        goal = self.dock(attempt)
        goal.accepted()
        return goal


# --- driving


def test_a_goal_is_the_pose_in_the_map_with_the_yaw_as_a_quaternion() -> None:
    sent = Bench().dock().request.pose
    assert sent.header.frame_id == "map"
    assert (sent.pose.position.x, sent.pose.position.y) == (1.0, 2.0)
    q = sent.pose.orientation
    assert (q.x, q.y, q.z, q.w) == pytest.approx((0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5)))


def test_a_drive_that_arrives_is_done() -> None:
    bench = Bench()
    bench.accepted_dock().ended(SUCCEEDED, RESULT)
    assert bench.outlet.reports == [("accepted", "a1"), ("done", "a1", {})]


def test_a_rejected_goal_has_a_code_of_its_own() -> None:
    bench = Bench()
    bench.dock().rejected()
    assert bench.outlet.reports[0][:3] == ("failed", "a1", "nav_rejected")


def test_an_aborted_goal_is_told_with_what_the_server_said() -> None:
    bench = Bench()
    bench.accepted_dock().ended(ABORTED, SimpleNamespace(error_code=204, error_msg="no path"))
    assert bench.outlet.reports[-1] == ("failed", "a1", "nav_status_6", "ABORTED, error 204: no path")


def test_every_status_is_called_as_in_its_message() -> None:
    told = {f"STATUS_{failure(status, RESULT)[1]}": status for status in range(7)}
    assert told == {name: getattr(GoalStatus, name) for name in dir(GoalStatus) if name.startswith("STATUS_")}


def test_a_cancel_that_was_asked_for_is_no_failure() -> None:
    bench = Bench()
    goal = bench.accepted_dock()
    bench.client.cancel("a1")
    goal.ended(CANCELED, RESULT)
    assert goal.cancels == 1
    assert bench.outlet.kinds("a1") == ["accepted", "cancelled"]


def test_a_cancel_that_nobody_asked_for_is_a_failure() -> None:
    bench = Bench()
    bench.accepted_dock().ended(CANCELED, RESULT)
    assert bench.outlet.reports[-1] == ("failed", "a1", "nav_status_5", "CANCELED")


@pytest.mark.parametrize(("status", "kind"), [(SUCCEEDED, "done"), (ABORTED, "failed")])
def test_a_goal_that_ends_while_it_is_cancelled_is_told_as_it_ended(status: int, kind: str) -> None:
    bench = Bench()
    goal = bench.accepted_dock()
    bench.client.cancel("a1")
    goal.ended(status, RESULT)
    assert bench.outlet.kinds("a1") == ["accepted", kind]


def test_an_attempt_cancelled_before_its_acceptance_reports_it_and_can_be_cancelled_again() -> None:
    bench = Bench()
    goal = bench.dock()
    bench.client.cancel("a1")
    assert bench.outlet.reports == []
    goal.accepted()
    bench.client.cancel("a1")
    goal.ended(CANCELED, RESULT)
    assert bench.outlet.kinds("a1") == ["accepted", "cancelled"]


def test_attempts_are_kept_apart() -> None:
    bench = Bench()
    first, second = bench.accepted_dock("a1"), bench.accepted_dock("a2")
    bench.client.cancel("a1")
    assert (first.cancels, second.cancels) == (1, 0)
    first.ended(CANCELED, RESULT)
    second.ended(SUCCEEDED, RESULT)
    assert bench.outlet.kinds("a1") == ["accepted", "cancelled"]
    assert bench.outlet.kinds("a2") == ["accepted", "done"]


def test_feedback_becomes_progress_when_it_says_something_new() -> None:
    bench = Bench()
    goal = bench.accepted_dock()
    for distance in (2.34, 2.31, 1.98):
        goal.feedback(SimpleNamespace(distance_remaining=distance, number_of_recoveries=1))
    assert bench.outlet.reports[1:] == [
        ("progress", "a1", "2.3 m to go, 1 recoveries"),
        ("progress", "a1", "2.0 m to go, 1 recoveries"),
    ]


def test_unknown_attempts_and_words_are_told_apart() -> None:
    bench = Bench()
    bench.client.cancel("nobody")
    assert bench.outlet.reports == []
    with pytest.raises(ValueError, match="no operation 'fly'"):
        bench.client.start("a1", "fly", {})
    with pytest.raises(ValueError, match="no action 'fly'"):
        bench.client.act("fly", {})


# --- the server's life


def test_the_server_is_missing_until_it_can_be_reached() -> None:
    bench = Bench()
    bench.ros.server.up = False
    assert bench.client.missing() == ["action server navigate_to_pose"]
    bench.ros.server.up = True
    clearing = ["action server navigate_to_pose to cancel the goals it had"]
    assert bench.client.missing() == clearing
    assert bench.client.missing() == clearing
    (call,) = bench.ros.remote.calls  # all goals: no id, no time; asked once
    assert not any(call.request.goal_info.goal_id.uuid)
    call.done(None)
    assert bench.client.missing() == []


def test_without_a_server_nothing_is_sent() -> None:
    bench = Bench()
    bench.ros.server.up = False
    bench.client.start("a1", "dock", {"pose": POSE})
    assert bench.ros.server.goals == []
    assert bench.outlet.reports == [
        ("failed", "a1", "nav_unavailable", "action server navigate_to_pose is not there")
    ]


def test_a_server_that_stays_away_loses_the_goal_which_is_cancelled_all_the_same() -> None:
    bench = Bench()
    goal = bench.accepted_dock()
    bench.ros.server.up = False
    bench.ros.pass_time(SERVER_GRACE_S / 2)
    assert bench.outlet.kinds("a1") == ["accepted"]
    bench.ros.pass_time(SERVER_GRACE_S)
    assert bench.outlet.reports[-1] == (
        "failed",
        "a1",
        "nav_unavailable",
        "action server navigate_to_pose is gone",
    )
    assert goal.cancels == 1
    goal.ended(SUCCEEDED, RESULT)
    assert bench.outlet.kinds("a1") == ["accepted", "failed"]


def test_a_server_that_stumbles_keeps_the_goal_however_often() -> None:
    bench = Bench()
    goal = bench.accepted_dock()
    for _ in range(4):
        bench.ros.server.up = False
        bench.ros.pass_time(SERVER_GRACE_S * 0.6)
        bench.ros.server.up = True
        bench.ros.pass_time(SERVER_GRACE_S * 0.2)
    goal.ended(SUCCEEDED, RESULT)
    assert bench.outlet.kinds("a1") == ["accepted", "done"]


def test_a_goal_accepted_after_it_was_given_up_is_cancelled_by_the_driver() -> None:
    bench = Bench()
    goal = bench.dock()
    bench.ros.server.up = False
    bench.ros.pass_time(SERVER_GRACE_S * 2)
    before = goal.cancels
    goal.accepted()
    assert goal.cancels == before + 1
    assert bench.outlet.kinds("a1") == ["failed"]


def test_closing_stops_the_robot_and_reports_nothing() -> None:
    bench = Bench()
    running, waiting = bench.accepted_dock("a1"), bench.dock("a2")
    bench.client.start("a3", "localize", {"max_variance": 0.25})
    before = list(bench.outlet.reports)
    bench.client.close()
    assert running.cancels == 1
    waiting.accepted()
    assert waiting.cancels == 2  # the first one came too early for the server
    running.ended(CANCELED, RESULT)
    bench.pose(amcl())
    bench.ros.pass_time(10.0)
    assert bench.outlet.reports == before
    assert bench.outlet.values == []


# --- localization


def go_to(bench: Bench, **limit: float) -> list[tuple[Any, ...]]:
    bench.client.start("a1", "go_to", {"pose": POSE, **limit})
    return bench.outlet.reports


def test_no_drive_without_a_pose() -> None:
    failed = ("failed", "a1", "amcl_drift_var", "amcl_drift_var=unknown")
    assert go_to(Bench()) == [failed]
    assert go_to(Bench(), max_variance=0.25) == [failed]


def test_no_drive_with_an_uncertain_pose() -> None:
    bench = Bench()
    bench.pose(amcl(0.312))
    assert go_to(bench, max_variance=0.25) == [("failed", "a1", "amcl_drift_var", "amcl_drift_var=0.312")]
    assert bench.ros.server.goals == []


def test_an_uncertain_pose_does_when_no_limit_is_given() -> None:
    bench = Bench()
    bench.pose(amcl(9.0))
    bench.ros.node.publishers = 0
    assert go_to(bench) == []
    assert len(bench.ros.server.goals) == 1


def test_the_pose_of_a_dead_localizer_does_not_count() -> None:
    bench = Bench()
    bench.pose(amcl())
    bench.ros.node.publishers = 0
    assert go_to(bench, max_variance=0.25) == [("failed", "a1", "amcl_drift_var", "amcl_drift_var=unknown")]


def test_the_pose_of_a_dead_localizer_counts_where_it_is_a_seed() -> None:
    bench = Bench(changed={"amcl_pose_must_live": False})
    bench.pose(amcl())
    bench.ros.node.publishers = 0
    assert go_to(bench, max_variance=0.25) == []
    assert len(bench.ros.server.goals) == 1


def test_the_dock_has_no_gate() -> None:
    bench = Bench()
    bench.dock()
    assert bench.outlet.reports == []
    assert len(bench.ros.server.goals) == 1


def test_localize_says_what_it_waits_for_and_ends_when_it_has_it() -> None:
    bench = Bench()
    bench.client.start("a1", "localize", {"max_variance": 0.25})
    bench.ros.pass_time(1.0)
    bench.pose(amcl(0.412))
    bench.ros.node.publishers = 0
    bench.ros.pass_time(1.0)
    bench.ros.node.publishers = 1
    bench.pose(amcl(0.2))
    assert bench.outlet.reports == [
        ("accepted", "a1"),
        ("progress", "a1", "no /amcl_pose received"),
        ("progress", "a1", "variance 0.412 > 0.25"),
        ("progress", "a1", "/amcl_pose has no publisher any more"),
        ("done", "a1", {}),
    ]


def test_localize_ends_at_once_with_a_pose_that_is_good_already() -> None:
    bench = Bench()
    bench.pose(amcl())
    bench.ros.pass_time(3600.0)  # a robot that stands still hears nothing from its localizer
    bench.client.start("a1", "localize", {"max_variance": 0.25})
    assert bench.outlet.kinds("a1") == ["accepted", "done"]


def test_localize_can_be_cancelled() -> None:
    bench = Bench()
    bench.client.start("a1", "localize", {"max_variance": 0.25})
    bench.client.cancel("a1")
    bench.pose(amcl())
    assert bench.outlet.kinds("a1") == ["accepted", "cancelled"]


def test_a_pose_is_reported_as_a_record_when_it_comes() -> None:
    bench = Bench()
    bench.pose(amcl(yaw=1.0))
    ((name, value, stamp),) = bench.outlet.values
    assert (name, stamp) == ("robot.pose", bench.ros.time)
    assert value == pytest.approx({"x": 3.0, "y": 4.0, "yaw": 1.0})


@pytest.mark.parametrize("frame", ["map", "/map", ""])
def test_a_pose_in_the_map_is_taken_however_the_frame_is_spelt(frame: str) -> None:
    bench = Bench()
    bench.pose(amcl(frame=frame))
    assert len(bench.outlet.of("robot.pose")) == 1


def test_a_pose_in_another_frame_is_ignored_and_warned_about_once() -> None:
    bench = Bench()
    bench.pose(amcl(frame="odom"))
    bench.pose(amcl(frame="odom"))
    assert bench.outlet.of("robot.pose") == []
    assert [details["frame"] for _, details in bench.ros.log.warnings] == ["odom"]


def test_a_pose_that_is_no_place_is_not_reported_and_stops_the_robot_from_setting_off() -> None:
    lost, empty = amcl(), amcl()
    lost.pose.pose.position.x = math.nan
    empty.pose.pose.orientation.w = 0.0
    for message in (lost, empty):
        bench = Bench()
        bench.pose(amcl())
        bench.pose(message)
        assert len(bench.outlet.of("robot.pose")) == 1
        assert go_to(bench, max_variance=0.25)[0][3] == "amcl_drift_var=unknown"


# --- live values


def test_the_battery_is_reported_as_a_fraction_and_junk_is_not() -> None:
    bench = Bench()
    for reading in (0.8, 35.0, math.nan, -1.0, 100.0):
        bench.ros.subscriptions["/io/power/power_watcher"](BatteryState(percentage=reading))
    assert bench.outlet.of("robot.battery") == pytest.approx([0.8, 0.35, 1.0])


BATTERY, OTHER_BATTERY = "/io/power/power_watcher", "/battery"


def test_of_several_batteries_the_worst_counts_and_its_topic_is_reported() -> None:
    bench = Bench()
    for topic, reading in ((OTHER_BATTERY, 0.1), (BATTERY, 1.0), (OTHER_BATTERY, 0.6), (BATTERY, 0.5)):
        bench.ros.subscriptions[topic](BatteryState(percentage=reading))
    assert bench.outlet.of("robot.battery") == pytest.approx([0.1, 0.1, 0.6, 0.5])
    assert bench.outlet.of("robot.battery_source") == [OTHER_BATTERY, BATTERY]


def test_a_battery_that_falls_silent_is_unknown_and_reported_while_that_lasts() -> None:
    bench = Bench()
    bench.ros.subscriptions[OTHER_BATTERY](BatteryState(percentage=0.1))
    for _ in range(13):
        bench.ros.subscriptions[BATTERY](BatteryState(percentage=1.0))
        bench.ros.pass_time(2.5)
    assert bench.outlet.of("robot.battery")[-2:] == [0.1, 1.0]
    assert bench.outlet.events == [("nav.battery_silent", {"source": OTHER_BATTERY})]
    unknown = "the charge of the battery is unknown: /battery is silent"
    assert bench.ros.troubles["battery"] == unknown
    bench.ros.pass_time(30.0)
    assert bench.outlet.events[1:] == [
        ("nav.battery_silent", {"source": name}) for name in (OTHER_BATTERY, BATTERY)
    ]
    bench.ros.subscriptions[OTHER_BATTERY](BatteryState(percentage=0.3))
    assert bench.outlet.of("robot.battery")[-1] == pytest.approx(0.3)
    assert bench.ros.troubles["battery"] == f"the charge of the battery is unknown: {BATTERY} is silent"


def test_a_battery_that_falls_silent_may_count_as_empty() -> None:
    bench = Bench(changed={"silent_battery_is_empty": True})
    bench.ros.subscriptions[BATTERY](BatteryState(percentage=0.9))
    bench.ros.pass_time(32.5)
    assert bench.outlet.of("robot.battery") == pytest.approx([0.9, 0.0])
    bench.ros.subscriptions[BATTERY](BatteryState(percentage=0.9))
    assert bench.outlet.of("robot.battery")[-1] == pytest.approx(0.9)


def test_a_battery_may_be_told_as_seldom_as_it_likes() -> None:
    bench = Bench(changed={"battery_timeout_s": 0.0})
    bench.ros.subscriptions[BATTERY](BatteryState(percentage=0.5))
    bench.ros.pass_time(1000.0)
    assert bench.outlet.events == []
    assert bench.ros.timers == []


def test_the_emergency_stop_is_reported_as_it_comes() -> None:
    bench = Bench()
    for engaged in (True, True, False):
        bench.ros.subscriptions["/e_stop_state"](Bool(data=engaged))
    assert bench.outlet.of("robot.estop") == [True, False]


def test_an_emergency_stop_that_falls_silent_is_engaged() -> None:
    bench = Bench()
    for _ in range(8):
        bench.ros.subscriptions["/e_stop_state"](Bool(data=False))
        bench.ros.pass_time(0.5)
    bench.ros.pass_time(2.0)
    assert bench.outlet.of("robot.estop")[-2:] == [False, True]
    assert bench.ros.log.warnings == [("the emergency stop is silent (/e_stop_state)", {})]
    assert bench.ros.troubles["stop"] == "the emergency stop is silent (/e_stop_state)"


def test_topics_and_frame_are_those_of_the_parameters() -> None:
    changed = {"amcl_pose_topic": "/p", "estop_topic": "/e", "battery_topic": "/b", "frame_id": "hall"}
    bench = Bench(changed=changed)
    status = "navigate_to_pose/_action/status"
    assert set(bench.ros.subscriptions) == {"/p", "/e", "/b", "/battery", PAGES_TOPIC, HMI_TOPIC, status}
    assert bench.dock().request.pose.header.frame_id == "hall"


# --- goals of others


OTHER = list(range(16))
STATUS = "navigate_to_pose/_action/status"


def working(*goals: list[int]) -> GoalStatusArray:
    executing = GoalStatus.STATUS_EXECUTING
    told = [GoalStatus(goal_info=GoalInfo(goal_id=UUID(uuid=goal)), status=executing) for goal in goals]
    return GoalStatusArray(status_list=told)


def test_a_goal_of_another_client_ends_before_ours_is_sent() -> None:
    bench = Bench()
    bench.ros.subscriptions[STATUS](working(OTHER))
    bench.client.start("a1", "dock", {"pose": POSE})
    assert bench.ros.server.goals == []
    (call,) = bench.ros.remote.calls
    assert list(call.request.goal_info.goal_id.uuid) == OTHER
    bench.ros.subscriptions[STATUS](working())
    (goal,) = bench.ros.server.goals
    bench.ros.subscriptions[STATUS](working(list(goal_id("navigate_to_pose", goal.key))))
    bench.client.start("a2", "dock", {"pose": POSE})  # ours is no other's
    assert len(bench.ros.server.goals) == 2


def test_what_is_cancelled_while_it_waits_for_that_is_never_sent() -> None:
    bench = Bench()
    bench.ros.subscriptions[STATUS](working(OTHER))
    bench.client.start("a1", "dock", {"pose": POSE})
    bench.client.cancel("a1")
    bench.ros.subscriptions[STATUS](working())
    assert bench.ros.server.goals == []
    assert bench.outlet.reports == [("cancelled", "a1")]


def test_a_goal_that_does_not_end_is_replaced() -> None:
    bench = Bench()
    bench.ros.subscriptions[STATUS](working(OTHER))
    bench.client.start("a1", "dock", {"pose": POSE})
    for _ in range(OTHERS_ASKS):
        assert bench.ros.server.goals == []
        bench.ros.pass_time(OTHERS_PERIOD_S)
    assert len(bench.ros.remote.calls) == OTHERS_ASKS
    assert len(bench.ros.server.goals) == 1
