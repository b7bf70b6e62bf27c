"""Draws a sensor's field on the map of the greenhouse, as PNG or SVG, with matplotlib."""

from __future__ import annotations

import io
import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from lupin_engine.errors import LupinError
from lupin_twin.export.forms import utc
from lupin_twin.field import (
    DEFAULTS,
    FieldGrid,
    Floats,
    InterpolationSettings,
    OccupancyMap,
    SensorField,
    interpolate,
)
from lupin_twin.missions import MissionRecord, Observation
from lupin_twin.records import Reading
from lupin_twin.state import TwinTag
from lupin_twin.text import QUANTITIES, number, printable, with_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ENDINGS = (".png", ".svg")

#: Cells along the longer side of the field, and metres that are shown around the tags where there is no map.
CELLS = 400
MARGIN_M = 0.75

#: Metres of the longer side up to which a picture is drawn: one stray tag must not make it a speck.
WIDEST_M = 1000.0

#: The shorter side of what is shown, of the longer one: a single row of tags is not a line.
NARROWEST = 0.2

#: What the colour scale spans at least, of its middle and in the sensor's unit: noise is not painted as a
#: difference.
LEAST_SPAN, LEAST_UNITS = 0.01, 0.01

#: Inches of the longer side of the field, and dots of each.
SIDE_IN, DPI = 6.5, 150

#: Points: letters of a label, its distance from the tag, a mark and the line around it; and letters of an id
#: that are shown.
LETTER_PT, GAP_PT, MARK_PT, LINE_PT, LABEL = 7.0, 4.0, 4.5, 0.8, 12

#: What of the field may be hidden. Where labels would need more there are none, and marks become smaller.
BY_LABELS, BY_MARKS = 0.25, 0.1

#: An occupied cell of the map has this value or more, of 100.
OCCUPIED = 65

_MISSING = "pictures need a package that is not installed: pip install 'lupin-engine[sim]'"

#: Dark ink on white; the colour scale is one that people who see few colours can read as well.
_INK, _FAINT, _HATCH, _COLOURS = "#1b1f24", "#5b636c", "#c3c8ce", "viridis"
_WALL = (0.32, 0.35, 0.38)

#: Where the label of a tag is, if it has one: right of its mark (else left), above it (else below).
Label: TypeAlias = tuple[bool, bool] | None

#: Where a label may be, above and right; the first is where it is if it can.
_AROUND = ((True, True), (True, False), (False, True), (False, False))

#: A rectangle in points: left, bottom, right, top.
Box: TypeAlias = tuple[float, float, float, float]


class NoPicture(LupinError):
    """The picture cannot be drawn; the text says why."""


@dataclass(frozen=True)
class _PictureContent:
    """A sensor's readings, interpolated within `reach` metres of their tags, on a map."""

    record: MissionRecord
    sensor: str
    tags: list[TwinTag]
    occupancy: OccupancyMap | None
    reach: float


def picture(
    record: MissionRecord,
    sensor: str,
    occupancy: OccupancyMap | None,
    ending: str,
    distance: float | None = None,
) -> bytes:
    """Return the picture of a sensor's field as PNG or SVG, the same bytes for the same record.

    Raises:
        NoPicture: matplotlib is not installed, or the tags are too far apart.
    """
    try:
        import matplotlib as mpl
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError:
        raise NoPicture(_MISSING) from None
    reach = DEFAULTS.max_distance if distance is None else distance
    tags = [tag for tag in record.twin.tags.values() if tag.pin is not None]
    grid = _grid(tags, occupancy)
    explored = None if occupancy is None else occupancy.explored(grid)
    field = interpolate(
        grid, *record.twin.samples(sensor), InterpolationSettings(falloff=reach, max_distance=reach), explored
    )
    with (
        mpl.rc_context({"svg.fonttype": "path", "svg.hashsalt": "lupin", "hatch.linewidth": 0.6}),
        warnings.catch_warnings(),
    ):
        # Of a letter that no font has there is an empty box, which says it.
        warnings.filterwarnings("ignore", r"Glyph \d+ ", UserWarning)
        figure = Figure(figsize=_size(grid), dpi=DPI, layout="constrained", facecolor="white")
        FigureCanvasAgg(figure)
        _draw(figure.add_subplot(), _PictureContent(record, sensor, tags, occupancy, reach), field)
        file = io.BytesIO()
        # Neither date nor version of the drawing program: the same record is the same file.
        metadata = (
            {"Date": None, "Creator": "Lupin engine"} if ending == ".svg" else {"Software": "Lupin engine"}
        )
        # Tight, for the layout forgets the room of labels when the axes become narrower to be true to scale.
        figure.savefig(
            file, format=ending.removeprefix("."), metadata=metadata, bbox_inches="tight", pad_inches=0.1
        )
    return file.getvalue()


