"""The latest value of each sensor and how old it is; written by a network's thread, read by the node's."""

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
    """A value, when it was measured by the wall clock, and how old it was at a moment of the steady one."""

    value: float
    stamp: float
    age: float
    arrived: float


class Latest:
    """Values by tag and sensor.

    The age of a value goes on with the steady clock, so that a wall clock that is set makes nothing older or
    younger. A stamp of the future, of a sensor whose clock is ahead, counts as now.
    """

    def __init__(self, clocks: Clocks) -> None:
        self._clocks = clocks
        self._lock = threading.Lock()
        self._tags: dict[str, dict[str, _Kept]] = {}

    def put(self, tag: str, sample: SensorSample) -> bool:
        """Keep a value unless a later one is there; False when there is no room for another tag or sensor."""
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
        """The tags of which there was any value."""
        with self._lock:
            return tuple(self._tags)

    def of(self, tag: str) -> dict[str, Measurement]:
        """Return what there is of a tag, by sensor."""
        with self._lock:
            own = dict(self._tags.get(tag, {}))
        return {
            sensor: Measurement(sensor, kept.value, unit_of(sensor), kept.stamp, self._age(kept))
            for sensor, kept in own.items()
        }

    def _age(self, kept: _Kept) -> float:
        return kept.age + self._clocks.steady() - kept.arrived
