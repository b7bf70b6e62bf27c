"""Fuses the flower detections of one scan: the maximum confidence for each kind and column of the box. Pure.

A detection is credited to the tag that is scanned when it arrives; another tag begins a new scan, so nothing
is carried over. The box is divided into columns of equal width with at most one bloom each. A maximum depends
neither on the order of detections nor on how often one is seen.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lupin_greenhouse import Array, is_under_way
from lupin_perception.boxes import BoxView, column_of, is_inside
from lupin_perception.detections import Detection

#: The lifecycle state of a search: by the interface document nothing is attributed in it, whatever its phase.
SEARCHING = "EXPLORING"

Indices = NDArray[np.intp]

#: The confidence of an absent detection.
NONE = -np.inf
#: The change of confidence that is published.
_NEWS = 0.1


def scanned_tag(lifecycle: str, phase: str, target: str) -> str:
    """Return the tag that a mission is scanning; '' for none.

    Its phase may be named after the lifecycle (`MONITORING_SCANNING`). A tag that is only being confirmed
    does not count.
    """
    scans = is_under_way(lifecycle) and lifecycle != SEARCHING and "SCANNING" in phase
    return target if scans else ""


@dataclass(frozen=True)
class Rules:
    """The rules of fusion: metres, radians and fractions.

    Detections below `min_confidence` are dropped; if `gated` and the width of the box is known, also those
    more than `margin` beside it. Class `anomaly` is the pest, every other one a species.
    """

    view: BoxView
    columns: int
    anomaly: str
    min_confidence: float
    gated: bool
    margin: float

    def count(
        self, bearings: Array, confidences: Array, pan: float, width: float | None
    ) -> tuple[NDArray[np.bool_], Indices]:
        """Return which detections count, and the column of each in a box of a `width` (m; None: unknown).

        `bearings` from -1 at the image's left edge to +1, `confidences` from 0 to 1, `pan` as in `BoxView`.
        """
        fractions = self.view.fraction(pan, bearings)
        counted = confidences >= self.min_confidence
        if self.gated and width is not None:
            counted &= is_inside(fractions, width, self.margin)
        return counted, column_of(fractions, self.columns)


def fuse(best: Array, columns: Indices, kinds: Indices, confidences: Array) -> Array:
    """Return the maximum confidence of each kind in each column, `NONE` where there is none.

    `best` has a row for each column and a column for each kind; the others have an entry for each detection:

        b'[k, s] = max(b[k, s], max { c_i : k_i = k, s_i = s })
    """
    fused = best.copy()
    np.maximum.at(fused, (columns, kinds), confidences)
    return fused


def surest(names: NDArray[np.str_], confidences: Array) -> tuple[str, float]:
    """Return the name with the highest confidence, of equal ones the first, and that confidence.

    Without any, ('', 0.0).
    """
    if not np.any(confidences > NONE):
        return "", 0.0
    first = int(np.argmax(confidences))
    return str(names[first]), float(confidences[first])


@dataclass(frozen=True)
class ColumnBloom:
    """The bloom of one column: its surest species ('' for none), and whether there is a pest."""

    column: int
    species: str
    confidence: float
    anomaly: bool


@dataclass(frozen=True)
class ScanSummary:
    """A scan so far: the surest species of all ('' for none), whether any pest was seen, and the blooms."""

    species: str
    confidence: float
    anomaly: bool
    blooms: tuple[ColumnBloom, ...]

    def adds_to(self, last: ScanSummary | None) -> bool:
        """Return whether to publish this after `last`: other blooms, or another overall confidence."""
        if last is None or abs(self.confidence - last.confidence) > _NEWS:
            return True
        return self._shape() != last._shape()

    def _shape(self) -> tuple[object, ...]:
        blooms = tuple((bloom.column, bloom.species, bloom.anomaly) for bloom in self.blooms)
        return self.species, self.anomaly, blooms


class TagScan:
    """The detections at one tag, for as long as it is scanned."""

    def __init__(self, rules: Rules) -> None:
        """Begin without a scanned tag."""
        self._rules = rules
        self.tag_id = ""
        self._width: float | None = None
        #: Names of what was seen, in their order, and how sure each is in each column.
        self._kinds: NDArray[np.str_]
        self._best: Array
        #: The same, from before `age` was called last.
        self._before: Array
        self._forget()

    def aim(self, tag_id: str, width: float | None = None) -> bool:
        """Set the scanned tag, '' for none, and the width of its box (m), if known; return whether that
        changed.

        Another tag, or another width, begins a new scan: earlier detections may be a neighbour's.
        """
        if (tag_id, width) == (self.tag_id, self._width):
            return False
        self.tag_id, self._width = tag_id, width
        self._forget()
        return True

    def add(self, detections: Sequence[Detection], pan: float) -> None:
        """Credit detections to the scanned tag; `pan` in radians, see `BoxView`."""
        if not self.tag_id or not detections:
            return
        bearings = np.array([detection.bearing for detection in detections])
        confidences = np.array([detection.confidence for detection in detections])
        names = np.array([detection.name for detection in detections])
        counted, columns = self._rules.count(bearings, confidences, pan, self._width)
        self._fuse(columns[counted], names[counted], confidences[counted])

    def _fuse(self, columns: Indices, names: NDArray[np.str_], confidences: Array) -> None:
        self._make_room(names)
        self._best = fuse(self._best, columns, np.searchsorted(self._kinds, names), confidences)

    def resume(self, summary: ScanSummary) -> None:
        """Continue an earlier process's scan from its summary, which has no confidence of pests."""
        found = [(bloom.column, bloom.species, bloom.confidence) for bloom in summary.blooms if bloom.species]
        found += [(bloom.column, self._rules.anomaly, 0.0) for bloom in summary.blooms if bloom.anomaly]
        found = [one for one in found if 0 <= one[0] < self._rules.columns]
        if found:
            columns, names, confidences = map(np.array, zip(*found, strict=True))
            self._fuse(columns, names, confidences)

    def age(self) -> None:
        """Drop detections from before the last call: for a scan without an end."""
        self._before, self._best = self._best, np.full_like(self._best, NONE)

    def summary(self) -> ScanSummary | None:
        """Return the summary; None without detections."""
        best = np.maximum(self._best, self._before)
        seen: NDArray[np.bool_] = best > NONE
        is_pest = np.equal(self._kinds, self._rules.anomaly)
        if not seen.any():
            return None
        names, species, pests = self._kinds[~is_pest], best[:, ~is_pest], seen[:, is_pest]
        blooms = (
            ColumnBloom(column, *surest(names, species[column]), bool(pests[column].any()))
            for column in np.flatnonzero(seen.any(axis=1)).tolist()
        )
        overall = surest(names, species.max(axis=0, initial=NONE))
        return ScanSummary(*overall, bool(pests.any()), tuple(blooms))

    def _forget(self) -> None:
        self._kinds = np.empty(0, dtype=np.str_)
        self._best = self._before = np.empty((self._rules.columns, 0))

    def _make_room(self, names: NDArray[np.str_]) -> None:
        """Add columns to the table for new names."""
        kinds = np.union1d(self._kinds, names)
        if kinds.size > self._kinds.size:
            places = np.searchsorted(kinds, self._kinds)
            self._best, self._before = (
                _spread(best, places, kinds.size) for best in (self._best, self._before)
            )
            self._kinds = kinds


def _spread(best: Array, places: Indices, size: int) -> Array:
    """Return a table of `size` kinds with these columns at their new indices, and `NONE` elsewhere."""
    wider = np.full((len(best), size), NONE)
    wider[:, places] = best
    return wider
