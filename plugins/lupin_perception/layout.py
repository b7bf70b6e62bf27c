"""Registers the known layout to the map by its tags (Kabsch), and derives the planter boxes from it. Pure.

Layout and map have different origins. A rigid motion of the plane, p -> R(turn) p + shift, leads from one to
the other, fitted by least squares to the tags that were found; in the plane it has a closed form: with the
pairs a, b relative to their means, turn = atan2(sum a x b, sum a . b) and shift = mean(b) - R mean(a).

Outliers are left out, the worst first, but not below three tags. No box comes of a fit with too large an
error, or of tags too near to each other. Metres and radians; the result is in frame `map`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from lupin_greenhouse import Array, Layout, Pose, Table, Tag, matrix
from lupin_perception.boxes import PlanterBox, Size

#: Tags that a fit keeps however badly they fit: of two nobody can say which one is wrong.
_LEAST_TAGS = 3
#: Tags, or a side of a table, nearer to each other (m) have no direction.
_SHORTEST_M = 1e-6


@dataclass(frozen=True, eq=False)
class RigidMotion:
    """A rotation about the origin (rad), then a translation (x, y in m)."""

    turn: float
    shift: Array

    def move(self, points: ArrayLike) -> Array:
        """Return points (x, y), row by row, after the motion."""
        moved: Array = np.asarray(points, dtype=float) @ _rotation(self.turn).T + self.shift
        return moved

    def errors(self, known: ArrayLike, found: ArrayLike) -> Array:
        """Return the distance of each known point, moved, from where it was found, in metres."""
        distances: Array = np.linalg.norm(self.move(known) - np.asarray(found, dtype=float), axis=-1)
        return distances


def fit(known: ArrayLike, found: ArrayLike) -> RigidMotion:
    """Return the least-squares motion from points (x, y) of the layout to where they were found.

    Without pairs it is the identity; a single pair, or several at one place, give a translation only.
    """
    a = np.asarray(known, dtype=float).reshape(-1, 2)
    b = np.asarray(found, dtype=float).reshape(-1, 2)
    if len(a) == 0:
        return RigidMotion(0.0, np.zeros(2))
    from_middle, to_middle = a.mean(axis=0), b.mean(axis=0)
    da, db = a - from_middle, b - to_middle
    crossed = float((da[:, 0] * db[:, 1] - da[:, 1] * db[:, 0]).sum())
    turn = math.atan2(crossed, float((da * db).sum())) if spread(a) > _SHORTEST_M else 0.0
    return RigidMotion(turn, to_middle - _rotation(turn) @ from_middle)


def spread(points: ArrayLike) -> float:
    """Return the root mean square distance of points (x, y) from their mean, in metres."""
    placed = np.asarray(points, dtype=float)
    return float(np.sqrt(((placed - placed.mean(axis=0)) ** 2).sum(axis=1).mean()))


@dataclass(frozen=True)
class Quality:
    """The limits of a usable fit: the error of its worst tag, and the least spread of its tags, in metres.

    Tags near to each other determine the rotation badly: by about the error divided by the spread.
    """

    max_error: float
    min_spread: float


@dataclass(frozen=True)
class Registration:
    """The result: boxes by tag id, tags that hang elsewhere, and why there are no boxes."""

    boxes: Mapping[str, PlanterBox]
    misplaced: tuple[str, ...] = ()
    reason: str = ""


def register(layout: Layout, found: Mapping[str, Pose], quality: Quality) -> Registration:
    """Return the box of every tag that was found where the layout has it.

    Outliers are left out, the worst first: plates are moved, and detectors err. A fit that does not reach the
    quality gives no boxes.
    """
    tags = sorted(tag_id for tag_id in found if tag_id in layout.tags)
    misplaced: list[str] = []
    while True:
        known = np.array([_place(layout.tags[tag_id]) for tag_id in tags]).reshape(-1, 2)
        seen = np.array([found[tag_id].plane for tag_id in tags]).reshape(-1, 2)
        motion = fit(known, seen)
        errors = motion.errors(known, seen)
        if len(tags) <= _LEAST_TAGS or errors.max() <= quality.max_error:
            break
        misplaced.append(tags.pop(int(errors.argmax())))
    reason = _shortfall(known, errors, quality)
    if reason:
        return Registration({}, reason=reason)
    boxes = ((tag_id, _box_of(layout, tag_id, motion, found[tag_id])) for tag_id in tags)
    return Registration({tag_id: box for tag_id, box in boxes if box is not None}, tuple(misplaced))


def _shortfall(known: Array, errors: Array, quality: Quality) -> str:
    """Return why a fit is unusable, with the same text for every such fit; "" if it is usable."""
    if len(known) == 0:
        return "none of the tags found is in the layout"
    if spread(known) < quality.min_spread:
        return "the tags found are too near to each other to say how the layout lies on the map"
    if errors.max() > quality.max_error:
        return f"the layout does not fit: tags are more than {quality.max_error:g} m from where it has them"
    return ""


def _box_of(layout: Layout, tag_id: str, motion: RigidMotion, plate: Pose) -> PlanterBox | None:
    tag = layout.tags[tag_id]
    table = nearest_table(layout.tables, tag)
    if table is None:
        return None
    # The plate's normal by the layout; without one the direction from the table to the tag.
    normal = _rotation(motion.turn).T @ matrix(plate.rotation)[:2, 2]
    return box_of(table, tag, normal, motion)


def nearest_table(tables: Iterable[Table], tag: Tag) -> Table | None:
    """Return the table nearest to a tag, of equally near ones the first by id; None without tables."""
    return min(tables, key=lambda table: (table.distance(tag.x, tag.y), table.id), default=None)


def box_of(table: Table, tag: Tag, normal: ArrayLike, motion: RigidMotion) -> PlanterBox | None:
    """Return the whole table as a box whose front is the side that the plate's normal points out of.

    `normal` is in the layout's frame. Where it has no clear side, the front is the long side towards the tag.
    None for a table without an area.
    """
    low, high = np.array((table.x0, table.y0)), np.array((table.x1, table.y1))
    sides, middle = high - low, (low + high) / 2.0
    if sides.min() < _SHORTEST_M:
        return None
    away = np.asarray(normal, dtype=float)
    axis = int(np.abs(away).argmax())
    if np.linalg.norm(away) < 0.5:
        away, axis = np.array(_place(tag)) - middle, int(sides.argmin())
    out = np.zeros(2)
    out[axis] = -1.0 if away[axis] < 0.0 else 1.0
    front = motion.move(middle + out * sides[axis] / 2.0)
    return PlanterBox(front, _rotation(motion.turn) @ out, Size(float(sides[1 - axis]), float(sides[axis])))


def _place(tag: Tag) -> tuple[float, float]:
    return tag.x, tag.y


def _rotation(turn: float) -> Array:
    cosine, sine = math.cos(turn), math.sin(turn)
    return np.array(((cosine, -sine), (sine, cosine)))


#: A box on the wire: its tag, centre, heading of its outward normal, and size; radians and metres.
Entry = Mapping[str, str | float]


def entries(boxes: Mapping[str, PlanterBox], height: float) -> Sequence[Entry]:
    """Return boxes in the published form: `{"id", "x", "y", "yaw", "width", "depth", "height"}` each."""
    return [_entry(tag_id, box, height) for tag_id, box in boxes.items()]


def _entry(tag_id: str, box: PlanterBox, height: float) -> Entry:
    x, y = (box.origin - box.normal * box.size.depth / 2.0).tolist()
    yaw = math.atan2(float(box.normal[1]), float(box.normal[0]))
    place = {"id": tag_id, "x": x, "y": y, "yaw": yaw}
    return {**place, "width": box.size.width, "depth": box.size.depth, "height": height}
