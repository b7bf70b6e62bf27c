"""Fans topics out to clients: one ROS subscription for each topic and type, and a bounded queue per client.

A message is encoded once for all clients. A client that reads too slowly delays no other: its outbox (4 MB)
drops the oldest states first, then events, and the client gets a warning with the number of lost events. All
of it runs on the event loop.
"""

from __future__ import annotations

import asyncio
from collections import OrderedDict, deque
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Protocol

from lupin_gateway.encoding import Compression, FrameData, Sample, status

#: Bytes that may wait for one client; older samples go first, then the client itself.
OUTBOX_BYTES = 4_000_000
#: Samples of one subscription that may wait, of a topic of states and of one of events.
WAITING_STATES, WAITING_EVENTS = 20, 1000
#: Seconds that a subscription of ROS stays when its last client has gone: pages are loaded anew.
LINGER_S = 5.0


class Feed(Protocol):
    """A subscription of ROS."""

    def close(self) -> None:
        """End it; no callback follows."""


#: Begins a subscription of ROS of a topic and a type ('' means that of the topic's publishers). The first
#: function is to be called on the loop with every message, and whether later subscribers are to have it
#: too; the second with what is wrong, '' once nothing is any more.
Listen = Callable[[str, str, Callable[[Sample, bool], None], Callable[[str], None]], Feed]


@dataclass(frozen=True)
class Backlog:
    """How many samples of a topic are kept for later subscribers, and whether they are events.

    Events are dropped after all states, and clients are warned of lost ones; lost states are silent.
    """

    depth: int = 1
    events: bool = False


@dataclass(eq=False)
class _WaitingFrame:
    """A frame in an outbox, and the subscription that it is of."""

    frame: FrameData
    source: Subscriber | None


class Outbox:
    """The send queue of one client, in order; `full` is called when even replies exceed `OUTBOX_BYTES`."""

    def __init__(self, full: Callable[[], None]) -> None:
        self._waiting: OrderedDict[_WaitingFrame, None] = OrderedDict()
        self._filled = asyncio.Event()
        self._full = full
        self.bytes = 0
        #: Bytes of messages that the throttles of this client hold back.
        self.held = 0

    def put(self, frame: FrameData, source: Subscriber | None = None) -> None:
        """Queue a frame. A subscription's may be dropped later; one too long becomes an error."""
        if source is not None and len(frame) > OUTBOX_BYTES:  # all others would be dropped for it, and it too
            frame = status("error", f"{source.topic}: a message of {len(frame)} bytes is too long", source.id)
        waiting = _WaitingFrame(frame, source)
        self._waiting[waiting] = None
        self.bytes += len(frame)
        if source is not None:
            source.waiting.append(waiting)
            if len(source.waiting) > source.limit:
                self._lose(source.waiting[0], source)
        while self.bytes > OUTBOX_BYTES and self._lose_oldest():
            pass
        if self.bytes > OUTBOX_BYTES:
            self._full()
        self._filled.set()

    def _lose_oldest(self) -> bool:
        """Drop the oldest state, else the oldest event; return False where only replies are left."""
        oldest: tuple[_WaitingFrame, Subscriber] | None = None
        for waiting in self._waiting:
            if waiting.source is not None and (oldest is None or not waiting.source.kept.events):
                oldest = waiting, waiting.source
                if not waiting.source.kept.events:
                    break
        if oldest is not None:
            self._lose(*oldest)
        return oldest is not None

    def _lose(self, waiting: _WaitingFrame, source: Subscriber) -> None:
        source.waiting.remove(waiting)
        source.lost += 1
        self.drop(waiting)

    def drop(self, waiting: _WaitingFrame) -> None:
        """Remove a frame from the queue."""
        del self._waiting[waiting]
        self.bytes -= len(waiting.frame)

    async def take(self) -> FrameData:
        """Wait for the next frame."""
        while not self._waiting:
            self._filled.clear()
            await self._filled.wait()
        waiting, _ = self._waiting.popitem(last=False)
        source = waiting.source
        if source is not None:
            source.waiting.popleft()
            lost, source.lost = source.lost, 0
            if lost and source.kept.events:
                return self._about_losses(waiting, source, lost)
        self.bytes -= len(waiting.frame)
        return waiting.frame

    def _about_losses(self, waiting: _WaitingFrame, source: Subscriber, lost: int) -> FrameData:
        """Return a warning about lost events, and put the frame back at the head of the queue."""
        kept = _WaitingFrame(waiting.frame, None)
        self._waiting[kept] = None
        self._waiting.move_to_end(kept, last=False)
        text = f"{source.topic}: {lost} messages were lost, because this client reads too slowly"
        return status("warning", text, source.id)


