"""What the gateway keeps of the past: which messages, within how many bytes, and who gets them."""

from __future__ import annotations

import asyncio
import gzip
import json
import random
import struct
import time
from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any
from urllib.error import HTTPError
from urllib.request import Request, urlopen

import pytest

from lupin_engine.errors import UsageError
from lupin_gateway.access import IssuedToken, UserRole, Visitor
from lupin_gateway.encoding import Sample
from lupin_gateway.history import BLOCK_BYTES, TopicHistory
from lupin_gateway.history.settings import HistoryTopic, history_topics
from lupin_gateway.hub import Backlog, Hub, Outbox, Subscriber
from lupin_gateway.node import PARAMETERS
from lupin_gateway.shapes import NotCarried
from tests.plugins.gateway.served import ServedGateway

TYPE = "std_msgs/msg/String"


class Past:
    """A history over topics that a test publishes on, at times of its own."""

    def __init__(self, *wanted: HistoryTopic) -> None:
        self.now = 10_000.0
        self.told: dict[str, Callable[[Sample, bool], None]] = {}
        self.hub = Hub(self._listen, lambda topic: Backlog())
        self.history = TopicHistory(self.hub, wanted, lambda: self.now)
        self.history.start()

    def _listen(self, topic: str, type_: str, told: Any, problem: Any) -> Past:
        self.told[topic] = told
        return self

    def close(self) -> None:
        """See `hub.Feed`."""

    def say(self, topic: str, text: str, stamp: int = 0, after: float = 0.0) -> None:
        """Publish a text behind the stamp of a header, some seconds later."""
        self.now += after
        serialized = struct.pack("<4xq", stamp) + text.encode()
        self.told[topic](Sample(topic, serialized, stamp, decode), False)

    def kept(self, begin: float = 0.0, *topics: str) -> list[dict[str, Any]]:
        """What a page would be told."""
        return [json.loads(line) for line in self.history.lines(begin, topics or self.history.topics)]

    def texts(self) -> list[str]:
        """The texts of all that is kept."""
        return [line["msg"]["data"] for line in self.kept()]


def decode(serialized: bytes) -> dict[str, Any]:
    """Read what `Past.say` publishes; transforms are a text of frames."""
    text = serialized[12:].decode()
    if text == "broken":
        raise NotCarried("what came is no String")
    return {"data": text, "transforms": [{"child_frame_id": frame} for frame in text.split()[:-1]]}


def test_lines_of_all_topics_are_in_the_order_of_time() -> None:
    """A line is what a page gets by the protocol, with its topic and when it arrived."""
    past = Past(HistoryTopic("/a", TYPE, 1_000_000), HistoryTopic("/b", TYPE, 1_000_000))
    past.say("/b", "one")
    past.say("/a", "two", after=0.25)
    past.say("/b", "three", after=0.25)
    assert past.texts() == ["one", "two", "three"]
    assert past.kept(10_000_250.0)[0] == {
        "topic": "/a", "at": 10_000_250, "msg": {"data": "two", "transforms": []},
    }  # fmt: skip
    assert [line["msg"]["data"] for line in past.kept(0.0, "/b")] == ["one", "three"]


def test_a_page_and_the_history_share_one_subscription() -> None:
    """What a page subscribes to is not received twice."""
    past = Past(HistoryTopic("/a", TYPE, 1_000_000))
    before = past.told.copy()
    past.hub.subscribe(Subscriber("/a", Outbox(pytest.fail)), TYPE)
    assert past.told == before


def test_on_change_what_repeats_is_kept_now_and_then() -> None:
    """The stamp alone is no news; a sign of life every 2 s tells a silence from a state that lasts."""
    past = Past(HistoryTopic("/a", TYPE, 1_000_000, every=2.0, on_change=True))
    for stamp in range(25):
        past.say("/a", "READY", stamp, after=0.2)
    past.say("/a", "DONE", 25, after=0.1)
    past.say("/a", "READY", 26, after=0.1)
    assert past.texts() == ["READY", "READY", "READY", "DONE", "READY"]
    quiet = Past(HistoryTopic("/a", TYPE, 1_000_000, on_change=True))
    for stamp, text in enumerate(["READY", "READY", "DONE"]):
        quiet.say("/a", text, stamp, after=100.0)
    assert quiet.texts() == ["READY", "DONE"]


def test_transforms_are_sampled_for_each_node_that_tells_them() -> None:
    """The slow transform of one node is not lost among many of another."""
    past = Past(HistoryTopic("/tf", TYPE, 1_000_000, every=0.5))
    for count in range(100):
        past.say("/tf", f"base_link {count}", after=0.02)
        if count % 10 == 0:
            past.say("/tf", f"odom {count}")
    told = past.texts()
    assert [text for text in told if text.startswith("base")] == [f"base_link {n}" for n in (0, 25, 50, 75)]
    assert [text for text in told if text.startswith("odom")] == [f"odom {n}" for n in (0, 30, 60, 90)]


def test_a_clock_that_goes_back_stops_nothing() -> None:
    """Sampling goes on at once when the robot's clock is set an hour back."""
    past = Past(HistoryTopic("/a", TYPE, 1_000_000, every=5.0))
    past.say("/a", "before")
    past.say("/a", "after", after=-3600.0)
    assert sorted(past.texts()) == ["after", "before"]


