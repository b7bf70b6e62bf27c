"""The quality of the robot's localization, and whether it is good enough to drive.

The measure is the largest of the variances of x, y (m²) and yaw (rad²). The other entries of the covariance
say nothing here: a planar localizer leaves those of z, roll and pitch at huge values.
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
    """Read a PoseWithCovarianceStamped; None when its numbers describe no place.

    A quaternion of all zeros is what a message has that nobody filled in.
    """
    position, q = message.pose.pose.position, message.pose.pose.orientation
    numbers = (position.x, position.y, q.x, q.y, q.z, q.w)
    if not all(map(math.isfinite, numbers)) or not any((q.x, q.y, q.z, q.w)):
        return None
    return Fix(position.x, position.y, heading(q), variance(message.pose.covariance))


def variance(covariance: Sequence[float]) -> float:
    """Return the largest variance of x, y and yaw; infinite when one of them is none: not finite, below 0."""
    planar = [float(covariance[index]) for index in PLANAR]
    return max(planar) if all(math.isfinite(one) and one >= 0.0 for one in planar) else math.inf


def waits_for(known: Fix | None, live: bool, limit: float, topic: str) -> str:
    """Say why the robot does not count as localized yet, or "" when it does."""
    if known is None:
        return f"no {topic} received"
    if not live:
        return f"{topic} has no publisher any more"
    return "" if known.variance <= limit else f"variance {known.variance:.3f} > {limit:g}"


def drift(known: Fix | None, live: bool, limit: float | None) -> str:
    """Say why the robot must not set off, or "" when it may.

    Without a limit any pose ever received will do: with a map that is still being made, the pose is a seed
    whose publisher is long gone.
    """
    if known is None or (limit is not None and not live):
        return "amcl_drift_var=unknown"
    return "" if limit is None or known.variance <= limit else f"amcl_drift_var={known.variance:.3f}"
