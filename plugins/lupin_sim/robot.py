"""The simulated body: follows a path or a velocity, and drains its battery. Time is an argument, in seconds.

Metres and radians in frame `map`. Motion is exact for any time step, so a late tick changes nothing.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise

from lupin_sim.floor import Point

#: Turns on the spot, in radians a second for each metre a second that it drives: a robot that is told to be
#: faster is faster at everything.
TURN_RATE = 3.0


@dataclass(frozen=True)
class FloorPose:
    """A pose on the floor."""

    x: float
    y: float
    yaw: float


class Robot:
    """The pose, the path, and the battery's charge (0 to 1)."""

    def __init__(self, pose: FloorPose, now: float, speed: float) -> None:
        self.pose = pose
        self.speed = speed
        self.charge = 1.0
        self.drain_per_s = 0.0
        self.braked = False
        self._now = now
        self._corners: deque[Point] = deque()
        self._final_yaw: float | None = None
        #: Velocity by hand: m/s forward, rad/s to the left, and until when it is obeyed.
        self._twist = (0.0, 0.0, -math.inf)

    @property
    def by_hand(self) -> bool:
        """Whether it follows a velocity."""
        return self._twist[2] > self._now

    @property
    def arrived(self) -> bool:
        """Whether nothing is left to drive or turn."""
        return self._final_yaw is None

    @property
    def path(self) -> list[Point]:
        """The present position, and the remaining corners."""
        return [(self.pose.x, self.pose.y), *self._corners]

    @property
    def remaining(self) -> float:
        """The rest of the path in metres."""
        return sum(math.dist(a, b) for a, b in pairwise(self.path))

    def follow(self, corners: Iterable[Point], yaw: float) -> None:
        """Drive over `corners` from here, then turn to `yaw`."""
        self.halt()
        self._corners = deque(corners)
        self._final_yaw = yaw

    def obey(self, forward: float, left: float, until: float) -> None:
        """Drive with a velocity in m/s and rad/s, within its limits, until a time; it avoids no tables."""
        most, most_turn = self.speed, TURN_RATE * self.speed
        self._twist = max(-most, min(most, forward)), max(-most_turn, min(most_turn, left)), until

    def halt(self) -> None:
        """Drop the path or velocity, and stand still."""
        self._corners.clear()
        self._final_yaw = None
        self._twist = (0.0, 0.0, -math.inf)

    def advance(self, now: float) -> None:
        """Simulate until `now`: drive unless `braked` or empty, and drain."""
        passed = max(0.0, now - self._now)
        obeyed = max(0.0, min(now, self._twist[2]) - self._now)
        self._now = now
        if not self.braked and self.charge > 0.0:
            self._drive(passed)
            self._roll(obeyed)
        self.charge = max(0.0, self.charge - self.drain_per_s * passed)

    def _drive(self, time: float) -> None:
        while time > 0.0 and not self.arrived:
            if self._corners:
                time = self._towards(self._corners[0], time)
            elif self._final_yaw is not None:
                time = self._turn(self._final_yaw, time)
                if self.pose.yaw == self._final_yaw:
                    self._final_yaw = None

    def _roll(self, time: float) -> None:
        """Roll along the arc of the velocity."""
        forward, left, _ = self._twist
        yaw = self.pose.yaw + left * time
        middle, half = (self.pose.yaw + yaw) / 2.0, left * time / 2.0
        chord = forward * time * (math.sin(half) / half if half else 1.0)
        x, y = self.pose.x + chord * math.cos(middle), self.pose.y + chord * math.sin(middle)
        self.pose = FloorPose(x, y, math.remainder(yaw, math.tau))

    def _towards(self, corner: Point, time: float) -> float:
        """Turn to and drive towards `corner`; return the remaining time."""
        dx, dy = corner[0] - self.pose.x, corner[1] - self.pose.y
        distance = math.hypot(dx, dy)
        if distance > 0.0:
            heading = math.atan2(dy, dx)
            time = self._turn(heading, time)
            if self.pose.yaw != heading:
                return 0.0
        if distance <= self.speed * time:
            self._corners.popleft()
            self.pose = FloorPose(corner[0], corner[1], self.pose.yaw)
            return time - distance / self.speed
        part = self.speed * time / distance
        self.pose = FloorPose(self.pose.x + part * dx, self.pose.y + part * dy, self.pose.yaw)
        return 0.0

    def _turn(self, yaw: float, time: float) -> float:
        """Turn towards `yaw` by the shorter way; return the remaining time."""
        angle = math.remainder(yaw - self.pose.yaw, math.tau)
        needed = abs(angle) / (TURN_RATE * self.speed)
        if needed <= time:
            self.pose = FloorPose(self.pose.x, self.pose.y, yaw)
            return time - needed
        turned = self.pose.yaw + math.copysign(TURN_RATE * self.speed * time, angle)
        self.pose = FloorPose(self.pose.x, self.pose.y, turned)
        return 0.0
