"""Topics, subscribers and their outboxes: who gets what when somebody is slow, late, or throttled."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable
from typing import Any

import pytest

from lupin_gateway.encoding import Sample
from lupin_gateway.hub import OUTBOX_BYTES, WAITING_STATES, Backlog, Hub, Outbox, Subscriber

TYPE = "std_msgs/msg/String"


class Source:
    """Stands at ROS's end of the subscriptions of a hub: what a test publishes."""

    def __init__(self) -> None:
        self.told: dict[str, tuple[Callable[[Sample, bool], None], Callable[[str], None]]] = {}
        self.opened: list[str] = []
        self.closed: list[str] = []
        self.decoded = 0

    def listen(self, topic: str, type_: str, told: Any, problem: Any) -> Source:
        """See `hub.Listen`."""
        self.opened.append(topic)
        self.told[topic] = (told, problem)
        return self

    def close(self) -> None:
        """See `hub.Feed`."""
        self.closed.append(self.opened[-1])

    def publish(self, topic: str, data: Any, latched: bool = True) -> None:
        """Publish; the stamp is the number of the message."""

        def decode(serialized: bytes) -> dict[str, Any]:
            self.decoded += 1
            return {"data": data}

        self.told[topic][0](Sample(topic, repr(data).encode(), 1_500_000_000, decode), latched)


def hub_of(source: Source, **kept: Backlog) -> Hub:
    """A hub whose topics keep as given, by their names without slash."""
    return Hub(source.listen, lambda topic: kept.get(topic[1:], Backlog()))


async def drained(outbox: Outbox) -> list[dict[str, Any]]:
    """Take all that waits."""
    found = []
    try:
        while True:
            found.append(json.loads(await asyncio.wait_for(outbox.take(), 0.05)))
    except asyncio.TimeoutError:
        return found


async def data_of(outbox: Outbox) -> list[Any]:
    """Take all that waits, and return the data of the messages."""
    return [frame["msg"]["data"] for frame in await drained(outbox)]


def run(test: Any) -> Any:
    """Let a test run on a loop."""
    return lambda: asyncio.run(test())


@run
async def test_one_subscription_and_one_encoding_for_all() -> None:
    """Three pages cost one subscription of ROS, and each message is decoded once."""
    source, outboxes = Source(), [Outbox(pytest.fail) for _ in range(3)]
    hub = hub_of(source)
    for outbox in outboxes:
        hub.subscribe(Subscriber("/a", outbox), TYPE)
    source.publish("/a", 1)
    assert [await data_of(outbox) for outbox in outboxes] == [[1], [1], [1]]
    assert (source.opened, source.decoded) == (["/a"], 1)


@run
async def test_with_and_without_a_type_a_message_is_decoded_once() -> None:
    """Two subscriptions of ROS bring it, and all pages get the same frame."""
    source, outboxes = Source(), [Outbox(pytest.fail) for _ in range(2)]
    hub = hub_of(source)
    heard = []
    for outbox, type_ in zip(outboxes, ("", TYPE), strict=True):
        hub.subscribe(Subscriber("/a", outbox), type_)
        heard.append(source.told["/a"])
    for number in (1, 2):
        for source.told["/a"] in heard:
            source.publish("/a", number)
    assert [await data_of(outbox) for outbox in outboxes] == [[1, 2], [1, 2]]
    assert (source.opened, source.decoded) == (["/a", "/a"], 2)


@run
async def test_late_pages_get_what_is_kept() -> None:
    """Of states the last one, of events as many as are kept; what is not latched is gone."""
    source, outbox = Source(), Outbox(pytest.fail)
    hub = hub_of(source, events=Backlog(3, events=True))
    for topic in ("/state", "/events", "/stream"):
        hub.subscribe(Subscriber(topic, Outbox(pytest.fail)), TYPE)
        for number in range(5):
            source.publish(topic, number, latched=topic != "/stream")
    for topic in ("/state", "/events", "/stream"):
        hub.subscribe(Subscriber(topic, outbox), TYPE)
    assert await data_of(outbox) == [4, 2, 3, 4]


@run
async def test_what_comes_again_is_told_once() -> None:
    """A subscription of ROS that is made anew brings the backlog again."""
    source, outbox = Source(), Outbox(pytest.fail)
    hub = hub_of(source, events=Backlog(3, events=True))
    hub.subscribe(Subscriber("/events", outbox), TYPE)
    for number in (1, 2, 1, 2, 3):
        source.publish("/events", number)
    assert await data_of(outbox) == [1, 2, 3]


@run
async def test_nobody_listens_nothing_is_decoded() -> None:
    """The subscription stays for a moment when the last page has gone, and costs no decoding."""
    source = Source()
    hub = hub_of(source)
    subscriber = Subscriber("/a", Outbox(pytest.fail))
    hub.subscribe(subscriber, TYPE)
    hub.unsubscribe(subscriber)
    source.publish("/a", 1)
    assert source.decoded == 0
    assert hub.topics() == {"/a": 0}


