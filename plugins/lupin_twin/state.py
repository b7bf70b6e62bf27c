"""Folds records into the table of tags; pure, time is an argument.

The first position of a tag is kept, so that its marker does not drift with the robot's localization, until a
camera with more sightings of it reports another one: a reading may come with no better position than the
robot's. Readings are the latest of each sensor, flowers the latest of all; a planter box of the geometry
topic replaces one that came with flowers.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np

from lupin_twin.field import Floats
from lupin_twin.records import (
    Anomaly,
    Bloom,
    BoxOutline,
    Corners,
    Discovery,
    Flowers,
    Observed,
    Pin,
    Reading,
    Record,
)

#: Sensors of the interface; further ones are known once they have been read.
SENSORS = ("temperature", "humidity", "co2", "light", "soil_moisture")

#: Observations that are kept of each tag, unless said otherwise.
HISTORY = 32

#: Tags, and sensors by name, that there is room for: a detector that is broken invents them without end.
MAX_TAGS, MAX_SENSORS = 10_000, 256

#: Anomaly reports that are kept in memory, and metres within which one is near a tag.
REPORTS = 256
NEAR_M = 2.0

#: Metres by which a better place must differ from the one that is known.
MOVED_M = 0.05

#: The published age of a tag that was never observed, in seconds: nobody takes it for fresh, and unlike
#: an infinite number every reader of JSON reads it.
NEVER_S = 1e9

#: Values beyond this cannot be sent in a field, which has 32 bits for each.
LARGEST = float(np.finfo(np.float32).max)


def observed_at(record: Observed, received: float) -> float:
    """Return when an observation that arrived at time `received` was made, in seconds of the twin's clock.

    It is never later than its arrival (0: unknown), so a stamp of a clock that is ahead keeps no tag fresh.
    """
    return min(record.stamp, received or math.inf)


@dataclass
class TwinTag:
    """The state of one tag; `pin` is None while its position is unknown.

    `sightings` is the count of the camera that gave the position, 0 without one. `last_observed` is the time
    of the latest reading or flowers, in seconds, None before the first.
    """

    tag_id: str
    history: deque[Reading]
    pin: Pin | None = None
    sightings: int = 0
    readings: dict[str, float] = field(default_factory=dict)
    last_observed: float | None = None
    species: str = ""
    confidence: float = 0.0
    anomaly: bool = False
    blooms: tuple[Bloom, ...] = ()
    footprint: Corners = ()
    footprint_from_channel: bool = False

    def stale_seconds(self, now: float) -> float:
        """Return the time since the last observation; `NEVER_S` or more without one."""
        return max(now, NEVER_S) if self.last_observed is None else max(0.0, now - self.last_observed)

    def is_better(self, seen: Discovery) -> bool:
        """Return whether a discovery has a better position than the known one."""
        if self.pin is None:
            return True
        moved = math.hypot(seen.pin.x - self.pin.x, seen.pin.y - self.pin.y)
        return seen.sightings > self.sightings and moved > MOVED_M

    def shows(self, seen: Discovery) -> bool:
        """Return whether the flowers of a discovery are known; one without flowers adds none."""
        reported = seen.species, seen.confidence, seen.anomaly
        return reported == ("", 0.0, False) or reported == (self.species, self.confidence, self.anomaly)


@dataclass(frozen=True)
class TwinReport:
    """An anomaly and the nearest tag within 2 m, "" if there is none."""

    anomaly: Anomaly
    near: str


class Twin:
    """All tags in the order of their first record, and the anomaly reports.

    `observation_count` counts readings and flowers, `pins` assigned positions, and `revision` all changes.
    """

    def __init__(self, history: int = HISTORY) -> None:
        self._history = history
        self._tags: dict[str, TwinTag] = {}
        self._anomalies: deque[Anomaly] = deque(maxlen=REPORTS)
        self._sensors = dict.fromkeys(SENSORS)
        self._time = 0.0
        self.observation_count = 0
        self.pins = 0
        self.revision = 0

    @property
    def tags(self) -> Mapping[str, TwinTag]:
        """The tags by id."""
        return self._tags

    @property
    def sensors(self) -> Iterable[str]:
        """The sensors of the interface, then further ones that were read."""
        return self._sensors.keys()

    @property
    def reports(self) -> list[TwinReport]:
        """The latest anomaly reports, oldest first, with the nearest tag by present knowledge."""
        return [TwinReport(anomaly, self.nearest(anomaly.x, anomaly.y)) for anomaly in self._anomalies]

    def nearest(self, x: float, y: float) -> str:
        """Return the nearest tag within 2 m of a place, "" if there is none."""
        pins = [(tag.tag_id, tag.pin) for tag in self._tags.values() if tag.pin is not None]
        near = [(math.hypot(pin.x - x, pin.y - y), tag_id) for tag_id, pin in pins]
        distance, tag_id = min(near, default=(math.inf, ""))
        return tag_id if distance <= NEAR_M else ""

    def has_room(self, record: Record) -> bool:
        """Return whether a record's tag and sensors are known, or fit within the limits."""
        if isinstance(record, Anomaly):
            return True
        if record.tag_id not in self._tags and len(self._tags) >= MAX_TAGS:
            return False
        readings = record.readings if isinstance(record, Reading) else ()
        new = {name for name, _ in readings} - self._sensors.keys()
        return not new or len(self._sensors) + len(new) <= MAX_SENSORS

    def is_news(self, record: Record) -> bool:
        """Return whether `apply` would change anything: positions and boxes are repeated often."""
        if isinstance(record, Discovery):
            tag = self._tags.get(record.tag_id)
            return tag is None or tag.is_better(record) or not tag.shows(record)
        if isinstance(record, BoxOutline):
            tag = self._tags.get(record.tag_id)
            return tag is None or not tag.footprint_from_channel or tag.footprint != record.footprint
        return True

    def apply(self, record: Record, received: float) -> None:
        """Apply a record that arrived at time `received`; 0 if the clock had not begun by then."""
        self.revision += 1
        match record:
            case Reading():
                self._apply_reading(record, observed_at(record, received))
            case Flowers():
                self._apply_flowers(record, observed_at(record, received))
            case Anomaly():
                self._anomalies.append(record)
            case Discovery():
                self._apply_discovery(record)
            case BoxOutline():
                tag = self._tag(record.tag_id)
                tag.footprint, tag.footprint_from_channel = record.footprint, True

    def _apply_discovery(self, record: Discovery) -> None:
        tag = self._tag(record.tag_id)
        if tag.is_better(record):
            tag.pin, tag.sightings = record.pin, record.sightings
            self.pins += 1
        if not tag.shows(record):
            tag.species, tag.confidence, tag.anomaly = record.species, record.confidence, record.anomaly

    def _apply_reading(self, record: Reading, time: float) -> None:
        tag = self._tag(record.tag_id)
        self._pin(tag, record.pin)
        tag.readings.update(record.readings)
        tag.history.append(record)
        self._sensors.update(dict.fromkeys(tag.readings))
        self._observed(tag, time)

    def _apply_flowers(self, record: Flowers, time: float) -> None:
        tag = self._tag(record.tag_id)
        self._pin(tag, record.pin)
        tag.species, tag.confidence = record.species, record.confidence
        tag.anomaly, tag.blooms = record.anomaly, record.blooms
        if not tag.footprint_from_channel:
            tag.footprint = record.footprint
        self._observed(tag, time)

    def _observed(self, tag: TwinTag, time: float) -> None:
        # After an outage the newest need not come last: each publisher has a backlog of its own.
        tag.last_observed = time if tag.last_observed is None else max(tag.last_observed, time)
        self.observation_count += 1

    def _pin(self, tag: TwinTag, pin: Pin | None) -> None:
        if tag.pin is None and pin is not None:
            tag.pin = pin
            self.pins += 1

    def _tag(self, tag_id: str) -> TwinTag:
        if tag_id not in self._tags:
            self._tags[tag_id] = TwinTag(tag_id, deque(maxlen=self._history))
        return self._tags[tag_id]

    def advance_time(self, now: float) -> None:
        """Set the time, in seconds; 0 while the clock has not begun.

        If it has gone back, the clock was set, and no observation counts as later than now: else the tags of
        a restarted simulation would stay fresh for as long as the last one took.
        """
        if 0.0 < now < self._time:
            for tag in self._tags.values():
                tag.last_observed = None if tag.last_observed is None else min(tag.last_observed, now)
            self.revision += 1
        self._time = now or self._time

    def forget_time(self) -> None:
        """Accept any next time, without a comparison to earlier ones."""
        self._time = 0.0

    def samples(self, sensor: str) -> tuple[Floats, Floats]:
        """Return positions (n rows of x, y) and the latest values of the tags that have both."""
        found = [
            (tag.pin.x, tag.pin.y, value)
            for tag in self._tags.values()
            if tag.pin is not None and abs(value := tag.readings.get(sensor, math.nan)) <= LARGEST
        ]
        table = np.array(found, dtype=np.float64).reshape(-1, 3)
        return table[:, :2], table[:, 2]
