"""Validates and answers requests for a sensor field, with a cache; pure."""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass

import numpy as np

from lupin_engine.errors import LupinError, nearest, shortened
from lupin_twin.field import DEFAULTS, BadGrid, FieldGrid, Interpolation, InterpolationSettings, OccupancyMap
from lupin_twin.state import Twin

#: Cells of a field, which make a message of 1 MB; and fields that are remembered.
MAX_CELLS = 250_000
REMEMBERED = 64

#: Fields that are kept up to date, which takes more memory: what is asked for again and again are few.
FOLLOWED = 8


class FieldRequestRefused(LupinError):
    """A request is refused; the text says why."""


@dataclass(frozen=True)
class Request:
    """A sensor and a rectangle in frame `map`, metres."""

    sensor: str
    resolution: float
    min_x: float
    min_y: float
    max_x: float
    max_y: float


@dataclass(frozen=True)
class Heatmap:
    """A field as published: `values` are 32-bit floats, row by row from `min_y` on."""

    grid: FieldGrid
    values: bytes
    minimum: float
    maximum: float
    sample_count: int


class Heatmaps:
    """Answers requests from the state of the twin; answers are cached.

    The key is sensor, count of observations, area and resolution. Any other change (the place of a tag, the
    map) clears the cache. The `FOLLOWED` last requested fields are updated only around changed tags.
    """

    def __init__(self, twin: Twin, settings: InterpolationSettings = DEFAULTS) -> None:
        self._twin = twin
        self._settings = settings
        self._map: OccupancyMap | None = None
        self._pins = 0
        self._known: OrderedDict[tuple[Request, int], Heatmap] = OrderedDict()
        self._followed: OrderedDict[Request, Interpolation] = OrderedDict()

    def explore(self, occupancy: OccupancyMap) -> None:
        """Restrict fields to the known part of this map from now on; does nothing for the same map."""
        if self._map is not None and self._map.same_as(occupancy):
            return
        self._map = occupancy
        self._known.clear()
        self._followed.clear()

    def answer(self, request: Request) -> Heatmap:
        """Return the field.

        Raises:
            FieldRequestRefused: the sensor is unknown, the area is invalid, or it has too many cells.
        """
        if self._pins != self._twin.pins:
            self._pins = self._twin.pins
            self._known.clear()
        key = request, self._twin.observation_count
        if key in self._known:
            self._known.move_to_end(key)
        else:
            self._known[key] = self._work_out(request)
            if len(self._known) > REMEMBERED:
                self._known.popitem(last=False)
        return self._known[key]

    def _work_out(self, request: Request) -> Heatmap:
        samples = self._twin.samples(self._sensor(request.sensor))
        if request not in self._followed:
            grid = _grid(request)
            explored = None if self._map is None else self._map.explored(grid)
            self._followed[request] = Interpolation(grid, self._settings, explored)
            if len(self._followed) > FOLLOWED:
                self._followed.popitem(last=False)
        self._followed.move_to_end(request)
        field = self._followed[request].update(*samples)
        sent = field.values.astype(np.float32).tobytes()
        return Heatmap(field.grid, sent, field.minimum, field.maximum, field.sample_count)

    def _sensor(self, given: str) -> str:
        sensor, known = given.strip(), list(self._twin.sensors)
        if not sensor:
            raise FieldRequestRefused(f"the sensor type is empty; allowed: {', '.join(map(repr, known))}")
        if sensor not in known:
            shown = shortened(sensor)
            raise FieldRequestRefused(f"unknown sensor type {shown!r}; {nearest(shown, known)}")
        return sensor


def _grid(request: Request) -> FieldGrid:
    bounds = request.min_x, request.min_y, request.max_x, request.max_y
    try:
        grid = FieldGrid.over(*bounds, request.resolution)
    except BadGrid as problem:
        raise FieldRequestRefused(str(problem)) from None
    for axis, low, high in (("x", request.min_x, request.max_x), ("y", request.min_y, request.max_y)):
        if low == high:
            raise FieldRequestRefused(f"the bounding box is empty: {axis} from {low:g} to {high:g} m")
    if grid.width * grid.height > MAX_CELLS:
        size = f"{request.max_x - request.min_x:g} m x {request.max_y - request.min_y:g} m"
        raise FieldRequestRefused(
            f"{size} at {request.resolution:g} m are more than {MAX_CELLS} cells; "
            "ask for a smaller area or a coarser resolution"
        )
    return grid
