"""Rigid transforms: composition, rotation matrices, interpolation. Pure.

Metres; rotations are unit quaternions (x, y, z, w) as in ROS, x forward, y left, z up (REP 103), in
Hamilton's convention, ij = k.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: A shorter quaternion has no direction.
_SHORTEST = 1e-6


@dataclass(frozen=True, eq=False)
class Pose:
    """A position (x, y, z) and a rotation (x, y, z, w) in some frame; also a frame in its parent."""

    position: Array
    rotation: Array

    def __matmul__(self, inner: Pose) -> Pose:
        """Return `inner`, given in this frame, in this frame's parent.

        p = p1 + R(q1) p2 and q = q1 q2.
        """
        turned = matrix(self.rotation) @ inner.position
        return Pose(self.position + turned, product(self.rotation, inner.rotation))

    @property
    def plane(self) -> tuple[float, float]:
        """The place on the floor: x and y in metres."""
        x, y = self.position[:2].tolist()
        return x, y


def pose_of(position: Iterable[float], rotation: Iterable[float]) -> Pose | None:
    """Return a pose with a unit quaternion; None where numbers are not finite or the quaternion is zero."""
    place, turn = (*position,), (*rotation,)
    length = math.hypot(*turn)  # does not overflow where a sum of squares would
    if not all(map(math.isfinite, (*place, *turn, length))) or length < _SHORTEST:
        return None
    # Plain numbers until here: for so few numpy takes ten times as long, and there are a hundred a second.
    return Pose(np.array(place, dtype=float), np.array([part / length for part in turn], dtype=float))


def seen_rotation(rotation: Any) -> tuple[float, float, float, float] | None:
    """Return the unit quaternion (x, y, z, w) of a tag that was seen; None where it is not finite.

    In a DiscoveredTag all zeros mean that the orientation was not set, so the identity is returned, and w = 0
    is a true half turn. That w = 0 means "no pose" holds for Observation, TwinTagState and ConfirmTag only.
    """
    given = rotation.x, rotation.y, rotation.z, rotation.w
    length = math.hypot(*given)
    if not all(map(math.isfinite, given)) or not math.isfinite(length):
        return None
    x, y, z, w = given if length >= _SHORTEST else (0.0, 0.0, 0.0, 1.0)
    length = length if length >= _SHORTEST else 1.0
    return x / length, y / length, z / length, w / length


def heading(rotation: Any) -> float:
    """Return the yaw of a quaternion message, in radians from -pi to pi.

    atan2(2 (w z + x y), w^2 + x^2 - y^2 - z^2), the direction of the rotated x axis in the plane, for
    quaternions of any length; all zeros give 0.
    """
    x, y, z, w = rotation.x, rotation.y, rotation.z, rotation.w
    return math.atan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z)


def product(first: Array, second: Array) -> Array:
    """Return Hamilton's product: the rotation by `second`, then by `first`."""
    x1, y1, z1, w1 = first.tolist()
    x2, y2, z2, w2 = second.tolist()
    return np.array(
        (
            w1 * x2 + x1 * w2 + y1 * z2 - z1 * y2,
            w1 * y2 - x1 * z2 + y1 * w2 + z1 * x2,
            w1 * z2 + x1 * y2 - y1 * x2 + z1 * w2,
            w1 * w2 - x1 * x2 - y1 * y2 - z1 * z2,
        )
    )


def matrix(rotation: Array) -> Array:
    """Return the rotation matrix of a unit quaternion."""
    x, y, z, w = rotation.tolist()
    return np.array(
        (
            (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
            (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
            (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
        )
    )


def between(first: Pose, second: Pose, share: float) -> Pose:
    """Return the pose at `share` (0 to 1) of the way: linear, and nlerp by the shorter way for the rotation.

    q ∝ (1 - s) q1 ± s q2: off the true great circle by less than 1 % of the angle for turns up to 60°;
    consecutive transforms of a frame are closer than that.
    """
    other = second.rotation if float(first.rotation @ second.rotation) >= 0.0 else -second.rotation
    turn = (1.0 - share) * first.rotation + share * other
    place = (1.0 - share) * first.position + share * second.position
    return Pose(place, turn / np.linalg.norm(turn))
