"""Clocks: that of a loop, the virtual one of simulations, and local time in a zone."""

from __future__ import annotations

from collections.abc import Collection
from datetime import date, datetime, timedelta, timezone, tzinfo
from datetime import time as time_of_day
from typing import Protocol

from lupin_engine.plugin.types import zone_called

UTC = "UTC"
_WRITTEN = "2026-11-22 22:00"
#: Years that every clock and every table of zones has.
_FIRST_YEAR, _LAST_YEAR = 1971, 2999


class Clock(Protocol):
    """A steady clock, in seconds from any origin; it never goes backwards."""

    def now(self) -> float:
        """Return the time."""


class VirtualClock:
    """A steady clock that stands still until it is moved, and a wall clock (POSIX time) that may be set."""

    def __init__(self, start: float = 0.0, wall: float = 0.0) -> None:
        self._now = start
        self._ahead = wall - start

    def now(self) -> float:
        """Return the time."""
        return self._now

    def wall(self) -> float:
        """Return the time of the wall clock."""
        return self._now + self._ahead

    def set_wall(self, wall: float) -> None:
        """Set the wall clock; the steady one stays as it is."""
        self._ahead = wall - self._now

    def move_to(self, time: float) -> None:
        """Jump forward to `time`.

        Raises:
            ValueError: `time` lies before now; the text names both.
        """
        if time < self._now:
            raise ValueError(f"the clock stands at {self._now:g} s and cannot go back to {time:g} s")
        self._now = time


class ZoneCalendar:
    """Local dates and times of day in a time zone: a `machine.scope.Calendar`."""

    def __init__(self, zone: tzinfo, name: str) -> None:
        self._zone = zone
        self._name = name

    def shown(self, moment: float) -> tuple[str, str]:
        """Return date and time of day, as texts."""
        found = self._local(moment)
        return found.date().isoformat(), f"{found:%H:%M}"

    def hour(self, moment: float) -> int:
        """Return the hour of the day, 0 to 23."""
        return self._local(moment).hour

    def as_text(self, moment: float) -> str:
        """Return a moment as people write it, with the zone."""
        return f"{self._local(moment):%Y-%m-%d %H:%M:%S} {self._name}"

    def written(self, moment: float) -> str:
        """Return a moment as `moment` reads it."""
        found = self._local(moment)
        exact = found if found.fold else found.replace(tzinfo=None)
        precise = "microseconds" if found.microsecond else "seconds" if found.second else "minutes"
        return exact.isoformat(" ", precise)

    def next(self, time: str, after: float, without: Collection[str]) -> tuple[float, str]:
        """Return the first moment later than `after` at which clocks show `time`, and its date.

        Dates in `without` are skipped. A time that clocks leave out on a date counts as shown when they leap.
        """
        day, wanted = self._local(after).date(), time_of_day.fromisoformat(time)
        while True:
            moment = self._reached(day, wanted)
            if moment > round(after, 3) and day.isoformat() not in without:
                return moment, day.isoformat()
            day += timedelta(days=1)

    def moment(self, text: str) -> float:
        """Return the POSIX time of a local one, such as `2026-11-22 22:00`, perhaps with an offset from UTC.

        Raises:
            ValueError: this is no date with a time of day.
        """
        try:
            found = datetime.fromisoformat(text) if len(text) >= len(_WRITTEN) else None
        except ValueError:
            found = None
        if found is None or not _FIRST_YEAR <= found.year <= _LAST_YEAR:
            problem = f"expected a date with a time of day, got {text!r}"
            raise ValueError(f"{problem}; write one such as {_WRITTEN!r}")
        return found.timestamp() if found.tzinfo is not None else self._reached(found.date(), found.time())

    def _local(self, moment: float) -> datetime:
        return datetime.fromtimestamp(round(moment, 3), self._zone)

    def _reached(self, day: date, time: time_of_day) -> float:
        """Return when clocks first show a time of day on a date, or leap over it."""
        wanted = datetime.combine(day, time)
        found = wanted.replace(tzinfo=self._zone)
        there = found.astimezone(timezone.utc)
        if there.astimezone(self._zone).replace(tzinfo=None) == wanted:
            return there.timestamp()
        # Left out: the leap lies between what both ways to count lead to.
        before, after = wanted.replace(tzinfo=self._zone, fold=1).timestamp(), there.timestamp()
        behind = self._local(before).utcoffset()
        while after - before > 1.0:
            middle = (before + after) // 2
            if self._local(middle).utcoffset() == behind:
                before = middle
            else:
                after = middle
        return after


def calendar_of(zone: str) -> ZoneCalendar:
    """Return the calendar of a time zone, by its IANA name; ValueError when there is none."""
    return ZoneCalendar(zone_called(zone), zone)
