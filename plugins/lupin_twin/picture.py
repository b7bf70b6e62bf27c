"""A sensor's field as a picture: what is known between the tags, on the map of the greenhouse."""

from __future__ import annotations

import io
import math
import warnings
from typing import TYPE_CHECKING, Any

import numpy as np

from lupin_engine.errors import LupinError
from lupin_twin.export.forms import utc
from lupin_twin.field import DEFAULTS, Field, Floats, Grid, OccupancyMap, Settings, interpolate
from lupin_twin.missions import MissionRecord, Observation
from lupin_twin.records import Reading
from lupin_twin.state import Tag
from lupin_twin.text import number, printable
from lupin_twin.units import QUANTITIES, with_unit

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

#: Points: letters of a label, and half of a mark; and letters of an id that are shown.
LETTER_PT, MARK_PT, LABEL = 7.0, 3.0, 12

#: An occupied cell of the map has this value or more, of 100.
OCCUPIED = 65

_MISSING = "pictures need a package that is not installed: pip install 'lupin-engine[sim]'"

#: Dark ink on white; the colour scale is one that people who see few colours can read as well.
_INK, _FAINT, _HATCH, _COLOURS = "#1b1f24", "#5b636c", "#c3c8ce", "viridis"
_WALL = (0.32, 0.35, 0.38)


class NoPicture(LupinError):
    """The picture cannot be drawn; the text says why."""


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
        grid, *record.twin.samples(sensor), Settings(falloff=reach, max_distance=reach), explored
    )
    with (
        mpl.rc_context({"svg.fonttype": "path", "svg.hashsalt": "lupin", "hatch.linewidth": 0.6}),
        warnings.catch_warnings(),
    ):
        # Of a letter that no font has there is an empty box, which says it.
        warnings.filterwarnings("ignore", r"Glyph \d+ ", UserWarning)
        figure = Figure(figsize=_size(grid), dpi=DPI, layout="constrained", facecolor="white")
        FigureCanvasAgg(figure)
        _draw(figure.add_subplot(), record, sensor, field, occupancy, tags, reach)
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


def _grid(tags: list[Tag], occupancy: OccupancyMap | None) -> Grid:
    """Return cells over the tags, and over all of the map that is known."""
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
    return Grid.over(min_x, min_y, max_x, max_y, side / CELLS)


def _on_map(occupancy: OccupancyMap, columns: Any, rows: Any) -> tuple[Any, Any]:
    """Return where cells of the map are, in metres."""
    cos, sin = math.cos(occupancy.yaw), math.sin(occupancy.yaw)
    along, across = columns * occupancy.resolution, rows * occupancy.resolution
    return occupancy.x + cos * along - sin * across, occupancy.y + sin * along + cos * across


def _size(grid: Grid) -> tuple[float, float]:
    """Return the figure's width and height in inches; around the field there is room for scale and text."""
    longest = max(grid.width, grid.height)
    width, height = SIDE_IN * grid.width / longest, SIDE_IN * grid.height / longest
    return max(width + 1.8, 4.2), max(height + 1.25, 3.0)


def _draw(
    axes: Axes,
    record: MissionRecord,
    sensor: str,
    field: Field,
    occupancy: OccupancyMap | None,
    tags: list[Tag],
    reach: float,
) -> None:
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
    _tags(axes, grid, tags, sensor)
    bar = axes.figure.colorbar(image, ax=axes, fraction=0.05, pad=0.03)
    bar.set_label(_plain(with_unit(sensor)[:40]), color=_INK)
    bar.outline.set_visible(False)
    axes.set_title(_title(sensor, values), loc="left", fontsize=10, color=_INK, pad=46)
    key = f"{_source(record, sensor, len(values))}\n{_key(occupancy, reach)}"
    axes.text(0.0, 1.01, key, transform=axes.transAxes, fontsize=7, color=_FAINT, va="bottom")
    axes.tick_params(colors=_INK, labelsize=8)
    for spine in axes.spines.values():
        spine.set_color(_FAINT)


def _key(occupancy: OccupancyMap | None, reach: float) -> str:
    blank = f"filled: read here · hollow: not read\nblank: nothing was read within {reach:g} m"
    return blank if occupancy is None else f"{blank} · hatched: not explored"


def _range(values: Floats) -> tuple[float, float]:
    """Return the ends of the colour scale; values that are nearly the same are in its middle."""
    low, high = float(values.min()), float(values.max())
    middle = low / 2.0 + high / 2.0
    room = max(abs(middle) * LEAST_SPAN, LEAST_UNITS)
    return (low, high) if high - low >= room else (middle - room, middle + room)


def _unexplored(axes: Axes, grid: Grid, occupancy: OccupancyMap | None) -> None:
    """Hatch what nobody has looked at yet."""
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
    axes: Axes, grid: Grid, occupancy: OccupancyMap, extent: tuple[float, float, float, float]
) -> None:
    """Draw what is in the way, over the field."""
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


