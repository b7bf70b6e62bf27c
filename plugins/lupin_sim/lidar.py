"""Simulates mapping: an occupancy grid that is revealed by ray casting as the robot drives.

Metres in frame `map`; rows are y and columns x. The lidar sees in all directions up to its range, and not
through tables. Revealed cells never change, since nothing in the greenhouse moves.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from lupin_greenhouse import LENGTH, WIDTH
from lupin_sim.layout import Floorplan

UNKNOWN, FREE, OCCUPIED = -1, 0, 100

#: Metres a cell. The walls are one cell thick, so the grid begins one cell outside the floor.
RESOLUTION = 0.05
ORIGIN_X = ORIGIN_Y = -RESOLUTION

#: Rays are so dense, and so finely followed, that no two neighbours miss a cell between them.
_STEP = RESOLUTION / 2


class Lidar:
    """Ray casting: the cells that rays pass, and those where they end."""

    def __init__(self, layout: Floorplan, reach: float) -> None:
        """`reach` is the range in metres."""
        self._solid = _solid_cells(layout)
        angles = np.linspace(0.0, math.tau, math.ceil(math.tau * reach / _STEP), endpoint=False)
        lengths = np.arange(0.0, reach + _STEP / 2, _STEP)
        self._right = np.cos(angles)[:, None] * lengths
        self._up = np.sin(angles)[:, None] * lengths

    @property
    def shape(self) -> tuple[int, ...]:
        """Rows and columns of the grid."""
        return self._solid.shape

    def look(self, x: float, y: float) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Return the free and the solid cells seen from (x, y)."""
        rows, columns = _cell(self._up + y, ORIGIN_Y), _cell(self._right + x, ORIGIN_X)
        height, width = self.shape
        inside = (rows >= 0) & (rows < height) & (columns >= 0) & (columns < width)
        rows, columns = np.clip(rows, 0, height - 1), np.clip(columns, 0, width - 1)
        ends = self._solid[rows, columns] | ~inside
        # A ray has passed something from its first solid sample on; that sample itself is still seen.
        before = np.logical_or.accumulate(ends, axis=1)
        first = ends.copy()
        first[:, 1:] &= ~before[:, :-1]
        return self._marked(rows, columns, ~before), self._marked(rows, columns, first & inside)

    def _marked(
        self, rows: NDArray[np.intp], columns: NDArray[np.intp], where: NDArray[np.bool_]
    ) -> NDArray[np.bool_]:
        marked = np.zeros(self.shape, dtype=np.bool_)
        marked[rows[where], columns[where]] = True
        return marked


class GrowingMap:
    """The cells revealed so far; `changed` since they were last taken."""

    def __init__(self, lidar: Lidar) -> None:
        self._lidar = lidar
        self.changed = True
        self.cells: NDArray[np.int8] = np.full(lidar.shape, UNKNOWN, dtype=np.int8)

    def reveal(self, x: float, y: float) -> None:
        """Reveal the cells seen from (x, y)."""
        free, solid = self._lidar.look(x, y)
        fresh = (free | solid) & (self.cells == UNKNOWN)
        if fresh.any():
            self.cells[fresh & free] = FREE
            self.cells[fresh & solid] = OCCUPIED
            self.changed = True

    def forget(self) -> None:
        """Reset all cells to unknown."""
        self.cells.fill(UNKNOWN)
        self.changed = True

    def take(self) -> NDArray[np.int8]:
        """Return the cells, and clear `changed`."""
        self.changed = False
        return self.cells


def _solid_cells(layout: Floorplan) -> NDArray[np.bool_]:
    """Return which cells are table or wall, by their centres."""
    columns, rows = (round(length / RESOLUTION) + 2 for length in (WIDTH, LENGTH))
    xs = ORIGIN_X + (np.arange(columns) + 0.5) * RESOLUTION
    ys = (ORIGIN_Y + (np.arange(rows) + 0.5) * RESOLUTION)[:, None]
    solid = (xs < 0.0) | (xs > WIDTH) | (ys < 0.0) | (ys > LENGTH)
    for table in layout.tables:
        solid |= (xs >= table.x0) & (xs <= table.x1) & (ys >= table.y0) & (ys <= table.y1)
    return solid


def _cell(places: NDArray[np.float64], origin: float) -> NDArray[np.intp]:
    return np.floor((places - origin) / RESOLUTION).astype(np.intp)
