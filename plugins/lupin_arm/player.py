"""A replay, planned before anything is sent: the motion of the arm, and when the jaw moves. Pure."""

from __future__ import annotations

from dataclasses import dataclass

from lupin_arm.joints import Pose
from lupin_arm.library import NotInLibrary, Sequence
from lupin_arm.trajectory import Trajectory, TrajectorySample, replay

#: The jaw is commanded where a recording moves it farther than this since the last command, in radians.
JAW_MOVED = 0.05


@dataclass(frozen=True)
class JawEvent:
    """The jaw goes to an angle, so many seconds after the beginning of the replay."""

    time: float
    angle: float


@dataclass(frozen=True)
class Replay:
    """What is sent for a sequence."""

    trajectory: Trajectory
    jaw: tuple[JawEvent, ...]

    @property
    def duration(self) -> float:
        """How long it takes, the way to the first pose included."""
        return self.trajectory.duration


def plan(sequence: Sequence, speed: float, start: Pose) -> Replay:
    """Return the replay of a sequence for an arm that is at `start`.

    It begins with a move to the first pose at an ordinary pace: the arm may have been left anywhere. Jaw and
    arm keep together where a stretch takes longer than it was recorded.

    Raises:
        NotInLibrary: the speed is no number.
    """
    samples = [TrajectorySample(waypoint.t, waypoint.arm) for waypoint in sequence.waypoints]
    try:
        trajectory = replay(samples, speed, start)
    except ValueError as reason:
        raise NotInLibrary(str(reason)) from None
    return Replay(trajectory, tuple(_jaw_events(sequence, trajectory)))


def _jaw_events(sequence: Sequence, trajectory: Trajectory) -> list[JawEvent]:
    events: list[JawEvent] = []
    for waypoint, point in zip(sequence.waypoints, trajectory.points, strict=True):
        angle = waypoint.gripper if sequence.include_gripper else None
        if angle is not None and (not events or abs(angle - events[-1].angle) > JAW_MOVED):
            events.append(JawEvent(point.time, angle))
    return events
