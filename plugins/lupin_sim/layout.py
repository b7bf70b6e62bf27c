"""The layout of the greenhouse: its walls, its tables and its tags. Metres, frame `map`.

The file is the one that mdp-greenhouse itself reads: `{"tags": {id: {"x", "y", ...}}, "tables": {name: {"x0",
"x1", "y0", "y1"}}}`, or the tags alone.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any

from lupin_engine.errors import LupinError

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
    """Read a layout file; the empty name stands for the one of `mdp-greenhouse`.

    Raises:
        LupinError: the file is missing or is no layout.
    """
    try:
        text = Path(file).expanduser().read_text(encoding="utf-8") if file else _bundled()
        return layout_of(json.loads(text))
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise LupinError(f"layout {file or 'of mdp-greenhouse'} cannot be used: {error}") from error


def layout_of(data: Mapping[str, Any]) -> Layout:
    """Return what a parsed layout says; one that is a bare map of tags has no tables."""
    sides, tables = ("x0", "y0", "x1", "y1"), data.get("tables", {}) if "tags" in data else {}
    tags = data.get("tags", data)
    return Layout(
        tuple(Table(*(float(table[side]) for side in sides)) for table in tables.values()),
        tuple(Tag(str(name), float(tag["x"]), float(tag["y"])) for name, tag in tags.items()),
    )


def _bundled() -> str:
    try:
        return (resources.files("greenhouse_sim") / "configs" / "tag_locations.json").read_text("utf-8")
    except ModuleNotFoundError as error:
        raise LupinError("the greenhouse is not installed: pip install mdp-greenhouse") from error
