"""The software stop of all pages: each page's own, their OR, what pages left behind, and a link that is lost.

Pure: connections are numbers, and time is an argument, in seconds of a clock that never goes back.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal, TypedDict

#: How often ROS hears the stop beside each change, in Hz.
TELL_HZ = 5.0
#: A page that is loaded anew is away for less than this, in seconds: the link is not lost by that.
LINK_GRACE_S = 2.0
#: Pages try to reach a gateway that starts again at least so often, in seconds.
BACK_WITHIN_S = 10.0
#: What the stop is called that `on_link_lost: stop` engages.
LINK = "link"


class OnLinkLost(enum.Enum):
    """What happens when the last operator's connection is gone."""

    CONTINUE = "continue"
    PAUSE = "pause"
    STOP = "stop"


@dataclass
class _StopOfPage:
    """A page that is connected. `overruled`: an operator has reset its stop, and it repeats it."""

    name: str
    browser: str
    is_operator: bool
    stopped_at: float | None = None
    overruled: bool = False
    has_told: bool = False


@dataclass(frozen=True)
class LeftStop:
    """A stop whose page is gone: the name of its connection, its browser ('': unknown), and since when."""

    name: str
    browser: str
    since: float


@dataclass(frozen=True)
class KeptStops:
    """What outlives a gateway: names of stops with their browsers, and whether an operator was connected."""

    stops: tuple[tuple[str, str], ...] = ()
    operator: bool = False


class StopRecord(TypedDict):
    """A stop that is engaged for `age` seconds; `left`: its page is gone."""

    name: str
    left: bool
    age: float


class StopsRecord(TypedDict):
    """Which stops of pages are engaged, and the link: `lost` where what to do about that was decided."""

    stopped: bool
    stops: list[StopRecord]
    operators: int
    link: Annotated[str, Literal["up", "lost", "none"]]
    on_link_lost: Annotated[str, OnLinkLost]


class StopArbiter:
    """Keeps the stop of each page by itself; ROS is told whether any of them is engaged.

    Who sees a danger may stop the robot, so a viewer may too, unless `viewers_stop` is false. That the danger
    is over is for an operator to say: a viewer's `false` withdraws nothing, and an operator resets that stop
    by its name, like one whose page is gone.
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
        """What ROS is told: whether any stop is engaged."""
        return bool(self._left) or any(page.stopped_at is not None for page in self._pages.values())

    # -- what pages do ----------------------------------------------------------------------------------

    def joined(self, page: int, name: str, *, operator: bool, browser: str = "") -> None:
        """A page has connected. `name` is of this connection alone; `browser` proves that it is one known."""
        self._pages[page] = _StopOfPage(name, browser, operator)
        if operator:
            self._lost_at, self._is_decided = None, False

    def told(self, page: int, stopped: bool, now: float) -> str:
        """A page says whether its stop is engaged; return why that is not taken, '' where it is."""
        one = self._pages[page]
        first, one.has_told = not one.has_told, True
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
        """Let a page that comes back stopped have the stop that its browser left last; loading does that."""
        own = [left for left in self._left.values() if left.browser and left.browser == page.browser]
        if own:
            newest = max(own, key=lambda left: left.since)
            page.stopped_at = newest.since
            del self._left[newest.name]

    def gone(self, page: int, now: float) -> None:
        """A page is not connected any more; its stop stays."""
        one = self._pages.pop(page, None)
        if one is None:
            return
        if one.stopped_at is not None:
            self._leave(one.name, one.browser, one.stopped_at)
        if one.is_operator and not self._operators():
            self._lost_at, self._is_decided = now, False

    def reset(self, name: str) -> str:
        """Release a stop by name, for an operator; return why it is not, '' where it is."""
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
        """Return what to do now that the last operator's link is lost; once for each loss, else None.

        The stop that is meant by `OnLinkLost.STOP` is engaged by this call, under the name `LINK`.
        """
        if self._lost_at is None or self._is_decided or now < self._lost_at + LINK_GRACE_S:
            return None
        self._is_decided = True
        if self._on_link_lost is OnLinkLost.STOP:
            self._leave(LINK, "", now)
        return self._on_link_lost

    @property
    def link_is_lost(self) -> bool:
        """Whether no operator is connected, and what to do about that was decided."""
        return self._is_decided and not self._operators()

    # -- what is shown and kept -------------------------------------------------------------------------

    def state(self, now: float) -> StopsRecord:
        """Return what pages can show: which stops are engaged, for how many seconds, and the link."""
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
        """Return what a gateway that starts again must know."""
        pages = [(one.name, one.browser) for one in self._pages.values() if one.stopped_at is not None]
        stops = sorted([*((left.name, left.browser) for left in self._left.values()), *pages])
        return KeptStops(tuple(stops), bool(self._operators()))

    def restore(self, kept: KeptStops, now: float) -> None:
        """Engage the stops that an earlier gateway had: its pages are gone, and none said all is well.

        Where an operator was connected, that link is lost unless somebody is back within `BACK_WITHIN_S`.
        """
        for name, browser in kept.stops:
            self._leave(name, browser, now)
        if kept.operator:
            self._lost_at = now + BACK_WITHIN_S - LINK_GRACE_S

    def _leave(self, name: str, browser: str, since: float) -> None:
        """Keep a stop that nobody tells any more, under a name that no other has: a reset is of one alone."""
        while name in self._left:
            name += "'"
        self._left[name] = LeftStop(name, browser, since)


def stop_of(message: Any) -> bool:
    """Return whether a published std_msgs/Bool says stop; what says nothing clear is a stop."""
    data = message.get("data", True) if isinstance(message, Mapping) else True
    if isinstance(data, (int, float)) and not math.isnan(data):
        return bool(data)
    return True
