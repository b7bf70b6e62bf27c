"""The ports of the web side (event loop) to a robot; `node.ros` and `virtual` adapt to them."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

from lupin_gateway.access import UseRefusal
from lupin_gateway.encoding import Sample
from lupin_gateway.hub import Feed


@dataclass(frozen=True)
class CallFailed:
    """A failed call, goal or publication; the text names it."""

    text: str


@dataclass(frozen=True)
class GoalEnd:
    """How a goal ended: the number of `action_msgs/GoalStatus`, and the result."""

    status: int
    result: Mapping[str, Any]


class RosPort(Protocol):
    """The robot, as the web side sees it.

    Nothing here blocks or raises for wrong data of a page: results and errors go to the given callbacks, on
    the event loop. Names are absolute, types complete (`std_msgs/msg/String`) or ''.
    """

    def about(self) -> Mapping[str, Any]:
        """Return the `mode` (robot, simulation, recording), and details of the latter two, for pages."""

    def listen(
        self,
        topic: str,
        type_: str,
        on_sample: Callable[[Sample, bool], None],
        problem: Callable[[str], None],
    ) -> Feed:
        """Begin a subscription; see `hub.Listen`."""

    def advertise(self, topic: str, type_: str, latch: bool, problem: Callable[[str], None]) -> None:
        """Prepare to publish; must be followed by one `unadvertise`."""

    def unadvertise(self, topic: str) -> None:
        """Stop publishing, once every page that advertised the topic has called this."""

    def publish(self, topic: str, data: Any, problem: Callable[[str], None]) -> None:
        """Publish a message, given by its fields."""

    def call(self, service: str, data: Any, limit: float, done: Callable[[Any], None]) -> None:
        """Call a service: `done` gets the response by its fields, or `CallFailed`, within `limit` seconds.

        The type is always the server's.
        """

    def send_goal(
        self,
        action: str,
        data: Any,
        feedback: Callable[[Mapping[str, Any]], None],
        done: Callable[[GoalEnd | CallFailed], None],
    ) -> Callable[[], None]:
        """Send a goal; return the function that cancels it. `done` is called once, also after a cancel."""

    def ask(self, question: str, data: Any, refusal: UseRefusal, done: Callable[[Any], None]) -> bool:
        """Answer a call of `/rosapi/QUESTION` as `call` does; False where there is no such question.

        `refusal` decides of which names the client learns.
        """


class HistoryPort(Protocol):
    """Recorded messages of topics, from before a page was opened."""

    @property
    def topics(self) -> Collection[str]:
        """The topics with a history."""

    def start(self) -> None:
        """Begin to record; on the event loop."""

    def lines(self, begin: float, topics: Collection[str]) -> Iterator[bytes]:
        """Return messages from a time on (ms since 1970), a line of JSON each, the oldest first."""
