"""The simulated greenhouse: its walls, tables and tags. Metres, frame `map`."""

from __future__ import annotations

from dataclasses import dataclass

from lupin_greenhouse import Table, Tag, layout, plates


@dataclass(frozen=True)
class Floorplan:
    """The walls, tables and tags."""

    tables: tuple[Table, ...] = ()
    tags: tuple[Tag, ...] = ()

    def clearance(self, x: float, y: float) -> float:
        """Return the distance to the nearest table or wall; 0 on a table, negative beyond a wall."""
        return plates.clearance(self.tables, x, y)


def load_layout(file: str = "") -> Floorplan:
    """Read a layout file; an empty name means the bundled greenhouse.

    Raises:
        LupinError: the file is missing or is no layout.
    """
    known = layout.load(file)
    return Floorplan(known.tables, tuple(known.tags.values()))
