"""The arm's controller: the only module that commands the arm, and the arbiter between its users.

Presets, sliders, library and calibration go through `Arm`. It refuses to move the arm while the emergency
stop is engaged, the servos are off, another owner has a claim, or the position is unknown, and it refuses
motions outside the limits. A stop ends the motion; it does not resume.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from builtin_interfaces.msg import Duration
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from lupin_arm.joints import ARM, JAW_CLOSED, JAW_OPEN, Pose, reach_pose
from lupin_arm.node.feedback import Feedback, Listener
from lupin_arm.node.gripper import Gripper
from lupin_arm.node.serving import ArmRequestRefused
from lupin_arm.node.torque import Done, Torque
from lupin_arm.trajectory import FIRST_POINT_S, START_TOLERANCE, VELOCITY_HINT, Point, Trajectory
from lupin_engine.plugin import time_fields
from lupin_greenhouse import StopListener, StopState
from lupin_ros.adapter import Qos, RosNode

#: Seconds without feedback after which the arm counts as gone; when it is back it is pinned like a new one.
LOST_S = 2.0
#: Seconds for which a motion may still be under way after its last point: servos lag.
SETTLE_S = 0.5
#: Seconds in which a motion is stopped.
HOLD_S = 0.3


@dataclass(frozen=True)
class _ArmMotion:
    """The last motion that was sent; without an owner it only holds the arm in place."""

    trajectory: Trajectory
    start: Pose
    began: float
    owner: str = ""

    def at(self, now: float) -> Pose:
        """Return the commanded pose."""
        return self.trajectory.at(now - self.began, self.start)

    def under_way(self, now: float) -> bool:
        """Return whether the arm may still be moving."""
        return now - self.began < self.trajectory.duration + SETTLE_S

    def on_the_way(self, joint: int, angle: float) -> bool:
        """Return whether a joint's angle is within the range of this motion."""
        passed = [self.start[joint], *(point.pose[joint] for point in self.trajectory.points)]
        return min(passed) - START_TOLERANCE <= angle <= max(passed) + START_TOLERANCE


@dataclass(frozen=True)
class _Claim:
    """An owner's exclusive use of the arm."""

    owner: str
    what: str
    interrupted: Callable[[str], None]