def _grid(tags: list[TwinTag], occupancy: OccupancyMap | None) -> FieldGrid:
    """Return the cells over all tags and the known part of the map; NoPicture: wider than `WIDEST_M`."""
    places = [(tag.pin.x, tag.pin.y) for tag in tags if tag.pin is not None]
    low = np.min(places, axis=0) - MARGIN_M
    high = np.max(places, axis=0) + MARGIN_M
    if occupancy is not None and (occupancy.cells >= 0).any():
        rows, columns = np.nonzero(occupancy.cells >= 0)
        x, y = _on_map(occupancy, columns + 0.5, rows + 0.5)
        low = np.minimum(low, (x.min(), y.min()))
        high = np.maximum(high, (x.max(), y.max()))
    side = float(np.max(high - low))
    if not side <= WIDEST_M:
        raise NoPicture(f"the tags are {side:g} m apart, too far for a picture (at most {WIDEST_M:g} m)")
    missing = np.maximum(NARROWEST * side - (high - low), 0.0) / 2.0
    (min_x, min_y), (max_x, max_y) = (low - missing).tolist(), (high + missing).tolist()
    return FieldGrid.over(min_x, min_y, max_x, max_y, side / CELLS)


def _on_map(occupancy: OccupancyMap, columns: Any, rows: Any) -> tuple[Any, Any]:
    """Return the positions of cells of the map, in metres."""
    cos, sin = math.cos(occupancy.yaw), math.sin(occupancy.yaw)
    along, across = columns * occupancy.resolution, rows * occupancy.resolution
    return occupancy.x + cos * along - sin * across, occupancy.y + sin * along + cos * across


def _size(grid: FieldGrid) -> tuple[float, float]:
    """Return the figure's width and height in inches; around the field there is room for scale and text."""
    longest = max(grid.width, grid.height)
    width, height = SIDE_IN * grid.width / longest, SIDE_IN * grid.height / longest
    return max(width + 1.8, 4.2), max(height + 1.25, 3.0)


def _draw(axes: Axes, content: _PictureContent, field: SensorField) -> None:
    record, sensor, tags, occupancy = content.record, content.sensor, content.tags, content.occupancy
    grid = field.grid
    extent = (
        grid.min_x,
        grid.min_x + grid.width * grid.resolution,
        grid.min_y,
        grid.min_y + grid.height * grid.resolution,
    )
    axes.set(xlim=extent[:2], ylim=extent[2:], aspect="equal", xlabel="x [m]", ylabel="y [m]")
    axes.set_facecolor("#f4f5f7")
    _unexplored(axes, grid, occupancy)
    values = record.twin.samples(sensor)[1]
    lowest, highest = _range(values)
    image = axes.imshow(
        np.ma.masked_invalid(field.values),
        origin="lower",
        extent=extent,
        cmap=_COLOURS,
        vmin=lowest,
        vmax=highest,
        interpolation="nearest",
        zorder=1,
    )
    if occupancy is not None:
        _walls(axes, grid, occupancy, extent)
    labels = _labels(grid, tags)
    _marks(axes, grid, tags, sensor)
    _write_labels(axes, tags, labels)
    bar = axes.figure.colorbar(image, ax=axes, fraction=0.05, pad=0.03)
    bar.set_label(_plain(with_unit(sensor)[:40]), color=_INK)
    bar.outline.set_visible(False)
    axes.set_title(_title(sensor, values), loc="left", fontsize=10, color=_INK, pad=46)
    key = f"{_source(record, sensor, len(values))}\n{_key(occupancy, content.reach, None not in labels)}"
    axes.text(0.0, 1.01, key, transform=axes.transAxes, fontsize=7, color=_FAINT, va="bottom")
    axes.tick_params(colors=_INK, labelsize=8)
    for spine in axes.spines.values():
        spine.set_color(_FAINT)


