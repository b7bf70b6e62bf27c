"""The charge of the battery as a fraction, whatever scale its driver uses."""

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