def test_the_oldest_go_when_the_bytes_are_used_up() -> None:
    """Of messages that cannot be packed; those that can take a tenth. The newest is always there."""
    dice = random.Random(1)
    past = Past(HistoryTopic("/a", TYPE, 200_000))
    for number in range(2000):
        past.say("/a", f"{number} {dice.randbytes(500).hex()}", after=1.0)
    told = [int(text.split()[0]) for text in past.texts()]
    assert told == list(range(told[0], 2000))
    assert 200_000 / 1000 * 0.9 < len(told) < (200_000 * 2 + BLOCK_BYTES) / 1000
    alike = Past(HistoryTopic("/a", TYPE, 200_000))
    for number in range(2000):
        alike.say("/a", f"{number} {'{attempt: accepted}' * 50}", after=1.0)
    assert len(alike.texts()) == 2000


def test_what_is_no_message_is_left_out() -> None:
    """One broken message does not keep the others from being told."""
    past = Past(HistoryTopic("/a", TYPE, 1_000_000), HistoryTopic("/tf", TYPE, 1_000_000, every=0.5))
    past.say("/a", "one")
    past.say("/a", "broken")
    past.say("/tf", "broken")
    past.say("/a", "two")
    assert past.texts() == ["one", "two"]


def test_the_parameter() -> None:
    """Every wrong entry is told; the default is at most 64 MB in all."""
    found = history_topics(PARAMETERS["history"].default)
    assert sum(each.limit for each in found) <= 64_000_000
    assert found[4] == HistoryTopic("/mission/state", "lupin_msgs/msg/MissionState", 4_000_000, 2.0, True)
    with pytest.raises(UsageError) as refused:
        history_topics(["/a std_msgs/String 4 MB", f"/b {TYPE} 1 MB", f"/b {TYPE} 2 MB every 0.5 s"])
    assert str(refused.value) == (
        "history: '/a std_msgs/String 4 MB' is no TOPIC TYPE NUMBER MB [on change] [every NUMBER s], "
        "such as /twin/state lupin_msgs/msg/TwinState 8 MB every 5 s\n"
        "history: /b is named twice"
    )


# -- over HTTP --------------------------------------------------------------------------------------------

TOKENS = [
    IssuedToken(Visitor("eve", UserRole.VIEWER), "e" * 40),
    IssuedToken(Visitor("cleo", UserRole.ENGINEER), "c" * 40),
]
STEPS, SECRET = "/mission_orchestrator/steps", "/lupin/secret"


def asked(port: int, query: str = "", **headers: str) -> list[dict[str, Any]]:
    """Get the history."""
    request = Request(f"http://localhost:{port}/history{query}", headers=headers)
    with urlopen(request) as answer:
        body = answer.read()
        if answer.headers.get("content-encoding") == "gzip":
            body = gzip.decompress(body)
    return [json.loads(line) for line in body.splitlines()]


def test_who_gets_it(tmp_path: Path) -> None:
    """A viewer gets what viewers may subscribe to; without a token nobody gets anything."""
    wanted = [HistoryTopic(name, TYPE, 1_000_000) for name in (STEPS, SECRET)]
    with ServedGateway(tmp_path, tokens=TOKENS, history=wanted) as served:
        for topic in (STEPS, SECRET):
            served.call(lambda topic=topic: served.robot.tell(topic, "x"))

        def topics(secret: str) -> Sequence[str]:
            return [line["topic"] for line in asked(served.port, Authorization=f"Bearer {secret * 40}")]

        assert topics("e") == [STEPS]
        assert topics("c") == [STEPS, SECRET]
        assert asked(served.port, f"?topics={SECRET}", Authorization=f"Bearer {'e' * 40}") == []
        named = asked(served.port, f"?topics={SECRET},/other", Authorization=f"Bearer {'c' * 40}")
        assert [line["topic"] for line in named] == [SECRET]
        with pytest.raises(HTTPError, match="401"):
            asked(served.port)


def test_since_and_packed(tmp_path: Path) -> None:
    """Only what is newer comes; `since` must be a time."""
    clock = [1000.0]
    with ServedGateway(
        tmp_path, history=[HistoryTopic(STEPS, TYPE, 1_000_000)], wall=lambda: clock[0]
    ) as served:
        for text in ("one", "two"):
            served.call(lambda text=text: served.robot.tell(STEPS, text))
            clock[0] += 10.0
        two = [{"topic": STEPS, "at": 1_010_000, "msg": {"data": "two"}}]
        assert asked(served.port, "?since=1005000") == two
        assert len(asked(served.port, **{"Accept-Encoding": "gzip"})) == 2
        for wrong in ("yesterday", "nan"):
            with pytest.raises(HTTPError) as refused:
                asked(served.port, f"?since={wrong}")
            assert refused.value.status == 400
            assert refused.value.read().decode() == (
                f"since=MS is wanted, milliseconds since 1970, such as since=1795434151280, not {wrong!r}\n"
            )


def test_a_large_history_keeps_nobody_waiting(tmp_path: Path) -> None:
    """It is sent in many turns of the loop, and in between others have theirs.

    By the processor's time of the loop's thread: a busy machine makes no turn longer.
    """
    with ServedGateway(tmp_path, history=[HistoryTopic(STEPS, TYPE, 50_000_000)]) as served:
        looked: list[float] = []

        def fill() -> None:
            for number in range(20_000):
                served.robot.tell(STEPS, f"{number} {'attempt accepted ' * 100}")

        def look() -> None:
            looked.append(time.thread_time())
            timer[0] = asyncio.get_running_loop().call_soon(look)

        timer: list[asyncio.Handle | None] = [None]
        served.call(fill)
        served.call(look)
        lines = asked(served.port)
        served.call(lambda: timer[0] and timer[0].cancel())
        assert len(lines) == 20_000
        turns = [later - earlier for earlier, later in pairwise(looked)]
        assert max(turns) < sum(turns) / 4
