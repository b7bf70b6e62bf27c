"""Computes the approach pose: where the robot stands to read a tag. Pure; frame `map`.

Metres and radians. The pose lies on the plate's normal, since a code cannot be read from the side. The
normal is the layout's, else a guess from the nearest table (see `plates`).
"""

from __future__ import annotations

import enum
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lupin_greenhouse import Table
from lupin_nav.overrides import Override
from lupin_nav.plates import side_of

MIN_STANDOFF_M = 0.2
MAX_STANDOFF_M = 1.5
#: How far the goal is pulled back at a time when it lies inside a table.
PULL_BACK_M = 0.1
#: A direction shorter than this has no meaning.
DEGENERATE_M = 1e-6
#: So that 0.5 m pulled back three times still counts as 0.2 m.
_ROUNDING_M = 1e-9

Array = NDArray[np.float64]
#: A position in metres: (x, y).
Point = tuple[float, float]
#: An orientation as in a ROS message: (x, y, z, w).
Quaternion = tuple[float, float, float, float]


class ApproachSource(str, enum.Enum):
    """The rule that gave an approach pose."""

    GEOMETRY = "geometry"
    OVERRIDE = "override"
    FALLBACK = "fallback"
    DISCOVERED_NORMAL = "discovered_normal"
    DISCOVERED_ROBOT = "discovered_robot"


@dataclass(frozen=True)
class Approach:
    """The approach pose (metres, radians, frame `map`) and its origin.

    `table` is the nearest table's id where one was looked for; `standoff` is the used distance from the tag,
    in metres.
    """

    x: float
    y: float
    yaw: float
    source: ApproachSource
    table: str | None
    standoff: float


class Tables:
    """The tables of a layout as arrays, so that each test is one numpy operation."""

    def __init__(self, tables: Sequence[Table]) -> None:
        # Sorted by id, because the first of equal distances wins.
        self.all = tuple(sorted(tables, key=lambda table: table.id))
        self.low: Array = np.array([(t.x0, t.y0) for t in self.all], dtype=float).reshape(-1, 2)
        self.high: Array = np.array([(t.x1, t.y1) for t in self.all], dtype=float).reshape(-1, 2)

    def inside(self, points: Array) -> NDArray[np.bool_]:
        """Return for each of `points` (n, 2) whether a table covers it, edges included."""
        above = points[:, None, :] >= self.low
        below = points[:, None, :] <= self.high
        covered: NDArray[np.bool_] = np.any(np.all(above & below, axis=2), axis=1)
        return covered


def clamp_standoff(standoff: float) -> float:
    """Clamp a distance to 0.2 m ... 1.5 m; one that is not finite becomes 0.2 m."""
    if not math.isfinite(standoff):
        return MIN_STANDOFF_M
    return min(max(standoff, MIN_STANDOFF_M), MAX_STANDOFF_M)


@lru_cache(maxsize=8)
def tables_of(tables: tuple[Table, ...]) -> Tables:
    """Return the tables of a layout as arrays; cached."""
    return Tables(tables)


@lru_cache(maxsize=1024)
def approach(
    tag: Point,
    tables: Tables,
    standoff: float,
    fallback_yaw: float,
    override: Override | None = None,
    facing: float | None = None,
) -> Approach:
    """Return the approach pose for a tag of the layout; `facing` is its plate's heading there, or None.

    A full override (goal_x, goal_y and yaw) is used as it is. Else the goal lies `standoff` from the tag
    along the plate's normal, and is pulled back towards the tag until no table covers it. Without facing and
    tables, or where no goal is free, it is the tag itself (`fallback`). A partial override replaces single
    fields of the result.
    """
    own = override or Override()
    distance = clamp_standoff(standoff if own.standoff is None else own.standoff)
    if own.goal_x is not None and own.goal_y is not None and own.yaw is not None:
        return Approach(own.goal_x, own.goal_y, own.yaw, ApproachSource.OVERRIDE, None, distance)
    side = side_of(tag, tables.all, facing)
    table = None if side is None else side.table
    clear = None if side is None else _clear_goal(partial(side.before, tag), tables, distance)
    if clear is None:
        yaw = fallback_yaw if own.yaw is None else own.yaw
        return Approach(tag[0], tag[1], yaw, ApproachSource.FALLBACK, table, 0.0)
    goal, used = clear
    return Approach(
        x=float(goal[0]) if own.goal_x is None else own.goal_x,
        y=float(goal[1]) if own.goal_y is None else own.goal_y,
        yaw=_bearing(goal, tag) if own.yaw is None else own.yaw,
        source=ApproachSource.GEOMETRY if own == Override() else ApproachSource.OVERRIDE,
        table=table,
        standoff=used,
    )


def _clear_goal(
    before: Callable[[float], Point], tables: Tables, standoff: float
) -> tuple[Array, float] | None:
    """Return the farthest goal that no table covers and its distance from the tag, or None.

    `before` gives the goal at a distance from the tag.
    """
    steps = int((standoff - MIN_STANDOFF_M + _ROUNDING_M) / PULL_BACK_M) + 1
    distances = standoff - PULL_BACK_M * np.arange(steps)
    goals: Array = np.array([before(distance) for distance in distances], dtype=float)
    free = np.flatnonzero(~tables.inside(goals))
    if free.size == 0:
        return None
    return goals[free[0]], float(distances[free[0]])


def approach_discovered(
    tag: Point,
    facing: Quaternion,
    standoff: float,
    fallback_yaw: float,
    robot: Point | None = None,
    tables: Tables | None = None,
) -> Approach:
    """Return the approach pose for a tag that was discovered, from its orientation.

    The normal is the plate's +Z axis; where that is vertical, the direction to the robot; without a robot's
    position the goal is the tag itself. With tables the goal is pulled back towards the tag until none covers
    it; where that finds no free one, it stays as it was.
    """
    distance = clamp_standoff(standoff)
    qx, qy, qz, qw = facing
    dx, dy = 2.0 * (qx * qz + qw * qy), 2.0 * (qy * qz - qw * qx)
    source = ApproachSource.DISCOVERED_NORMAL
    if math.hypot(dx, dy) < DEGENERATE_M and robot is not None:
        dx, dy, source = robot[0] - tag[0], robot[1] - tag[1], ApproachSource.DISCOVERED_ROBOT
    length = math.hypot(dx, dy)
    if length < DEGENERATE_M:
        return Approach(tag[0], tag[1], fallback_yaw, ApproachSource.FALLBACK, None, 0.0)

    def before(away: float) -> Point:
        return tag[0] + away * dx / length, tag[1] + away * dy / length

    clear = None if tables is None else _clear_goal(before, tables, distance)
    used = distance if clear is None else clear[1]
    x, y = before(used)
    return Approach(x, y, math.atan2(tag[1] - y, tag[0] - x), source, None, used)


def _bearing(origin: Any, target: Any) -> float:
    dx, dy = target - origin
    return math.atan2(float(dy), float(dx))
