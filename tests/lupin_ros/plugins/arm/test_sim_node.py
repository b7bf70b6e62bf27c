"""The simulated arm over real DDS: it looks like the robot's drivers, and is as picky."""

from __future__ import annotations

import math
from typing import Any

import pytest
from action_msgs.msg import GoalStatus
from builtin_interfaces.msg import Duration, Time
from control_msgs.action import GripperCommand
from mirte_msgs.msg import ServoPosition
from mirte_msgs.srv import SetServoAngleWithSpeed
from rosgraph_msgs.msg import Clock
from std_srvs.srv import SetBool
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from lupin_arm import simulated as simulated_module
from lupin_arm.catalog import PLUGIN
from lupin_arm.joints import ARM, Pose
from lupin_arm.node import sim as sim_module
from lupin_arm.node.sim import PARAMETERS, ArmSimNode
from lupin_arm.presets import PRESETS
from lupin_engine.errors import LupinError
from lupin_engine.plugin.wire import time_fields
from lupin_ros.adapter.node import GoalCallbacks, Qos
from tests.lupin_ros.helpers import work_off
from tests.lupin_ros.plugins.arm.scene import TRAJECTORIES, Bystander, MakeNode

NAMES = [joint.state_name for joint in ARM]
HOME, INSPECT = PRESETS["home"], PRESETS["inspect"]
GRIPPER = "/mirte_master_gripper_controller/gripper_cmd"


class Bench(Bystander):
    """A simulated arm, and a controller's client."""

    def __init__(self, make_node: MakeNode, *arguments: str) -> None:
        super().__init__(make_node)
        self.robot = make_node("lupin_arm_sim", arguments, PARAMETERS)
        self.sim = ArmSimNode(self.robot)
        self.nodes.append(self.robot)
        self.commands = self.ros.publisher(JointTrajectory, TRAJECTORIES, Qos.EVENT)
        self.gripper = self.ros.action(GripperCommand, GRIPPER)
        self.ended: list[tuple[int, Any]] = []
        self.until(lambda: self.commands.get_subscription_count() == 2 and self.gripper.ready())
        self.begin()

    def begin(self) -> None:
        """Wait until it is told where the arm is."""
        self.until(lambda: self.told)

    def send(self, pose: Pose, seconds: float = 0.3, **changed: Any) -> None:
        """Command the arm; `changed` fields of the message or of its point make it a bad command."""
        nanoseconds = round(seconds * 1e9)
        point = JointTrajectoryPoint(positions=list(pose), velocities=[1.0] * 4)
        point.time_from_start = Duration(sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9)
        message = JointTrajectory(joint_names=NAMES, points=[point])
        for name, value in changed.items():
            setattr(message if hasattr(message, name) else point, name, value)
        self.commands.publish(message)

    def grip(self, angle: float) -> Any:
        """Send the jaw somewhere."""
        goal = GripperCommand.Goal()
        goal.command.position = angle
        return self.gripper.send(
            goal,
            GoalCallbacks(
                ended=lambda status, result: self.ended.append((status, result)),
                rejected=lambda: self.ended.append((0, None)),
            ),
        )


class TimedBench(Bench):
    """The same on a clock that goes on only when a test says so."""

    #: Seconds of a tick: as long as the shortest wait of the simulated arm.
    TICK = 0.05

    def __init__(self, make_node: MakeNode) -> None:
        super().__init__(make_node, "--ros-args", "-p", "use_sim_time:=true")

    def begin(self) -> None:
        self.time = 1000.0
        self._clock = self.ros.publisher(Clock, "/clock", Qos.EVENT)
        self.until(self._is_heard)
        self.pass_time(1.0)

    def pass_time(self, seconds: float) -> None:
        """Let so much time pass, tick by tick."""
        for _ in range(round(seconds / self.TICK)):
            self.time += self.TICK
            self.until(self._is_heard)
            work_off(self.nodes, 5)

    def _is_heard(self) -> bool:
        if self.robot.now() < self.time - self.TICK / 2:
            self._clock.publish(Clock(clock=Time(**time_fields(self.time))))
            return False
        return True


