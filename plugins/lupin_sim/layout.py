"""The greenhouse that is simulated: its walls, its tables and its tags. Metres, frame `map`."""

from __future__ import annotations

import math
from dataclasses import dataclass

from lupin_engine.world import layout

#: Inner measures of the greenhouse in metres, x and y; it has a wall around.
WIDTH, LENGTH = 4.0, 8.0


@dataclass(frozen=True)
class Table:
    """A table as an upright rectangle."""

    x0: float
    y0: float
    x1: float
    y1: float

    def distance(self, x: float, y: float) -> float:
        """Return how far a place is from this table; 0 on it."""
        return math.hypot(max(self.x0 - x, 0.0, x - self.x1), max(self.y0 - y, 0.0, y - self.y1))


@dataclass(frozen=True)
class Tag:
    """A tag: its id and the place of its plate."""

    id: str
    x: float
    y: float


@dataclass(frozen=True)
class Layout:
    """What stands in the greenhouse."""

    tables: tuple[Table, ...] = ()
    tags: tuple[Tag, ...] = ()

    def clearance(self, x: float, y: float) -> float:
        """Return how far a place is from the nearest table or wall; 0 on a table, negative behind a wall."""
        walls = (x, WIDTH - x, y, LENGTH - y)
        return min(*walls, *(table.distance(x, y) for table in self.tables))


def load_layout(file: str = "") -> Layout:
    """Read a layout file; the empty name stands for the bundled greenhouse.

    Raises:
        LupinError: the file is missing or is no layout.
    """
    known = layout.load(file)
    return Layout(
        tuple(Table(table.x0, table.y0, table.x1, table.y1) for table in known.tables),
        tuple(Tag(tag.id, tag.x, tag.y) for tag in known.tags.values()),
    )
