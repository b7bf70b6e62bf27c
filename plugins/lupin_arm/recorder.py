"""Samples a recording: decides which poses become waypoints, and their times. Pure; times are arguments."""

from __future__ import annotations

import math

from lupin_arm.joints import Pose, clamp_jaw, clamp_pose, farthest
from lupin_arm.library import NotInLibrary, Sequence, Waypoint

#: A pose is taken when so much time has passed since the last one, and a joint has moved so far.
PERIOD_S = 0.05
MOVED = math.radians(0.5)
#: Where a recording ends by itself.
MAX_WAYPOINTS = 800
MAX_SECONDS = 60.0
#: Stamps that go on so many seconds more or less than their arrivals are of a clock that was set.
CLOCK_SET_S = 1.0
#: Less than this, in seconds, lies between two waypoints of the same moment.
_MOMENT_S = 0.001


class PoseRecording:
    """The waypoints of one recording; times begin with the first one. It is cut at `MAX_WAYPOINTS` or
    `MAX_SECONDS`.

    Each pose has its stamp, by the arm's clock, and its arrival by our steady clock; where both disagree by
    more than `CLOCK_SET_S`, the arm's clock was set. Angles beyond the limits are clamped.
    """

    def __init__(self, mode: str, include_gripper: bool) -> None:
        self.mode = mode
        self.include_gripper = include_gripper
        self.waypoints: list[Waypoint] = []
        #: Why nothing more is taken; '' while the recording goes on.
        self.full = ""
        #: Waypoints of which an angle was beyond its limit.
        self.clamped = 0
        self._begun = 0.0  # stamp of the first pose
        self._arrived = 0.0  # its arrival
        self._stamp = self._heard = 0.0  # stamp of the last pose, and its arrival
        self._last: Waypoint | None = None  # the last that was seen, taken or not

    def sample(self, stamp: float, arrival: float, pose: Pose, jaw: float | None) -> None:
        """Take a pose: a waypoint where `PERIOD_S` has passed and a joint has moved."""
        if self.full:
            return
        if self._last is None:
            self._begun, self._arrived = stamp, arrival
        else:
            step = (stamp - self._stamp) - (arrival - self._heard)
            self._begun += step if abs(step) > CLOCK_SET_S else 0.0
        self._stamp, self._heard = stamp, arrival
        time = stamp - self._begun
        if self._last is not None and not time > self._last.t:
            return  # told twice, or by a clock that was set back
        if time > MAX_SECONDS:
            self.full = f"cut at {MAX_SECONDS:g} s"
            return
        gripper = None if jaw is None or not self.include_gripper else clamp_jaw(jaw)
        self._look_at(Waypoint(t=time, arm=list(clamp_pose(pose)), gripper=gripper), pose)

    def _look_at(self, seen: Waypoint, pose: Pose) -> None:
        self._last = seen
        if self.waypoints:
            before = self.waypoints[-1]
            if seen.t - before.t < PERIOD_S - _MOMENT_S or not self._moved(before, seen):
                return
        self.waypoints.append(seen)
        self.clamped += farthest(_pose(seen), pose) > MOVED
        if len(self.waypoints) >= MAX_WAYPOINTS:
            self.full = f"cut at {MAX_WAYPOINTS} waypoints"

    @staticmethod
    def _moved(before: Waypoint, now: Waypoint) -> bool:
        jaw = abs((now.gripper or 0.0) - (before.gripper or 0.0))
        return max(farthest(_pose(before), _pose(now)), jaw) >= MOVED

    def elapsed(self, now: float) -> float:
        """Return the length of the recording, `now` being on the clock of arrivals."""
        if self._last is None:
            return 0.0
        return self._last.t if self.full else min(max(now - self._arrived, self._last.t), MAX_SECONDS)

    def finish(self, now: float, created: str) -> Sequence:
        """Return the sequence recorded until `now`; its last waypoint is at its end.

        Raises:
            NotInLibrary: no pose was seen.
        """
        if self._last is None:
            missing = "no joint states with all joints of the arm have arrived"
            raise NotInLibrary(f"nothing was recorded: {missing}")
        waypoints, end = list(self.waypoints), self.elapsed(now)
        # One who has held still at the end means that, too.
        if end - waypoints[-1].t > _MOMENT_S and len(waypoints) < MAX_WAYPOINTS:
            waypoints.append(self._last.model_copy(update={"t": end}))
        return Sequence(
            mode="kinesthetic" if self.mode == "kinesthetic" else "teleop",
            include_gripper=self.include_gripper,
            duration_s=waypoints[-1].t,
            created=created,
            waypoints=waypoints,
        )


def _pose(waypoint: Waypoint) -> Pose:
    pan, lift, elbow, wrist = waypoint.arm
    return pan, lift, elbow, wrist
