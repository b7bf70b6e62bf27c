"""Plans a replay of a sequence: the arm's trajectory, and the events of the jaw. Pure."""

from __future__ import annotations

from dataclasses import dataclass

from lupin_arm.joints import Pose
from lupin_arm.library import NotInLibrary, Sequence
from lupin_arm.trajectory import Trajectory, TrajectorySample, replay

#: The jaw is commanded where a recording moves it farther than this since the last command, in radians.
JAW_MOVED = 0.05


@dataclass(frozen=True)
class JawEvent:
    """An angle of the jaw, so many seconds after the replay begins."""

    time: float
    angle: float


@dataclass(frozen=True)
class Replay:
    """The commands of a replay."""

    trajectory: Trajectory
    jaw: tuple[JawEvent, ...]

    @property
    def duration(self) -> float:
        """Its duration in seconds, the move to the first pose included."""
        return self.trajectory.duration


def plan(sequence: Sequence, speed: float, start: Pose) -> Replay:
    """Return the replay of a sequence for an arm that is at `start`.

    It begins with a move to the first pose at the default rate: the arm may be anywhere. Where a stretch
    takes longer than recorded, because a joint would be too fast, the jaw's events are shifted too.

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
