"""Poses for tests, and whether two are one."""

from __future__ import annotations

import math

import numpy as np

from lupin_greenhouse.poses import Pose, matrix, pose_of


def at(x: float = 0.0, y: float = 0.0, z: float = 0.0, yaw: float = 0.0) -> Pose:
    """A place, turned by `yaw` about the vertical."""
    pose = pose_of((x, y, z), (0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2)))
    assert pose is not None
    return pose


def is_same(one: Pose, other: Pose) -> bool:
    """Say whether two poses are one; q and -q are the same rotation."""
    places = np.allclose(one.position, other.position, atol=1e-9)
    return bool(places and np.allclose(matrix(one.rotation), matrix(other.rotation), atol=1e-9))
