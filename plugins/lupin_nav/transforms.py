"""Where the robot is, by the transforms that others publish: the last one of each, on the plane.

Metres and radians. The wheels of ROS 2 have no tf2 for Python; a robot on a floor needs little of it: x, y
and the heading of the last transform of each frame, composed from the robot's frame up to the map.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Planar:
    """A place and a heading in some frame, or a frame in its parent."""

    x: float
    y: float
    yaw: float

    def __matmul__(self, inner: Planar) -> Planar:
        """Return `inner`, which is told in this frame, in the frame that this one is told in."""
        cosine, sine = math.cos(self.yaw), math.sin(self.yaw)
        return Planar(
            self.x + cosine * inner.x - sine * inner.y,
            self.y + sine * inner.x + cosine * inner.y,
            math.remainder(self.yaw + inner.yaw, math.tau),
        )


def heading(q: Any) -> float:
    """Return the rotation about the vertical axis of a quaternion message, in radians."""
    return math.atan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y * q.y + q.z * q.z))


def frame_name(name: str) -> str:
    """Return a frame's name as ROS 2 spells it; some publishers still put a slash before it."""
    return name.lstrip("/")


class Transforms:
    """The last transform of every frame that has a parent."""

    def __init__(self) -> None:
        self._parents: dict[str, tuple[str, Planar]] = {}

    def take(self, message: Any) -> None:
        """Take in a TFMessage; what holds no finite numbers is left out."""
        for stamped in message.transforms:
            shift, q = stamped.transform.translation, stamped.transform.rotation
            place = Planar(shift.x, shift.y, heading(q))
            if all(map(math.isfinite, (place.x, place.y, place.yaw))):
                parent = frame_name(stamped.header.frame_id)
                self._parents[frame_name(stamped.child_frame_id)] = parent, place

    def find(self, target: str, source: str) -> Planar | None:
        """Return where frame `source` is in frame `target`; None when the one is not above the other."""
        place = Planar(0.0, 0.0, 0.0)
        frame, above = frame_name(source), frame_name(target)
        passed = set()
        while frame != above:
            if frame not in self._parents or frame in passed:
                return None  # a tree that goes in circles has no top
            passed.add(frame)
            frame, step = self._parents[frame]
            place = step @ place
        return place
