"""The interface of a node to the adapter's parts, timers that can be restarted, and long work in slices."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from typing import Any, Protocol

from lupin_ros.adapter.frames import FramePrefix


class TimerHandle(Protocol):
    """A running timer."""

    def cancel(self) -> None:
        """End it; cancelling twice does no harm."""


class Poster(Protocol):
    """A node's thread."""

    def post(self, callback: Callable[[], object]) -> None:
        """Run `callback` on the node's thread."""


class Host(Poster, Protocol):
    """The methods of `RosNode` that the adapter's parts use."""

    node: Any
    log: Any
    frames: FramePrefix

    def guarded(self, callback: Callable[..., Any]) -> Callable[..., Any]:
        """Return `callback` with its exceptions logged."""

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


#: How many calls are made in one turn of the node's thread; messages and timers are handled between turns.
SLICE = 25


class Slices:
    """Makes many short calls in order, such as publishing a thousand outcomes, without blocking the thread.

    Up to `SLICE` are made at once, the rest in the following turns. What a call raises passes on to whoever
    makes it; that call is not repeated, and those behind it follow in the next turn.
    """

    def __init__(self, host: Poster) -> None:
        """`host` makes a call in the next turn of its thread."""
        self._host = host
        self._waiting: deque[Iterator[Callable[[], None]]] = deque()
        self._room = SLICE
        self._posted = False

    def add(self, act: Callable[[], None]) -> None:
        """Make a call, now or in a later turn; raises what a call raises that is made now."""
        self.add_each((act,))

    def add_each(self, acts: Iterable[Callable[[], None]]) -> None:
        """Make calls; the iterable is advanced when the turn of each comes."""
        self._waiting.append(iter(acts))
        if not self._posted:
            self._posted = True
            self._host.post(self._next_turn)
        self._go_on()

    @property
    def is_done(self) -> bool:
        """Whether no call waits."""
        return not self._waiting

    def finish(self) -> None:
        """Make all waiting calls now: there will be no other turn. Raises what the first of them raises."""
        first: Exception | None = None
        while (act := self._take()) is not None:
            try:
                act()
            except Exception as problem:
                first = first or problem
        if first is not None:
            raise first

    def _next_turn(self) -> None:
        self._room, self._posted = SLICE, False
        try:
            self._go_on()
        finally:  # a call that raises is not repeated; the rest follows
            if self._waiting:
                self._posted = True
                self._host.post(self._next_turn)

    def _go_on(self) -> None:
        while self._room and (act := self._take()) is not None:
            self._room -= 1
            act()

    def _take(self) -> Callable[[], None] | None:
        """Return the next act that waits; None without one."""
        while self._waiting:
            act = next(self._waiting[0], None)
            if act is not None:
                return act
            self._waiting.popleft()
        return None
