"""Computes which tags the camera sees: in range, in the field of view, from the front, not behind a table.

Metres and radians in frame `map`. Heights are ignored: tags hang at about the camera's own height.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lupin_greenhouse import LENGTH, WIDTH, Table, Tag
from lupin_sim.floor import Point
from lupin_sim.layout import Floorplan
from lupin_sim.robot import FloorPose

Numbers = NDArray[np.float64]

#: How far before its table a plate hangs.
_BEFORE_M = 0.01
#: A direction with less of an axis than this (a sine) leads along it.
_ALONG = 1e-6
#: The most oblique view, from the plate's normal, under which its code can still be read.
MOST_OBLIQUE = math.radians(75.0)


@dataclass(frozen=True)
class Plate:
    """A tag's plate: its position in the layout, the heading of its normal, and the position of its face."""

    id: str
    x: float
    y: float
    yaw: float
    face: tuple[float, float]


class Camera:
    """The camera of the robot: looks ahead over `field` radians, up to `reach` metres."""

    def __init__(self, layout: Floorplan, reach: float, field: float, pests: Sequence[Point] = ()) -> None:
        self._pests: Numbers = np.array(pests, dtype=float).reshape(-1, 2)
        self.plates = plates_of(layout)
        self._reach, self._half = reach, field / 2.0
        self._faces = np.array([plate.face for plate in self.plates], dtype=float).reshape(-1, 2)
        self._yaws = np.array([plate.yaw for plate in self.plates], dtype=float)
        self._low = np.array([(t.x0, t.y0) for t in layout.tables], dtype=float).reshape(-1, 2)
        self._high = np.array([(t.x1, t.y1) for t in layout.tables], dtype=float).reshape(-1, 2)

    def sees(self, pose: FloorPose) -> list[Plate]:
        """Return the plates that are seen from `pose`."""
        off = self._faces - (pose.x, pose.y)
        bearing = np.arctan2(off[:, 1], off[:, 0])
        readable = np.abs(_angle(bearing + math.pi - self._yaws)) <= MOST_OBLIQUE
        return [self.plates[index] for index in self._in_view(pose, self._faces, readable)]

    def pests(self, pose: FloorPose) -> list[Point]:
        """Return the places of the pests that are seen from `pose`."""
        seen = self._pests[self._in_view(pose, self._pests, np.ones(len(self._pests), dtype=bool))]
        return [(x, y) for x, y in seen.tolist()]

    def _in_view(self, pose: FloorPose, places: Numbers, candidates: NDArray[np.bool_]) -> NDArray[np.intp]:
        """Return the candidates that are in range, in the field of view, and not behind a table."""
        eye = np.array((pose.x, pose.y))
        off = places - eye
        seen = candidates & (np.hypot(off[:, 0], off[:, 1]) <= self._reach)
        seen &= np.abs(_angle(np.arctan2(off[:, 1], off[:, 0]) - pose.yaw)) <= self._half
        found = np.flatnonzero(seen)
        return found[~self._hidden(eye, off[found])]

    def _hidden(self, eye: Numbers, off: Numbers) -> NDArray[np.bool_]:
        """Return for each line from `eye` along `off` whether it crosses a table (slab test).

        `enter` and `leave` are the shares of the line between which it is inside in x and in y.
        """
        with np.errstate(divide="ignore", invalid="ignore"):
            one = (self._low - eye) / off[:, None, :]
            other = (self._high - eye) / off[:, None, :]
        enter = np.fmax(np.fmin(one, other).max(axis=2), 0.0)
        leave = np.fmin(np.fmax(one, other).min(axis=2), 1.0)
        hidden: NDArray[np.bool_] = np.any(enter < leave, axis=1)
        return hidden


def plates_of(layout: Floorplan) -> tuple[Plate, ...]:
    """Return the plates of the simulated greenhouse.

    Without `facing` in the layout a plate hangs on the nearest side of its table, of equal ones a long side;
    without tables it faces the middle of the floor. `lupin_nav` is not asked: a robot with another layout, or
    a guess, may be wrong.
    """
    return tuple(_plate(tag, layout.tables) for tag in layout.tags)


def _plate(tag: Tag, tables: Sequence[Table]) -> Plate:
    table = min(tables, key=lambda table: table.distance(tag.x, tag.y), default=None)
    if table is None:
        middle = math.atan2(LENGTH / 2 - tag.y, WIDTH / 2 - tag.x)
        return Plate(tag.id, tag.x, tag.y, middle if tag.facing is None else tag.facing, (tag.x, tag.y))
    yaw = _nearest_side(tag, table) if tag.facing is None else tag.facing
    return Plate(tag.id, tag.x, tag.y, yaw, _face(tag, table, yaw))


def _nearest_side(tag: Tag, table: Table) -> float:
    wide = table.x1 - table.x0 >= table.y1 - table.y0
    across = ((abs(table.y1 - tag.y), math.pi / 2), (abs(tag.y - table.y0), -math.pi / 2))
    along = ((abs(table.x1 - tag.x), 0.0), (abs(tag.x - table.x0), math.pi))
    return min(across + along if wide else along + across, key=lambda side: side[0])[1]


def _face(tag: Tag, table: Table, yaw: float) -> tuple[float, float]:
    """Return the position of a plate's face: just before its tag, or before the table that the tag is on."""
    dx, dy = math.cos(yaw), math.sin(yaw)
    to_x, to_y = (table.x1 if dx > 0.0 else table.x0), (table.y1 if dy > 0.0 else table.y0)
    ways = ((to_x - tag.x, dx), (to_y - tag.y, dy)) if table.distance(tag.x, tag.y) == 0.0 else ()
    out = min((way / part for way, part in ways if abs(part) > _ALONG), default=0.0)
    return tag.x + (out + _BEFORE_M) * dx, tag.y + (out + _BEFORE_M) * dy


def facing(yaw: float) -> tuple[float, float, float, float]:
    """Return the shortest rotation (x, y, z, w) that turns +Z to the horizontal heading `yaw`.

    Its w is never 0, which would mean unset. The rotation about the plate's own normal is not simulated.
    """
    half = math.sqrt(0.5)
    return -half * math.sin(yaw), half * math.cos(yaw), 0.0, half


def _angle(difference: Any) -> Any:
    """Return angles within -pi ... pi."""
    return (difference + math.pi) % math.tau - math.pi
