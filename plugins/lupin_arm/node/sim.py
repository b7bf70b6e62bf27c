"""The node `lupin_arm_sim`: the interface of the arm's drivers and controllers, over a simulated arm.

The services of real servos are left out: there is no command gate and nothing to calibrate. At rest it
publishes its state five times a second, just often enough for readers with a limit of 0.5 s.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

from control_msgs.action import GripperCommand
from mirte_msgs.msg import ServoPosition
from mirte_msgs.srv import SetServoAngleWithSpeed
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from lupin_arm.joints import ARM, JAW_OPEN, Pose, jaw_from_degrees
from lupin_arm.node.gates import SERVOS
from lupin_arm.presets import PRESETS
from lupin_arm.simulated import SimulatedArm
from lupin_arm.trajectory import LONGEST_S, Point, Trajectory, time_for
from lupin_engine.errors import LupinError, Problems
from lupin_engine.plugin import ANGLE, Parameter, list_of, seconds_of
from lupin_ros.adapter import Qos, Repeater, RosNode, ServedGoal

#: Seconds between two messages while nothing moves, and while something does.
REST_S, MOVE_S = 0.2, 0.05
#: Seconds after which a jaw that does not come nearer is given up.
STALL_S = 1.0

PARAMETERS = {
    "start": Parameter(
        list_of(ANGLE), list(PRESETS["home"]), "where the joints are at the start: pan, lift, elbow, wrist"
    ),
    "hand": Parameter(
        list_of(ANGLE), [], "where somebody moves the arm by hand while its servos are off; empty: nowhere"
    ),
}

_NAMES = [joint.state_name for joint in ARM]


def check(values: Mapping[str, Any]) -> None:
    """Check that parameters name poses that the servos reach.

    Raises:
        LupinError: all errors.
    """
    problems = Problems()
    with problems.collecting():
        _servo_pose("start", values["start"])
    with problems.collecting():
        if values["hand"]:
            _servo_pose("hand", values["hand"])
    problems.raise_any()


class ArmSimNode:
    """Publishes the simulated joint states, and executes trajectories and goals."""

    def __init__(self, ros: RosNode) -> None:
        self._ros = ros
        values = ros.parameters()
        self._arm = SimulatedArm(_servo_pose("start", values["start"]), JAW_OPEN, ros.elapsed())
        self._goal: ServedGoal | None = None
        self._goal_began = 0.0
        self._in_reach = True
        self._moving = Repeater(ros.timer, MOVE_S, self._move)
        self._states = ros.publisher(JointState, "/joint_states", Qos.DETECTION)
        self._servos = [
            ros.publisher(ServoPosition, f"{SERVOS}/{name}/position", Qos.EVENT)
            for name in [*(joint.name for joint in ARM), "gripper"]
        ]
        self._connect()
        reason = self._change({"hand": values["hand"]})
        if reason is not None:
            raise LupinError(reason)
        ros.timer(REST_S, self._rest)
        self._publish_state()

    def _connect(self) -> None:
        ros = self._ros
        topic = "/mirte_master_arm_controller/joint_trajectory"
        ros.subscribe(JointTrajectory, topic, Qos.EVENT, self._on_trajectory)
        ros.serve(SetBool, f"{SERVOS}/enable_all_servos", self._power)
        for index, joint in enumerate(ARM):
            name = f"{SERVOS}/{joint.name}/set_angle_with_speed"
            ros.serve(SetServoAngleWithSpeed, name, partial(self._turn, index))
        name = f"{SERVOS}/gripper/set_angle_with_speed"
        ros.serve(SetServoAngleWithSpeed, name, self._turn_jaw)
        ros.serve_action(
            GripperCommand,
            "/mirte_master_gripper_controller/gripper_cmd",
            admit=lambda goal: math.isfinite(goal.command.position),
            started=self._start,
            cancelled=self._cancel,
        )
        ros.on_parameter(self._change)
        ros.on_stop(lambda: self._end_goal("abort"))

    def _change(self, values: Mapping[str, Any]) -> str | None:
        """Apply new parameter values; return why not, None where that is done."""
        if "start" in values:
            return "start: read at the start of the node only"
        try:
            hand = _servo_pose("hand", values["hand"]) if values["hand"] else None
        except LupinError as reason:
            return str(reason)
        self._arm.push(hand, self._ros.elapsed())
        self._go_on()
        return None

    # --- what is asked ------------------------------------------------------------------------------------

    def _on_trajectory(self, message: JointTrajectory) -> None:
        """Execute a trajectory; as in a real controller an invalid one is logged and dropped."""
        if sorted(message.joint_names) != sorted(_NAMES):
            self._ros.log.warning(
                "trajectory refused: not the arm's joints", joints=list(message.joint_names)
            )
            return
        order = [list(message.joint_names).index(name) for name in _NAMES]
        points = [_point(point, order) for point in message.points]
        times = [0.0, *(point.time for point in points if point is not None)]
        if not points or None in points or any(b <= a for a, b in itertools.pairwise(times)):
            self._ros.log.warning("trajectory refused: its points are not usable", points=len(points))
            return
        found = tuple(point for point in points if point is not None)
        self._arm.follow(Trajectory(found), self._ros.elapsed())
        self._go_on()

    def _power(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        self._arm.power(bool(request.data), self._ros.elapsed())
        self._go_on()
        response.success = True
        response.message = f"servos {'enabled' if request.data else 'disabled'}"
        return response

    def _turn(self, index: int, request: Any, response: Any) -> Any:
        angle, rate = request.angle, request.rate
        if request.degrees:
            angle, rate = math.radians(angle), math.radians(rate)
        target = list(self._arm.pose)
        way, target[index] = abs(angle - target[index]), angle
        try:
            motion = Trajectory((Point(_servo_pose("angle", target), time_for(way, rate)),))
        except (LupinError, ValueError):
            return response  # as a servo does: it stays where it is
        if motion.duration > LONGEST_S:
            return response
        self._arm.follow(motion, self._ros.elapsed())
        self._go_on()
        response.status = True
        return response

    def _turn_jaw(self, request: Any, response: Any) -> Any:
        try:
            angle = jaw_from_degrees(request.angle if request.degrees else math.degrees(request.angle))
        except ValueError:
            return response
        response.status = self._arm.send_jaw(angle, self._ros.elapsed())
        self._go_on()
        return response

    # --- the jaw's goal -----------------------------------------------------------------------------------

    def _start(self, served: ServedGoal) -> None:
        self._end_goal("abort")  # as its controller does: the new goal wins
        self._goal, self._goal_began = served, self._ros.elapsed()
        self._in_reach = self._arm.send_jaw(served.request.command.position, self._goal_began)
        self._go_on()

    def _cancel(self, served: ServedGoal) -> None:
        if served is self._goal:
            self._arm.stop_jaw(self._ros.elapsed())
            self._end_goal("cancel")

    def _look_after_goal(self) -> None:
        if self._goal is None:
            return
        works = self._in_reach and self._arm.powered
        if works and self._arm.jaw_there:
            self._end_goal("succeed")
        elif not works and self._ros.elapsed() - self._goal_began >= STALL_S:
            self._end_goal("abort")

    def _end_goal(self, how: str) -> None:
        served, self._goal = self._goal, None
        if served is None:
            return
        reached = how == "succeed"
        result = GripperCommand.Result(position=self._arm.jaw, reached_goal=reached, stalled=how == "abort")
        {"succeed": served.succeed, "abort": served.abort, "cancel": served.cancel}[how](result)

    # --- published state ----------------------------------------------------------------------------------

    def _go_on(self) -> None:
        """Publish more often while something moves."""
        if self._arm.moving or self._goal is not None:
            self._moving.start()

    def _move(self) -> None:
        self._arm.advance(self._ros.elapsed())
        self._publish_state()
        self._look_after_goal()
        if not self._arm.moving and self._goal is None:
            self._moving.stop()

    def _rest(self) -> None:
        if not self._moving.running:
            self._publish_state()

    def _publish_state(self) -> None:
        angles = self._arm.angles
        message = JointState(name=list(angles), position=list(angles.values()))
        message.header.stamp = self._ros.stamp()
        self._states.publish(message)
        for publisher, angle in zip(self._servos, angles.values(), strict=True):
            if publisher.get_subscription_count():  # hardly anybody asks for these
                servo = ServoPosition(angle=angle, raw=round(math.degrees(angle) * 100.0))
                servo.header.stamp = message.header.stamp
                publisher.publish(servo)


def _point(message: JointTrajectoryPoint, order: Sequence[int]) -> Point | None:
    """Return a point with its angles in our order; None where a controller would refuse it."""
    numbers = len(message.positions) == len(order) and all(map(math.isfinite, message.positions))
    # The servos are said to refuse a velocity of zero.
    if not numbers or any(velocity == 0.0 for velocity in message.velocities):
        return None
    pan, lift, elbow, wrist = (message.positions[index] for index in order)
    return Point((pan, lift, elbow, wrist), seconds_of(message.time_from_start))


def _servo_pose(what: str, angles: Sequence[float]) -> Pose:
    """Return four angles that the servos reach.

    Raises:
        LupinError: there are not four, or one is out of reach.
    """
    if len(angles) != len(ARM):
        raise LupinError(f"{what}: expected {len(ARM)} angles, got {len(angles)}")
    for joint, angle in zip(ARM, angles, strict=True):
        low, high = joint.servo_deg
        if not low <= math.degrees(angle) <= high:
            raise LupinError(
                f"{what}: {joint.name} reaches {low:g} to {high:g} deg, not {math.degrees(angle):g}"
            )
    pan, lift, elbow, wrist = angles
    return pan, lift, elbow, wrist


def main(arguments: Sequence[str]) -> int:
    """Run the node until it is stopped; `arguments` are the ROS arguments."""
    with RosNode("lupin_arm_sim", arguments, PARAMETERS) as ros:
        ArmSimNode(ros)
        ros.spin()
    return 0
