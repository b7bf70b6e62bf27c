"""Frontier-based exploration (Yamauchi): finds the best frontier of an occupancy grid. Pure, without ROS.

A frontier cell is free and has an unknown 4-neighbour; 8-connected frontier cells are one frontier. Of those
with enough cells, and not near a place to avoid, the best has the highest `cells / (1 + distance)`; of equal
ones the first, row by row from the grid's origin.

Occupancy is as in nav_msgs/OccupancyGrid: -1 unknown, 0 free to 100 occupied, row by row, x running fastest.
Lengths are metres and angles radians in the frame of the map; the grid may be rotated in it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

UNKNOWN = -1

#: A clearance that exceeds a whole number of cells by less than this part of a cell is that number: the
#: resolution of a message is a float32, and 0.3 m are 15 cells of 0.02 m, not 16.
_WHOLE_CELLS = 1e-5

Cells = NDArray[np.int8]
Mask = NDArray[np.bool_]
Indices = NDArray[np.intp]
Numbers = NDArray[np.float64]
#: A place on the floor in metres.
Point = tuple[float, float]


@dataclass(frozen=True)
class OccupancyGrid:
    """An occupancy grid: `cells[row, column]`, metres a cell, and the pose of the corner of cell (0, 0)."""

    cells: Cells
    resolution: float
    x: float = 0.0
    y: float = 0.0
    yaw: float = 0.0

    def places(self, rows: Indices, columns: Indices) -> tuple[Numbers, Numbers]:
        """Return the centres of cells: origin + R(yaw) · (index + 0.5) · resolution."""
        right = (columns.astype(np.float64) + 0.5) * self.resolution
        up = (rows.astype(np.float64) + 0.5) * self.resolution
        if self.yaw == 0.0:
            return self.x + right, self.y + up
        cosine, sine = math.cos(self.yaw), math.sin(self.yaw)
        return self.x + cosine * right - sine * up, self.y + sine * right + cosine * up


@dataclass(frozen=True)
class Thresholds:
    """The thresholds of the search.

    Cells from `occupied` on are solid; those between `free` and `occupied` are neither, and are only counted:
    a map full of them has no frontiers, to everybody's surprise. For the clearance, cells from
    `clearance_occupied` on are solid, which may be stricter. `radius_cells` of 0 or more replaces `clearance`
    (m). Places nearer than `avoid_distance` (m) to an avoided one count as that one.
    """

    free: int = 20
    occupied: int = 65
    min_cells: int = 6
    clearance: float = 0.35
    radius_cells: int = -1
    clearance_occupied: int = 65
    avoid_distance: float = 0.5

    def radius(self, resolution: float) -> int:
        """Return the clearance in cells: ceil(clearance / resolution)."""
        if self.radius_cells >= 0:
            return self.radius_cells
        return math.ceil(self.clearance / resolution - _WHOLE_CELLS)


@dataclass(frozen=True)
class Frontier:
    """The chosen frontier: its cell nearest to the centroid (m), its size, and the number of candidates."""

    x: float
    y: float
    cells: int
    clusters: int


@dataclass(frozen=True)
class Survey:
    """The best frontier, if any, and counts: cells that are known, that are neither free nor solid, frontier
    cells
    without clearance, and frontiers that are too small or avoided.
    """

    frontier: Frontier | None
    known: int
    undecided: int
    cramped: int
    small: int
    avoided: int


def make_grid(
    data: ArrayLike, width: int, height: int, resolution: float, origin: Sequence[float] = (0.0, 0.0)
) -> OccupancyGrid | None:
    """Return the grid of row-major `data`; None when size, resolution or origin (x, y[, yaw]) are invalid."""
    if width <= 0 or height <= 0 or not (math.isfinite(resolution) and resolution > 0.0):
        return None
    flat = np.asarray(data, dtype=np.int8).reshape(-1)
    if flat.size < width * height or not all(map(math.isfinite, origin)):
        return None
    return OccupancyGrid(
        flat[: width * height].reshape(height, width), float(resolution), *map(float, origin)
    )


def survey(
    grid: OccupancyGrid,
    robot: Point | None = None,
    thresholds: Thresholds | None = None,
    avoid: Sequence[Point] = (),
) -> Survey:
    """Search for the best frontier outside of `avoid` (m).

    Without the robot's position (m) only the size counts.
    """
    limits = thresholds or Thresholds()
    rows, columns = np.nonzero(_frontier_cells(grid.cells, limits.free))
    solid = grid.cells >= limits.clearance_occupied
    clear = ~_near(solid, rows, columns, limits.radius(grid.resolution))
    cramped = int(rows.size - np.count_nonzero(clear))
    rows, columns = rows[clear], columns[clear]
    labels, sizes = _clusters(rows, columns, grid.cells.shape)
    large = np.flatnonzero(sizes >= limits.min_cells)
    middles = _representatives(rows, columns, labels, sizes)[large] if large.size else large
    xs, ys = grid.places(rows[middles], columns[middles])
    allowed = _apart(xs, ys, avoid, limits.avoid_distance)
    return Survey(
        frontier=_best(xs[allowed], ys[allowed], sizes[large][allowed], robot),
        known=int(np.count_nonzero(grid.cells != UNKNOWN)),
        undecided=int(np.count_nonzero((grid.cells > limits.free) & (grid.cells < limits.occupied))),
        cramped=cramped,
        small=int(sizes.size - large.size),
        avoided=int(large.size - np.count_nonzero(allowed)),
    )


def _frontier_cells(cells: Cells, free: int) -> Mask:
    unknown = cells == UNKNOWN
    beside = np.zeros_like(unknown)
    beside[1:] |= unknown[:-1]
    beside[:-1] |= unknown[1:]
    beside[:, 1:] |= unknown[:, :-1]
    beside[:, :-1] |= unknown[:, 1:]
    found: Mask = beside & (cells >= 0) & (cells <= free)
    return found


def _near(solid: Mask, rows: Indices, columns: Indices, radius: int) -> Mask:
    """Return for each cell whether the square of 2·radius + 1 cells around it has a solid one.

    Cells outside the grid are not solid. A summed-area table: `sums[r, c]` counts the solid cells above and
    left of (r, c), so that a square of any size costs four look-ups.
    """
    height, width = solid.shape
    radius = min(radius, height + width)  # all of the grid, however small its cells are said to be
    sums = np.zeros((height + 1, width + 1), dtype=np.int64)
    np.cumsum(np.cumsum(solid, axis=0, dtype=np.int64), axis=1, out=sums[1:, 1:])
    top, bottom = np.maximum(rows - radius, 0), np.minimum(rows + radius + 1, height)
    left, right = np.maximum(columns - radius, 0), np.minimum(columns + radius + 1, width)
    count = sums[bottom, right] - sums[top, right] - sums[bottom, left] + sums[top, left]
    near: Mask = count > 0
    return near


def _clusters(rows: Indices, columns: Indices, shape: tuple[int, ...]) -> tuple[Indices, Indices]:
    """Return the cluster of each cell, and the size of each cluster; numbered row by row."""
    count = rows.size
    one, other = _touching(rows, columns, shape)
    # Each cell takes the lowest number that it can reach: over a touching cell, or from the cell whose number
    # it has. The second halves the way each time, so a long frontier takes few rounds.
    lowest = np.arange(count)
    while True:
        before = lowest.copy()
        least = np.minimum(lowest[one], lowest[other])
        np.minimum.at(lowest, before[one], least)
        np.minimum.at(lowest, before[other], least)
        lowest = lowest[lowest]
        if np.array_equal(before, lowest):
            break
    _, labels, sizes = np.unique(lowest, return_inverse=True, return_counts=True)
    return labels.reshape(-1), sizes


def _touching(rows: Indices, columns: Indices, shape: tuple[int, ...]) -> tuple[Indices, Indices]:
    """Return the pairs of cells that touch, each once, as two arrays of numbers of cells."""
    # A border of one saves all looks at the edges; -1 is no cell.
    numbers = np.full((shape[0] + 2, shape[1] + 2), -1, dtype=np.intp)
    numbers[rows + 1, columns + 1] = np.arange(rows.size)
    beside = [
        numbers[rows + 1 + down, columns + 1 + right] for down, right in ((0, 1), (1, -1), (1, 0), (1, 1))
    ]
    other = np.concatenate(beside)
    one = np.tile(np.arange(rows.size), len(beside))
    touches = other >= 0
    return one[touches], other[touches]


def _apart(xs: Numbers, ys: Numbers, avoid: Sequence[Point], distance: float) -> Mask:
    """Return for each place whether it is farther than `distance` from everything to avoid."""
    apart = np.ones(xs.size, dtype=np.bool_)
    for x, y in avoid:
        apart &= np.hypot(xs - x, ys - y) > distance
    return apart


def _best(xs: Numbers, ys: Numbers, sizes: Indices, robot: Point | None) -> Frontier | None:
    """Return the largest frontier, of which distance to the robot takes away; None without any."""
    if sizes.size == 0:
        return None
    scores: Any = sizes.astype(np.float64)
    if robot is not None:
        scores /= 1.0 + np.hypot(xs - robot[0], ys - robot[1])
    best = int(np.argmax(scores))
    return Frontier(float(xs[best]), float(ys[best]), int(sizes[best]), int(sizes.size))


def _representatives(rows: Indices, columns: Indices, labels: Indices, sizes: Indices) -> Indices:
    """Return for each cluster its cell nearest to the centroid, and of equal ones the first row by row."""
    # Distances times the size of the cluster are whole numbers, so that equal ones are equal.
    off_row = rows * sizes[labels] - np.bincount(labels, rows)[labels]
    off_column = columns * sizes[labels] - np.bincount(labels, columns)[labels]
    by_cluster = np.lexsort((off_row**2 + off_column**2, labels))  # stable: equals stay in their order
    first = np.concatenate(([0], np.cumsum(sizes)[:-1]))
    nearest: Indices = by_cluster[first]
    return nearest
