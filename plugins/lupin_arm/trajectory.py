"""Trajectories of the arm as data, and functions that make them safe to send. Loads without ROS.

The results of `move` and `replay` have angles in the command windows, strictly increasing times, and no joint
faster than `MAX_RATE`.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

from lupin_arm.joints import DEFAULT_RATE, MAX_RATE, OutsideLimits, Pose, check_pose, clamp_pose, farthest

#: What every point says about each joint's velocity, in rad/s: the servos are said to refuse zero.
VELOCITY_HINT = 1.0
#: Earliest time of a first point, and least time between two points, in seconds.
FIRST_POINT_S = 0.1
STEP_S = 0.01
#: Longest motion, in seconds: more is a mistake of units.
LONGEST_S = 3600.0
#: How much faster or slower than it was recorded a motion may be played.
SLOWEST, FASTEST = 0.25, 2.0

#: How far, in radians, the arm may be from where a motion begins before its first stretch counts as too fast.
#: The arm moves between being looked at and being commanded.
START_TOLERANCE = 0.08
#: Rounding when speeds are compared.
_ROUNDING = 1.0 + 1e-6


@dataclass(frozen=True)
class Point:
    """A pose, and its time in seconds after the motion begins."""

    pose: Pose
    time: float


@dataclass(frozen=True)
class Trajectory:
    """A motion: at least one point."""

    points: tuple[Point, ...]

    @property
    def duration(self) -> float:
        """Seconds until the last point."""
        return self.points[-1].time

    @property
    def target(self) -> Pose:
        """The last pose."""
        return self.points[-1].pose

    def at(self, time: float, start: Pose) -> Pose:
        """Return the pose at a time for a motion that began at `start`: linear between points."""
        before = Point(start, 0.0)
        for point in self.points:
            if time < point.time:
                return _between(before, point, time)
            before = point
        return self.target

    def problem(self, start: Pose | None = None) -> str | None:
        """Return why this must not be sent, to an arm at `start` if given; None if it may."""
        if not self.points:
            return "the motion has no points"
        try:
            for point in self.points:
                check_pose(point.pose)
        except OutsideLimits as reason:
            return str(reason)
        times = [0.0, *(point.time for point in self.points)]
        if not all(before < after <= LONGEST_S for before, after in itertools.pairwise(times)):
            return f"the times of a motion must increase, up to {LONGEST_S:g} s"
        if self._too_fast(start):
            return f"a joint would be faster than {math.degrees(MAX_RATE):g} deg/s"
        return None

    def _too_fast(self, start: Pose | None) -> bool:
        first = self.points[0]
        stretches = [(farthest(a.pose, b.pose), b.time - a.time) for a, b in itertools.pairwise(self.points)]
        if start is not None:
            stretches.append((farthest(start, first.pose) - START_TOLERANCE, first.time))
        return any(way > MAX_RATE * time * _ROUNDING for way, time in stretches)


@dataclass(frozen=True)
class TrajectorySample:
    """A recorded pose, and its time in seconds after the recording began."""

    time: float
    pose: Sequence[float]


def move(target: Sequence[float], seconds: float, start: Pose | None = None) -> Trajectory:
    """Return the motion to one pose, its angles clamped, in `seconds` or, if needed, longer.

    Raises:
        OutsideLimits: an angle is not a number, or there are not four of them.
        ValueError: `seconds` is not a number, or too long.
    """
    pose = clamp_pose(target)
    fastest = 0.0 if start is None else farthest(start, pose) / MAX_RATE
    return Trajectory((Point(pose, _duration(max(FIRST_POINT_S, _number("time", seconds), fastest))),))


def time_for(way: float, rate: float) -> float:
    """Return the seconds for a distance at a rate: at most the highest; for zero and less the default.

    Raises:
        ValueError: the rate is not a number.
    """
    _number("rate", rate)
    return max(FIRST_POINT_S, way / min(rate if rate > 0.0 else DEFAULT_RATE, MAX_RATE))


def clamp_speed(speed: float) -> float:
    """Clamp a playback speed; zero means as recorded.

    Raises:
        ValueError: it is not a number.
    """
    _number("speed", speed)
    return 1.0 if speed == 0.0 else min(max(speed, SLOWEST), FASTEST)


def replay(samples: Sequence[TrajectorySample], speed: float, start: Pose) -> Trajectory:
    """Return the motion along recorded poses, after a move from `start` to the first of them.

    That move is at the default rate. Later points keep their recorded distances in time, divided by the
    clamped speed, and are stretched where a joint would be too fast.

    Raises:
        OutsideLimits: an angle is not a number, or there are not four of them.
        ValueError: there are no samples, a time or the speed is not a number, or it takes too long.
    """
    if not samples:
        raise ValueError("there is nothing to play")
    factor = clamp_speed(speed)
    poses = [clamp_pose(sample.pose) for sample in samples]
    times = [_number("time", sample.time) for sample in samples]
    points = [Point(poses[0], time_for(farthest(start, poses[0]), DEFAULT_RATE))]
    for index in range(1, len(samples)):
        recorded = (times[index] - times[index - 1]) / factor
        fastest = farthest(poses[index - 1], poses[index]) / MAX_RATE
        points.append(Point(poses[index], _duration(points[-1].time + max(STEP_S, recorded, fastest))))
    return Trajectory(tuple(points))


def _between(before: Point, after: Point, time: float) -> Pose:
    share = (time - before.time) / (after.time - before.time)
    pan, lift, elbow, wrist = (a + share * (b - a) for a, b in zip(before.pose, after.pose, strict=True))
    return pan, lift, elbow, wrist


def _number(what: str, value: float) -> float:
    if not math.isfinite(value):
        raise ValueError(f"the {what} {value} is not a number")
    return value


def _duration(seconds: float) -> float:
    if seconds > LONGEST_S:
        raise ValueError(f"the motion would take longer than {LONGEST_S:g} s")
    return seconds
