"""Fixed measures of the greenhouse that its layout file does not have. Pure; metres in frame `map`."""

from __future__ import annotations

from collections.abc import Sequence

from lupin_greenhouse.layout import Table

#: Inner measures of the greenhouse, x and y; it has a wall around.
WIDTH, LENGTH = 4.0, 8.0
#: Width of a tag's plate.
PLATE_M = 0.16


def clearance(tables: Sequence[Table], x: float, y: float) -> float:
    """Return the distance of a point from the nearest table or wall; 0 on a table, negative beyond a wall."""
    return min(x, WIDTH - x, y, LENGTH - y, *(table.distance(x, y) for table in tables))
