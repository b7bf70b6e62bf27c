"""Many small things of one step, done a few at a time: a thousand targets that are closed at once."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

#: How many are done in one turn of the node's thread; messages and timers have theirs in between.
SLICE = 25


class Slices:
    """Does what is added, in that order: the first ones at once, the rest in the turns that follow."""

    def __init__(self, post: Callable[[Callable[[], None]], None]) -> None:
        """`post` has something done in the next turn of the thread."""
        self._post = post
        self._waiting: deque[Callable[[], None]] = deque()
        self._room = SLICE
        self._posted = False

    def add(self, act: Callable[[], None]) -> None:
        """Do something, now or soon."""
        self._waiting.append(act)
        if not self._posted:
            self._posted = True
            self._post(self._next_turn)
        self._go_on()

    def finish(self) -> None:
        """Do all that waits: there will be no other turn."""
        while self._waiting:
            self._waiting.popleft()()

    def _next_turn(self) -> None:
        self._room, self._posted = SLICE, False
        self._go_on()
        if self._waiting:
            self._posted = True
            self._post(self._next_turn)

    def _go_on(self) -> None:
        while self._waiting and self._room:
            self._room -= 1
            self._waiting.popleft()()