def _key(occupancy: OccupancyMap | None, reach: float, labelled: bool) -> str:
    marks = "filled: read here · hollow: not read" + ("" if labelled else " · no id: no room")
    blank = f"blank: nothing was read within {reach:g} m"
    return f"{marks}\n{blank}" + ("" if occupancy is None else " · hatched: not explored")


def _range(values: Floats) -> tuple[float, float]:
    """Return the ends of the colour scale, which spans at least `LEAST_SPAN` of the middle."""
    low, high = float(values.min()), float(values.max())
    middle = low / 2.0 + high / 2.0
    room = max(abs(middle) * LEAST_SPAN, LEAST_UNITS)
    return (low, high) if high - low >= room else (middle - room, middle + room)


def _unexplored(axes: Axes, grid: FieldGrid, occupancy: OccupancyMap | None) -> None:
    """Hatch the unknown part of the map."""
    if occupancy is None:
        return
    unknown = ~occupancy.explored(grid)
    if unknown.any() and min(unknown.shape) > 1:  # contours need two rows and columns
        area = axes.contourf(
            grid.x,
            grid.y,
            unknown.astype(float),
            levels=[0.5, 1.5],
            colors="none",
            hatches=["////"],
            zorder=0,
        )
        area.set_edgecolor(_HATCH)
        area.set_linewidth(0.0)


def _walls(
    axes: Axes, grid: FieldGrid, occupancy: OccupancyMap, extent: tuple[float, float, float, float]
) -> None:
    """Draw occupied cells over the field."""
    occupied = OccupancyMap(
        occupancy.x,
        occupancy.y,
        occupancy.yaw,
        occupancy.resolution,
        np.where(occupancy.cells >= OCCUPIED, 0, -1).astype(np.int8),
    ).explored(grid)
    ink = np.zeros((*occupied.shape, 4))
    ink[occupied] = (*_WALL, 1.0)
    axes.imshow(ink, origin="lower", extent=extent, interpolation="nearest", zorder=2)


def _marks(axes: Axes, grid: FieldGrid, tags: list[TwinTag], sensor: str) -> None:
    """Mark each tag; those without a reading of this sensor are hollow."""
    places = np.array([(tag.pin.x, tag.pin.y) for tag in tags if tag.pin is not None])
    size = min(MARK_PT, math.sqrt(BY_MARKS * math.prod(_edge(grid)) / len(tags)))
    read = np.array([math.isfinite(tag.readings.get(sensor, math.nan)) for tag in tags])
    for shown, fill, line in ((~read, "white", _INK), (read, _INK, "white")):
        # All at once: an artist for each takes seconds for thousands of tags.
        axes.plot(
            *places[shown].T,
            linestyle="none",
            marker="o",
            markersize=size,
            markerfacecolor=fill,
            markeredgecolor=line,
            markeredgewidth=LINE_PT * size / MARK_PT,
            zorder=4,
        )


def _write_labels(axes: Axes, tags: list[TwinTag], labels: list[Label]) -> None:
    """Write the id of each tag that has room for it beside its mark."""
    from matplotlib.patheffects import withStroke

    for tag, label in zip(tags, labels, strict=True):
        if label is None or tag.pin is None:
            continue
        right, above = label
        axes.annotate(
            _plain(tag.tag_id[:LABEL]),
            (tag.pin.x, tag.pin.y),
            xytext=(GAP_PT if right else -GAP_PT, GAP_PT if above else -GAP_PT),
            textcoords="offset points",
            ha="left" if right else "right",
            va="bottom" if above else "top",
            fontsize=LETTER_PT,
            color=_INK,
            path_effects=[withStroke(linewidth=2.0, foreground="white")],
            zorder=3,
        )


def _points(grid: FieldGrid) -> float:
    """Return how many points a metre is long in the picture, about."""
    return 72.0 * SIDE_IN / (max(grid.width, grid.height) * grid.resolution)


def _edge(grid: FieldGrid) -> tuple[float, float]:
    """Return how wide and how high the field is in the picture, in points."""
    metre = grid.resolution * _points(grid)
    return grid.width * metre, grid.height * metre


