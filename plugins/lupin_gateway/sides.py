"""What the side of pages (an asyncio loop) calls of the side of ROS (a thread of its own)."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

from lupin_gateway.encoding import Sample
from lupin_gateway.hub import Feed


@dataclass(frozen=True)
class CallFailed:
    """A call, goal or publication that came to nothing; the text names what it was about."""

    text: str


@dataclass(frozen=True)
class GoalEnd:
    """How a goal ended: the number of `action_msgs/GoalStatus`, and the result."""

    status: int
    result: Mapping[str, Any]


class RosSide(Protocol):
    """ROS, as the pages' side sees it.

    Nothing here waits, and nothing raises for what a page has sent: what comes of it is told to the functions
    that are given, on the loop. Names are absolute, types complete (`std_msgs/msg/String`) or ''.
    """

    def about(self) -> Mapping[str, Any]:
        """What pages look at: the `mode` (robot, simulation, recording), and more of the latter two."""

    def listen(
        self, topic: str, type_: str, told: Callable[[Sample, bool], None], problem: Callable[[str], None]
    ) -> Feed:
        """Begin a subscription; see `hub.Listen`."""

    def advertise(self, topic: str, type_: str, latch: bool, problem: Callable[[str], None]) -> None:
        """Prepare to publish; each is to be followed by one `unadvertise`."""

    def unadvertise(self, topic: str) -> None:
        """Publish no more, when all who advertised have said so."""

    def publish(self, topic: str, data: Any, problem: Callable[[str], None]) -> None:
        """Publish a message, given by its fields."""

    def call(self, service: str, data: Any, limit: float, done: Callable[[Any], None]) -> None:
        """Call a service: `done` gets the response by its fields, or `CallFailed`, within `limit` seconds.

        The type is that of the server, whatever a page believes.
        """

    def send_goal(
        self,
        action: str,
        data: Any,
        feedback: Callable[[Mapping[str, Any]], None],
        done: Callable[[GoalEnd | CallFailed], None],
    ) -> Callable[[], None]:
        """Send a goal, and return what cancels it; `done` comes once, also after a cancel."""

    def ask(self, question: str, data: Any, done: Callable[[Any], None]) -> bool:
        """Answer a call of `/rosapi/QUESTION` as `call` does; False where there is no such question."""


class KeptPast(Protocol):
    """What topics said before a page was opened."""

    @property
    def topics(self) -> Collection[str]:
        """The topics whose past there is."""

    def start(self) -> None:
        """Begin to keep; on the loop."""

    def lines(self, begin: float, topics: Collection[str]) -> Iterator[bytes]:
        """Return what topics said from a time on (ms since 1970), a line of JSON each, the oldest first."""
