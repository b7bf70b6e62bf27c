"""Timers that run only while there is something to look at, so that a node at rest costs nothing."""

from __future__ import annotations

from collections.abc import Callable

from lupin_engine.ros.adapter.host import Timer

#: Starts a repeating timer: `RosNode.timer` or `RosNode.steady_timer`.
Every = Callable[[float, Callable[[], None]], Timer]


class Repeater:
    """A timer that can be started and stopped, both again and again; for the node's own thread."""

    def __init__(self, every: Every, period: float, callback: Callable[[], None]) -> None:
        """Call `callback` every `period` seconds of the clock of `every`, once this is started."""
        self._every = every
        self._period = period
        self._callback = callback
        self._timer: Timer | None = None

    @property
    def running(self) -> bool:
        """Whether it calls."""
        return self._timer is not None

    def start(self) -> None:
        """Begin to call, the first time after a period; one that runs goes on as it does."""
        if self._timer is None:
            self._timer = self._every(self._period, self._callback)

    def stop(self) -> None:
        """Call no more; stopping twice does no harm."""
        timer, self._timer = self._timer, None
        if timer is not None:
            timer.cancel()