def _labels(grid: FieldGrid, tags: list[TwinTag]) -> list[Label]:
    """Return where the label of each tag is.

    It is in the first of the four places around its mark that covers no mark and no earlier label, in the
    picture if possible. Where none is free, and where labels would hide the field, there is no label.
    """
    places = [(tag.pin.x - grid.min_x, tag.pin.y - grid.min_y) for tag in tags if tag.pin is not None]
    marks, edge = np.array(places) * _points(grid), _edge(grid)
    sizes = [(0.6 * LETTER_PT * len(tag.tag_id[:LABEL]), LETTER_PT) for tag in tags]
    labels: list[Label] = [None] * len(tags)
    if sum(width * height for width, height in sizes) > BY_LABELS * math.prod(edge):
        return labels
    half = (MARK_PT + 2.0 * LINE_PT) / 2.0
    taken = np.concatenate([np.hstack([marks - half, marks + half]), np.full((len(tags), 4), np.nan)])
    for index, (mark, size) in enumerate(zip(marks.tolist(), sizes, strict=True)):
        boxes = {(right, above): _box(mark, size, right, above) for above, right in _AROUND}
        free = [place for place, box in boxes.items() if not _covers(box, taken[: len(tags) + index])]
        inside = [place for place in free if _inside(boxes[place], edge)]
        labels[index] = place = next(iter((*inside, *free)), None)
        if place is not None:
            taken[len(tags) + index] = boxes[place]
    return labels


def _box(mark: Sequence[float], size: tuple[float, float], right: bool, above: bool) -> Box:
    """Return the left, bottom, right and top of a label."""
    x = mark[0] + GAP_PT if right else mark[0] - GAP_PT - size[0]
    y = mark[1] + GAP_PT if above else mark[1] - GAP_PT - size[1]
    return x, y, x + size[0], y + size[1]


def _inside(box: Box, edge: tuple[float, float]) -> bool:
    """Say whether a box is between 0 and the edge."""
    return min(box[:2]) >= 0.0 and box[2] <= edge[0] and box[3] <= edge[1]


def _covers(box: Box, others: Floats) -> bool:
    """Say whether a box shares a place with one of the others (rows)."""
    left, bottom, right, top = others.T
    return bool(((box[0] < right) & (left < box[2]) & (box[1] < top) & (bottom < box[3])).any())


def _title(sensor: str, values: Floats) -> str:
    """Return the title: the sensor with the range of its readings."""
    quantity = QUANTITIES.get(sensor)
    symbol = "" if quantity is None or quantity.symbol == "1" else f" {quantity.symbol}"
    ends = dict.fromkeys((number(float(values.min())), number(float(values.max()))))
    return f"{_plain(sensor[:40]).replace('_', ' ')}: {' to '.join(ends)}{symbol}"


def _source(record: MissionRecord, sensor: str, count: int) -> str:
    """Return the subtitle: number of tags, times of the shown readings, and their missions."""
    shown = _shown(record, sensor)
    times = [seen.time for seen in shown]
    tags = "1 tag" if count == 1 else f"{count} tags"
    missions = _missions({seen.record.mission_id for seen in shown})
    return f"read at {tags}, {missions}\n{_span(min(times), max(times))} UTC"


def _shown(record: MissionRecord, sensor: str) -> list[Observation]:
    """Return the latest observation of each shown tag's value."""
    latest = {
        seen.record.tag_id: seen
        for seen in record.observations
        if isinstance(seen.record, Reading) and sensor in dict(seen.record.readings)
    }
    tags = ((record.twin.tags[tag_id], seen) for tag_id, seen in latest.items())
    return [seen for tag, seen in tags if tag.pin is not None and math.isfinite(tag.readings[sensor])]


def _missions(ids: set[str]) -> str:
    """Return these missions in words; "" is for observations outside of one."""
    names, outside = ids - {""}, "outside of missions"
    if not names:
        return outside
    of = f"mission {_plain(min(names)[:20])}" if len(names) == 1 else f"{len(names)} missions"
    return f"{of} and {outside}" if "" in ids else of


def _span(first: float, last: float) -> str:
    """Return a span of time to the minute; the day only once where it is the same."""
    (day, begin), (last_day, end) = (utc(time)[:16].split("T") for time in (first, last))
    if day != last_day:
        return f"{day} {begin} to {last_day} {end}"
    return f"{day} {begin}" if begin == end else f"{day} {begin} to {end}"


def _plain(text: str) -> str:
    """Return text with dollar signs escaped, which matplotlib takes for formulas."""
    return printable(text).replace("$", r"\$")