class Arm:
    """The arm and its jaw over ROS. An owner is a user's name, such as `preset`."""

    def __init__(self, ros: RosNode, parameters: Mapping[str, Any]) -> None:
        self._ros = ros
        self._states_topic: str = parameters["joint_states_topic"]
        self._trajectories = ros.publisher(JointTrajectory, parameters["trajectory_topic"], Qos.EVENT)
        self._gripper = Gripper(ros, parameters["gripper_action"])
        self._torque = Torque(
            ros,
            parameters["torque_service"],
            parameters["gate_service"],
            self._pin,
            lambda: self._held_by,
        )
        self._motion: _ArmMotion | None = None
        self._claim: _Claim | None = None
        self._heard = float("-inf")
        self._was_stopped = False
        #: How often the arm was stopped: what waited through a stop is not sent after it.
        self.stops = 0
        self._feedback = Feedback(ros, self._states_topic)
        self._feedback.listen(self._on_feedback)
        self._estop = StopListener(ros, parameters["estop_topic"], parameters["estop_timeout"], self._stop)
        ros.on_inactive(lambda: self._freeze("the arm's node was deactivated"))

    @property
    def stopped(self) -> bool:
        """Whether the emergency stop is engaged, or counts so because it is silent."""
        return self._estop.engaged

    @property
    def _held_by(self) -> str | None:
        return self._estop.reason or self._ros.inactive or None

    # --- where it is --------------------------------------------------------------------------------------

    def pose(self) -> Pose | None:
        """Return the measured pose in radians; None without one in the last 0.5 s."""
        return self._feedback.pose()

    def jaw(self) -> float | None:
        """Return the measured angle of the jaw's joint in radians; None without one in the last 0.5 s."""
        return self._feedback.jaw()

    def listen(self, listener: Listener) -> None:
        """Call `listener(stamp, pose, jaw)` with each measurement."""
        self._feedback.listen(listener)

    def here(self, owner: str) -> Pose:
        """Return where a motion of `owner` begins: the measured pose, else the commanded one.

        Raises:
            ArmRequestRefused: the owner may not move the arm, or nothing is known of it.
        """
        reason = self.refusal(owner)
        if reason is not None:
            raise ArmRequestRefused(reason)
        self.must_be_known()
        return self.pose() or self._should_be()

    def commanded(self) -> Pose:
        """Return the pose that the arm keeps or moves to.

        A joint that was moved by hand keeps its measured angle.

        Raises:
            ArmRequestRefused: nothing is known of the arm.
        """
        self.must_be_known()
        motion, pose = self._motion, self.pose()
        assert motion is not None  # it was pinned when it became known
        if pose is None:
            return motion.trajectory.target
        under_way = motion.under_way(self._ros.elapsed())
        pan, lift, elbow, wrist = (
            target if self._belongs(motion, under_way, joint, angle) else angle
            for joint, (target, angle) in enumerate(zip(motion.trajectory.target, pose, strict=True))
        )
        return pan, lift, elbow, wrist

    @staticmethod
    def _belongs(motion: _ArmMotion, under_way: bool, joint: int, angle: float) -> bool:
        if under_way:
            return motion.on_the_way(joint, angle)
        return abs(angle - motion.trajectory.target[joint]) <= START_TOLERANCE

    def _should_be(self) -> Pose:
        assert self._motion is not None
        return self._motion.at(self._ros.elapsed())

    # --- who may move it ----------------------------------------------------------------------------------

    def claim(self, owner: str, what: str, interrupted: Callable[[str], None]) -> None:
        """Reserve the arm for `owner` until `release`; `what` is the reason that others are given.

        `interrupted(reason)` is called when the emergency stop is engaged, or the arm was lost and is back.
        The arm has stopped then; the claim stays until its owner releases it.

        Raises:
            ArmRequestRefused: another owner has a claim, the emergency stop is engaged, or servos are being
                switched.
        """
        reason = self._held_by or self._claim_reason(owner) or self._switching_reason()
        if reason is not None:
            raise ArmRequestRefused(reason)
        self._claim = _Claim(owner, what, interrupted)

    def release(self, owner: str) -> None:
        """End a claim; does nothing to another owner's."""
        if self._claim is not None and self._claim.owner == owner:
            self._claim = None

    def refusal(self, owner: str) -> str | None:
        """Return why `owner` may not move the arm now; None if it may."""
        reason = self._held_by or self._claim_reason(owner) or self._switching_reason()
        return reason or self._torque_reason()

    def _claim_reason(self, owner: str) -> str | None:
        busy = self._claim is not None and self._claim.owner != owner
        return f"the arm is busy: {self._claim.what}" if self._claim is not None and busy else None

    def _switching_reason(self) -> str | None:
        return "the servos are being switched on or off" if self._torque.switching else None

    def _torque_reason(self) -> str | None:
        if self._torque.state is False:
            return "the servos are off; switch them on first (/lupin/arm/set_torque)"
        return None

    def must_be_known(self) -> None:
        """Check that the position of the arm is known.

        Raises:
            ArmRequestRefused: it is not.
        """
        if self._ros.elapsed() - self._heard <= LOST_S:
            return
        if self._heard == float("-inf"):
            raise ArmRequestRefused(
                f"it is not known where the arm is: no {self._states_topic} with its joints yet"
            )
        raise ArmRequestRefused(
            f"it is not known where the arm is: no {self._states_topic} for more than {LOST_S:g} s"
        )

    # --- moving it ----------------------------------------------------------------------------------------

    def send(self, trajectory: Trajectory, owner: str) -> None:
        """Replace the present motion of the arm.

        Raises:
            ArmRequestRefused: `owner` may not move it, or the motion is outside the limits; nothing was sent.
        """
        reason = trajectory.problem(self.here(owner))
        if reason is not None:
            raise ArmRequestRefused(reason)
        self._publish(trajectory, owner)

    def moves(self, owner: str) -> bool:
        """Whether the arm executes a motion of `owner`."""
        motion = self._motion
        return motion is not None and motion.owner == owner and motion.under_way(self._ros.elapsed())

    def hold(self, seconds: float = HOLD_S) -> None:
        """Stop arm and jaw where they are; with the servos off the arm stays limp."""
        self._gripper.stop()
        if self._motion is not None and self._torque.state is not False:
            self._publish(_stay(self.pose() or self._should_be(), seconds))

    def halt(self, reason: str) -> None:
        """Stop a motion that has an owner, since its owner has ended; an arm at rest is left alone."""
        if self._motion is None or not self._motion.owner or not self._motion.under_way(self._ros.elapsed()):
            return
        self._ros.log.warning("the arm stops", reason=reason)
        self.hold()
        self._interrupt(reason)

    def move_jaw(self, angle: float, owner: str, done: Done | None = None) -> None:
        """Send the jaw to an angle of its joint, in radians; `done(None)` when sent, else `done(reason)`.

        Raises:
            ArmRequestRefused: it may not be moved, or not to there; nothing was sent, `done` is not called.
        """
        reason = self.refusal(owner)
        if reason is None and not JAW_OPEN <= angle <= JAW_CLOSED:
            reason = f"gripper: {angle:.2f} rad is not within {JAW_OPEN:g} to {JAW_CLOSED:g}"
        if reason is not None:
            raise ArmRequestRefused(reason)
        self._gripper.move(angle, lambda: self.refusal(owner), done or self._log_problem)

    def _log_problem(self, problem: str | None) -> None:
        if problem is not None:
            self._ros.log.warning(f"jaw not moved: {problem}")

    def _publish(self, trajectory: Trajectory, owner: str = "") -> None:
        start = self.pose() or (trajectory.target if self._motion is None else self._should_be())
        self._motion = _ArmMotion(trajectory, start, self._ros.elapsed(), owner)
        self._trajectories.publish(_message(trajectory))

    def _pin(self) -> bool:
        """Command the measured pose, which replaces older targets; return False where none is measured."""
        pose = self.pose()
        if pose is not None:
            self._publish(_stay(pose, FIRST_POINT_S))
        return pose is not None

    # --- the servos ---------------------------------------------------------------------------------------

    @property
    def torque(self) -> bool | None:
        """Whether the servos are on, as last confirmed; None before."""
        return self._torque.state

    def set_torque(self, on: bool, owner: str, done: Done) -> None:
        """Switch the servos on or off; `done(None)` when that is confirmed, else `done(reason)`.

        Raises:
            ArmRequestRefused: another owner has a claim; or, for on, the emergency stop is engaged, or the
                position is unknown, so that the arm might jump.
        """
        reason = (self._held_by if on else None) or self._claim_reason(owner)
        if reason is not None:
            raise ArmRequestRefused(reason)
        if on:
            self.must_be_known()
        self._torque.set(on, done)

    # --- feedback and stop --------------------------------------------------------------------------------

    def _on_feedback(self, _stamp: float, _pose: Pose, _jaw: float | None) -> None:
        now = self._ros.elapsed()
        before, self._heard = self._heard, now
        if now - before <= LOST_S:
            return
        self._pin()
        self._ros.log.info("the arm is there; it is pinned to where it is")
        if before > float("-inf"):  # whatever was under way has been ended by that
            self._interrupt(f"for more than {LOST_S:g} s it was not known where the arm is")

    def _interrupt(self, reason: str) -> None:
        if self._claim is not None:
            self._claim.interrupted(reason)

    def _stop(self, state: StopState) -> None:
        """Hold the arm when the stop is engaged; a release moves nothing."""
        before, self._was_stopped = self._was_stopped, state.engaged
        if before == state.engaged:
            return
        if not state.engaged:
            self._ros.log.info("emergency stop released")
            return
        self._freeze(f"the emergency stop was {'silent' if state.silent else 'engaged'}")

    def _freeze(self, reason: str) -> None:
        self.stops += 1
        self._ros.log.warning(f"{reason}: the arm stays where it is")
        self.hold()
        self._interrupt(reason)


def _stay(pose: Pose, seconds: float) -> Trajectory:
    """Return a motion that stays at a pose, clamped to the servos' range."""
    return Trajectory((Point(reach_pose(pose), seconds),))


def _message(trajectory: Trajectory) -> JointTrajectory:
    points = [
        JointTrajectoryPoint(
            positions=list(point.pose),
            velocities=[VELOCITY_HINT] * len(ARM),
            time_from_start=Duration(**time_fields(point.time)),
        )
        for point in trajectory.points
    ]
    return JointTrajectory(joint_names=[joint.state_name for joint in ARM], points=points)
