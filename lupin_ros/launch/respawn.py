"""Decides when processes that have died are restarted, with a growing delay and a limit.

Pure: time is an argument, in seconds of a steady clock.
"""

from __future__ import annotations

from collections.abc import Container
from dataclasses import dataclass

#: A node that has died is started again after so many seconds: the first time, the second, ...; then no more.
RESPAWN_AFTER_S = (1.0, 4.0, 10.0)
#: One that has lived as long as this since its last start begins with the first time again, in seconds.
FORGIVEN_AFTER_S = 600.0
#: One that has lived as long as this is back, in seconds; the network remembers a dead one for less.
BACK_AFTER_S = 5.0


@dataclass
class _Gone:
    """A process that has died: the wall clock's time of that, and the times of its restart.

    `due` is when it is to be restarted (None: not, or done), `started` when it was (None: not yet).
    """

    since: str
    due: float | None
    started: float | None = None


class Respawns:
    """The processes that have died, by name."""

    def __init__(self, respawn: bool = True) -> None:
        """`respawn` is whether any is started again."""
        self._respawn = respawn
        self._tries: dict[str, int] = {}
        self._started: dict[str, float] = {}
        self._gone: dict[str, _Gone] = {}

    def died(self, name: str, now: float, clock: str) -> str:
        """Record a death at the wall clock's time `clock`; return a sentence about the restart.

        The sentence says when it comes, or that there is none: after the last of `RESPAWN_AFTER_S`, or
        without `respawn`.
        """
        if now - self._started.get(name, now) >= FORGIVEN_AFTER_S:
            self._tries.pop(name, None)
        tries = self._tries.get(name, 0)
        since = self._gone[name].since if name in self._gone else clock
        if not self._respawn:
            self._gone[name] = _Gone(since, None)
            return f"{name} is gone since {since}; something else is to start it again (--no-respawn)"
        if tries >= len(RESPAWN_AFTER_S):
            self._gone[name] = _Gone(since, None)
            return f"{name} is gone since {since}, and is not started again: it has died {tries + 1} times"
        delay = RESPAWN_AFTER_S[tries]
        self._tries[name] = tries + 1
        self._gone[name] = _Gone(since, now + delay)
        return f"{name} is started again in {delay:g} s ({tries + 1} of {len(RESPAWN_AFTER_S)})"

    def comes_back(self, name: str) -> bool:
        """Return whether a dead process is still to be restarted; False for an unknown or a restarted one."""
        return name in self._gone and self._gone[name].due is not None

    def due(self, now: float) -> list[str]:
        """Return the names of those to be started now; each once."""
        found = [name for name, gone in self._gone.items() if gone.due is not None and gone.due <= now]
        for name in found:
            self._gone[name].due, self._gone[name].started = None, now
            self._started[name] = now
        return found

    def back(self, running: Container[str], now: float) -> list[str]:
        """Return a sentence, once, for each process that is back: restarted, and alive for `BACK_AFTER_S`."""
        found = [
            name
            for name, gone in self._gone.items()
            if gone.started is not None and now - gone.started >= BACK_AFTER_S and name in running
        ]
        texts = [f"{name} is back; it was gone since {self._gone[name].since}" for name in found]
        for name in found:
            del self._gone[name]
        return texts
