"""The geometry of the planter box behind a tag, and of blooms in it. Metres and radians, frame `map`. Pure.

A box is behind its tag, which hangs in the middle of its front face. On the plane

* O, the origin, is the middle of the front face,
* n, the normal, is the tag's own +Z on the plane: out of the bed, into the aisle,
* l, the lateral axis, is n turned by +90°: (-n_y, n_x), to the right for an observer in the aisle.

A place in the box is a fraction f (-1 left edge, +1 right edge as seen from the aisle) and a depth d (0 front
face, 1 back): O + l f w/2 - n d D, with width w and depth D of the box.

Depth and height of a bloom are not measured (one uncalibrated camera). The drawn depth is cosmetic: a fixed
scatter, so that the blooms of a box do not form a line.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lupin_greenhouse import Array, Pose, matrix

#: The share of a turn by the golden ratio: multiples of it never cluster.
GOLDEN = 0.6180339887498949
#: A normal shorter than this on the plane has no direction: the tag lies on its back.
_SHORTEST = 1e-6


@dataclass(frozen=True)
class Size:
    """Inner width (along the aisle) and depth (away from it) of a box, in metres."""

    width: float
    depth: float


@dataclass(frozen=True, eq=False)
class PlanterBox:
    """A box on the plane: the middle of its front face, its unit normal into the aisle, its size."""

    origin: Array
    normal: Array
    size: Size

    @property
    def lateral(self) -> Array:
        """The unit vector along the front face: the normal turned by +90°."""
        return np.array((-self.normal[1], self.normal[0]))

    def place(self, fraction: ArrayLike, depth: ArrayLike) -> Array:
        """Return the places (x, y) of fractions and depths: O + l f w/2 - n d D, row by row."""
        f, d = np.asarray(fraction, dtype=float), np.asarray(depth, dtype=float)
        along = f[..., None] * (self.size.width / 2.0) * self.lateral
        placed: Array = self.origin + along - d[..., None] * self.size.depth * self.normal
        return placed

    def footprint(self) -> Array:
        """Return the corners (x, y): front at f = 1, front at f = -1, back at -1, back at 1."""
        return self.place((1.0, -1.0, -1.0, 1.0), (0.0, 0.0, 1.0, 1.0))

    def is_like(self, other: PlanterBox, shift: float, turn: float) -> bool:
        """Return whether both fronts are within `shift` metres and `turn` radians of each other."""
        moved = float(np.linalg.norm(self.origin - other.origin))
        return moved <= shift and float(self.normal @ other.normal) >= math.cos(turn)


def box_from_tag(tag: Pose, size: Size, lateral_offset: float = 0.0) -> PlanterBox | None:
    """Return the box behind a tag with a known pose in `map`; None when the tag faces up or down.

    The normal is the horizontal part of the tag's +Z, the third column of its rotation. The tag hangs
    `lateral_offset` metres to the left of the middle of the box.
    """
    normal = matrix(tag.rotation)[:2, 2]
    length = float(np.linalg.norm(normal))
    if length < _SHORTEST:
        return None
    normal = normal / length
    lateral = np.array((-normal[1], normal[0]))
    return PlanterBox(tag.position[:2] + lateral_offset * lateral, normal, size)


@dataclass(frozen=True)
class BoxView:
    """Converts the place in the image and the arm's pan to the place in the box.

    At `pan_half_span` (rad) of the pan joint a bloom at the image's outer edge, `half_field` (rad) further
    out, is at the edge of the box.
    """

    pan_half_span: float
    half_field: float

    def fraction(self, pan: float, bearing: ArrayLike) -> Array:
        """Return the lateral fractions f = (pan + b half_field) / (pan_half_span + half_field) of bearings b.

        `pan` in radians grows to the right, as a bearing does, from -1 at the image's left edge to +1 at its
        right one. Fractions are not clamped: beyond ±1 lies the neighbour's box.
        """
        span = self.pan_half_span + self.half_field
        b = np.asarray(bearing, dtype=float)
        return np.asarray((pan + b * self.half_field) / span if span > 0.0 else np.zeros_like(b))


def is_inside(fraction: ArrayLike, width: float, margin: float) -> NDArray[np.bool_]:
    """Return which lateral fractions are within the box or `margin` metres beside it.

    |f| ≤ 1 + m / (w/2). Blooms outside belong to a neighbour; clamping would credit them to this box.
    """
    limit = 1.0 + margin / (width / 2.0) if width > 0.0 else -1.0
    return np.asarray(np.abs(fraction) <= limit)


def column_of(fraction: ArrayLike, columns: int) -> NDArray[np.intp]:
    """Return the column (of equal widths, 0 at the left edge) of each lateral fraction.

    k = floor((f + 1)/2 N), clamped to the outermost columns.
    """
    f = np.asarray(fraction, dtype=float)
    return np.clip(np.floor((f + 1.0) / 2.0 * columns), 0, columns - 1).astype(np.intp)


def column_fraction(column: ArrayLike, columns: int) -> Array:
    """Return the lateral fractions of the middle of columns k: -1 + (2k + 1)/N."""
    return np.asarray(-1.0 + (2.0 * np.asarray(column, dtype=float) + 1.0) / columns)


def column_depth(column: ArrayLike, base: float, spread: float) -> Array:
    """Return the depths at which the blooms of columns k are drawn: cosmetic, not measured.

    base + (frac(k φ) - 1/2) 2 spread, within 0 and 1, with the golden ratio's φ = 0.618...: irregular to the
    eye and deterministic.
    """
    jitter = (np.modf(np.asarray(column, dtype=float) * GOLDEN)[0] - 0.5) * 2.0 * spread
    return np.asarray(np.clip(base + jitter, 0.0, 1.0))
