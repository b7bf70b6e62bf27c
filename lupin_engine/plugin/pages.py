"""The interface of a source for browser clients that is no robot: a simulation or a recording.

A `PageSource` has the topics and services of a robot. A plugin whose catalog names `pages` serves it. It uses
no ROS and no thread: the server's one loop makes all calls but `history`.
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
    """The methods of a source, for a server; `now` is always in seconds of one steady clock."""

    @property
    def topics(self) -> Mapping[str, str]:
        """The topics, each with its type, such as `std_msgs/msg/String`."""

    @property
    def events(self) -> Collection[str]:
        """Those of the topics of which every message counts."""

    @property
    def access(self) -> Access:
        """Return the access of clients to it, beside the declarations of plugins and the profile."""

    def about(self) -> Mapping[str, Any]:
        """Return the first data for a client: `mode`, `title`, and more."""

    def begin(self, tell: Callable[[PageMessage], None], forget: Callable[[], None]) -> None:
        """Begin; pass every message from now on to `tell`, and call `forget` when all of them are void."""

    def work(self, now: float) -> float | None:
        """Carry out due actions; return the seconds until the next call, None: only after a request."""

    def clock(self, now: float) -> float:
        """Return the time of its clock, in milliseconds since 1970."""

    def call(self, service: str, arguments: Mapping[str, Any], now: float) -> Mapping[str, Any]:
        """Answer a call by the fields of its response.

        Raises:
            LupinError: it has no such service, or the arguments are none of it.
        """

    def stop(self, stopped: bool) -> None:
        """Hear that a page has the robot stopped, or that none has any more."""

    def history(self, since: float, topics: Collection[str]) -> Iterator[PageMessage]:
        """Yield the messages later than `since`, the oldest first; no topics: of all. On any thread."""


#: Serves a source on a port of this machine until SIGINT or SIGTERM; the function is told where pages are.
#: It raises UsageError where the port is taken.
ServePages = Callable[[PageSource, int, Callable[[str], object]], None]


def declared_access(catalog: Catalog) -> Iterator[Access]:
    """Yield the access that plugins and the profile declare, with the orchestrator's services and topics."""
    profile = catalog.profile
    yield profile.access
    for plugin in catalog.plugins.values():
        if plugin.profile in ("", profile.name):
            yield plugin.access
    if (wire := profile.wire) is not None:
        requests = (wire.requests.format(name) for name in profile.requests)
        yield Access((wire.state.name, wire.outcomes.name), (wire.start.name, *requests))
