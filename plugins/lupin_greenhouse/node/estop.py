"""Subscribes to all sources of the emergency stop, and reports their combined state; see `stops`."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from std_msgs.msg import Bool

from lupin_greenhouse.stops import (
    HMI,
    HMI_TOPIC,
    PAGES,
    PAGES_TOPIC,
    QUIET_S,
    ROBOT,
    StopFold,
    StopState,
    rules,
)
from lupin_ros.adapter import Qos, Repeater, RosNode

#: Looks within the shortest time after which something is over.
LOOKS = 8


class StopListener:
    """Feeds the stop's topics to `StopFold`; nodes that move something call it to learn whether they may.

    It uses real time, also in simulation, and counts timer ticks instead of seconds: after a block of its own
    the node reads waiting messages before it counts on.
    """

    def __init__(
        self, ros: RosNode, topic: str, timeout: float, changed: Callable[[StopState], None]
    ) -> None:
        """Call `changed` with each new state, and when a source is first heard; if it raises, it is called
        again.

        `topic` is the robot's own emergency stop, '' for the node that publishes it. Once that was periodic,
        silence for `timeout` s counts as engaged; 0: never.
        """
        self._ros = ros
        self._changed = changed
        self._fold = StopFold(rules(timeout if topic else None))
        topics = {**({ROBOT: topic} if topic else {}), PAGES: PAGES_TOPIC, HMI: HMI_TOPIC}
        self._topics = {source: ros.full(name) for source, name in topics.items()}
        self._heard: set[str] = set()
        self._closed = False
        self._now = 0.0
        self._period = min(timeout or QUIET_S, QUIET_S) / LOOKS
        self._looking = Repeater(ros.steady_timer, self._period, self._look)
        self.state = StopState()
        self._reported: StopState | None = self.state
        for source, name in self._topics.items():
            qos = Qos.LATCHED if source == PAGES else Qos.EVENT
            ros.subscribe(Bool, name, qos, partial(self._on_message, source))

    @property
    def engaged(self) -> bool:
        """Whether the robot is stopped."""
        return self.state.engaged

    @property
    def sources(self) -> tuple[str, ...]:
        """The names of the engaged sources."""
        return self.state.sources

    @property
    def reason(self) -> str:
        """Why nothing may move, with the topics that say so; '' while it may."""
        said: dict[str, list[str]] = {}
        for name in self.state.sources:
            how = "silent" if name in self.state.silent else "engaged"
            said.setdefault(how, []).append(self._topics[name])
        stated = " and ".join(f"{how} ({', '.join(topics)})" for how, topics in said.items())
        return stated and f"the emergency stop is {stated}"

    def close(self) -> None:
        """Stop reporting."""
        self._closed = True
        self._looking.stop()

    def _on_message(self, source: str, message: Bool) -> None:
        if self._closed:
            return
        # The graph is asked only where the answer counts.
        counts = message.data or source in self.state.sources
        writers = self._writers(self._topics[source]) if counts else frozenset[str]()
        self._fold.heard(source, message.data, writers, self._now + self._period)
        is_first = source not in self._heard
        self._heard.add(source)
        self._report(is_first)

    def _writers(self, topic: str) -> frozenset[str]:
        found = self._ros.node.get_publishers_info_by_topic(topic)
        return frozenset(bytes(one.endpoint_gid).hex() for one in found)

    def _look(self) -> None:
        self._now += self._period
        self._fold.look(self._now)
        self._report(False)

    def _report(self, is_first: bool) -> None:
        self.state = self._fold.state
        if self._fold.waits:
            self._looking.start()
        else:
            self._looking.stop()
        if is_first or self.state != self._reported:
            self._reported = None  # if it raises it is called again, with the next message or look
            self._changed(self.state)
            self._reported = self.state
