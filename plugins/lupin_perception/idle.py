"""Schedules sensor readings of tags while no mission is active. Pure; time is an argument, in seconds.

A tag is read once, or again after each period; after a failure again after `AGAIN_S`. A tag that the
greenhouse does not know waits for the period like one that was read.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

#: Seconds before a reading that failed is tried again, and readings under way at a time.
AGAIN_S = 5.0
AT_ONCE = 4


class Schedule:
    """The next due time of each tag, for as long as this process lives."""

    def __init__(self, period: float) -> None:
        """Read each tag every `period` seconds; 0: once."""
        self._period = period if period > 0.0 else math.inf
        self._due: dict[str, float] = {}
        self._under_way: set[str] = set()

    def due(self, tags: Iterable[str], now: float) -> list[str]:
        """Return the tags to read now, pending until `done` or `failed`; at most `AT_ONCE` are."""
        room = AT_ONCE - len(self._under_way)
        wanted = [tag for tag in tags if tag not in self._under_way and self._due.get(tag, now) <= now]
        self._under_way.update(wanted[:room])
        return wanted[:room]

    def done(self, tag_id: str, now: float) -> None:
        """Record that a tag was read, or does not exist."""
        self._end(tag_id, now + self._period)

    def failed(self, tag_id: str, now: float) -> None:
        """Record that a tag could not be read."""
        self._end(tag_id, now + AGAIN_S)

    def _end(self, tag_id: str, due: float) -> None:
        self._under_way.discard(tag_id)
        self._due[tag_id] = due
