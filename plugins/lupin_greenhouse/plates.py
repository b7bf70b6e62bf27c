"""Where a tag's plate faces: a layout says where a tag is, not on which side of its table it hangs. Pure.

Metres and radians in frame `map`. Whoever drives to a tag and whoever simulates what is seen from there ask
the same function, so that a robot that stands before a plate also sees it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from lupin_greenhouse.layout import Table

#: Inner measures of the greenhouse, x and y; it has a wall around.
WIDTH, LENGTH = 4.0, 8.0
#: Width of a plate: a tag so near to the corner of its table may hang on either side.
PLATE_M = 0.16
#: Of several sides a tag hangs where there is most room at this distance before it.
VIEWING_M = 0.5


@dataclass(frozen=True)
class Side:
    """A side of a table: its outward normal, and how far inside of it the tag is (metres)."""

    table: Table
    yaw: float
    inside: float

    def before(self, tag: tuple[float, float], distance: float) -> tuple[float, float]:
        """Return the place at `distance` from a tag, along the normal."""
        return tag[0] + distance * math.cos(self.yaw), tag[1] + distance * math.sin(self.yaw)


def clearance(tables: Sequence[Table], x: float, y: float) -> float:
    """Return how far a place is from the nearest table or wall; 0 on a table, negative behind a wall."""
    return min(x, WIDTH - x, y, LENGTH - y, *(table.distance(x, y) for table in tables))


def side_of(tag: tuple[float, float], tables: Sequence[Table]) -> Side | None:
    """Return the side on which a tag hangs, None without tables.

    It is a side of the nearest table (of equally near ones the first), and the nearest of its sides. Near a
    corner it is the one with most room before it, so that a plate does not face a wall or the next table.
    """
    if not tables:
        return None
    table = min(tables, key=lambda table: table.distance(*tag))
    sides = _sides(table, *tag)
    nearest = min(abs(side.inside) for side in sides)
    at_hand = [side for side in sides if abs(side.inside) <= max(PLATE_M, nearest)]
    return max(at_hand, key=lambda side: _room(tables, *side.before(tag, VIEWING_M)))


def _room(tables: Sequence[Table], x: float, y: float) -> float:
    """Return the clearance of a place; tables that stand elsewhere are in a greenhouse of unknown walls."""
    if all(t.x0 >= 0.0 and t.x1 <= WIDTH and t.y0 >= 0.0 and t.y1 <= LENGTH for t in tables):
        return clearance(tables, x, y)
    return min(table.distance(x, y) for table in tables)


def _sides(table: Table, x: float, y: float) -> tuple[Side, ...]:
    return (
        Side(table, 0.0, table.x1 - x),
        Side(table, math.pi / 2, table.y1 - y),
        Side(table, math.pi, x - table.x0),
        Side(table, -math.pi / 2, y - table.y0),
    )
