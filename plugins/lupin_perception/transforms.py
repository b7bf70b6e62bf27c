"""Poses in space, and where a frame is in another by the transforms that others publish. Pure.

Metres; rotations are unit quaternions (x, y, z, w) as in ROS, x forward, y left, z up. Moments are seconds of
whatever clock stamped the transforms.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Seconds for which moving frames are remembered.
HISTORY_S = 10.0
#: Frames that are remembered: a robot has some dozens, a greenhouse has hundreds of tags.
MAX_FRAMES = 2000
#: A shorter quaternion has no direction.
_SHORTEST = 1e-6


@dataclass(frozen=True, eq=False)
class Pose:
    """A place (x, y, z) and a rotation (x, y, z, w) in some frame, or a frame in its parent."""

    position: Array
    rotation: Array

    def __matmul__(self, inner: Pose) -> Pose:
        """Return `inner`, which is told in this frame, in the frame that this one is told in.

        p = p1 + R(q1) p2 and q = q1 q2.
        """
        turned = matrix(self.rotation) @ inner.position
        return Pose(self.position + turned, product(self.rotation, inner.rotation))


def pose_of(position: Iterable[float], rotation: Iterable[float]) -> Pose | None:
    """Return a pose with a unit quaternion; None when numbers are not finite or say no rotation."""
    place, turn = (*position,), (*rotation,)
    length = math.hypot(*turn)  # does not overflow where a sum of squares would
    if not all(map(math.isfinite, (*place, *turn, length))) or length < _SHORTEST:
        return None
    # Plain numbers until here: numpy takes ten times as long for so few, and robots tell a hundred a second.
    return Pose(np.array(place, dtype=float), np.array([part / length for part in turn], dtype=float))


def product(first: Array, second: Array) -> Array:
    """Return the quaternion that turns by `second` and then by `first` (Hamilton's product)."""
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
    """Return the rotation matrix of a unit quaternion; its columns are where the axes point."""
    x, y, z, w = rotation.tolist()
    return np.array(
        (
            (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
            (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
            (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
        )
    )


def between(first: Pose, second: Pose, share: float) -> Pose:
    """Return the pose at `share` (0 to 1) of the way: a line, and a rotation by the shorter way.

    q ∝ (1 - s) q1 ± s q2: off the true great circle by less than 1 % of the angle for turns up to 60°, and
    two transforms of one frame are closer than that.
    """
    other = second.rotation if float(first.rotation @ second.rotation) >= 0.0 else -second.rotation
    turn = (1.0 - share) * first.rotation + share * other
    place = (1.0 - share) * first.position + share * second.position
    return Pose(place, turn / np.linalg.norm(turn))


@dataclass
class _Track:
    """Where one frame was in its parent, oldest first. A static one has one pose, good for every moment."""

    parent: str
    static: bool
    moments: list[float] = field(default_factory=list)
    poses: list[Pose] = field(default_factory=list)

    def add(self, pose: Pose, moment: float) -> None:
        if self.moments and moment <= self.moments[-1]:
            if moment > self.moments[-1] - HISTORY_S:
                return  # overtaken on the way
            self.moments.clear()  # the clock was set back: what is known is of another time
            self.poses.clear()
        self.moments.append(moment)
        self.poses.append(pose)
        too_old = bisect_right(self.moments, moment - HISTORY_S)
        del self.moments[:too_old], self.poses[:too_old]

    def at(self, moment: float) -> Pose:
        """Return the pose at a moment that is not before the oldest and not after the latest."""
        after = bisect_right(self.moments, moment)
        if self.static or after == len(self.moments):
            return self.poses[-1]
        begin, end = self.moments[after - 1], self.moments[after]
        return between(self.poses[after - 1], self.poses[after], (moment - begin) / (end - begin))


class Frames:
    """The transforms of the last seconds, as a tree of frames."""

    def __init__(self) -> None:
        """Nothing is known at first."""
        self._tracks: dict[str, _Track] = {}

    def add(self, parent: str, child: str, pose: Pose, moment: float, *, static: bool = False) -> bool:
        """Take in where `child` is in `parent`; False when there are too many frames already."""
        child, parent = _name(child), _name(parent)
        track = self._tracks.get(child)
        if track is None and len(self._tracks) >= MAX_FRAMES:
            return False
        if track is None or track.parent != parent or track.static or static:
            track = self._tracks[child] = _Track(parent, static)
        track.add(pose, moment)
        return True

    def find(self, target: str, source: str) -> Pose | None:
        """Return the latest pose of frame `source` in frame `target`; None when it is not known.

        All transforms are taken at one moment, the last for which every frame on the way is known: a tag
        that was seen a second ago is placed by where the camera was then, not by where it is now.
        """
        tracks = self._chain(_name(target), _name(source))
        if tracks is None:
            return None
        moving = [track for track in tracks if not track.static]
        moment = min((track.moments[-1] for track in moving), default=math.inf)
        if any(track.moments[0] > moment for track in moving):
            return None
        pose = Pose(np.zeros(3), np.array((0.0, 0.0, 0.0, 1.0)))
        for track in tracks:
            pose = track.at(moment) @ pose
        return pose

    def _chain(self, target: str, source: str) -> Sequence[_Track] | None:
        """Return the frames from `source` up to below `target`."""
        chain: list[_Track] = []
        passed: set[str] = set()
        frame = source
        while frame != target:
            if frame not in self._tracks or frame in passed:
                return None  # a tree that goes in circles has no top
            passed.add(frame)
            chain.append(self._tracks[frame])
            frame = chain[-1].parent
        return chain


def _name(frame: str) -> str:
    """Return a frame's name as ROS 2 spells it; some publishers still put a slash before it."""
    return frame.lstrip("/")
