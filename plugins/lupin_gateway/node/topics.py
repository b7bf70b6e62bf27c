"""Subscriptions whose QoS follows the publishers', and publishers that wait briefly for their readers.

For the ROS thread. Beyond `DEPTH` undelivered messages of a topic, and `MOST_HELD` unsent ones, the oldest
are lost.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from typing import Any

from rclpy.qos import QoSProfile

from lupin_gateway.encoding import Sample
from lupin_gateway.filling import DoesNotFit, filled
from lupin_gateway.motion.names import MotionNames
from lupin_gateway.node import types
from lupin_gateway.shapes import NotCarried
from lupin_ros.adapter import Qos, Repeater, RosNode, TimerHandle, heard_profile, is_latched, type_name

#: Messages that ROS keeps until they are taken: a burst, or what is kept for late subscribers.
DEPTH = 100
#: Seconds between two looks for publishers of topics that have none yet; the others every `REST` of them.
LOOK_S, REST = 0.2, 5
#: Seconds that a new publisher waits for readers that are there already, and between two looks for them.
MATCH_S, MATCH_LOOK_S = 0.5, 0.01
#: Messages that wait meanwhile.
MOST_HELD = 100
#: Seconds that a publisher stays when nobody advertises it any more.
PUBLISHER_LINGER_S = 3.0

Post = Callable[..., None]


class Subscription:
    """One topic; the ROS subscription is made as soon as a node publishes it.

    Its reliability and durability are the best that all publishers offer: a stricter reader would get
    nothing, a laxer one no backlog.
    """

    def __init__(
        self, ros: RosNode, topic: str, type_: str, on_sample: Any, problem: Any, post: Post
    ) -> None:
        self._ros = ros
        self.topic = topic
        self._type = type_
        self._on_sample = on_sample
        self._problem = problem
        self._post = post
        self._profile: QoSProfile | None = None
        self._subscription: Any = None
        #: What the pages' side has had no time for yet; of more, the oldest are lost, as in ROS itself.
        self._pending: deque[tuple[Sample, bool]] = deque(maxlen=DEPTH)
        self._is_posted = False

    @property
    def heard(self) -> bool:
        """Whether the ROS subscription exists."""
        return self._subscription is not None

    def look(self) -> None:
        """Match type and QoS to the current publishers; a type that none of them has is reported."""
        publishers = self._ros.node.get_publishers_info_by_topic(self._ros.full(self.topic))
        if not publishers:
            return
        published = sorted({type_name(each) for each in publishers})
        type_ = self._type or published[0]
        if type_ not in published:
            self._post(self._problem, f"{self.topic} is of type {', '.join(published)}, not {type_}")
            return
        profile = heard_profile([each.qos_profile for each in publishers], DEPTH)
        if profile != self._profile:
            self._subscribe(type_, profile)

    def _subscribe(self, type_: str, profile: QoSProfile) -> None:
        self.close()
        self._profile = profile
        latched = is_latched(profile)
        try:
            kind, decode = types.class_of(type_), self._ros.frames.reading(types.decode(type_))
        except NotCarried as problem:
            self._post(self._problem, f"{self.topic}: {problem}")
            return

        def on_message(serialized: bytes, info: dict[str, int]) -> None:
            sample = Sample(self.topic, serialized, info["source_timestamp"], decode)
            self._pending.append((sample, latched))
            if not self._is_posted:
                self._is_posted = True
                self._post(self._deliver_next)

        self._subscription = self._ros.subscribe_raw(kind, self.topic, profile, on_message)
        self._ros.watch_channels([f"rt{self._ros.full(self.topic)}"])
        self._post(self._problem, "")

    def _deliver_next(self) -> None:
        """Deliver one message on the loop, and schedule the next: other work comes in between."""
        self._is_posted = False
        if self._pending:
            self._on_sample(*self._pending.popleft())
        if self._pending and not self._is_posted:
            self._is_posted = True
            self._post(self._deliver_next)

    def close(self) -> None:
        """End it."""
        if self._subscription is not None:
            self._ros.node.destroy_subscription(self._subscription)
            self._subscription = None


class Subscriptions:
    """All subscriptions; looks for new publishers of each periodically."""

    def __init__(self, ros: RosNode, post: Post) -> None:
        self._ros = ros
        self._post = post
        self._all: list[Subscription] = []
        self._round = 0
        self._looking = Repeater(ros.steady_timer, LOOK_S, self._look)

    def add(self, topic: str, type_: str, on_sample: Any, problem: Any) -> Subscription:
        """Begin a subscription."""
        added = Subscription(self._ros, topic, type_, on_sample, problem, self._post)
        self._all.append(added)
        self._looking.start()
        self._ros.guarded(added.look)()
        return added

    def remove(self, subscription: Subscription) -> None:
        """End a subscription."""
        subscription.close()
        self._all.remove(subscription)
        if not self._all:
            self._looking.stop()

    def published(self, topic: str) -> None:
        """Look for publishers of one topic now: a page publishes it, and another may listen."""
        for each in self._all:
            if each.topic == topic and not each.heard:
                self._ros.guarded(each.look)()

    def _look(self) -> None:
        self._round += 1
        for each in self._all:
            if not each.heard or self._round % REST == 0:
                self._ros.guarded(each.look)()


class _SharedPublisher:
    """A publisher; messages wait for its readers to be matched, for at most `MATCH_S`."""

    def __init__(self, ros: RosNode, topic: str, type_: str, latch: bool) -> None:
        self._ros = ros
        self._topic = topic
        self.type = type_
        self.latch = latch
        self.users = 0
        self.ending: TimerHandle | None = None
        self._publisher = ros.publisher(types.class_of(type_), topic, Qos.LATCHED if latch else Qos.EVENT)
        self._held: deque[Any] = deque(maxlen=MOST_HELD)
        self._until = time.monotonic() + MATCH_S
        self._is_new = True
        self._waiting = Repeater(ros.steady_timer, MATCH_LOOK_S, self._release)

    def publish(self, data: Any) -> None:
        message = filled(types.shape(self.type), data)
        if self._is_new and not self._matched():
            self._held.append(message)
            self._waiting.start()
            return
        self._is_new = False
        self._publisher.publish(message)

    def _matched(self) -> bool:
        there = self._ros.node.count_subscribers(self._ros.full(self._topic))
        return self._publisher.get_subscription_count() >= there or time.monotonic() >= self._until

    def _release(self) -> None:
        if not self._matched():
            return
        self._waiting.stop()
        self._is_new = False
        while self._held:
            self._publisher.publish(self._held.popleft())

    def drop_held(self) -> None:
        self._held.clear()

    def close(self) -> None:
        self._waiting.stop()
        self._ros.node.destroy_publisher(self._publisher)


class Publishers:
    """All publishers, one per topic, shared by the pages that advertise it."""

    def __init__(self, ros: RosNode, made: Callable[[str], None]) -> None:
        """`made` is called with the topic of each new publisher."""
        self._ros = ros
        self._made = made
        self._all: dict[str, _SharedPublisher] = {}
        #: Topics on which something was published since the last `halt`.
        self._used: set[str] = set()

    def advertise(self, topic: str, type_: str, latch: bool) -> str:
        """Make a publisher, or share the existing one; return the error, '' where there is none."""
        publisher = self._all.get(topic)
        if publisher is not None and publisher.type != type_:
            return f"{topic} is of type {publisher.type}, not {type_}"
        try:
            if publisher is None:
                self._refuse_other_type(topic, type_)
                publisher = self._all[topic] = _SharedPublisher(self._ros, topic, type_, latch)
                self._made(topic)
        except NotCarried as problem:
            return f"{topic}: {problem}"
        publisher.users += 1
        if publisher.ending is not None:
            publisher.ending.cancel()
            publisher.ending = None
        return ""

    def _refuse_other_type(self, topic: str, type_: str) -> None:
        known = topic_types(self._ros, topic)
        if known and type_ not in known:
            raise NotCarried(f"it is of type {', '.join(known)}, not {type_}")

    def unadvertise(self, topic: str) -> None:
        """Remove one user; the publisher stays for `PUBLISHER_LINGER_S`, so that its last message arrives."""
        publisher = self._all.get(topic)
        if publisher is None:
            return
        publisher.users = max(0, publisher.users - 1)
        if not publisher.users and publisher.ending is None:
            publisher.ending = self._ros.steady_timer(
                PUBLISHER_LINGER_S, lambda: self._close(topic, publisher)
            )

    def _close(self, topic: str, publisher: _SharedPublisher) -> None:
        if publisher.ending is not None:
            publisher.ending.cancel()
        if self._all.get(topic) is publisher:
            del self._all[topic]
            publisher.close()

    def publish(self, topic: str, data: Any) -> str:
        """Publish, with the network's type if no page advertised one; return the error, else ''."""
        publisher = self._all.get(topic)
        if publisher is None:
            known = topic_types(self._ros, topic)
            if not known:
                return f"{topic}: advertise it before the first message, so that its type is known"
            problem = self.advertise(topic, known[0], latch=False)
            if problem:
                return problem
            publisher = self._all[topic]
            self.unadvertise(topic)
        try:
            publisher.publish(data)
        except DoesNotFit as problem:
            return f"{topic}: {problem}"
        self._used.add(topic)
        return ""

    def halt(self, moving: MotionNames) -> None:
        """Drop waiting messages that move the robot; publish zero on each used topic of velocities."""
        used, self._used = self._used, set()
        for topic in used & self._all.keys():
            if moving.published(topic, None):
                self._all[topic].drop_held()
            if moving.is_velocity(topic):
                self._all[topic].publish({})


def topic_types(ros: RosNode, topic: str) -> list[str]:
    """Return the types under which a topic is published or subscribed to."""
    node, topic = ros.node, ros.full(topic)
    ends = [*node.get_publishers_info_by_topic(topic), *node.get_subscriptions_info_by_topic(topic)]
    return sorted({type_name(each) for each in ends})
