"""Places detected tags on the map by joining the detector's frames with transforms. Pure.

Either may arrive first: a sighting waits up to `LATE_S` for its transform. Time is an argument, in seconds of
a steady clock.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any

from lupin_greenhouse import Frames, Pose
from lupin_perception.detections import MAX_ENTRIES, TagSeen
from lupin_perception.registry import Known, Registry

#: The frame of the map.
MAP = "map"
#: Frames in a row without a place for any of their tags that are worth a warning.
UNPLACED_FRAMES = 5
#: Seconds for which a sighting waits for its transform, and seconds after which one that came before says
#: nothing any more.
LATE_S = 3.0


class Sightings:
    """The tags in sight, and the sightings that wait for a transform; the registry counts placed ones."""

    def __init__(
        self, tags: Registry, prefix: str, in_sight: float, placed: Callable[[Known | None], None]
    ) -> None:
        """A tag's frame is `prefix` and its id; it is in sight for `in_sight` seconds after its last frame.

        `placed` is called with each tag that was counted, or None where the registry is full.
        """
        self._tags, self._prefix, self._in_sight, self._placed = tags, prefix, in_sight, placed
        self._frames = Frames()
        #: Tags of the last frames: distance in metres, and when.
        self._sights: dict[str, tuple[float, float]] = {}
        #: Sightings that wait for a transform, by the id of their tag, and since when.
        self._late: dict[str, tuple[TagSeen, float]] = {}
        #: Frames in a row with tags of which none could be placed.
        self._unplaced = 0

    def take(self, transforms: Iterable[Any], now: float, *, static: bool = False) -> list[str]:
        """Add the transforms of a TFMessage, and count the waiting sightings that they place.

        Sightings that have waited longer than `LATE_S` are dropped without a word. Return the problems of the
        transforms left out, once for each kind.
        """
        problems = self._frames.take(transforms, static=static, heard=now)
        # Whichever transform it was that was missing: that of the tag, or one on the way to the map.
        self._late = {tag: late for tag, late in self._late.items() if not self._place_late(*late, now)}
        return problems

    def see(self, seen: Sequence[TagSeen], now: float) -> str:
        """Take a frame of the detector: count its tags, or let those that cannot be placed yet wait.

        A tag beyond the reach of the registry is in sight, but not counted. Return a warning at the
        `UNPLACED_FRAMES`-th frame in a row of which no tag could be placed; '' for none.
        """
        self._forget_sights(now)
        self._sights.update({tag.id: (tag.distance, now) for tag in seen})
        near = [tag for tag in seen if self._tags.is_near(tag.distance)]
        unplaced = [tag for tag in near if not self._place(tag, now, now)]
        for tag in unplaced:
            self._tags.saw(tag.id, now)
        self._late.update({tag.id: (tag, now) for tag in unplaced})
        if len(self._late) > MAX_ENTRIES:  # a detector gone wild: each transform would try them all
            self._late = dict(list(self._late.items())[-MAX_ENTRIES:])
        return self._undecided(near, unplaced, now)

    def in_sight(self, now: float) -> dict[str, float]:
        """Return the tags of the last frames with their distances in metres."""
        self._forget_sights(now)
        return {tag: distance for tag, (distance, _) in self._sights.items()}

    def where(self, frame: str, now: float) -> Pose | None:
        """Return the pose of a frame on the map; None where recent transforms do not connect the two."""
        return self._frames.find(MAP, frame, now - LATE_S)

    def forget(self) -> None:
        """Begin a new mission: drop waiting sightings; tags in sight and transforms stay."""
        self._late.clear()

    def _forget_sights(self, now: float) -> None:
        since = now - self._in_sight
        self._sights = {tag: sight for tag, sight in self._sights.items() if sight[1] >= since}

    def _frame_of(self, tag: TagSeen) -> str:
        return f"{self._prefix}{tag.id}"

    def _place_late(self, tag: TagSeen, seen: float, now: float) -> bool:
        """Count a waiting sighting, if it can be placed; return whether it is done."""
        return now - seen > LATE_S or self._place(tag, seen, now)

    def _place(self, tag: TagSeen, seen: float, now: float) -> bool:
        """Count a tag that was `seen` then, if it can be placed; return whether it was."""
        pose = self.where(self._frame_of(tag), now)
        if pose is None:
            return False
        self._placed(self._tags.add(tag.id, pose, tag.distance, seen))
        return True

    def _undecided(self, near: Sequence[TagSeen], unplaced: Sequence[TagSeen], now: float) -> str:
        """Return a warning, once in a row, when tags are seen but none can be placed; '' for none.

        An exploration would find nothing.
        """
        some_placed = len(unplaced) < len(near)
        self._unplaced = 0 if some_placed else self._unplaced + bool(near)
        if not near or self._unplaced != UNPLACED_FRAMES:
            return ""
        gap = self._frames.gap(MAP, self._frame_of(near[0]), now - LATE_S)
        return f"tags are seen but none can be placed: {gap}; is the camera calibrated, the robot localized?"
