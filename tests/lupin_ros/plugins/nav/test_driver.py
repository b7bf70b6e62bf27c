"""The base's driver over real DDS, against servers that reject, abort, dawdle and die."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import pytest
from action_msgs.srv import CancelGoal
from geometry_msgs.msg import PoseWithCovarianceStamped, TransformStamped
from nav2_msgs.action import NavigateToPose
from nav_msgs.msg import OccupancyGrid
from sensor_msgs.msg import BatteryState
from std_msgs.msg import Bool
from tf2_msgs.msg import TFMessage

from lupin_nav.catalog import PLUGIN
from lupin_nav.client import NavClient
from lupin_ros.adapter.action_driver import SERVER_GRACE_S
from lupin_ros.adapter.node import Qos, RosNode, ServedGoal
from tests.lupin_ros.helpers import spin_until
from tests.lupin_ros.system.wire.wire import Asked, Base
from tests.plugins.fakes import FakeOutlet, defaults

MakeNode = Callable[..., RosNode]
POSE = {"x": 1.0, "y": 2.0, "yaw": 0.0}


class Nav2:
    """An action server that takes what it is told to take, and whose goals end when a test says so."""

    def __init__(self, node: RosNode, willing: bool = True) -> None:
        self.node = node
        self.goals: list[ServedGoal] = []
        self.cancels = 0
        node.serve_action(
            NavigateToPose,
            "navigate_to_pose",
            admit=lambda _: willing,
            started=self.goals.append,
            cancelled=self._cancel,
        )

    def _cancel(self, goal: ServedGoal) -> None:
        self.cancels += 1
        goal.cancel(NavigateToPose.Result())


@dataclass
class Rig:
    """A driver on a node of its own, and every other node that has to work meanwhile."""

    ros: RosNode
    changed: dict[str, Any] = field(default_factory=dict)
    others: list[RosNode] = field(default_factory=list)
    outlet: FakeOutlet = field(default_factory=FakeOutlet)

    def __post_init__(self) -> None:
        self.client = NavClient(self.ros, self.outlet, defaults(PLUGIN, **self.changed))

    def until(self, condition: Callable[[], Any], what: str = "") -> None:
        spin_until([self.ros, *self.others], condition, what=f"{what} {self.outlet.reports}")

    def until_reported(self, kind: str, attempt: str = "a1") -> tuple[Any, ...]:
        def found() -> list[tuple[Any, ...]]:
            return [report for report in self.outlet.reports if report[:2] == (kind, attempt)]

        self.until(found, kind)
        return found()[-1]

    def with_nav2(self, node: RosNode, willing: bool = True) -> Nav2:
        self.others.append(node)
        nav2 = Nav2(node, willing)
        self.until(lambda: not self.client.missing(), "server found")
        return nav2

    def dock(self, attempt: str = "a1") -> None:
        self.client.start(attempt, "dock", {"pose": POSE})


def covariance(variance: float) -> PoseWithCovarianceStamped:
    message = PoseWithCovarianceStamped()
    message.header.frame_id = "map"
    message.pose.covariance[35] = variance
    return message


def test_a_drive_reaches_the_server_and_is_done(make_node: MakeNode) -> None:
    rig = Rig(make_node("ours"))
    assert rig.client.missing() == ["action server navigate_to_pose"]
    nav2 = rig.with_nav2(make_node("nav2"))
    rig.dock()
    rig.until_reported("accepted")
    feedback = NavigateToPose.Feedback(distance_remaining=2.0, number_of_recoveries=1)
    nav2.goals[0].feedback(feedback)
    assert rig.until_reported("progress")[2] == "2.0 m to go, 1 recoveries"
    nav2.goals[0].succeed(NavigateToPose.Result())
    rig.until_reported("done")
    assert nav2.goals[0].request.pose.pose.position.y == 2.0


def test_goals_of_before_that_a_server_refuses_to_end_keep_the_driver_waiting(make_node: MakeNode) -> None:
    """They would go on beside ours; it is asked again."""

    class Refusing(Base):
        code, asked = CancelGoal.Response.ERROR_REJECTED, 0

        def _on_cancel(self, asked: Asked) -> None:
            self.asked += 1
            asked.answer(CancelGoal.Response(return_code=self.code))

    rig = Rig(make_node("ours"))
    rig.others.append(make_node("nav2"))
    server = Refusing(rig.others[0])
    waits = ["action server navigate_to_pose to cancel the goals it had"]
    rig.until(lambda: rig.client.missing() == waits and server.asked > 2, "asked again")
    server.code = CancelGoal.Response.ERROR_NONE
    rig.until(lambda: not rig.client.missing(), "cancelled")


def test_a_server_that_rejects(make_node: MakeNode) -> None:
    rig = Rig(make_node("ours"))
    rig.with_nav2(make_node("nav2"), willing=False)
    rig.dock()
    assert rig.until_reported("failed")[2] == "nav_rejected"
    assert rig.outlet.kinds("a1") == ["failed"]


def test_a_server_that_aborts(make_node: MakeNode) -> None:
    rig = Rig(make_node("ours"))
    nav2 = rig.with_nav2(make_node("nav2"))
    rig.dock()
    rig.until_reported("accepted")
    nav2.goals[0].abort(NavigateToPose.Result(error_code=204, error_msg="no path"))
    assert rig.until_reported("failed") == ("failed", "a1", "nav_status_6", "ABORTED, error 204: no path")


def test_a_cancel_reaches_the_server(make_node: MakeNode) -> None:
    rig = Rig(make_node("ours"))
    nav2 = rig.with_nav2(make_node("nav2"))
    rig.dock()
    rig.until_reported("accepted")
    rig.client.cancel("a1")
    rig.until_reported("cancelled")
    assert nav2.cancels == 1
    assert rig.outlet.kinds("a1") == ["accepted", "cancelled"]


def test_a_goal_accepted_after_its_cancel_is_reported_and_cancelled_then(make_node: MakeNode) -> None:
    rig = Rig(make_node("ours"))
    nav2 = rig.with_nav2(make_node("nav2"))
    rig.dock()
    rig.client.cancel("a1")  # nobody has spun since: the server cannot have taken the goal
    assert rig.outlet.reports == []
    rig.until_reported("accepted")
    rig.client.cancel("a1")
    rig.until_reported("cancelled")
    assert not nav2.goals[0].active


def test_a_server_that_dies_is_noticed(make_node: MakeNode) -> None:
    rig = Rig(make_node("ours"))
    nav2 = rig.with_nav2(make_node("nav2"))
    rig.dock()
    rig.until_reported("accepted")
    rig.others.remove(nav2.node)
    nav2.node.close()
    start = rig.ros.now()
    assert rig.until_reported("failed")[2] == "nav_unavailable"
    assert rig.ros.now() - start >= SERVER_GRACE_S - 0.2
    assert rig.client.missing() == ["action server navigate_to_pose"]


def test_a_server_that_restarts_has_lost_the_goal_and_takes_the_next(make_node: MakeNode) -> None:
    rig = Rig(make_node("ours"))
    nav2 = rig.with_nav2(make_node("nav2"))
    rig.dock()
    rig.until_reported("accepted")
    rig.others.remove(nav2.node)
    nav2.node.close()
    again = rig.with_nav2(make_node("nav2"))
    # In time the new server says that it knows no such goal; else the old one has been away for too long.
    assert rig.until_reported("failed")[2] in ("nav_status_0", "nav_unavailable")
    rig.dock("a2")
    rig.until_reported("accepted", "a2")
    again.goals[0].succeed(NavigateToPose.Result())
    rig.until_reported("done", "a2")
    assert rig.outlet.kinds("a1") == ["accepted", "failed"]


def test_closing_stops_the_robot(make_node: MakeNode) -> None:
    rig = Rig(make_node("ours"))
    nav2 = rig.with_nav2(make_node("nav2"))
    rig.dock()
    rig.until_reported("accepted")
    rig.client.close()
    rig.until(lambda: nav2.cancels == 1, "cancelled at the server")
    assert rig.outlet.kinds("a1") == ["accepted"]


def test_a_localizer_that_settles_drifts_and_dies(make_node: MakeNode) -> None:
    rig, amcl = Rig(make_node("ours")), make_node("amcl")
    nav2 = rig.with_nav2(make_node("nav2"))
    rig.others.append(amcl)
    rig.client.start("a1", "localize", {"max_variance": 0.25})
    assert rig.outlet.reports[-1] == ("progress", "a1", "no /amcl_pose received")
    poses = amcl.publisher(PoseWithCovarianceStamped, "/amcl_pose", Qos.LATCHED)
    poses.publish(covariance(0.412))
    rig.until(lambda: rig.outlet.reports[-1] == ("progress", "a1", "variance 0.412 > 0.25"))
    poses.publish(covariance(0.01))
    rig.until_reported("done")
    rig.client.start("a2", "go_to", {"pose": POSE, "max_variance": 0.25})
    rig.until_reported("accepted", "a2")
    nav2.goals[0].succeed(NavigateToPose.Result())
    rig.until_reported("done", "a2")
    poses.publish(covariance(0.312))
    rig.until(lambda: len(rig.outlet.of("robot.pose")) == 3, "third pose")
    rig.client.start("a3", "go_to", {"pose": POSE, "max_variance": 0.25})
    assert rig.outlet.reports[-1] == ("failed", "a3", "amcl_drift_var", "amcl_drift_var=0.312")
    rig.others.remove(amcl)
    amcl.close()
    rig.client.start("a4", "localize", {"max_variance": 9.0})

    def noticed() -> bool:
        return ("progress", "a4", "/amcl_pose has no publisher any more") in rig.outlet.reports

    # The graph may still show the publisher for a moment: then the attempt ended at once, and one more asks.
    def ask_again() -> bool:
        if rig.outlet.kinds("a4")[-1:] == ["done"]:
            rig.outlet.reports.clear()
            rig.client.start("a4", "localize", {"max_variance": 9.0})
        return noticed()

    rig.until(ask_again, "death of the localizer")
    rig.client.start("a5", "go_to", {"pose": POSE, "max_variance": 9.0})
    assert rig.outlet.reports[-1] == ("failed", "a5", "amcl_drift_var", "amcl_drift_var=unknown")


def test_a_pose_sent_before_we_came_is_enough_while_its_localizer_lives(make_node: MakeNode) -> None:
    amcl = make_node("amcl")
    amcl.publisher(PoseWithCovarianceStamped, "/amcl_pose", Qos.LATCHED).publish(covariance(0.01))
    rig = Rig(make_node("ours"), others=[amcl])
    rig.client.start("a1", "localize", {"max_variance": 0.25})
    rig.until_reported("done")
    assert rig.outlet.of("robot.pose") == [{"x": 0.0, "y": 0.0, "yaw": 0.0}]


def test_the_localizer_is_found_under_a_remapped_name(make_node: MakeNode) -> None:
    amcl = make_node("amcl")
    amcl.publisher(PoseWithCovarianceStamped, "/robot1/pose", Qos.LATCHED).publish(covariance(0.01))
    remapped = make_node("ours", ["--ros-args", "-r", "/amcl_pose:=/robot1/pose"])
    rig = Rig(remapped, others=[amcl])
    rig.client.start("a1", "localize", {"max_variance": 0.25})
    assert rig.outlet.reports[-1] == ("progress", "a1", "no /robot1/pose received")
    rig.until_reported("done")


def test_battery_and_emergency_stop_arrive(make_node: MakeNode) -> None:
    robot = make_node("robot")
    battery = robot.publisher(BatteryState, "/io/power/power_watcher", Qos.EVENT)
    estop = robot.publisher(Bool, "/e_stop_state", Qos.EVENT)
    rig = Rig(make_node("ours"), others=[robot])

    def heard() -> bool:
        battery.publish(BatteryState(percentage=35.0))
        estop.publish(Bool(data=True))
        return bool(rig.outlet.of("robot.battery") and rig.outlet.of("robot.estop"))

    rig.until(heard, "battery and emergency stop")
    assert rig.outlet.of("robot.battery")[0] == pytest.approx(0.35)
    assert rig.outlet.of("robot.estop")[0] is True


# --- exploring


def half_known() -> OccupancyGrid:
    """40 x 40 cells of 10 cm: the left half is free, the right one unknown."""
    message = OccupancyGrid()
    message.header.frame_id = "map"
    message.info.width = message.info.height = 40
    message.info.resolution = 0.1
    message.info.origin.orientation.w = 1.0
    message.data.extend(([0] * 20 + [-1] * 20) * 40)
    return message


def link(parent: str, child: str, x: float) -> TransformStamped:
    stamped = TransformStamped(child_frame_id=child)
    stamped.header.frame_id = parent
    stamped.transform.translation.x, stamped.transform.rotation.w = x, 1.0
    return stamped


def test_a_search_hears_the_map_and_the_transforms_that_were_told_before_it_began(
    make_node: MakeNode,
) -> None:
    rig = Rig(make_node("ours"))
    slam = make_node("slam")
    rig.others.append(slam)
    slam.publisher(OccupancyGrid, "/map", Qos.LATCHED).publish(half_known())
    static = slam.publisher(TFMessage, "/tf_static", Qos.STATIC_TRANSFORMS)
    static.publish(TFMessage(transforms=[link("map", "odom", 1.0)]))
    moving = slam.publisher(TFMessage, "/tf", Qos.TRANSFORMS)
    rig.client.start("a1", "choose_frontier", {})
    rig.until(lambda: moving.get_subscription_count() == 1)
    moving.publish(TFMessage(transforms=[link("odom", "base_link", 0.5)]))
    pose = rig.until_reported("done")[2]["pose"]
    assert (pose["x"], pose["y"]) == pytest.approx((1.95, 1.95))
    assert pose["yaw"] == pytest.approx(math.atan2(1.95, 0.45))


def test_a_search_without_a_map_names_its_topic_and_can_be_cancelled(make_node: MakeNode) -> None:
    rig = Rig(make_node("ours"), changed={"map_topic": "hall"})
    rig.client.start("a1", "choose_frontier", {})
    assert rig.until_reported("progress")[2] == "no /hall received"
    rig.client.cancel("a1")
    assert rig.outlet.kinds("a1") == ["accepted", "cancelled"]
