"""Arbitrates the software stops of all pages: their OR is the gateway's stop, and a stop outlives its page.

A lost operator link may engage one too (`OnLinkLost`). Pure: connections are numbers, and times are in
seconds of a steady clock.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal, TypedDict

#: How often ROS hears the stop beside each change, in Hz.
PUBLISH_HZ = 5.0
#: A page that is loaded anew is away for less than this, in seconds: the link is not lost by that.
LINK_GRACE_S = 2.0
#: Pages try to reach a gateway that starts again at least so often, in seconds.
BACK_WITHIN_S = 10.0
#: What the stop is called that `on_link_lost: stop` engages.
LINK = "link"


class OnLinkLost(enum.Enum):
    """The reaction to the loss of the last operator's connection."""

    CONTINUE = "continue"
    PAUSE = "pause"
    STOP = "stop"


@dataclass
class _StopOfPage:
    """A connected page. `overruled`: an operator has reset its stop, which the page still repeats."""

    name: str
    browser: str
    is_operator: bool
    stopped_at: float | None = None
    overruled: bool = False
    has_reported: bool = False


@dataclass(frozen=True)
class LeftStop:
    """A stop whose page is gone: the connection's name, its browser ('': unknown), and since when."""

    name: str
    browser: str
    since: float


@dataclass(frozen=True)
class KeptStops:
    """The saved state: engaged stops with their browsers, and whether an operator was connected."""

    stops: tuple[tuple[str, str], ...] = ()
    operator: bool = False


class StopRecord(TypedDict):
    """A stop that is engaged for `age` seconds; `left`: its page is gone."""

    name: str
    left: bool
    age: float


class StopsRecord(TypedDict):
    """The engaged stops of pages, and the operators' link: `lost` once the reaction to it was decided."""

    stopped: bool
    stops: list[StopRecord]
    operators: int
    link: Annotated[str, Literal["up", "lost", "none"]]
    on_link_lost: Annotated[str, OnLinkLost]


