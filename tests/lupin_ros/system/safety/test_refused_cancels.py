"""A server that does not stop: it refuses the cancel, or accepts it and drives on. Nothing begins then."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import pytest
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav2_msgs.action import NavigateToPose
from rclpy.action import ActionServer, CancelResponse
from rclpy.action.server import ServerGoalHandle
from std_msgs.msg import Bool

from lupin_ros.adapter.actions import ServedGoal
from lupin_ros.adapter.node import Qos
from tests.lupin_ros.world import Operator, World

pytestmark = pytest.mark.timeout(120)

NODE = "mission_orchestrator"
WORDS = "the robot may be moving: navigation refuses to stop"
#: Speed of the stub's robot in metres a second, and seconds between two of its poses.
SPEED, POSE_S = 0.5, 0.1
#: Seconds that a busy machine may take for what happens at once.
BUSY_S = 1.0


@dataclass
class Goal:
    """A goal at the stub: when it came, how many were active then, and when its cancels came."""

    served: ServedGoal
    beside: int
    arrived: float = field(default_factory=time.monotonic)
    cancels: list[float] = field(default_factory=list)


class Navigation:
    """A server of rclpy that says no to cancels, or yes and drives on; a new goal replaces the old one."""

    def __init__(self, operator: Operator) -> None:
        self.goals: list[Goal] = []
        self.refuses = True
        #: Whether it drives, whatever became of its goals.
        self.drives = False
        #: How long it takes to answer a cancel, in seconds.
        self.takes = 0.0
        #: What it does about a cancel that it does not refuse.
        self.on_cancel: Callable[[Goal], Any] = self.stop
        self._ros = ros = operator.ros
        self._x = 0.0
        self._poses = ros.publisher(PoseWithCovarianceStamped, "/amcl_pose", Qos.LATCHED)
        self._server = ActionServer(
            ros.node,
            NavigateToPose,
            "navigate_to_pose",
            self._until_ended,
            handle_accepted_callback=self._start,
            cancel_callback=self._cancel,
        )
        ros.steady_timer(POSE_S, self._drive)

    def stop(self, goal: Goal) -> None:
        """Stand, and end the goal as cancelled."""
        self.drives = False
        goal.served.cancel(NavigateToPose.Result())

    def jump(self) -> None:
        """Correct the pose by a metre, as a localizer does."""
        self._x += 1.0

    @property
    def active(self) -> list[Goal]:
        """The goals that have not ended."""
        return [goal for goal in self.goals if goal.served.active]

    def _drive(self) -> None:
        if self.drives:
            self._x += SPEED * POSE_S
        pose = PoseWithCovarianceStamped()
        pose.header.frame_id = "map"
        pose.pose.pose.position.x = self._x
        pose.pose.pose.orientation.w = 1.0
        self._poses.publish(pose)

    def _start(self, handle: ServerGoalHandle) -> None:
        before = self.active
        served = ServedGoal(self._ros, handle, lambda _: self._ros.post(lambda: None))
        self.goals.append(Goal(served, len(before)))
        handle.execute()
        for old in before:
            old.served.abort(NavigateToPose.Result())
        self.drives = True

    async def _until_ended(self, handle: ServerGoalHandle) -> Any:
        key = bytes(handle.goal_id.uuid)
        return await next(goal for goal in self.goals if goal.served.key == key).served.result

    def _cancel(self, handle: ServerGoalHandle) -> CancelResponse:
        threading.Event().wait(self.takes)
        goal = next(goal for goal in self.goals if goal.served.key == bytes(handle.goal_id.uuid))
        goal.cancels.append(time.monotonic())
        if self.refuses:
            return CancelResponse.REJECT
        self._ros.post(lambda: self.on_cancel(goal))
        return CancelResponse.ACCEPT


@pytest.fixture
def navigation(world: World, operator: Operator) -> Iterator[Navigation]:
    """The stub with a mission that drives, whose first goal cannot be ended."""
    found = Navigation(operator)
    world.start("greenhouse_bridge")
    world.start(NODE)
    operator.in_state("READY")
    assert operator.start("29", "30").accepted
    operator.until(lambda: found.goals and found.drives, "the first goal")
    wait(operator, 1.0)
    yield found
    found.refuses = False


def wait(operator: Operator, seconds: float) -> None:
    until = time.monotonic() + seconds
    operator.until(lambda: time.monotonic() > until, "the time")


def until_reported(operator: Operator) -> None:
    operator.until(lambda: operator.state.last_error == f"cancel_refused: {WORDS}", "it is reported")


def assert_not_resumed(operator: Operator) -> None:
    answer = operator.ask("resume")
    assert (answer.success, answer.message) == (False, f"resume refused: {WORDS}")
    assert operator.state.paused


def test_a_refusal_is_no_end(operator: Operator, navigation: Navigation) -> None:
    """It is repeated and reported; nothing goes on beside the old goal, and everything after it."""
    assert operator.ask("pause").success
    (old,) = navigation.goals
    operator.until(lambda: old.cancels, "the first cancel")
    assert not operator.state.last_error
    until_reported(operator)
    assert 1.0 <= time.monotonic() - old.cancels[0] < 1.0 + BUSY_S
    assert_not_resumed(operator)
    wait(operator, 3.0)  # longer than the deadline of a cancel that is not answered
    assert_not_resumed(operator)
    assert len(old.cancels) >= 7
    assert max(b - a for a, b in zip(old.cancels, old.cancels[1:], strict=False)) < 0.5 + BUSY_S
    navigation.refuses = False
    operator.until(lambda: not navigation.active, "the end of the old goal")
    operator.until(lambda: operator.ask("resume").success, "resumed")
    operator.until(lambda: len(navigation.goals) == 2, "the next goal")
    assert [goal.beside for goal in navigation.goals] == [0, 0]


def test_a_refusal_that_takes_its_time_is_heard(operator: Operator, navigation: Navigation) -> None:
    """Longer than until the next cancel: it is no silence, after which the next goal would be sent."""
    navigation.takes = 0.8
    assert operator.ask("pause").success
    until_reported(operator)
    assert_not_resumed(operator)


def test_a_stop_that_is_let_go_does_not_begin_a_second_goal(
    operator: Operator, navigation: Navigation
) -> None:
    stop = operator.ros.publisher(Bool, "/e_stop_state", Qos.EVENT)
    operator.until(lambda: stop.get_subscription_count(), "its subscription")
    stop.publish(Bool(data=True))
    until_reported(operator)
    stop.publish(Bool(data=False))
    operator.until(lambda: not operator.state.estop_engaged, "the stop is let go")
    assert_not_resumed(operator)
    assert len(navigation.goals) == 1


def test_what_comes_next_waits_for_the_old_goal(operator: Operator, navigation: Navigation) -> None:
    """Also where nobody is held: the next target begins when the robot is free."""
    assert operator.ask("skip_current").success
    until_reported(operator)
    wait(operator, 3.0)
    (old,) = navigation.goals
    old.served.succeed(NavigateToPose.Result())
    operator.until(lambda: len(navigation.goals) == 2, "the next goal")
    assert [goal.beside for goal in navigation.goals] == [0, 0]


def test_the_way_home_takes_the_place_of_the_old_goal(operator: Operator, navigation: Navigation) -> None:
    assert operator.ask("pause").success
    until_reported(operator)
    assert operator.ask("dock").success
    operator.until(lambda: len(navigation.goals) == 2, "the way home", 3.0)
    operator.until(lambda: len(navigation.active) == 1, "the old goal is replaced")
    assert [goal.beside for goal in navigation.goals] == [0, 1]
    navigation.active[0].served.succeed(NavigateToPose.Result())
    operator.until(lambda: operator.state.paused and not navigation.active, "docked")


def test_the_next_orchestrator_is_refused_as_well(
    world: World, operator: Operator, navigation: Navigation
) -> None:
    """It knows the goal of the one that was killed, asks for its end, and begins nothing beside it."""
    process = world.processes[NODE]
    process.kill()
    process.wait(10.0)
    operator.states.clear()
    world.start(NODE, resume_policy="continue")
    operator.held()
    until_reported(operator)
    caller = Operator("other")  # a client that has no server of before
    answer = caller.ask("resume")
    assert (answer.success, answer.message) == (False, f"resume refused: {WORDS}")
    caller.ros.close()
    wait(operator, 3.0)
    assert len(navigation.goals) == 1


@pytest.mark.core
@pytest.mark.parametrize("ends", [False, True])
def test_a_server_that_agrees_and_drives_on_is_reported(
    operator: Operator, navigation: Navigation, ends: bool
) -> None:
    """Its goal may go on, or count as cancelled: the robot moves."""
    navigation.refuses = False
    navigation.on_cancel = (lambda goal: goal.served.cancel(NavigateToPose.Result())) if ends else id
    assert operator.ask("pause").success
    until_reported(operator)
    since = time.monotonic() - navigation.goals[0].cancels[0]
    assert 2.0 + 0.2 / SPEED <= since < 2.0 + 0.2 / SPEED + 2 * BUSY_S
    if not ends:
        assert_not_resumed(operator)
        navigation.stop(navigation.goals[0])
        operator.until(lambda: operator.ask("resume").success, "resumed")
        operator.until(lambda: len(navigation.goals) == 2, "the next goal")
    assert navigation.goals[-1].beside == 0


def test_a_robot_that_stands_is_not_reported(operator: Operator, navigation: Navigation) -> None:
    """Nor is a localizer that corrects itself."""
    navigation.refuses = False
    assert operator.ask("pause").success
    operator.held()
    wait(operator, 3.0)
    navigation.jump()
    wait(operator, 1.0)
    assert not operator.state.last_error
    assert operator.ask("resume").success