def _tags(axes: Axes, grid: Grid, tags: list[Tag], sensor: str) -> None:
    """Mark each tag with its id; those without a reading of this sensor are hollow."""
    from matplotlib.patheffects import withStroke

    for tag, place in zip(tags, _labels(grid, tags), strict=True):
        assert tag.pin is not None
        measured = math.isfinite(tag.readings.get(sensor, math.nan))
        axes.plot(
            tag.pin.x,
            tag.pin.y,
            marker="o",
            markersize=4.5,
            markerfacecolor=_INK if measured else "white",
            markeredgecolor="white" if measured else _INK,
            markeredgewidth=0.8,
            zorder=4,
        )
        right, above = place
        axes.annotate(
            _plain(tag.tag_id[:LABEL]),
            (tag.pin.x, tag.pin.y),
            xytext=(4 if right else -4, 4 if above else -4),
            textcoords="offset points",
            ha="left" if right else "right",
            va="bottom" if above else "top",
            fontsize=LETTER_PT,
            color=_INK,
            path_effects=[withStroke(linewidth=2.0, foreground="white")],
            zorder=3,
        )


def _labels(grid: Grid, tags: list[Tag]) -> list[tuple[bool, bool]]:
    """Return where the label of each tag is: right or left of its mark, above or below.

    The first of the four places in the picture that covers no mark and no earlier label; where none is free,
    the first.
    """
    points = 72.0 * SIDE_IN / (max(grid.width, grid.height) * grid.resolution)  # in a metre, about
    marks = [
        ((tag.pin.x - grid.min_x) * points, (tag.pin.y - grid.min_y) * points)
        for tag in tags
        if tag.pin is not None
    ]
    edge = grid.width * grid.resolution * points, grid.height * grid.resolution * points
    taken = [(x - MARK_PT, y - MARK_PT, x + MARK_PT, y + MARK_PT) for x, y in marks]
    places = []
    for tag, (x, y) in zip(tags, marks, strict=True):
        width, height = 0.6 * LETTER_PT * len(tag.tag_id[:LABEL]), LETTER_PT
        boxes = {
            (right, above): (
                x + 4 if right else x - 4 - width,
                y + 4 if above else y - 4 - height,
                x + 4 + width if right else x - 4,
                y + 4 + height if above else y - 4,
            )
            for above in (True, False)
            for right in (True, False)
        }
        free = (
            place
            for place, box in boxes.items()
            if _inside(box, edge) and not any(_overlap(box, other) for other in taken)
        )
        place = next(free, (True, True))
        places.append(place)
        taken.append(boxes[place])
    return places


def _inside(box: tuple[float, ...], edge: tuple[float, float]) -> bool:
    """Say whether a box (left, bottom, right, top) is between 0 and the edge."""
    return min(box[:2]) >= 0.0 and box[2] <= edge[0] and box[3] <= edge[1]


def _overlap(one: tuple[float, ...], other: tuple[float, ...]) -> bool:
    """Say whether two boxes (left, bottom, right, top) share a place."""
    return one[0] < other[2] and other[0] < one[2] and one[1] < other[3] and other[1] < one[3]


def _title(sensor: str, values: Floats) -> str:
    """Return what was read: the field between the tags has no other values."""
    quantity = QUANTITIES.get(sensor)
    symbol = "" if quantity is None or quantity.symbol == "1" else f" {quantity.symbol}"
    ends = dict.fromkeys((number(float(values.min())), number(float(values.max()))))
    return f"{_plain(sensor[:40]).replace('_', ' ')}: {' to '.join(ends)}{symbol}"


def _source(record: MissionRecord, sensor: str, count: int) -> str:
    """Return at how many tags and when the values were read that are shown, and by whom."""
    shown = _shown(record, sensor)
    times = [seen.time for seen in shown]
    tags = "1 tag" if count == 1 else f"{count} tags"
    missions = _missions({seen.record.mission_id for seen in shown})
    return f"read at {tags}, {missions}\n{_span(min(times), max(times))} UTC"


def _shown(record: MissionRecord, sensor: str) -> list[Observation]:
    """Return of each tag that is shown the observation of its value, which is the latest."""
    latest = {
        seen.record.tag_id: seen
        for seen in record.observations
        if isinstance(seen.record, Reading) and sensor in dict(seen.record.readings)
    }
    tags = ((record.twin.tags[tag_id], seen) for tag_id, seen in latest.items())
    return [seen for tag, seen in tags if tag.pin is not None and math.isfinite(tag.readings[sensor])]


def _missions(ids: set[str]) -> str:
    """Return these missions in words; "" is for what was seen outside of one."""
    names, outside = ids - {""}, "outside of missions"
    if not names:
        return outside
    of = f"mission {_plain(min(names)[:20])}" if len(names) == 1 else f"{len(names)} missions"
    return f"{of} and {outside}" if "" in ids else of


def _span(first: float, last: float) -> str:
    """Return from when to when, to the minute; the day once if it is the same."""
    (day, begin), (last_day, end) = (utc(time)[:16].split("T") for time in (first, last))
    if day != last_day:
        return f"{day} {begin} to {last_day} {end}"
    return f"{day} {begin}" if begin == end else f"{day} {begin} to {end}"


def _plain(text: str) -> str:
    """Return text as such: matplotlib takes what is between dollar signs for a formula."""
    return printable(text).replace("$", r"\$")
