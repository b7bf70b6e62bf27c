"""What will happen at which time: the queue of a simulation's world."""

from __future__ import annotations

import heapq
from collections.abc import Callable


class Agenda:
    """Things to do at a time; at the same time in the order in which they were noted down."""

    def __init__(self) -> None:
        self._entries: list[tuple[float, int, Callable[[], None]]] = []
        self._noted = 0

    def note(self, time: float, action: Callable[[], None]) -> None:
        """Do `action` at `time`, in seconds of the simulation."""
        self._noted += 1
        heapq.heappush(self._entries, (time, self._noted, action))

    @property
    def next_due(self) -> float | None:
        """When the next thing happens; None when nothing will."""
        return self._entries[0][0] if self._entries else None

    def do_next(self, now: float) -> bool:
        """Do the first thing that is due at `now`; say whether there was one."""
        if not self._entries or self._entries[0][0] > now:
            return False
        heapq.heappop(self._entries)[2]()
        return True
