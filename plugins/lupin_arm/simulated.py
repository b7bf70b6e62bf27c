"""A simulated arm: servos with their own speed and range, and the faults of the real one. Loads without ROS.

A servo silently ignores an angle that it cannot reach. The controller keeps its last target while the servos
are off, and moves there when they are on again.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from lupin_arm.joints import ARM, JAW, Pose
from lupin_arm.trajectory import Point, Trajectory

#: How fast a servo turns at best, in rad/s, and how fast a person moves a limp arm.
SERVO_RATE = math.radians(240.0)
HAND_RATE = math.radians(60.0)
#: How fast the jaw's controller moves it, in rad/s, and what its servo reaches, in radians.
JAW_RATE = 0.6
JAW_SERVO = (-0.30, 0.31)
#: Angles closer than this are the same.
NEAR = 1e-6


class SimulatedArm:
    """Four joints and a jaw; time is an argument, in seconds, and never runs backwards."""

    def __init__(self, pose: Pose, jaw: float, now: float) -> None:
        self.pose = pose
        self.jaw = jaw
        self.powered = True
        self._jaw_target = jaw
        self._hand: Pose | None = None
        self._now = now
        self._began, self._start = now, pose
        self._trajectory = Trajectory((Point(pose, 0.0),))

    @property
    def moving(self) -> bool:
        """Whether anything will change by itself."""
        if not self.powered:
            return self._hand is not None and not _near(self.pose, self._hand)
        under_way = self._now - self._began < self._trajectory.duration
        return under_way or not self.jaw_there or not _near(self.pose, self._wanted(self._now))

    @property
    def jaw_there(self) -> bool:
        """Whether the jaw has reached its target."""
        return abs(self.jaw - self._jaw_target) <= NEAR

    @property
    def angles(self) -> Mapping[str, float]:
        """All angles, by the names of `/joint_states`."""
        return {**{j.state_name: a for j, a in zip(ARM, self.pose, strict=True)}, JAW: self.jaw}

    def follow(self, trajectory: Trajectory, now: float) -> None:
        """Start a trajectory; it replaces the present one."""
        self.advance(now)
        self._start, self._began, self._trajectory = self.pose, now, trajectory

    def send_jaw(self, angle: float, now: float) -> bool:
        """Set the jaw's target; return False where its servo cannot reach it, and nothing changes."""
        self.advance(now)
        if not JAW_SERVO[0] <= angle <= JAW_SERVO[1]:
            return False
        self._jaw_target = angle
        return True

    def stop_jaw(self, now: float) -> None:
        """Stop the jaw where it is."""
        self.advance(now)
        self._jaw_target = self.jaw

    def power(self, on: bool, now: float) -> None:
        """Switch the servos on or off."""
        self.advance(now)
        self.powered = on

    def push(self, pose: Pose | None, now: float) -> None:
        """Move the arm to a pose as by hand, which works only while it is limp."""
        self.advance(now)
        self._hand = pose

    def advance(self, now: float) -> None:
        """Move everything to its state at `now`."""
        passed = max(0.0, now - self._now)
        self._now = max(now, self._now)
        if self.powered:
            self.pose = _toward(self.pose, self._wanted(self._now), SERVO_RATE * passed)
            self.jaw = _step(self.jaw, self._jaw_target, JAW_RATE * passed)
        elif self._hand is not None:
            self.pose = _toward(self.pose, self._hand, HAND_RATE * passed)

    def _wanted(self, now: float) -> Pose:
        """Return the controller's target; a joint that cannot reach its angle keeps its own."""
        asked = self._trajectory.at(now - self._began, self._start)
        pan, lift, elbow, wrist = (
            angle if joint.servo_deg[0] - NEAR <= math.degrees(angle) <= joint.servo_deg[1] + NEAR else at
            for joint, angle, at in zip(ARM, asked, self.pose, strict=True)
        )
        return pan, lift, elbow, wrist


def _toward(pose: Pose, target: Pose, most: float) -> Pose:
    pan, lift, elbow, wrist = (_step(a, b, most) for a, b in zip(pose, target, strict=True))
    return pan, lift, elbow, wrist


def _step(angle: float, target: float, most: float) -> float:
    return target if abs(target - angle) <= most else angle + math.copysign(most, target - angle)


def _near(one: Pose, other: Pose) -> bool:
    return all(abs(a - b) <= NEAR for a, b in zip(one, other, strict=True))