@dataclass(eq=False)
class Subscriber:
    """One subscription of a client: its options, and its frames in the outbox.

    `throttle` is the least time between two in seconds; `queue` is how many may wait, 0 for the default.
    """

    topic: str
    outbox: Outbox
    id: str | None = None
    compression: Compression = "none"
    throttle: float = 0.0
    queue: int = 0
    kept: Backlog = field(default_factory=Backlog)
    lost: int = 0
    waiting: deque[_WaitingFrame] = field(default_factory=deque)
    _held: deque[Sample] = field(default_factory=deque)
    _release: asyncio.TimerHandle | None = None

    @property
    def limit(self) -> int:
        """How many samples may wait in the outbox."""
        return self.queue or (WAITING_EVENTS if self.kept.events else WAITING_STATES)

    def offer(self, sample: Sample) -> None:
        """Send a sample, or hold it for the throttle; of held ones the newest is never dropped."""
        if not self.throttle:
            self.outbox.put(sample.frame(self.compression), self)
            return
        self._held.append(sample)
        self.outbox.held += len(sample.serialized)
        if self._release is None:
            self._pass_one()
        while len(self._held) > max(1, self.queue) or (
            len(self._held) > 1 and self.outbox.held > OUTBOX_BYTES
        ):
            self._next_held()

    def complain(self, problem: str) -> None:
        """Send the client an error about the topic."""
        self.outbox.put(status("error", problem, self.id))

    def _next_held(self) -> Sample:
        sample = self._held.popleft()
        self.outbox.held -= len(sample.serialized)
        return sample

    def _pass_one(self) -> None:
        self._release = None
        if self._held:  # only what is sent is encoded
            self.outbox.put(self._next_held().frame(self.compression), self)
            self._release = asyncio.get_running_loop().call_later(self.throttle, self._pass_one)

    def close(self) -> None:
        """Send nothing more; drop its waiting frames."""
        if self._release is not None:
            self._release.cancel()
        while self._held:
            self._next_held()
        for waiting in self.waiting:
            self.outbox.drop(waiting)
        self.waiting.clear()


class _OpenTopic:
    """One topic that a client subscribes to."""

    def __init__(self, name: str, type_: str, kept: Backlog) -> None:
        self.name = name
        self.type = type_
        self.kept = kept
        self.backlog: deque[Sample] = deque(maxlen=kept.depth)
        self.subscribers: list[Subscriber] = []
        self.problem = ""
        self.feed: Feed | None = None
        self.ending: asyncio.TimerHandle | None = None

    def deliver(self, sample: Sample, latched: bool) -> None:
        """Give a sample to all subscribers; repetitions of a new ROS subscription are dropped."""
        if latched or self.kept.events:
            if any(old.same(sample) for old in self.backlog):
                return
            self.backlog.append(sample)
        for subscriber in self.subscribers:
            subscriber.offer(sample)

    def report_problem(self, problem: str) -> None:
        """Send a new problem to all subscribers, and keep it for later ones; '' clears it."""
        if problem and problem != self.problem:
            for subscriber in self.subscribers:
                subscriber.complain(problem)
        self.problem = problem


class Hub:
    """All subscribed topics; `kept` gives the backlog that each keeps for later subscribers."""

    def __init__(self, listen: Listen, kept: Callable[[str], Backlog]) -> None:
        self._listen = listen
        self._kept = kept
        self._channels: dict[tuple[str, str], _OpenTopic] = {}  # who names a wrong type, or none, is apart
        self._last: dict[str, Sample] = {}

    def subscribe(self, subscriber: Subscriber, type_: str) -> None:
        """Send the backlog (latched and event topics have one), then new samples; `type_` '': the topic's."""
        channel = self._channels.get((subscriber.topic, type_)) or self._open(subscriber.topic, type_)
        if channel.ending is not None:
            channel.ending.cancel()
            channel.ending = None
        subscriber.kept = channel.kept
        channel.subscribers.append(subscriber)
        if channel.problem:
            subscriber.outbox.put(status("error", channel.problem, subscriber.id))
        for sample in channel.backlog:
            subscriber.offer(sample)

    def unsubscribe(self, subscriber: Subscriber) -> None:
        """Send no more of it; unknown ones are ignored."""
        subscriber.close()
        for channel in self._channels.values():
            if subscriber in channel.subscribers:
                channel.subscribers.remove(subscriber)
                if not channel.subscribers:
                    later = asyncio.get_running_loop().call_later
                    channel.ending = later(LINGER_S, self._close, channel)

    def forget(self) -> None:
        """Clear the backlogs of all topics."""
        self._last.clear()
        for channel in self._channels.values():
            channel.backlog.clear()

    def topics(self) -> dict[str, int]:
        """Return how many subscribers each topic has."""
        names = {name for name, _ in self._channels}
        return {
            name: sum(len(c.subscribers) for (n, _), c in self._channels.items() if n == name)
            for name in names
        }

    def _open(self, topic: str, type_: str) -> _OpenTopic:
        channel = self._channels[topic, type_] = _OpenTopic(topic, type_, self._kept(topic))
        channel.feed = self._listen(topic, type_, partial(self._deliver, channel), channel.report_problem)
        return channel

    def _deliver(self, channel: _OpenTopic, sample: Sample, latched: bool) -> None:
        """Give a sample to a topic's subscribers, decoded once for all of them."""
        last = self._last.get(channel.name)
        if last is None or not last.same(sample):
            last = self._last[channel.name] = sample
        channel.deliver(last, latched)

    def _close(self, channel: _OpenTopic) -> None:
        del self._channels[channel.name, channel.type]
        self._last.pop(channel.name, None)
        if channel.feed is not None:
            channel.feed.close()
