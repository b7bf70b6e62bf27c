"""Plans short paths around the tables on a grid, for a round robot. Metres, frame `map`.

Deterministic. The grid is coarse, so that a plan takes tens of milliseconds and may run on the ROS thread.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lupin_greenhouse import LENGTH, WIDTH, Table

Point = tuple[float, float]

#: Half the width of the robot, and the side of a grid cell, in metres.
ROBOT_RADIUS = 0.12
CELL = 0.05

#: A goal that is not free is moved by at most this many metres, as Nav2's planner does.
GOAL_TOLERANCE = 0.25

#: The moves from a cell to its neighbours: columns, rows, length in cells.
_MOVES = tuple(
    (dx, dy, float(np.hypot(dx, dy))) for dx in (-1, 0, 1) for dy in (-1, 0, 1) if (dx, dy) != (0, 0)
)


class Floor:
    """The free floor between tables and walls."""

    def __init__(self, tables: Sequence[Table]) -> None:
        self._tables = tuple(tables)
        self._shape = (round(WIDTH / CELL) + 1, round(LENGTH / CELL) + 1)
        xs, ys = np.meshgrid(*(np.arange(count) * CELL for count in self._shape), indexing="ij")
        self._free = self._fits(xs, ys)

    def is_free(self, x: float, y: float) -> bool:
        """Return whether the robot fits at this place."""
        return bool(self._fits(np.array([x]), np.array([y]))[0])

    def path(self, start: Point, goal: Point) -> list[Point] | None:
        """Return the corners of a short path, without the start; None when there is none.

        The last corner is `goal`, or a free place within `GOAL_TOLERANCE` of it. A start that is not free
        is left for the nearest free place within `WIDTH`; without one there is no path.
        """
        target = goal if self.is_free(*goal) else self._nearest_free(goal, GOAL_TOLERANCE)
        origin = self._nearest_free(start, WIDTH)
        if target is None or origin is None:
            return None
        end = self._nearest_free_cell(target, GOAL_TOLERANCE)
        begin = self._nearest_free_cell(origin, WIDTH)
        if end is None or begin is None:
            return None
        distances = self._distances(end)
        if not np.isfinite(distances[begin]):
            return None
        corners = [self._place(cell) for cell in _descent(distances, begin)]
        return self._shortened([start, *corners, target])[1:]

    def _fits(self, xs: NDArray[np.float64], ys: NDArray[np.float64]) -> NDArray[np.bool_]:
        low, epsilon = ROBOT_RADIUS, 1e-9
        fits = (xs >= low - epsilon) & (xs <= WIDTH - low + epsilon)
        fits &= (ys >= low - epsilon) & (ys <= LENGTH - low + epsilon)
        for table in self._tables:
            dx = np.maximum(np.maximum(table.x0 - xs, xs - table.x1), 0.0)
            dy = np.maximum(np.maximum(table.y0 - ys, ys - table.y1), 0.0)
            fits &= np.hypot(dx, dy) >= ROBOT_RADIUS - epsilon
        return fits

    def _nearest_free(self, point: Point, within: float) -> Point | None:
        """Return the nearest free place; None where there is none within so many metres."""
        if self.is_free(*point):
            return point
        cell = self._nearest_free_cell(point, within)
        return None if cell is None else self._place(cell)

    def _nearest_free_cell(self, point: Point, within: float) -> tuple[int, int] | None:
        columns, rows = np.nonzero(self._free)
        if len(columns) == 0:
            return None
        distances = np.hypot(columns * CELL - point[0], rows * CELL - point[1])
        nearest = int(np.argmin(distances))
        if distances[nearest] > within:
            return None
        return int(columns[nearest]), int(rows[nearest])

    def _distances(self, end: tuple[int, int]) -> NDArray[np.float64]:
        """Return the length of the way from every cell to `end`, in cells; infinite where there is none."""
        columns, rows = self._shape
        # A border of one cell saves all looks at the edges.
        padded = np.full((columns + 2, rows + 2), np.inf)
        padded[end[0] + 1, end[1] + 1] = 0.0
        inner = padded[1:-1, 1:-1]
        while True:
            before = inner.copy()
            for dx, dy, cost in _MOVES:
                shifted = padded[1 + dx : 1 + dx + columns, 1 + dy : 1 + dy + rows]
                np.minimum(inner, shifted + cost, out=inner)
            inner[~self._free] = np.inf
            if np.array_equal(before, inner):
                return inner

    def _place(self, cell: tuple[int, int]) -> Point:
        return cell[0] * CELL, cell[1] * CELL

    def _shortened(self, corners: list[Point]) -> list[Point]:
        """Drop every corner that the robot can cut."""
        kept = [corners[0]]
        at = 0
        while at < len(corners) - 1:
            farther = range(len(corners) - 1, at + 1, -1)
            at = next((i for i in farther if self._sees(corners[at], corners[i])), at + 1)
            kept.append(corners[at])
        return kept

    def _sees(self, a: Point, b: Point) -> bool:
        steps = max(2, int(np.hypot(b[0] - a[0], b[1] - a[1]) / (CELL / 2)) + 1)
        return bool(np.all(self._fits(np.linspace(a[0], b[0], steps), np.linspace(a[1], b[1], steps))))


def _descent(distances: NDArray[np.float64], begin: tuple[int, int]) -> list[tuple[int, int]]:
    """Follow the distances down to their end; the first of equal neighbours wins."""
    columns, rows = distances.shape
    cell, cells = begin, [begin]
    while distances[cell] > 0.0:
        around = [(cell[0] + dx, cell[1] + dy, cost) for dx, dy, cost in _MOVES]
        inside = [(x, y, cost) for x, y, cost in around if 0 <= x < columns and 0 <= y < rows]
        x, y, _ = min(inside, key=lambda move: distances[move[0], move[1]] + move[2])
        cell = (x, y)
        cells.append(cell)
    return cells
