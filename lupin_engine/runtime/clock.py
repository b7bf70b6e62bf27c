"""Time as an argument: the clock of a loop, and the virtual one that jumps."""

from __future__ import annotations

from typing import Protocol


class Clock(Protocol):
    """Says what time it is, in seconds from any origin; never goes backwards."""

    def now(self) -> float:
        """Return the time."""


class VirtualClock:
    """A clock that stands still until it is moved."""

    def __init__(self, start: float = 0.0) -> None:
        self._now = start

    def now(self) -> float:
        """Return the time."""
        return self._now

    def move_to(self, time: float) -> None:
        """Jump forward to `time`.

        Raises:
            ValueError: `time` lies before now; the text names both.
        """
        if time < self._now:
            raise ValueError(f"the clock stands at {self._now:g} s and cannot go back to {time:g} s")
        self._now = time
