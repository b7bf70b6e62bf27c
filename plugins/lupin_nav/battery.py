"""The charge of the battery as a fraction, whatever scale its drivers use; of several sources the worst."""

from __future__ import annotations

import math


def charge(percentage: float) -> float | None:
    """Return the charge as 0 ... 1, or None for a reading that says nothing (not finite, negative).

    `sensor_msgs/BatteryState` says 0 ... 1, but drivers publish 0 ... 100 and NaN as well; what is above 1 is
    taken as percent and capped at 100 %. A reading between 1 and 2 is ambiguous, and read as 1 ... 2 %: the
    robot then goes home with a full battery, and does not stay out with an empty one.
    """
    if not math.isfinite(percentage) or percentage < 0.0:
        return None
    return min(percentage / 100.0 if percentage > 1.0 else percentage, 1.0)


class Charges:
    """What each source has told of the battery: the worst of those that were heard lately counts.

    Pure: times are arguments, in seconds of one clock that never goes back.
    """

    def __init__(self, timeout: float, silent_is_empty: bool = False) -> None:
        """A source that was heard and is silent for `timeout` s is unknown, or empty; 0: never."""
        self._silent_is_empty = silent_is_empty
        self._timeout = timeout or math.inf
        #: By source: its charge, and when it told that; when it was heard or reported last.
        self._told: dict[str, tuple[float, float]] = {}
        self._reported: dict[str, float] = {}

    def heard(self, source: str, charge: float, now: float) -> None:
        """Take what a source tells, as a fraction."""
        self._told[source] = charge, now
        self._reported[source] = now

    def worst(self, now: float) -> tuple[str, float] | None:
        """Return the source with the lowest charge, and that charge; None while none is known."""
        silent = self.silent(now)
        known = [(charge, source) for source, (charge, _) in self._told.items() if source not in silent]
        if self._silent_is_empty:
            known += [(0.0, source) for source in silent]
        if not known:
            return None
        charge, source = min(known)
        return source, charge

    def silent(self, now: float) -> list[str]:
        """Return the sources that were heard and are unknown now."""
        return [source for source, (_, at) in self._told.items() if now - at >= self._timeout]

    def due(self, now: float) -> list[str]:
        """Return those of them that are to be reported: at once, and again after each timeout."""
        found = [source for source in self.silent(now) if now - self._reported[source] >= self._timeout]
        self._reported.update(dict.fromkeys(found, now))
        return found
