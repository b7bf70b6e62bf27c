"""The heading of a tag's plate: the layout's, else a guess. Pure; metres and radians in frame `map`.

Only drivers ask this. The simulated greenhouse has plates of its own, so a wrong layout or guess shows as in
a real one: the robot does not see its tag.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from lupin_greenhouse import LENGTH, PLATE_M, WIDTH, Table, clearance

#: Of several sides a tag hangs where there is most room at this distance before it.
VIEWING_M = 0.5


@dataclass(frozen=True)
class Side:
    """The side on which a plate hangs: the heading of its outward normal, and the nearest table, if any."""

    yaw: float
    table: str | None

    def before(self, tag: tuple[float, float], distance: float) -> tuple[float, float]:
        """Return the point at `distance` from a tag, along the normal."""
        return tag[0] + distance * math.cos(self.yaw), tag[1] + distance * math.sin(self.yaw)


def side_of(tag: tuple[float, float], tables: Sequence[Table], facing: float | None = None) -> Side | None:
    """Return the side on which a tag hangs; None where the layout has neither its facing nor tables.

    Without a facing it is guessed as the nearest side of the nearest table (of equal ones the first). Near a
    corner it is the side with most room before it, so that a plate does not face a wall or the next table.
    """
    table = min(tables, key=lambda table: table.distance(*tag), default=None)
    if facing is not None:
        return Side(facing, None if table is None else table.id)
    if table is None:
        return None
    inside = _sides(table, *tag)
    nearest = min(abs(distance) for distance in inside.values())
    at_hand = [
        Side(yaw, table.id) for yaw, distance in inside.items() if abs(distance) <= max(PLATE_M, nearest)
    ]
    return max(at_hand, key=lambda side: _room(tables, *side.before(tag, VIEWING_M)))


def _room(tables: Sequence[Table], x: float, y: float) -> float:
    """Return the clearance of a point; of walls only where all tables are inside of them."""
    if all(t.x0 >= 0.0 and t.x1 <= WIDTH and t.y0 >= 0.0 and t.y1 <= LENGTH for t in tables):
        return clearance(tables, x, y)
    return min(table.distance(x, y) for table in tables)


def _sides(table: Table, x: float, y: float) -> dict[float, float]:
    """Return how far inside of each side of a table a point is, by the heading of the side's normal."""
    return {0.0: table.x1 - x, math.pi / 2: table.y1 - y, math.pi: x - table.x0, -math.pi / 2: y - table.y0}
