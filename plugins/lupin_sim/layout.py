"""The greenhouse that is simulated: its walls, its tables and its tags. Metres, frame `map`."""

from __future__ import annotations

from dataclasses import dataclass

from lupin_greenhouse import Table, Tag, layout, plates


@dataclass(frozen=True)
class Floorplan:
    """What stands in the greenhouse."""

    tables: tuple[Table, ...] = ()
    tags: tuple[Tag, ...] = ()

    def clearance(self, x: float, y: float) -> float:
        """Return how far a place is from the nearest table or wall; 0 on a table, negative behind a wall."""
        return plates.clearance(self.tables, x, y)


def load_layout(file: str = "") -> Floorplan:
    """Read a layout file; the empty name stands for the bundled greenhouse.

    Raises:
        LupinError: the file is missing or is no layout.
    """
    known = layout.load(file)
    return Floorplan(known.tables, tuple(known.tags.values()))
