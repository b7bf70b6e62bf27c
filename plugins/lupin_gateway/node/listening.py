"""What the gateway itself hears of the robot, to notify people: steps, and diagnostics."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import orjson

from lupin_engine.ros import names
from lupin_gateway.encoding import Sample
from lupin_gateway.guard import HouseRules
from lupin_gateway.hub import Hub, Outbox, Subscriber
from lupin_gateway.shapes import NotCarried

#: Takes a message by its fields.
Take = Callable[[Mapping[str, Any]], None]


class _RobotListener(Subscriber):
    """Takes what a topic says, instead of sending it to a page."""

    def __init__(self, topic: str, take: Take) -> None:
        super().__init__(topic, Outbox(lambda: None))
        self._take = take

    def offer(self, sample: Sample) -> None:
        """Take a message; one that is not as it should be is nobody's notification."""
        try:
            self._take(sample.decode(sample.serialized))
        except (NotCarried, ValueError, TypeError, KeyError, AttributeError):
            return

    def complain(self, problem: str) -> None:
        """There is no page that could be told."""


def listen(hub: Hub, rules: HouseRules) -> None:
    """Begin to notify people of what the robot tells; on the loop."""
    people, clocks = rules.people, rules.clocks

    def take_step(message: Mapping[str, Any]) -> None:
        people.steps.take(orjson.loads(message["data"]))

    def take_diagnostics(message: Mapping[str, Any]) -> None:
        for status in message["status"]:
            people.nodes.take(status, clocks.wall(), clocks.steady())

    hub.subscribe(_RobotListener(names.STEPS_TOPIC, take_step), "std_msgs/msg/String")
    hub.subscribe(
        _RobotListener(names.DIAGNOSTICS_TOPIC, take_diagnostics), "diagnostic_msgs/msg/DiagnosticArray"
    )