@pytest.fixture
def bench(make_node: MakeNode) -> Bench:
    return Bench(make_node)


@pytest.fixture
def timed(make_node: MakeNode) -> TimedBench:
    return TimedBench(make_node)


def test_it_rests_at_home_and_tells_so_often_enough_to_be_fresh(timed: TimedBench) -> None:
    assert list(timed.angles) == [*NAMES, "gripper_joint"]
    assert timed.pose == HOME
    told = timed.told
    timed.pass_time(2.0)
    timed.until(lambda: timed.told - told >= 9, "the last of them")
    assert timed.told - told <= 11


def test_it_tells_more_often_while_it_moves(timed: TimedBench) -> None:
    timed.send(INSPECT, 2.0)
    timed.until(lambda: timed.sim._moving.running)
    told = timed.told
    timed.pass_time(2.0)
    timed.until(lambda: timed.told - told >= 39, "the last of them")
    assert timed.told - told <= 41
    timed.pass_time(0.2)
    timed.arrives(INSPECT)
    assert not timed.sim._moving.running


def test_joints_may_come_in_any_order(bench: Bench) -> None:
    bench.send((-0.8, 0.9, -0.4, 0.0), joint_names=NAMES[::-1])
    bench.arrives(INSPECT)


@pytest.mark.parametrize(
    "changed",
    [
        {"joint_names": NAMES[:3]},
        {"joint_names": [*NAMES[:3], "tail_joint"]},
        {"points": []},
        {"positions": [0.0] * 3},
        {"positions": [0.0, 0.0, 0.0, math.nan]},
        {"velocities": [0.0] * 4},
        {"time_from_start": Duration()},
    ],
    ids=["three joints", "another joint", "no points", "three angles", "nan", "no velocity", "no time"],
)
def test_a_command_that_a_controller_refuses_moves_nothing(bench: Bench, changed: dict[str, Any]) -> None:
    bench.send(INSPECT, **changed)
    bench.wait(0.3)
    assert bench.pose == HOME
    bench.send(INSPECT)
    bench.arrives(INSPECT)


def test_the_vendors_services_turn_a_servo(bench: Bench) -> None:
    request = SetServoAngleWithSpeed.Request(angle=30.0, rate=180.0)
    assert bench.call(SetServoAngleWithSpeed, "/io/servo/hiwonder/elbow/set_angle_with_speed", request).status
    bench.arrives((HOME[0], HOME[1], math.radians(30.0), HOME[3]))
    request = SetServoAngleWithSpeed.Request(angle=0.5, rate=0.0, degrees=False)
    name = "/io/servo/hiwonder/gripper/set_angle_with_speed"
    assert bench.call(SetServoAngleWithSpeed, name, request).status
    bench.until(lambda: bench.jaw == pytest.approx(0.2399, abs=1e-3))


@pytest.mark.parametrize("angle", [95.0, math.nan, math.inf])
def test_an_angle_that_a_servo_does_not_reach_is_answered_with_no(bench: Bench, angle: float) -> None:
    request = SetServoAngleWithSpeed.Request(angle=angle, rate=60.0)
    name = "/io/servo/hiwonder/wrist/set_angle_with_speed"
    assert not bench.call(SetServoAngleWithSpeed, name, request).status
    bench.wait(0.1)
    assert bench.pose == HOME


def test_positions_of_servos_are_told_to_whoever_listens(bench: Bench) -> None:
    heard: list[ServoPosition] = []
    bench.ros.subscribe(ServoPosition, "/io/servo/hiwonder/wrist/position", Qos.EVENT, heard.append)
    bench.until(lambda: heard)
    assert (heard[0].angle, heard[0].raw) == (pytest.approx(HOME[3]), -8995)


