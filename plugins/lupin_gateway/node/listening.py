"""Subscribes the gateway to steps, diagnostics and mission state, for notifications and the motion gate."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import orjson

from lupin_engine.plugin import Profile
from lupin_gateway.encoding import Sample
from lupin_gateway.guard import GatewayRules
from lupin_gateway.hub import Hub, Outbox, Subscriber
from lupin_gateway.motion import MissionLevel
from lupin_gateway.shapes import NotCarried
from lupin_ros.service import names

#: Takes a message by its fields.
Take = Callable[[Mapping[str, Any]], None]


class _RobotListener(Subscriber):
    """A subscriber that calls a function for each message."""

    def __init__(self, topic: str, take: Take) -> None:
        super().__init__(topic, Outbox(lambda: None))
        self._take = take

    def offer(self, sample: Sample) -> None:
        """Pass on a decoded message; one that cannot be decoded or has wrong fields is dropped."""
        try:
            self._take(sample.decode(sample.serialized))
        except (NotCarried, ValueError, TypeError, KeyError, AttributeError):
            return

    def complain(self, problem: str) -> None:
        """Ignore the problem: there is no page to report it to."""


def listen(hub: Hub, rules: GatewayRules, profile: Profile) -> None:
    """Begin to listen; on the event loop."""
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


def _take_state(rules: GatewayRules, profile: Profile, message: Mapping[str, Any]) -> None:
    """Pass the mission's state to the motion gate: whether it is active, held, or stopped."""
    assert profile.wire is not None
    state = rules.progress = profile.wire.read_state(message)
    alarms = (name for name, flag in profile.terminal.flags.items() if flag.alarm)
    level = MissionLevel(
        state.lifecycle,
        under_way=state.lifecycle not in profile.stages.without_mission,
        held=state.paused,
        stopped=any(state.flags.get(name) for name in alarms),
    )
    rules.motion.hear_mission(level, rules.clocks.steady())
    rules.settle_motion()
