"""A sensor field between tags: inverse-distance weighting on a grid (Shepard 1968); pure numpy.

Frames and units: positions, distances and resolutions are metres in frame `map`; values have the unit of
their sensor. Cell (column i, row j) has its centre at `(min_x + (i + 0.5)·r, min_y + (j + 0.5)·r)`; arrays
are indexed `[row, column]`, row 0 at `min_y`.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from lupin_engine.errors import LupinError

Floats: TypeAlias = NDArray[np.float64]
Mask: TypeAlias = NDArray[np.bool_]

#: Metres from a sample within which a cell has the sample's value, where the weight would go to infinity.
EXACT_M = 1e-3

#: Cells by which the far edge may stick out without another row: bounds that went through 32 bits do.
EDGE_CELLS = 1e-3


class BadGrid(LupinError):
    """Bounds, resolution or mask of a grid are invalid."""


@dataclass(frozen=True)
class InterpolationSettings:
    """How to interpolate.

    power: exponent p of the weight d^-p.
    falloff: metres; samples farther from a cell have no weight in it.
    max_distance: metres; a cell whose nearest sample is farther has no value. Where it exceeds `falloff`, the
        ring between the two has the value of the nearest sample.
    """

    power: float = 2.0
    falloff: float = 2.0
    max_distance: float = 2.0


DEFAULTS = InterpolationSettings()


@dataclass(frozen=True)
class FieldGrid:
    """Square cells of side `resolution` over a rectangle that begins at (`min_x`, `min_y`)."""

    min_x: float
    min_y: float
    resolution: float
    width: int
    height: int

    @classmethod
    def over(cls, min_x: float, min_y: float, max_x: float, max_y: float, resolution: float) -> FieldGrid:
        """Return the grid that covers the rectangle; an axis without extent gets one cell.

        Raises:
            BadGrid: a bound is not finite or beyond its opposite, or the resolution is not above 0.
        """
        if not all(map(math.isfinite, (min_x, min_y, max_x, max_y))):
            raise BadGrid(
                f"the bounds must be finite, got x {min_x:g} to {max_x:g}, y {min_y:g} to {max_y:g}"
            )
        if not (math.isfinite(resolution) and resolution > 0.0):
            raise BadGrid(f"the resolution must be above 0 m, got {resolution:g}")
        for axis, low, high in (("x", min_x, max_x), ("y", min_y, max_y)):
            if high < low:
                raise BadGrid(f"the bounds of {axis} are the wrong way round: {low:g} to {high:g}")
        width, height = _cells(max_x - min_x, resolution), _cells(max_y - min_y, resolution)
        return cls(min_x, min_y, resolution, width, height)

    @property
    def x(self) -> Floats:
        """The x of the cells' centres, by column."""
        return _centres(self.min_x, self.width, self.resolution)

    @property
    def y(self) -> Floats:
        """The y of the cells' centres, by row."""
        return _centres(self.min_y, self.height, self.resolution)


def _centres(minimum: float, count: int, resolution: float) -> Floats:
    steps: Floats = np.arange(count) + np.float64(0.5)
    return minimum + steps * np.float64(resolution)


def _cells(extent: float, resolution: float) -> int:
    # At least one; a quotient beyond the largest float still has to come out as a number that can be refused.
    return max(1, math.ceil(min(extent / resolution, 1e300) - EDGE_CELLS))


@dataclass(frozen=True)
class SensorField:
    """An interpolated field: read-only values `[row, column]`, NaN where unknown.

    `minimum` and `maximum` are over the cells with a value, 0 without any; `sample_count` is the number of
    samples.
    """

    grid: FieldGrid
    values: Floats
    minimum: float
    maximum: float
    sample_count: int


def interpolate(
    grid: FieldGrid,
    positions: Floats,
    values: Floats,
    settings: InterpolationSettings = DEFAULTS,
    explored: Mask | None = None,
) -> SensorField:
    """Return the field of `values` measured at `positions` (n rows of x, y), all of them finite.

    For a cell with centre c and samples (s_k, v_k) at distances d_k = |c - s_k|:

    * NaN where min d_k > max_distance, or `explored` (`[row, column]`) is false;
    * v of the nearest sample where min d_k < 1 mm, and where no sample is within the falloff;
    * else sum(v_k·d_k^-p) / sum(d_k^-p) over the samples with d_k <= falloff.

    Of samples that are equally near, the one that is least by (x, y, value) counts as the nearest, so that
    the order in which samples are given changes nothing, not even the last bit.

    Source: D. Shepard, "A two-dimensional interpolation function for irregularly-spaced data", 1968.

    Raises:
        BadGrid: `explored` has not one entry for each cell.
    """
    return Interpolation(grid, settings, explored).update(positions, values)