@run
async def test_a_slow_client_loses_old_states() -> None:
    """The newest ones wait; others are not told about it, and the next topic loses nothing."""
    source, outbox = Source(), Outbox(pytest.fail)
    hub = hub_of(source)
    hub.subscribe(Subscriber("/a", outbox), TYPE)
    hub.subscribe(Subscriber("/b", outbox), TYPE)
    source.publish("/b", "kept")
    for number in range(100):
        source.publish("/a", number, latched=False)
    assert await data_of(outbox) == ["kept", *range(100 - WAITING_STATES, 100)]


@run
async def test_a_slow_client_is_told_how_many_events_it_lost() -> None:
    """Before the first one that still comes."""
    source, outbox = Source(), Outbox(pytest.fail)
    hub = hub_of(source, events=Backlog(3, events=True))
    hub.subscribe(Subscriber("/events", outbox, queue=2, id="s"), TYPE)
    for number in range(10):
        source.publish("/events", number)
    told, *rest = await drained(outbox)
    assert told == {
        "op": "status",
        "level": "warning",
        "msg": "/events: 8 messages were lost, because this client reads too slowly",
        "id": "s",
    }
    assert [frame["msg"]["data"] for frame in rest] == [8, 9]


@run
async def test_a_client_that_never_reads_is_bounded() -> None:
    """States go before events; replies are never dropped, so too many of them end the client."""
    full: list[bool] = []
    source, outbox = Source(), Outbox(lambda: full.append(True))
    hub = hub_of(source, events=Backlog(3, events=True))
    hub.subscribe(Subscriber("/events", outbox), TYPE)
    hub.subscribe(Subscriber("/a", outbox), TYPE)
    source.publish("/events", "kept")
    for number in range(1000):
        source.publish("/a", f"{number}" + "x" * 500_000, latched=False)
        assert outbox.bytes <= OUTBOX_BYTES
    assert (await data_of(outbox))[0] == "kept"
    assert not full
    for _ in range(9):
        outbox.put("x" * 500_000)
    assert full


@run
async def test_a_throttle_lets_the_last_one_pass() -> None:
    """One at once, then one each interval: the newest, and with a queue the ones before it too."""
    source, plain, queued = Source(), Outbox(pytest.fail), Outbox(pytest.fail)
    hub = hub_of(source)
    hub.subscribe(Subscriber("/a", plain, throttle=0.02), TYPE)
    hub.subscribe(Subscriber("/a", queued, throttle=0.02, queue=3), TYPE)
    for number in range(10):
        source.publish("/a", number, latched=False)
    assert await asyncio.gather(data_of(plain), data_of(queued)) == [[0, 9], [0, 7, 8, 9]]
    assert source.decoded == 4


@run
async def test_what_waits_is_not_sent_after_the_end() -> None:
    """An unsubscribed topic is silent at once."""
    source, outbox = Source(), Outbox(pytest.fail)
    hub = hub_of(source)
    subscriber = Subscriber("/a", outbox)
    hub.subscribe(subscriber, TYPE)
    source.publish("/a", 1)
    hub.unsubscribe(subscriber)
    assert await drained(outbox) == []
    assert outbox.bytes == 0


@run
async def test_what_is_wrong_with_a_topic_is_told_to_all() -> None:
    """Also to those who come later; a page with another type is not concerned."""
    source, first, later, right = Source(), Outbox(pytest.fail), Outbox(pytest.fail), Outbox(pytest.fail)
    hub = hub_of(source)
    hub.subscribe(Subscriber("/a", first), "std_msgs/msg/Bool")
    source.told["/a"][1]("/a is of type std_msgs/msg/String, not std_msgs/msg/Bool")
    hub.subscribe(Subscriber("/a", later), "std_msgs/msg/Bool")
    hub.subscribe(Subscriber("/a", right), TYPE)
    expected = {
        "op": "status", "level": "error", "msg": "/a is of type std_msgs/msg/String, not std_msgs/msg/Bool",
    }  # fmt: skip
    assert await drained(first) == [expected]
    assert await drained(later) == [expected]
    assert await drained(right) == []


@run
async def test_what_a_throttle_holds_back_is_bounded() -> None:
    """However long a queue a page asks for, and of however many topics."""
    source, outbox = Source(), Outbox(lambda: None)
    hub = hub_of(source)
    pages = [Subscriber(f"/t{n}", outbox, throttle=3600.0, queue=10_000) for n in range(4)]
    for page in pages:
        hub.subscribe(page, TYPE)
    for number in range(40):
        for page in pages:
            source.publish(page.topic, f"{number}" + "x" * 100_000, latched=False)
    assert outbox.held <= OUTBOX_BYTES + 100_100
    for page in pages:
        hub.unsubscribe(page)
    assert outbox.held == 0


@run
async def test_a_message_that_is_longer_than_all_that_may_wait() -> None:
    """It is told instead of dropped in silence, and others are not dropped for it."""
    source, outbox = Source(), Outbox(lambda: None)
    hub = hub_of(source)
    for topic in ("/short", "/long"):
        hub.subscribe(Subscriber(topic, outbox), TYPE)
    source.publish("/short", "here", latched=False)
    source.publish("/long", "x" * OUTBOX_BYTES, latched=False)
    first, second = await drained(outbox)
    assert first["msg"] == {"data": "here"}
    assert (second["op"], second["level"]) == ("status", "error")
    assert second["msg"] == "/long: a message of 4000050 bytes is too long"
