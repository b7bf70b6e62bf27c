"""Maps real time to virtual time: paused, or at a factor; lost time beyond a second is not made up for."""

from __future__ import annotations

import math

from lupin_engine.errors import LupinError

#: The slowest and the fastest that can be asked for; beyond that only as fast as it goes.
SLOWEST, FASTEST = 0.1, 100.0
#: Real seconds that virtual time may fall behind before it is let go.
_BEHIND_S = 1.0


class Pace:
    """Converts seconds of a steady clock to those of a virtual one."""

    def __init__(self, speed: float = 1.0) -> None:
        self.speed = speed
        self.is_running = False
        self._anchor = (0.0, 0.0)

    def go(self, now: float, virtual: float) -> None:
        """Let virtual time run from `virtual` on, beginning at `now` of the steady clock."""
        self.is_running = True
        self._anchor = (now, virtual)

    def stand(self) -> None:
        """Pause virtual time."""
        self.is_running = False

    def set_speed(self, speed: float, now: float, virtual: float) -> None:
        """Set the factor; infinite: as fast as possible.

        Raises:
            LupinError: it is out of range.
        """
        if not (SLOWEST <= speed <= FASTEST or speed == math.inf):
            raise LupinError(f"a speed is {SLOWEST:g} to {FASTEST:g}, or max, got {speed:g}")
        self.speed = speed
        self._anchor = (now, virtual)

    def target(self, now: float, virtual: float) -> float:
        """Return the time that the virtual clock may reach now; `virtual` is its present time."""
        if self.speed == math.inf:
            return math.inf
        began, at = self._anchor
        target = at + (now - began) * self.speed
        if target - virtual > _BEHIND_S * self.speed:  # the machine is busy: time is let go, not made up for
            self._anchor = (now, virtual)
            return virtual
        return target

    def wait(self, now: float, due: float) -> float:
        """Return in how many real seconds the virtual clock reaches `due`."""
        if self.speed == math.inf:
            return 0.0
        began, at = self._anchor
        return max(0.0, (due - at) / self.speed - (now - began))
