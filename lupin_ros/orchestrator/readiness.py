"""What `plugins` tells of the others: `plugins.ready` is done when their drivers miss nothing, and
`plugins.missing` names what they miss.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

from lupin_engine.plugin import MISSING, Driver, Outlet
from lupin_ros.adapter.host import TimerHandle

#: How often the drivers are asked, in seconds.
POLL_PERIOD_S = 0.2
#: How often in a row something must be missing until that is told: discovery that stumbles is back sooner.
POLLS_UNTIL_GONE = 10


class Readiness:
    """A driver that asks the other drivers, all the time: a server can go at any time."""

    def __init__(
        self,
        drivers: Callable[[], Iterable[Driver]],
        outlet: Outlet,
        every: Callable[[float, Callable[[], None]], TimerHandle],
        now: Callable[[], float],
        goes_on: bool = False,
    ) -> None:
        """Ask the `drivers` of the plugins that the missions use.

        `every(period, callback)` starts a repeating timer, `now` returns the node's time.

        Who `goes_on` with another process's memory knows what that one was told, which need not be so any
        more: then it is told what is so, also when nothing is missing.
        """
        self._drivers = drivers
        self._outlet = outlet
        self._now = now
        self._attempt = ""
        self._progress = ""
        self._polls = 0  # in a row that found something missing
        self._gone: list[str] | None = None if goes_on else []  # as it was told last
        self._timer = every(POLL_PERIOD_S, self._poll)

    def missing(self) -> list[str]:
        """Name what the other plugins wait for."""
        return sorted(name for driver in self._drivers() for name in driver.missing())

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
        # That all is there is told before a wait for it ends, or a chart that looks at both would wait again.
        if missing != self._gone and (not missing or self._polls >= POLLS_UNTIL_GONE):
            self._gone = missing
            self._outlet.value(MISSING, missing, self._now())
        if self._attempt:
            self._answer(", ".join(missing))

    def _answer(self, missing: str) -> None:
        """Tell who waits how far it is."""
        if not missing:
            attempt, self._attempt = self._attempt, ""
            self._outlet.done(attempt, {})
        elif missing != self._progress:
            self._progress = missing
            self._outlet.progress(self._attempt, missing)
