"""Converts a battery's charge on any driver's scale to a fraction; of several sources the lowest counts."""

from __future__ import annotations

import math


def charge(percentage: float) -> float | None:
    """Return the charge as 0 ... 1; None for a reading that is negative or not finite.

    `sensor_msgs/BatteryState` defines 0 ... 1, but drivers publish 0 ... 100 and NaN too: values above 1
    count as percent, capped at 100 %. Values between 1 and 2 are ambiguous and count as 1 ... 2 %: the robot
    rather returns with a full battery than stays out with an empty one.
    """
    if not math.isfinite(percentage) or percentage < 0.0:
        return None
    return min(percentage / 100.0 if percentage > 1.0 else percentage, 1.0)


class Charges:
    """The last charge of each source, with a timeout for silent ones.

    Pure: times are arguments, in seconds of one clock that never goes back.
    """

    def __init__(self, timeout: float, silent_is_empty: bool = False) -> None:
        """A source that was heard and is silent for `timeout` s counts as unknown, or as empty; 0: never."""
        self._silent_is_empty = silent_is_empty
        self._timeout = timeout or math.inf
        #: By source: its charge, and when it reported that; when it was last heard or reported silent.
        self._reports: dict[str, tuple[float, float]] = {}
        self._reported: dict[str, float] = {}

    def heard(self, source: str, charge: float, now: float) -> None:
        """Take a source's charge, as a fraction."""
        self._reports[source] = charge, now
        self._reported[source] = now

    def worst(self, now: float) -> tuple[str, float] | None:
        """Return the source with the lowest charge, and that charge; None while none is known."""
        silent = self.silent(now)
        known = [(charge, source) for source, (charge, _) in self._reports.items() if source not in silent]
        if self._silent_is_empty:
            known += [(0.0, source) for source in silent]
        if not known:
            return None
        charge, source = min(known)
        return source, charge

    def silent(self, now: float) -> list[str]:
        """Return the sources that have timed out."""
        return [source for source, (_, at) in self._reports.items() if now - at >= self._timeout]

    def due(self, now: float) -> list[str]:
        """Return the timed-out sources to report now: at once, and again after each further timeout."""
        found = [source for source in self.silent(now) if now - self._reported[source] >= self._timeout]
        self._reported.update(dict.fromkeys(found, now))
        return found
