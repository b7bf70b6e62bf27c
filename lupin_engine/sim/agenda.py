"""The event queue of a simulation's world, ordered by time."""

from __future__ import annotations

import heapq
from collections.abc import Callable


class Agenda:
    """A priority queue of actions by time; at the same time in the order in which they were added."""

    def __init__(self) -> None:
        self._entries: list[tuple[float, int, Callable[[], None]]] = []
        self._count = 0

    def note(self, time: float, action: Callable[[], None]) -> None:
        """Do `action` at `time`, in seconds of the simulation."""
        self._count += 1
        heapq.heappush(self._entries, (time, self._count, action))

    @property
    def next_due(self) -> float | None:
        """The time of the next action; None when there is none."""
        return self._entries[0][0] if self._entries else None

    def do_next(self, now: float) -> bool:
        """Carry out the first action that is due at `now`; say whether there was one."""
        if not self._entries or self._entries[0][0] > now:
            return False
        heapq.heappop(self._entries)[2]()
        return True
