"""Between the loop and the node: the clock that the loop goes by, and where the clients of plugins report."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Any

from lupin_engine.runtime import Engine, EngineOutlet
from lupin_ros.adapter.node import RosNode


class NodeClock:
    """The loop's clock: the one of the node's timers, which neither steps nor goes back."""

    def __init__(self, ros: RosNode) -> None:
        self._ros = ros

    def now(self) -> float:
        """Return seconds of an origin of its own, to the microsecond: that is written into every record."""
        return round(self._ros.elapsed(), 6)

    def wall(self) -> float | None:
        """Return the robot's clock in POSIX time; with `use_sim_time` simulated time, once it is heard of."""
        return self._ros.now() or None

    def from_ros(self, stamp: float) -> float:
        """Return seconds of the node's clock as a moment of this clock."""
        return round(self.now() - (self._ros.now() - stamp), 6)


class RosOutlet(EngineOutlet):
    """Where the clients report; a value's stamp is turned into the loop's time."""

    def __init__(self, engine: Engine, clock: NodeClock, wake: Callable[[], None]) -> None:
        super().__init__(engine, wake)
        self._clock = clock
        self._last: dict[str, tuple[float, float, Any]] = {}

    def value(self, name: str, value: Any, stamp: float) -> None:
        """A live value changed; `stamp` is of the node's clock."""
        # What is told again keeps its moment: reading two clocks a second time would give another one.
        # What is later stays later, too: who waits between the two reads would have it dropped as older.
        told, at_least, _ = self._last.get(name, (-math.inf, -math.inf, None))
        at = at_least if stamp == told else self._clock.from_ros(stamp)
        if stamp > told:
            at = max(at, at_least)
        self._last[name] = stamp, at, value
        super().value(name, value, at)

    def was_told(self, name: str) -> bool:
        """Say whether a live value was reported to this process."""
        return name in self._last

    def tell_again(self, names: Iterable[str]) -> None:
        """Tell what was reported last of these live values: some topics speak only once."""
        for name in self._last.keys() & set(names):
            _, at, value = self._last[name]
            super().value(name, value, at)
