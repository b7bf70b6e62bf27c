"""The registry of tags seen in the present mission: poses, counts of sightings, flowers. At most `MAX_TAGS`.

Pure; time is an argument, in seconds of a steady clock. A tag is *discovered* after some sightings, since one
may be a false detection. Its pose is that of the nearest view, whose error is smallest. A new mission clears
all, so that an earlier find never counts for it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from lupin_engine.errors import shortened
from lupin_greenhouse import Pose
from lupin_perception.flowers import ScanSummary

#: Tags that are remembered; more in one greenhouse are a detector gone wild. The message with all of them is
#: within `ros.adapter.qos.OBJECT_BYTES`.
MAX_TAGS = 400
#: A pose that differs by less (m; cosine of half the angle) is the same.
_STILL_M, _STILL_TURN = 1e-3, 1.0 - 1e-6


@dataclass
class Known:
    """A tag: its pose in `map` by the nearest view, with distance (m), sightings, last one (s)."""

    id: str
    pose: Pose
    distance: float
    sightings: int
    last_seen: float
    summary: ScanSummary | None = None


@dataclass(frozen=True)
class Confirmation:
    """Whether a tag is in sight, the confidence (0 to 1), its pose, and why not."""

    detected: bool
    confidence: float
    pose: Pose | None = None
    error: str = ""


class Registry:
    """The tags of the present mission, in the order in which they were first seen."""

    def __init__(self, min_sightings: int, max_distance: float, freshness: float) -> None:
        """Set the sightings of a discovery, their range (m; 0: any), and a confirmation's age (s)."""
        self._enough = min_sightings
        self._reach = max_distance if max_distance > 0.0 else math.inf
        self._freshness = freshness
        self._known: dict[str, Known] = {}
        #: The mission that this is about; '' before the first.
        self.mission_id = ""
        #: Grows with every change of which tags are discovered, where they are, and what grows there.
        self.revision = 0

    def begin(self, mission_id: str) -> bool:
        """Take the published mission id ('': none); return whether it is new, which clears all."""
        if mission_id in ("", self.mission_id):
            return False
        self.mission_id = mission_id
        self._known.clear()
        self.revision += 1
        return True

    def restore(self, tags: Iterable[Known]) -> None:
        """Add the tags that an earlier process saved for this mission."""
        self._known.update({known.id: known for known in tags})
        self.revision += 1

    def is_near(self, distance: float) -> bool:
        """Return whether a view from `distance` metres counts; an unknown (infinite) distance does."""
        return distance <= self._reach or math.isinf(distance)

    def add(self, tag_id: str, pose: Pose, distance: float, now: float) -> Known | None:
        """Count a sighting that `is_near`, unchecked; return the tag, or None where the registry is full.

        Its pose is that of the nearest view, and of equally near ones (also: of unknown distance) the last.
        """
        known = self._known.get(tag_id)
        if known is None:
            if len(self._known) >= MAX_TAGS:
                return None
            known = self._known[tag_id] = Known(tag_id, pose, distance, 0, now)
        known.sightings += 1
        known.last_seen = max(known.last_seen, now)  # it may have waited for its place
        is_news = known.sightings == self._enough
        if distance <= known.distance:
            is_news |= known.sightings > self._enough and _has_moved(known.pose, pose)
            known.pose, known.distance = pose, distance
        self.revision += is_news
        return known

    def saw(self, tag_id: str, now: float) -> None:
        """Record that a tag is in sight without a pose: for confirmations only, no sighting is counted."""
        known = self._known.get(tag_id)
        if known is not None:
            known.last_seen = max(known.last_seen, now)

    def classify(self, tag_id: str, summary: ScanSummary) -> None:
        """Set the flowers of a tag; each scan replaces them."""
        self._known[tag_id].summary = summary
        self.revision += 1

    def find(self, tag_id: str) -> Known | None:
        """Return a tag; None where it was not seen, or too seldom to count as discovered."""
        known = self._known.get(tag_id)
        return known if known is not None and known.sightings >= self._enough else None

    def discovered(self) -> Sequence[Known]:
        """Return the discovered tags."""
        return [known for known in self._known.values() if known.sightings >= self._enough]

    def confirm(self, tag_id: str, now: float) -> Confirmation:
        """Return whether a tag is discovered, and was in sight lately."""
        known, name = self._known.get(tag_id), f"tag {shortened(tag_id)!r}"
        if known is None:
            return Confirmation(False, 0.0, error=f"{name} not discovered")
        if known.sightings < self._enough:
            count = f"{known.sightings} of {self._enough}"
            share = known.sightings / self._enough
            return Confirmation(False, share, error=f"{name} below sighting threshold: {count}")
        age = now - known.last_seen
        if age > self._freshness:
            seen = "not seen since this node began" if math.isinf(age) else f"last seen {age:.1f} s ago"
            since = f"{seen}, allowed {self._freshness:g} s"
            return Confirmation(False, 0.0, error=f"{name} stale: {since}")
        return Confirmation(True, 1.0, known.pose)


def _has_moved(before: Pose, now: Pose) -> bool:
    """Return whether two poses differ by more than rounding: a millimetre, or about a tenth of a degree."""
    place = float(np.abs(before.position - now.position).max())
    return place > _STILL_M or abs(float(before.rotation @ now.rotation)) < _STILL_TURN
