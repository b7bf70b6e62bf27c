"""Reports pests that belong to no tag. Pure; time is an argument (s).

A pest in the scanned box is reported with its tag's flowers. One seen while no tag is in sight is reported
here, at the robot's position, after several frames in a row, since one may be a false detection. A place is
reported once per mission; after `MAX_REPORTS` none is.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from lupin_perception.detections import Detection

#: Severity of a pest in an AnomalyReport: above 0, which is for information only.
PEST_SEVERITY = 1
#: Seconds after which a frame is in no row with the one before: a detector that sees nothing may say nothing.
ROW_S = 2.0
#: The most reports of one mission.
MAX_REPORTS = 200

#: A place on the floor in metres.
Point = tuple[float, float]


@dataclass(frozen=True)
class Pest:
    """A pest at no tag, with its confidence (0 to 1)."""

    name: str
    confidence: float

    @property
    def description(self) -> str:
        """The text for people."""
        return f"{self.name} seen where no tag is in sight (confidence {self.confidence:.2f})"


class AnomalyWatch:
    """Counts frames in a row with a pest, while no tag is in sight."""

    def __init__(self, name: str, min_confidence: float, frames: int, spacing: float) -> None:
        """Set the pest's class, its least confidence, the frames in a row, and metres between two reports."""
        self._name = name
        self._min_confidence = min_confidence
        self._frames = frames
        self._spacing = spacing
        self._row = 0
        self._last = -math.inf
        self._reported: list[Point] = []

    @property
    def reported(self) -> Sequence[Point]:
        """The places of the mission's reports."""
        return self._reported

    def begin(self, reported: Iterable[Point] = ()) -> None:
        """Begin a mission; `reported` are its earlier reports."""
        self._row = 0
        self._reported = list(reported)

    def interrupt(self) -> None:
        """Reset the count: a tag is in sight, or is being scanned."""
        self._row = 0

    def add(self, detections: Iterable[Detection], place: Point | None, now: float) -> Pest | None:
        """Count a frame seen from `place` (None: unknown); return a pest to report now.

        None where the frames in a row are too few, the place is unknown, one was reported near it, or
        `MAX_REPORTS` were.
        """
        sure = [
            d.confidence for d in detections if d.name == self._name and d.confidence >= self._min_confidence
        ]
        if not sure:
            self._row = 0
            return None
        self._row = self._row + 1 if now - self._last <= ROW_S else 1
        self._last = now
        if self._row < self._frames or place is None or not self._is_new(place):
            return None
        self._reported.append(place)
        return Pest(self._name, max(sure))

    def _is_new(self, place: Point) -> bool:
        near = any(math.dist(place, other) < self._spacing for other in self._reported)
        return not near and len(self._reported) < MAX_REPORTS
