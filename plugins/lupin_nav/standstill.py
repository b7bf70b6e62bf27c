"""Detects a robot that moves on after its drive was cancelled: a server may accept a cancel and drive on."""

from __future__ import annotations

import math

from lupin_nav.frontier import Point

#: How long the robot may take to stand after its drive was cancelled, and after that has ended, in seconds.
BRAKING_S = 2.0
#: How far a standing robot may be from where it was then, in metres.
MOVED_M = 0.2
#: How long a robot is watched whose drive has ended, after `BRAKING_S`, in seconds: people may drive it then.
WATCHED_S = 5.0
#: One that stays within so many metres for so many seconds stands: what moves it later is not its drive.
STOOD_S, STOOD_M = 1.0, 0.03


class MovementWatch:
    """Watches the poses after the last cancelled drive. A single jump of the localizer is no movement."""

    def __init__(self) -> None:
        self.attempt = ""
        self._since = 0.0
        self._ended = False
        self._from: Point | None = None
        self._last: Point = (0.0, 0.0)
        self._jump = 0.0

    def cancelled(self, attempt: str, now: float) -> None:
        """Begin to watch; repeated calls for an attempt change nothing."""
        if attempt != self.attempt:
            self.attempt, self._ended = attempt, False
            self._brake(now)

    def forget(self) -> None:
        """Stop watching: another drive has begun."""
        self.attempt = ""

    def moves(self, place: Point, now: float, runs: bool) -> bool:
        """Take a pose; return True, once, if the robot has moved on.

        It has when it is farther than `MOVED_M` from where it stood `BRAKING_S` after the cancel, and after
        the drive's end. The watch ends then, or some seconds after that end. `runs`: the server still has the
        drive.
        """
        if not self.attempt:
            return False
        if not (runs or self._ended):
            self._ended = True
            self._brake(now)
        if now < self._since + BRAKING_S:
            return False
        watched = STOOD_S if self._way(self._last) < STOOD_M else WATCHED_S
        if self._ended and now > self._since + BRAKING_S + watched:
            self.forget()
            return False
        if self._from is None:
            self._from = self._last = place
        self._jump = max(self._jump, math.dist(place, self._last))
        self._last = place
        moved = self._way(place) > MOVED_M
        if moved:
            self.forget()
        return moved

    def _way(self, place: Point) -> float:
        """Return the distance of a place from where the robot braked, in metres; 0 without a pose since."""
        return 0.0 if self._from is None else math.dist(place, self._from) - self._jump

    def _brake(self, now: float) -> None:
        self._since, self._from, self._jump = now, None, 0.0
