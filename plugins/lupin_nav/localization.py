"""Decides by the localizer's covariance whether the robot is localized well enough to drive.

The measure is the largest variance of x, y (m²) and yaw (rad²). Other entries are ignored: a planar localizer
leaves those of z, roll and pitch at huge values.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from lupin_greenhouse import heading

#: Places of x, y and yaw on the diagonal of a row-major 6 x 6 covariance.
PLANAR = (0, 7, 35)


@dataclass(frozen=True)
class Fix:
    """A pose of the localizer: metres and radians in frame `map`, and its largest planar variance."""

    x: float
    y: float
    yaw: float
    variance: float

    @property
    def pose(self) -> dict[str, float]:
        """The pose as a record of type `pose`."""
        return {"x": self.x, "y": self.y, "yaw": self.yaw}


def fix(message: Any) -> Fix | None:
    """Read a PoseWithCovarianceStamped; None where its numbers are no pose.

    A quaternion of all zeros counts as unset.
    """
    position, q = message.pose.pose.position, message.pose.pose.orientation
    numbers = (position.x, position.y, q.x, q.y, q.z, q.w)
    if not all(map(math.isfinite, numbers)) or not any((q.x, q.y, q.z, q.w)):
        return None
    return Fix(position.x, position.y, heading(q), variance(message.pose.covariance))


def variance(covariance: Sequence[float]) -> float:
    """Return the largest variance of x, y and yaw; infinite where one is negative or not finite."""
    planar = [float(covariance[index]) for index in PLANAR]
    return max(planar) if all(math.isfinite(one) and one >= 0.0 for one in planar) else math.inf


def waits_for(known: Fix | None, live: bool, limit: float, topic: str) -> str:
    """Return why the robot does not count as localized yet; "" where it does."""
    if known is None:
        return f"no {topic} received"
    if not live:
        return f"{topic} has no publisher any more"
    return "" if known.variance <= limit else f"variance {known.variance:.3f} > {limit:g}"


def drift(known: Fix | None, live: bool, limit: float | None) -> str:
    """Return why the robot must not set off; "" where it may.

    Without a limit every received pose will do: while a map is being made, the pose is a seed whose publisher
    is long gone.
    """
    if known is None or (limit is not None and not live):
        return "amcl_drift_var=unknown"
    return "" if limit is None or known.variance <= limit else f"amcl_drift_var={known.variance:.3f}"
