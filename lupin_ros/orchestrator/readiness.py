"""The driver of `plugins`: `plugins.ready` is done when no other driver misses a server, and the live value
`plugins.missing` names the missing ones.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any, Protocol

from lupin_engine.plugin import MISSING, Driver, Outlet
from lupin_ros.adapter.host import TimerHandle

#: How often the drivers are asked, in seconds.
POLL_PERIOD_S = 0.2
#: How often in a row something must be missing before it is reported: lapses of discovery are shorter.
POLLS_UNTIL_GONE = 10


class InUse(Protocol):
    """Whose servers are waited for."""

    def in_use(self) -> Iterable[Driver]:
        """Return the drivers of the plugins that the missions use."""


class PollHost(Protocol):
    """What is used of the node."""

    def steady_timer(self, period: float, callback: Callable[[], None]) -> TimerHandle:
        """Call `callback` every `period` seconds."""

    def now(self) -> float:
        """Return the node's time."""


class Readiness:
    """Polls the other drivers every `POLL_PERIOD_S`, also after the start: a server can go at any time.

    A missing server is in `plugins.missing` after `POLLS_UNTIL_GONE` polls in a row, a found one at once.
    """

    def __init__(self, clients: InUse, outlet: Outlet, ros: PollHost, is_resumed: bool = False) -> None:
        """Begin to poll.

        Where the machine `is_resumed`, its memory has the value of the last process: the first poll reports
        it in any case.
        """
        self._clients = clients
        self._outlet = outlet
        self._ros = ros
        self._attempt = ""
        self._progress = ""
        self._polls = 0  # in a row that found something missing
        self._reported: list[str] | None = None if is_resumed else []  # the last report
        self._timer = ros.steady_timer(POLL_PERIOD_S, self._poll)

    def missing(self) -> list[str]:
        """Return the names of the servers that other plugins wait for."""
        return sorted(name for driver in self._clients.in_use() for name in driver.missing())

    def start(self, attempt: str, operation: str, arguments: Mapping[str, Any]) -> None:
        """Begin to wait."""
        self._attempt, self._progress = attempt, ""
        self._outlet.accepted(attempt)

    def cancel(self, attempt: str) -> None:
        """Stop waiting."""
        if attempt == self._attempt:
            self._attempt = ""
            self._outlet.cancelled(attempt)

    def act(self, action: str, arguments: Mapping[str, Any]) -> None:
        """There are no actions."""

    def close(self) -> None:
        """Ask no more; nothing is reported."""
        self._timer.cancel()

    def _poll(self) -> None:
        missing = self.missing()
        self._polls = self._polls + 1 if missing else 0
        # An empty list is reported before `plugins.ready` is done: a chart that reads both would wait again.
        if missing != self._reported and (not missing or self._polls >= POLLS_UNTIL_GONE):
            self._reported = missing
            self._outlet.value(MISSING, missing, self._ros.now())
        if self._attempt:
            self._answer(", ".join(missing))

    def _answer(self, missing: str) -> None:
        """Report the progress or the end of the waiting attempt."""
        if not missing:
            attempt, self._attempt = self._attempt, ""
            self._outlet.done(attempt, {})
        elif missing != self._progress:
            self._progress = missing
            self._outlet.progress(self._attempt, missing)
