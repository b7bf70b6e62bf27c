"""What the gateway hears of the robot: steps and diagnostics, to notify people, and who has the base."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import orjson

from lupin_engine.plugin import Profile
from lupin_gateway.encoding import Sample
from lupin_gateway.guard import HouseRules
from lupin_gateway.hub import Hub, Outbox, Subscriber
from lupin_gateway.motion import MissionLevel
from lupin_gateway.shapes import NotCarried
from lupin_ros.service import names

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


def listen(hub: Hub, rules: HouseRules, profile: Profile) -> None:
    """Begin to hear the robot; on the loop."""
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
    if (wire := profile.wire) is not None:
        hub.subscribe(_RobotListener(wire.state.name, partial(_take_state, rules, profile)), wire.state.type)


def _take_state(rules: HouseRules, profile: Profile, message: Mapping[str, Any]) -> None:
    """Take where the mission stands: whether it has the base, is held, or is stopped."""
    assert profile.wire is not None
    told = profile.wire.read_state(message)
    alarms = (name for name, flag in profile.terminal.flags.items() if flag.alarm)
    level = MissionLevel(
        told.lifecycle,
        under_way=told.lifecycle not in profile.stages.without_mission,
        held=told.paused,
        stopped=any(told.flags.get(name) for name in alarms),
    )
    rules.motion.hear_mission(level, rules.clocks.steady())
    rules.settle_motion()