def test_the_jaw_succeeds_when_it_is_there(bench: Bench) -> None:
    bench.grip(0.2)
    bench.until(lambda: bench.ended)
    status, result = bench.ended[0]
    assert (status, result.reached_goal, result.stalled) == (GoalStatus.STATUS_SUCCEEDED, True, False)
    assert result.position == pytest.approx(0.2)


def test_a_new_goal_of_the_jaw_ends_the_one_before(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(simulated_module, "JAW_RATE", 0.1)
    bench.grip(0.25)
    bench.until(lambda: bench.sim._goal is not None)
    bench.grip(-0.1)
    bench.until(lambda: len(bench.ended) == 2)
    assert [status for status, _ in bench.ended] == [GoalStatus.STATUS_ABORTED, GoalStatus.STATUS_SUCCEEDED]


def test_a_goal_that_is_cancelled_leaves_the_jaw_where_it_is(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(simulated_module, "JAW_RATE", 0.1)
    goal = bench.grip(0.25)
    bench.until(lambda: bench.jaw > -0.1)
    goal.cancel()
    bench.until(lambda: bench.ended)
    assert bench.ended[0][0] == GoalStatus.STATUS_CANCELED
    assert bench.jaw < 0.2


def test_a_jaw_without_power_stalls(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sim_module, "STALL_S", 0.2)
    off = SetBool.Request(data=False)
    assert bench.call(SetBool, "/io/servo/hiwonder/enable_all_servos", off).success
    bench.grip(0.25)
    bench.until(lambda: bench.ended)
    assert (bench.ended[0][0], bench.ended[0][1].stalled) == (GoalStatus.STATUS_ABORTED, True)


@pytest.mark.parametrize(("angle", "status"), [(math.nan, 0), (2.0, GoalStatus.STATUS_ABORTED)])
def test_a_goal_out_of_reach_does_not_stay_open(
    bench: Bench, angle: float, status: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sim_module, "STALL_S", 0.2)
    bench.grip(angle)
    bench.until(lambda: bench.ended)
    assert bench.ended[0][0] == status


def test_a_hand_bends_only_a_limp_arm_and_only_where_it_reaches(bench: Bench) -> None:
    name = "lupin_arm_sim"
    reason = "hand: elbow reaches -116.3 to 92.5 deg, not 171.887"
    assert bench.set_parameter(name, "hand", [0.0, 0.0, 3.0, 0.0]) == reason
    assert bench.set_parameter(name, "hand", [0.0, 0.0]) == "hand: expected 4 angles, got 2"
    assert bench.set_parameter(name, "start", [0.0] * 4) == "start: read at the start of the node only"
    bent = (0.1, 0.0, -0.1, -1.5)
    assert bench.set_parameter(name, "hand", list(bent)) == ""
    bench.wait(0.2)
    assert bench.pose == HOME
    bench.call(SetBool, "/io/servo/hiwonder/enable_all_servos", SetBool.Request(data=False))
    bench.arrives(bent)


def test_a_start_out_of_reach_is_named(make_node: MakeNode) -> None:
    node = make_node("lupin_arm_sim", ["--ros-args", "-p", "start:=[9.0, 0.0, 0.0, 0.0]"], PARAMETERS)
    with pytest.raises(LupinError, match=r"^start: shoulder_pan reaches -86 to 90 deg, not 515\.662$"):
        ArmSimNode(node)


def test_it_stands_in_for_what_a_robot_serves(bench: Bench) -> None:
    (replaced,) = PLUGIN.stands_in["lupin_arm_sim"]
    assert f"/{replaced}" == GRIPPER
    last = f"{GRIPPER}/_action/get_result"

    def offered() -> set[str]:
        return {name for name, _ in bench.ros.node.get_service_names_and_types()}

    bench.until(lambda: {last, "/io/servo/hiwonder/enable_all_servos"} <= offered(), "its services")
    work_off(bench.nodes)
    assert not [name for name in offered() if name == "/enable_arm_control" or name.endswith("_offset")]