class StopArbiter:
    """Keeps the stop of each page, connected or gone; the robot is stopped while any of them is engaged.

    Every user may stop the robot: viewers too, unless `viewers_stop` is false. Only an
    operator may release: a viewer's `false` is refused, and an operator resets that stop by its name, as one
    whose page is gone.
    """

    def __init__(self, on_link_lost: OnLinkLost = OnLinkLost.CONTINUE, viewers_stop: bool = True) -> None:
        self._on_link_lost = on_link_lost
        self._viewers_stop = viewers_stop
        self._pages: dict[int, _StopOfPage] = {}
        self._left: dict[str, LeftStop] = {}
        #: When the last operator's page went; None while there is one, or before there was one.
        self._lost_at: float | None = None
        self._is_decided = False

    @property
    def stopped(self) -> bool:
        """Whether any stop is engaged."""
        return bool(self._left) or any(page.stopped_at is not None for page in self._pages.values())

    # -- what pages do ----------------------------------------------------------------------------------

    def joined(self, page: int, name: str, *, operator: bool, browser: str = "") -> None:
        """Add a page. `name` is unique to this connection; `browser` identifies a reloaded page."""
        self._pages[page] = _StopOfPage(name, browser, operator)
        if operator:
            self._lost_at, self._is_decided = None, False

    def report(self, page: int, stopped: bool, now: float) -> str:
        """Take a page's report whether its stop is engaged; return why it is refused, '' where it is not."""
        one = self._pages[page]
        first, one.has_reported = not one.has_reported, True
        if not one.is_operator and not self._viewers_stop:
            return "the stop is for operators here (viewers_stop is off)" if stopped else ""
        if not stopped:
            one.overruled = False
            if one.stopped_at is None or one.is_operator:
                one.stopped_at = None
                return ""
            return f"only an operator releases a stop: reset the stop {one.name!r}"
        if one.overruled:
            return "an operator has reset this stop: release it on this page before it stops again"
        if one.stopped_at is None:
            one.stopped_at = now
            if first:
                self._take_over(one)
        return ""

    def _take_over(self, page: _StopOfPage) -> None:
        """Give a page that reconnects stopped the last stop that its browser has left: it was reloaded."""
        own = [left for left in self._left.values() if left.browser and left.browser == page.browser]
        if own:
            newest = max(own, key=lambda left: left.since)
            page.stopped_at = newest.since
            del self._left[newest.name]

    def gone(self, page: int, now: float) -> None:
        """Remove a page; its stop stays engaged."""
        one = self._pages.pop(page, None)
        if one is None:
            return
        if one.stopped_at is not None:
            self._leave(one.name, one.browser, one.stopped_at)
        if one.is_operator and not self._operators():
            self._lost_at, self._is_decided = now, False

    def reset(self, name: str) -> str:
        """Release a stop by name, for an operator; return why it is not, '' where it is.

        The stop of a connected operator is released on that page only.
        """
        if self._left.pop(name, None) is not None:
            return ""
        engaged = {one.name: one for one in self._pages.values() if one.stopped_at is not None}
        page = engaged.get(name)
        if page is None:
            names = ", ".join(sorted({*self._left, *engaged}))
            return f"no stop is called {name!r}; " + (f"engaged are: {names}" if names else "none is engaged")
        if page.is_operator:
            return f"{name} is connected, and releases its stop itself"
        page.stopped_at, page.overruled = None, True
        return ""

    # -- the link ---------------------------------------------------------------------------------------

    def _operators(self) -> int:
        return sum(one.is_operator for one in self._pages.values())

    def link_lost(self, now: float) -> OnLinkLost | None:
        """Return the reaction to a lost operator link, once for each loss, after `LINK_GRACE_S`; else None.

        With `OnLinkLost.STOP` this call also engages the stop named `LINK`.
        """
        if self._lost_at is None or self._is_decided or now < self._lost_at + LINK_GRACE_S:
            return None
        self._is_decided = True
        if self._on_link_lost is OnLinkLost.STOP:
            self._leave(LINK, "", now)
        return self._on_link_lost

    @property
    def link_is_lost(self) -> bool:
        """Whether the link is lost and the reaction to it was returned."""
        return self._is_decided and not self._operators()

    # -- what is shown and kept -------------------------------------------------------------------------

    def state(self, now: float) -> StopsRecord:
        """Return the state for pages: engaged stops with their ages in seconds, and the link."""
        pages = [(p.name, p.stopped_at, False) for p in self._pages.values() if p.stopped_at is not None]
        left = [(one.name, one.since, True) for one in self._left.values()]
        return {
            "stopped": self.stopped,
            "stops": [
                {"name": name, "left": is_left, "age": round(now - since, 1)}
                for name, since, is_left in sorted([*pages, *left], key=lambda stop: stop[1])
            ],
            "operators": self._operators(),
            "link": "up" if self._operators() else "lost" if self.link_is_lost else "none",
            "on_link_lost": self._on_link_lost.value,
        }

    def kept(self) -> KeptStops:
        """Return the state to save for the next gateway."""
        pages = [(one.name, one.browser) for one in self._pages.values() if one.stopped_at is not None]
        stops = sorted([*((left.name, left.browser) for left in self._left.values()), *pages])
        return KeptStops(tuple(stops), bool(self._operators()))

    def restore(self, kept: KeptStops, now: float) -> None:
        """Engage the stops of an earlier gateway: its pages are gone, and none has released its stop.

        If an operator was connected then, the link is lost unless one is back within `BACK_WITHIN_S`.
        """
        for name, browser in kept.stops:
            self._leave(name, browser, now)
        if kept.operator:
            self._lost_at = now + BACK_WITHIN_S - LINK_GRACE_S

    def _leave(self, name: str, browser: str, since: float) -> None:
        """Keep a stop whose page is gone, under a unique name, so that a reset releases this one alone."""
        while name in self._left:
            name += "'"
        self._left[name] = LeftStop(name, browser, since)


def stop_of(message: Any) -> bool:
    """Return whether a published std_msgs/Bool engages the stop; anything but a clear false does."""
    data = message.get("data", True) if isinstance(message, Mapping) else True
    if isinstance(data, (int, float)) and not math.isnan(data):
        return bool(data)
    return True
