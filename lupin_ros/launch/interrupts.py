"""Counts SIGINT, SIGTERM and SIGHUP for polling, so that they interrupt no action half-way."""

from __future__ import annotations

import signal
import types
from typing import Any

_HANDLED = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class Interrupted(Exception):
    """The user wants to stop; raised by waits only."""


class Interrupts:
    """Counts SIGINT, SIGTERM and SIGHUP while active (the terminal was closed, the service is stopped).

    Where SIGHUP is ignored it stays so: a program started with `nohup` is to go on.
    """

    def __init__(self) -> None:
        self.count = 0
        #: Whether the first signal was Ctrl-C: somebody is there, and there is time to come home.
        self.at_leisure = False
        self._before: dict[signal.Signals, Any] = {}

    def check(self) -> None:
        """Raise `Interrupted` when there was a signal."""
        if self.count:
            raise Interrupted

    @property
    def insisted(self) -> bool:
        """Whether there was a second signal: stop now, with force."""
        return self.count > 1

    @property
    def insisted_twice(self) -> bool:
        """Whether there was a third signal: wait for nothing any more."""
        return self.count > 2

    def stop(self) -> None:
        """Count an interrupt by the program itself, as by SIGTERM."""
        self.count += 1

    def __enter__(self) -> Interrupts:
        ignored = signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
        numbers = [number for number in _HANDLED if number != signal.SIGHUP or not ignored]
        self._before = {number: signal.signal(number, self._count) for number in numbers}
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def _count(self, number: int, frame: types.FrameType | None) -> None:
        self.count += 1
        self.at_leisure = self.at_leisure or (self.count == 1 and number == signal.SIGINT)
