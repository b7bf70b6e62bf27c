"""The operation `plugins.ready`: done when every driver of the mission's plugins misses nothing."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from lupin_engine.middleware.host import Timer
from lupin_engine.plugin.contract import Driver, Outlet

#: How often the drivers are asked while BOOT waits, in seconds.
POLL_PERIOD = 0.2


class Readiness:
    """A driver that asks the other drivers. It polls only while somebody waits."""

    def __init__(
        self,
        drivers: Mapping[str, Driver],
        outlet: Outlet,
        every: Callable[[float, Callable[[], None]], Timer],
    ) -> None:
        """`every(period, callback)` starts a repeating timer."""
        self._drivers = drivers
        self._outlet = outlet
        self._every = every
        self._timer: Timer | None = None
        self._attempt = ""
        self._told = ""

    def missing(self) -> list[str]:
        """Name what the other plugins wait for."""
        others = [driver for driver in self._drivers.values() if driver is not self]
        return sorted(name for driver in others for name in driver.missing())

    def start(self, attempt: str, operation: str, arguments: Mapping[str, Any]) -> None:
        """Begin to wait."""
        self._attempt, self._told = attempt, ""
        self._outlet.accepted(attempt)
        self._timer = self._every(POLL_PERIOD, self._poll)

    def _poll(self) -> None:
        missing = ", ".join(self.missing())
        if not missing:
            self._stop()
            self._outlet.done(self._attempt, {})
        elif missing != self._told:
            self._told = missing
            self._outlet.progress(self._attempt, missing)

    def _stop(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def cancel(self, attempt: str) -> None:
        """Stop waiting."""
        if attempt == self._attempt and self._timer is not None:
            self._stop()
            self._outlet.cancelled(attempt)

    def act(self, action: str, arguments: Mapping[str, Any]) -> None:
        """There are no actions."""

    def close(self) -> None:
        """Stop waiting; nothing is reported."""
        self._stop()
