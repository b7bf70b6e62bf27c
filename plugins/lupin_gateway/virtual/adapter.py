"""The adapter of `RosPort` to a simulation or a recording; all of it runs on the event loop.

Publications, actions and most of `/rosapi/` are refused with a sentence.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable, Collection, Iterator, Mapping
from typing import Any

from lupin_engine.errors import LupinError
from lupin_engine.plugin import PageMessage, PageSource
from lupin_gateway.access import Use, UseRefusal
from lupin_gateway.encoding import Sample, as_json
from lupin_gateway.guard import STOPS_TOPIC
from lupin_gateway.people import NOTIFICATIONS_TOPIC, PEOPLE_TOPIC
from lupin_gateway.ports import CallFailed, GoalEnd


class _HeardTopic:
    """One subscription to a topic of the source (`hub.Feed`)."""

    def __init__(
        self, all_: list[_HeardTopic], topic: str, on_sample: Callable[[Sample, bool], None]
    ) -> None:
        self.topic = topic
        self.on_sample = on_sample
        self._all = all_
        all_.append(self)

    def close(self) -> None:
        """End the subscription: no sample follows."""
        self._all.remove(self)


class SourceAdapter:
    """A source as a `ports.RosPort`; `steady` is the clock, in seconds, by which it works."""

    def __init__(self, source: PageSource, steady: Callable[[], float]) -> None:
        self._source = source
        self._steady = steady
        self._heard: list[_HeardTopic] = []
        self._last: dict[str, Sample] = {}
        self._count = 0
        self._stopped = False
        self._asked = asyncio.Event()
        #: Called when the source's messages are to be dropped.
        self.forgotten: Callable[[], None] = lambda: None

    @property
    def _types(self) -> Mapping[str, str]:
        own = (STOPS_TOPIC, PEOPLE_TOPIC, NOTIFICATIONS_TOPIC)
        return {**self._source.topics, **dict.fromkeys(own, "std_msgs/msg/String")}

    async def work(self) -> None:
        """Run the source, for ever."""
        self._source.begin(self._deliver, self._forget)
        while True:
            self._asked.clear()
            wait = self._source.work(self._steady())
            await asyncio.sleep(0)  # frames of pages come between two turns
            waiting = asyncio.ensure_future(self._asked.wait())
            await asyncio.wait({waiting}, timeout=wait)
            waiting.cancel()

    def publish_text(self, topic: str, text: str) -> None:
        """Send a std_msgs/String of the gateway itself to pages."""
        self._deliver(PageMessage(topic, self._source.clock(self._steady()), {"data": text}))

    def stop(self, stopped: bool) -> None:
        """Pass on whether a page has stopped; called periodically, passed on when it changes."""
        if stopped is not self._stopped:
            self._stopped = stopped
            self._source.stop(stopped)
            self._asked.set()

    def _forget(self) -> None:
        """Drop the last messages of the source's topics."""
        for topic in self._source.topics:
            self._last.pop(topic, None)
        self.forgotten()

    def _deliver(self, message: PageMessage) -> None:
        self._count += 1  # two messages that say the same are two
        sample = _sample(message, self._count)
        self._last[message.topic] = sample
        for each in list(self._heard):
            if each.topic == message.topic:
                each.on_sample(sample, True)

    # -- as the side of ROS -----------------------------------------------------------------------------

    def about(self) -> Mapping[str, Any]:
        """Return the source's `mode` and further details."""
        return self._source.about()

    def listen(
        self,
        topic: str,
        type_: str,
        on_sample: Callable[[Sample, bool], None],
        problem: Callable[[str], None],
    ) -> _HeardTopic:
        """Subscribe; the last sample follows soon, or `problem` where the type is another one."""
        known = self._types.get(topic, type_)
        loop = asyncio.get_running_loop()
        if type_ and type_ != known:
            loop.call_soon(problem, f"{topic} is of type {known}, not {type_}")
        elif topic in self._last:
            loop.call_soon(on_sample, self._last[topic], True)
        return _HeardTopic(self._heard, topic, on_sample)

    def advertise(self, topic: str, type_: str, latch: bool, problem: Callable[[str], None]) -> None:
        """Refuse by `problem`: a source hears nothing that pages publish."""
        problem(self._no("hears nothing that pages publish", topic))

    def unadvertise(self, topic: str) -> None:
        """Do nothing: nothing was advertised."""

    def publish(self, topic: str, data: Any, problem: Callable[[str], None]) -> None:
        """Refuse by `problem`: a source hears nothing that pages publish."""
        problem(self._no("hears nothing that pages publish", topic))

    def call(self, service: str, data: Any, limit: float, done: Callable[[Any], None]) -> None:
        """Call the source; `done` gets the response, or `CallFailed` where it refuses. `limit` has no use."""
        loop = asyncio.get_running_loop()
        try:
            if not isinstance(data, Mapping):
                raise LupinError(f"{service}: its request is an object of fields")
            answer: Any = self._source.call(service, data, self._steady())
        except LupinError as problem:
            answer = CallFailed(str(problem))
        loop.call_soon(done, answer)
        self._asked.set()

    def send_goal(
        self,
        action: str,
        data: Any,
        feedback: Callable[[Mapping[str, Any]], None],
        done: Callable[[GoalEnd | CallFailed], None],
    ) -> Callable[[], None]:
        """Refuse by `CallFailed`: a source has no actions."""
        asyncio.get_running_loop().call_soon(done, CallFailed(self._no("has no actions", action)))
        return lambda: None

    def ask(self, question: str, data: Any, refusal: UseRefusal, done: Callable[[Any], None]) -> bool:
        """Answer `get_time` and `topics`; every other question is `CallFailed`. Always True."""
        if question == "get_time":
            rest, seconds = math.modf(self._source.clock(self._steady()) / 1000.0)
            done({"time": {"sec": int(seconds), "nanosec": int(rest * 1e9)}})
        elif question == "topics":
            known = {name: kind for name, kind in self._types.items() if not refusal(Use.SUBSCRIBE, name)}
            done({"topics": list(known), "types": list(known.values())})
        else:
            done(CallFailed(self._no("has no network", f"/rosapi/{question}")))
        return True

    def _no(self, why: str, name: str) -> str:
        return f"{name}: this is a {self._source.about()['mode']}, which {why}"


class SourceHistory:
    """The history of a source; see `ports.HistoryPort`."""

    def __init__(self, source: PageSource) -> None:
        self._source = source

    @property
    def topics(self) -> Collection[str]:
        """The topics of the source."""
        return self._source.topics.keys()

    def start(self) -> None:
        """Do nothing: the source records by itself."""

    def lines(self, begin: float, topics: Collection[str]) -> Iterator[bytes]:
        """Yield messages from a time on (ms since 1970), a line of JSON each, the oldest first."""
        for message in self._source.history(begin, topics):
            encoded = as_json(message.fields)
            yield b'{"topic":%b,"at":%.3f,"msg":%b}\n' % (as_json(message.topic), message.at, encoded)


def _sample(message: PageMessage, count: int) -> Sample:
    name, stamp_ns = str(count).encode(), round(message.at * 1e6)
    return Sample(message.topic, name, stamp_ns, lambda _: message.fields, message.at)
