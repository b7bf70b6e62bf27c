"""Adapts the node to the engine's loop: its steady clock, and the outlet that plugins' clients report to."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any, Protocol

from lupin_engine.runtime import EngineOutlet, Inbox
from lupin_ros.adapter.node import RosNode


class NodeClock:
    """The loop's clock: the steady one of the node's timers, which neither steps nor goes back."""

    def __init__(self, ros: RosNode) -> None:
        self._ros = ros

    def now(self) -> float:
        """Return seconds since an arbitrary origin, rounded to microseconds: every record has them."""
        return round(self._ros.elapsed(), 6)

    def wall(self) -> float | None:
        """Return the node's wall clock in POSIX time; None with `use_sim_time` before the first `/clock`."""
        return self._ros.now() or None

    def from_ros(self, stamp: float) -> float:
        """Convert a stamp of the node's wall clock into this clock."""
        return round(self.now() - (self._ros.now() - stamp), 6)


class Worker(Inbox, Protocol):
    """The loop, for those who report to it."""

    def work(self) -> None:
        """Step what is queued."""


class RosOutlet(EngineOutlet):
    """Queues reports of the clients; converts a value's stamp into the loop's clock, in the same order."""

    def __init__(self, loop: Worker, clock: NodeClock) -> None:
        super().__init__(loop, loop.work)
        self._clock = clock
        self._last: dict[str, tuple[float, float, Any]] = {}

    def value(self, name: str, value: Any, stamp: float) -> None:
        """Report a live value; `stamp` is of the node's wall clock."""
        # A repeated stamp keeps its conversion: reading two clocks a second time would give another one.
        # A later stamp stays later, too: a delay between the two reads would have the value dropped as older.
        last_stamp, at_least, _ = self._last.get(name, (-math.inf, -math.inf, None))
        at = at_least if stamp == last_stamp else self._clock.from_ros(stamp)
        if stamp > last_stamp:
            at = max(at, at_least)
        self._last[name] = stamp, at, value
        super().value(name, value, at)

    def was_reported(self, name: str) -> bool:
        """Return whether a live value was reported to this process."""
        return name in self._last

    def report_again(self, names: Iterable[str]) -> None:
        """Report the last value of each of these again: a latched topic sends it only once."""
        for name in self._last.keys() & set(names):
            _, at, value = self._last[name]
            super().value(name, value, at)
