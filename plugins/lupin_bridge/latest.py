"""A thread-safe table of each sensor's latest value; a network's thread writes it, the node's reads it."""

from __future__ import annotations

import threading
from dataclasses import dataclass

from lupin_bridge.backend import Clocks, Measurement
from lupin_bridge.topics import SensorSample
from lupin_bridge.units import unit_of

#: Without a layout any name may be a tag; more than this many are a mistake or an attack.
MAX_TAGS, MAX_SENSORS = 1000, 32


@dataclass(frozen=True)
class _Kept:
    """A value, its stamp by the wall clock, and its age at a moment of the steady clock."""

    value: float
    stamp: float
    age: float
    arrived: float


class Latest:
    """The latest values by tag and sensor.

    Ages advance with the steady clock, so setting the wall clock changes none. A stamp in the future, of a
    sensor whose clock is ahead, counts as now.
    """

    def __init__(self, clocks: Clocks) -> None:
        self._clocks = clocks
        self._lock = threading.Lock()
        self._tags: dict[str, dict[str, _Kept]] = {}

    def put(self, tag: str, sample: SensorSample) -> bool:
        """Store a value unless a later one is there; return False where a limit is reached."""
        now = self._clocks.wall()
        stamp = now if sample.stamp is None else min(sample.stamp, now)
        kept = _Kept(sample.value, stamp, now - stamp, self._clocks.steady())
        with self._lock:
            if tag not in self._tags and len(self._tags) >= MAX_TAGS:
                return False
            own = self._tags.setdefault(tag, {})
            before = own.get(sample.sensor)
            if before is None and len(own) >= MAX_SENSORS:
                return False
            if before is None or self._age(before) >= kept.age:
                own[sample.sensor] = kept
            return True

    def tags(self) -> tuple[str, ...]:
        """The tags with any value."""
        with self._lock:
            return tuple(self._tags)

    def of(self, tag: str) -> dict[str, Measurement]:
        """Return the latest values of a tag, by sensor."""
        with self._lock:
            own = dict(self._tags.get(tag, {}))
        return {
            sensor: Measurement(sensor, kept.value, unit_of(sensor), kept.stamp, self._age(kept))
            for sensor, kept in own.items()
        }

    def _age(self, kept: _Kept) -> float:
        return kept.age + self._clocks.steady() - kept.arrived
