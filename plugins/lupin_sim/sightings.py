"""What the camera has seen in the mission under way: each tag, and how often.

A tag counts as discovered after some sightings. A new mission begins with none; without a mission nothing is
added. So what is known is always of one mission, and `since` says when it last grew or was forgotten: a list
of an earlier mission never looks like one of the next.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Generic, TypeVar

from lupin_sim.camera import Plate

#: A moment of whatever clock; it is only kept.
Moment = TypeVar("Moment")

#: Lifecycle states in which no mission is under way.
IDLE = frozenset({"", "BOOT", "READY", "DONE", "FAULT"})


class Sightings(Generic[Moment]):
    """The tags seen, in the order in which they were first seen."""

    def __init__(self, enough: int, now: Moment) -> None:
        """`enough` sightings make a discovery; nothing has been seen until `now`."""
        self._enough = enough
        self._counts: dict[Plate, int] = {}
        self._mission_id = ""
        self._active = False
        #: When something was last seen, or forgotten.
        self.since = now

    def follow(self, mission_id: str, lifecycle: str, now: Moment) -> bool:
        """Take in the state of the mission; say whether a new one has begun, for which all is forgotten."""
        self._active = lifecycle not in IDLE
        if not mission_id or mission_id == self._mission_id:
            return False
        self._mission_id = mission_id
        self._counts.clear()
        self.since = now
        return True

    def add(self, plates: Iterable[Plate], now: Moment) -> None:
        """Count tags that are seen now; without a mission nobody counts."""
        if not self._active:
            return
        for plate in plates:
            self._counts[plate] = self._counts.get(plate, 0) + 1
            self.since = now

    @property
    def discovered(self) -> list[tuple[Plate, int]]:
        """The tags that were seen often enough, each with its number of sightings."""
        return [(plate, count) for plate, count in self._counts.items() if count >= self._enough]
