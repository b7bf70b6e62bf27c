"""Rate limit of refused requests: beyond 64 KiB in 10 s of one name and code they are counted, not recorded.

A refused request changes nothing but the number of the step. So one that a dry run refuses need not reach the
machine, and the journal of a flood stays small.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from lupin_engine.machine.event import Event
from lupin_engine.plugin.profile import ANSWER
from lupin_engine.runtime.journal.records import EVENT, encoded

#: Within so many seconds so many bytes of requests that are alike are written.
WINDOW_S, WINDOW_BYTES = 10.0, 65_536


@dataclass(slots=True)
class _Alike:
    """Requests of one name that were refused with one code since a moment: bytes written, how many more."""

    since: float
    written: int = 0
    more: int = 0


class RefusalLog(Protocol):
    """Records the numbers; the journal's writer is one."""

    def refused(self, request: str, code: str, more: int) -> None:
        """Record how many more requests of a name were refused with a code."""


class Refusals:
    """Counts requests that are not recorded, and records their numbers."""

    def __init__(self, log: RefusalLog) -> None:
        self._log = log
        self._alike: dict[tuple[str, str], _Alike] = {}

    def is_one_more(self, request: Event, code: str, now: float) -> bool:
        """Count a request that will be refused; say whether it is over the limit, and not to be recorded."""
        key = ANSWER if request.name.startswith(ANSWER) else request.name, code
        alike = self._alike.get(key)
        if alike is not None and now - alike.since >= WINDOW_S:
            self._end(key)
            alike = None
        if alike is None:
            alike = self._alike[key] = _Alike(now)
        size = len(encoded(EVENT, request.name, request.data))
        if alike.written + size > WINDOW_BYTES:
            alike.more += 1
            return True
        alike.written += size
        return False

    def report_due(self, now: float) -> None:
        """Report the counts of windows that have passed; to be called periodically."""
        for key, alike in list(self._alike.items()):
            if now - alike.since >= WINDOW_S:
                self._end(key)

    def report_all(self) -> None:
        """Report all counts, and reset."""
        for key in list(self._alike):
            self._end(key)

    def _end(self, key: tuple[str, str]) -> None:
        more = self._alike.pop(key).more
        if more:
            self._log.refused(*key, more)