class Interpolation:
    """A field that is updated incrementally: when few samples change, only cells within their reach are
    computed.

    The result is the same to the last bit as a full computation.

    Raises:
        BadGrid: `explored` has not one entry for each cell.
    """

    def __init__(
        self, grid: FieldGrid, settings: InterpolationSettings = DEFAULTS, explored: Mask | None = None
    ) -> None:
        if explored is not None and explored.shape != (grid.height, grid.width):
            raise BadGrid(f"the mask has shape {explored.shape}, the grid {(grid.height, grid.width)}")
        self._grid = grid
        self._settings = settings
        self._explored = explored
        self._x, self._y = grid.x, grid.y
        # A little more than enough: what is exactly at the limit belongs to it.
        self._reach = max(settings.falloff, settings.max_distance, EXACT_M) * (1.0 + 1e-9)
        self._samples: Counter[tuple[float, float, float]] = Counter()
        self._cells: Floats = np.full((grid.height, grid.width), np.nan)

    def update(self, positions: Floats, values: Floats) -> SensorField:
        """Return the field of these samples; see `interpolate`."""
        samples = Counter(zip(*positions.T.tolist(), values.tolist(), strict=True))
        area = self._reached([*(samples - self._samples), *(self._samples - samples)])
        if area is not None:
            rows, columns = area
            self._cells[area] = self._weighted(self._x[columns], self._y[rows], positions, values)
        self._samples = samples
        return self._field(values)

    def _reached(self, changed: list[tuple[float, float, float]]) -> tuple[slice, slice] | None:
        """Return the rows and columns of the smallest rectangle with all cells that these samples reach.

        None where they reach no cell.
        """
        found = [(_within(self._y, y, self._reach), _within(self._x, x, self._reach)) for x, y, _ in changed]
        found = [(rows, columns) for rows, columns in found if rows.start < rows.stop]
        found = [(rows, columns) for rows, columns in found if columns.start < columns.stop]
        if not found:
            return None
        rows, columns = zip(*found, strict=True)
        return _hull(rows), _hull(columns)

    def _field(self, values: Floats) -> SensorField:
        cells = self._cells.copy()
        if len(values):
            # A weighted mean lies within its samples; rounding must not take it out again.
            np.clip(cells, values.min(), values.max(), out=cells)
        if self._explored is not None:
            cells[~self._explored] = np.nan
        cells.flags.writeable = False
        known = cells[np.isfinite(cells)]
        low, high = (float(known.min()), float(known.max())) if known.size else (0.0, 0.0)
        return SensorField(self._grid, cells, low, high, len(values))

    def _weighted(self, grid_x: Floats, grid_y: Floats, positions: Floats, values: Floats) -> Floats:
        """Add up the samples one by one, each only within its reach: most cells are far from most samples."""
        settings, shape = self._settings, (len(grid_y), len(grid_x))
        total, weights = np.zeros(shape), np.zeros(shape)
        # A cell has the value of its nearest sample until something is mixed for it.
        nearest, cells = np.full(shape, np.inf), np.full(shape, np.nan)
        order = np.lexsort((values, positions[:, 1], positions[:, 0]))
        for (x, y), value in zip(positions[order].tolist(), values[order].tolist(), strict=True):
            columns, rows = _within(grid_x, x, self._reach), _within(grid_y, y, self._reach)
            if columns.start == columns.stop or rows.start == rows.stop:
                continue
            area = rows, columns
            squared = np.square(grid_y[rows] - y)[:, None] + np.square(grid_x[columns] - x)
            nearer = squared < nearest[area]
            np.copyto(nearest[area], squared, where=nearer)
            np.copyto(cells[area], value, where=nearer)
            weight = _weight(squared, settings)
            weights[area] += weight
            weight *= value
            total[area] += weight
        mixed = (weights > 0.0) & (nearest >= EXACT_M**2)
        np.divide(total, weights, out=cells, where=mixed)
        cells[nearest > settings.max_distance**2] = np.nan
        return cells


def _hull(parts: Sequence[slice]) -> slice:
    """Return the shortest slice with all of these in it."""
    return slice(min(part.start for part in parts), max(part.stop for part in parts))


def _within(centres: Floats, place: float, reach: float) -> slice:
    """Return which centres are within `reach` of `place`."""
    return slice(*np.searchsorted(centres, (place - reach, place + reach)).tolist())


def _weight(squared: Floats, settings: InterpolationSettings) -> Floats:
    """Return d^-p for squared distances, 0 beyond the falloff; d counts as no less than 1 mm."""
    bounded = np.maximum(squared, EXACT_M**2)
    # numpy's general power takes twenty times as long as a division.
    weight: Floats = np.reciprocal(bounded)
    if settings.power != 2.0:
        weight **= 0.5 * settings.power
    weight[squared > settings.falloff**2] = 0.0
    return weight


@dataclass(frozen=True)
class OccupancyMap:
    """An occupancy grid: `cells[row, column]`, below 0 where unknown.

    The corner of cell (0, 0) is at (`x`, `y`) in frame `map`, rotated by `yaw` (radians, anticlockwise).
    """

    x: float
    y: float
    yaw: float
    resolution: float
    cells: NDArray[np.int8]

    def same_as(self, other: OccupancyMap) -> bool:
        """Return whether both have the same cells at the same place."""
        place = (self.x, self.y, self.yaw, self.resolution)
        there = (other.x, other.y, other.yaw, other.resolution)
        return place == there and np.array_equal(self.cells, other.cells)

    def explored(self, grid: FieldGrid) -> Mask:
        """Return which cells of `grid` have their centre in a known part of the map."""
        dx, dy = grid.x - self.x, (grid.y - self.y)[:, None]
        cos, sin = math.cos(self.yaw) / self.resolution, math.sin(self.yaw) / self.resolution
        column, row = np.floor(cos * dx + sin * dy), np.floor(cos * dy - sin * dx)
        height, width = self.cells.shape
        inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
        known = np.zeros(inside.shape, dtype=bool)
        known[inside] = self.cells[row[inside].astype(np.intp), column[inside].astype(np.intp)] >= 0
        return known
