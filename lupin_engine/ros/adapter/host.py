"""What the parts of the adapter need of their node, and timers that run only while they are needed."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol


class TimerHandle(Protocol):
    """A running timer."""

    def cancel(self) -> None:
        """End it; cancelling twice does no harm."""


class Host(Protocol):
    """The node's side of an action or of a comparison with peers; see `ros.adapter.RosNode`."""

    node: Any
    log: Any

    def guarded(self, callback: Callable[..., Any]) -> Callable[..., Any]:
        """Return `callback` with its exceptions logged."""

    def post(self, callback: Callable[[], object]) -> None:
        """Run `callback` on the node's thread."""

    def steady_timer(self, period: float, callback: Callable[[], None]) -> TimerHandle:
        """Call `callback` every `period` seconds of real time."""

    def channels(self) -> list[str]:
        """Return the DDS topics that the node uses."""


#: Starts a repeating timer: `RosNode.timer` or `RosNode.steady_timer`.
Every = Callable[[float, Callable[[], None]], TimerHandle]


class Repeater:
    """A timer that can be started and stopped again and again; for the node's own thread.

    A node at rest runs none, so that it costs nothing.
    """

    def __init__(self, every: Every, period: float, callback: Callable[[], None]) -> None:
        """`callback` is called every `period` seconds of the clock of `every`, after `start`."""
        self._every = every
        self._period = period
        self._callback = callback
        self._timer: TimerHandle | None = None

    @property
    def running(self) -> bool:
        """Whether the timer runs."""
        return self._timer is not None

    def start(self) -> None:
        """Start the timer; one that runs is not restarted."""
        if self._timer is None:
            self._timer = self._every(self._period, self._callback)

    def stop(self) -> None:
        """Stop the timer; stopping twice does no harm."""
        timer, self._timer = self._timer, None
        if timer is not None:
            timer.cancel()
