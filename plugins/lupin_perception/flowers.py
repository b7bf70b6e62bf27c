"""What grows in the box that is being scanned: detections of one scan, fused. Pure.

A detection is credited to the tag that is scanned while it comes in, and to no other: with the tag the scan
begins anew, so that what was seen at the previous tag never bleeds into this one. Across the box lie some
columns of equal width; a column has at most one bloom. Fusion keeps the best of each column and species, so
the order of detections, and how often one is seen, change nothing.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from lupin_perception.boxes import View, column_of, is_inside
from lupin_perception.detections import Detection

#: Lifecycle states of a mission under way, and those of them in which targets are scanned.
ACTIVE = frozenset({"PREPARE", "EXPLORING", "INSPECTING", "MONITORING", "RETURNING"})
SCANNING = frozenset({"INSPECTING", "MONITORING"})

#: How much the confidence must change to be told again.
_NEWS = 0.1


def is_active(lifecycle: str) -> bool:
    """Say whether a mission is under way."""
    return lifecycle in ACTIVE


def scanned_tag(lifecycle: str, phase: str, target: str) -> str:
    """Return the tag that a mission is scanning; '' for none.

    Also in a phase that is named after the lifecycle (`MONITORING_SCANNING`), but not while the tag is only
    being confirmed.
    """
    return target if lifecycle in SCANNING and "SCANNING" in phase else ""


@dataclass(frozen=True)
class Rules:
    """How detections are fused: metres, radians and shares.

    Detections below `min_confidence` count for nothing; nor, if `gated` and the width of the box is known, do
    those more than `margin` beside it. Class `anomaly` is the pest, every other one a species.
    """

    view: View
    columns: int
    anomaly: str
    min_confidence: float
    gated: bool
    margin: float

    def fraction(self, detection: Detection, pan: float, width: float | None) -> float | None:
        """Return where across a box so wide (m; None: unknown) a detection is; None if it does not count."""
        if detection.confidence < self.min_confidence:
            return None
        fraction = self.view.fraction(pan, detection.bearing)
        if self.gated and width is not None and not is_inside(fraction, width, self.margin):
            return None
        return fraction


@dataclass(frozen=True)
class Bloom:
    """What is in one column: the species that is surest there ('' for none), and whether a pest is."""

    column: int
    species: str
    confidence: float
    anomaly: bool


@dataclass(frozen=True)
class Summary:
    """A scan so far: the surest species of all ('' for none), whether any pest was seen, and the blooms."""

    species: str
    confidence: float
    anomaly: bool
    blooms: tuple[Bloom, ...]

    def tells_more_than(self, last: Summary | None) -> bool:
        """Say whether this is worth telling after `last`: other blooms, or another confidence."""
        if last is None or abs(self.confidence - last.confidence) > _NEWS:
            return True
        return self._shape() != last._shape()

    def _shape(self) -> tuple[object, ...]:
        blooms = tuple((bloom.column, bloom.species, bloom.anomaly) for bloom in self.blooms)
        return self.species, self.anomaly, blooms


class Scan:
    """The detections at one tag, for as long as it is scanned."""

    def __init__(self, rules: Rules) -> None:
        """No tag is scanned at first."""
        self._rules = rules
        self.tag_id = ""
        self._width: float | None = None
        self._best: dict[tuple[int, str], float] = {}

    def aim(self, tag_id: str, width: float | None = None) -> bool:
        """Say which tag is scanned now, '' for none, and how wide its box is (m), if that is known.

        Another tag than before begins a new scan, and so does another width: what was seen of the tag so far
        may belong to its neighbour.
        """
        if (tag_id, width) == (self.tag_id, self._width):
            return False
        self.tag_id, self._width = tag_id, width
        self._best.clear()
        return True

    def add(self, detections: Iterable[Detection], pan: float) -> None:
        """Credit detections to the tag that is scanned; `pan` in radians, see `View`."""
        for detection in detections:
            fraction = self._rules.fraction(detection, pan, self._width)
            if fraction is not None and self.tag_id:
                where = column_of(fraction, self._rules.columns), detection.name
                self._best[where] = max(detection.confidence, self._best.get(where, 0.0))

    def summary(self) -> Summary | None:
        """Return what was seen; None as long as that is nothing."""
        if not self._best:
            return None
        anomaly = self._rules.anomaly
        species, confidence = _surest((n, c) for (_, n), c in self._best.items() if n != anomaly)
        columns = sorted({column for column, _ in self._best})
        found = any(name == anomaly for _, name in self._best)
        return Summary(species, confidence, found, tuple(self._bloom(column) for column in columns))

    def _bloom(self, column: int) -> Bloom:
        here = {name: confidence for (k, name), confidence in self._best.items() if k == column}
        anomaly = here.pop(self._rules.anomaly, None) is not None
        return Bloom(column, *_surest(here.items()), anomaly)


def _surest(candidates: Iterable[tuple[str, float]]) -> tuple[str, float]:
    """Return the surest species with its confidence; of equally sure ones the first by name."""
    return min(candidates, key=lambda pair: (-pair[1], pair[0]), default=("", 0.0))
