"""What people's pages can show that is no robot: a simulation in virtual time, or a recording.

Whoever has one of these implements `PageSource`, with the topics and services of a robot and in the same
words. A plugin whose catalog names `pages` serves it. There is no ROS in this, and no thread: everything is
called by the server's one loop.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

from lupin_engine.plugin.contract import Access
from lupin_engine.plugin.registry import Catalog


@dataclass(frozen=True)
class PageMessage:
    """A message of a topic by its fields; `at` is when it was, in milliseconds since 1970 by the source."""

    topic: str
    at: float
    fields: Mapping[str, Any]


class PageSource(Protocol):
    """What a server of pages asks of what it serves; `now` is always in seconds of one steady clock."""

    @property
    def topics(self) -> Mapping[str, str]:
        """The topics, each with its type, such as `std_msgs/msg/String`."""

    @property
    def events(self) -> Collection[str]:
        """Those of the topics of which every message counts."""

    @property
    def access(self) -> Access:
        """What pages may use of it, beside what plugins and the profile declare."""

    def about(self) -> Mapping[str, Any]:
        """What a page must know first: `mode`, `title`, and whatever else there is to say."""

    def begin(self, tell: Callable[[PageMessage], None], forget: Callable[[], None]) -> None:
        """Begin; `tell` is to be called with every message from now on, `forget` when all of it is void."""

    def work(self, now: float) -> float | None:
        """Let happen what is due; return in how many seconds to come, None: when asked for something."""

    def clock(self, now: float) -> float:
        """Return what its clock shows, in milliseconds since 1970."""

    def call(self, service: str, arguments: Mapping[str, Any], now: float) -> Mapping[str, Any]:
        """Answer a call by the fields of its response.

        Raises:
            LupinError: it has no such service, or the arguments are none of it.
        """

    def stop(self, stopped: bool) -> None:
        """Hear that a page has the robot stopped, or that none has any more."""

    def history(self, since: float, topics: Collection[str]) -> Iterator[PageMessage]:
        """Yield what was told later than `since`, the oldest first; no topics: of all. On any thread."""


#: Serves a source on a port of this machine until SIGINT or SIGTERM; the function is told where pages are.
#: It raises UsageError where the port is taken.
ServePages = Callable[[PageSource, int, Callable[[str], object]], None]


def declared_access(catalog: Catalog) -> Iterator[Access]:
    """Yield what plugins and the profile let pages use, with the services and topics of its orchestrator."""
    profile = catalog.profile
    yield profile.access
    for plugin in catalog.plugins.values():
        if plugin.profile in ("", profile.name):
            yield plugin.access
    if (wire := profile.wire) is not None:
        requests = (wire.requests.format(name) for name in profile.requests)
        yield Access((wire.state.name, wire.outcomes.name), (wire.start.name, *requests))
