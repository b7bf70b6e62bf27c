"""The operator's side of a mission over ROS: watches the orchestrator and asks it for things.

Nothing of rclpy leaves this module: what arrives becomes plain data, and every call has a deadline. The
owner calls `spin` from its own loop; there is no thread.
"""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

from std_msgs.msg import String
from std_srvs.srv import Trigger

from lupin_engine.plugin.profile import Profile, StartRequest
from lupin_engine.ros.adapter.network import Kind, interfaces
from lupin_engine.ros.adapter.node import CallFailure, Qos, RosNode, ServiceCaller
from lupin_engine.ros.bindings.definitions import interface_class
from lupin_engine.ros.messages import read, wire_of, write
from lupin_engine.ros.names import ANSWER_SERVICE, STEPS_TOPIC
from lupin_engine.runtime.record import OpenQuestion, open_questions

_START = "start"
#: How long more of the last steps are waited for, in seconds.
SETTLE_S = 0.3


@dataclass(frozen=True)
class Arrival:
    """A message as plain data, and when it came, in seconds of the monotonic clock."""

    kind: str  #: state, observation or step
    data: dict[str, Any]
    at: float


@dataclass(frozen=True)
class Answer:
    """What the orchestrator said to a request; `reached` is false when it did not say anything in time."""

    accepted: bool
    text: str
    mission_id: str = ""
    reached: bool = True


def _spin(ros: RosNode, seconds: float) -> None:
    """Work for at least `seconds`: a wait that is cut short by a message goes on."""
    until = time.monotonic() + seconds
    while (left := until - time.monotonic()) > 0:
        ros.spin_once(left)


def _call(
    ros: RosNode, caller: ServiceCaller, request: Any, timeout: float, meaning: Callable[[Any], Answer]
) -> Answer:
    """Return what the response of a service means, or why there is none."""
    answers: list[Any] = []
    call = caller.call(request, timeout, answers.append)
    # The call has its own deadline; this one is for a spin that is stuck.
    until = time.monotonic() + timeout + 0.5
    while not answers and time.monotonic() < until and ros.spin_once(0.1):
        pass
    call.cancel()
    if answers and not isinstance(answers[0], CallFailure):
        return meaning(answers[0])
    return Answer(False, answers[0].detail if answers else f"{caller.name}: no answer", reached=False)


def _of_trigger(response: Any) -> Answer:
    return Answer(response.success, response.message)


class Respondent:
    """A node that sees what is asked and answers it, whatever the profile; closed with `close`."""

    def __init__(self) -> None:
        self._ros = RosNode(f"lupin_answer_{os.getpid()}")
        self._newest: dict[str, Any] = {}
        self._ros.subscribe(String, STEPS_TOPIC, Qos.BACKLOG, self._take)

    def _take(self, message: Any) -> None:
        self._newest = json.loads(message.data)

    def asked(self, timeout: float) -> list[OpenQuestion] | None:
        """Return what is asked now; None when no orchestrator has said anything in time."""
        until = time.monotonic() + timeout
        while not self._newest and (left := until - time.monotonic()) > 0:
            self._ros.spin_once(left)
        if not self._newest:
            return None
        _spin(self._ros, SETTLE_S)  # the last steps come in one burst, the oldest first
        age = self._ros.now() - float(self._newest["stamp"])
        return open_questions(self._newest["view"], float(self._newest["time"]) + age)

    def answer(self, choice: str, timeout: float) -> Answer:
        """Answer with a choice."""
        caller = self._ros.service(Trigger, ANSWER_SERVICE.format(choice))
        return _call(self._ros, caller, Trigger.Request(), timeout, _of_trigger)

    def close(self) -> None:
        """Leave the network."""
        self._ros.leave()


class Operator:
    """A node that watches and asks; closed with `close`."""

    def __init__(self, profile: Profile) -> None:
        self._ros = RosNode(f"lupin_operator_{os.getpid()}")
        self._arrived: list[Arrival] = []
        self._wire = wire = wire_of(profile)
        self._start_type = interface_class(wire.start.type)
        self._callers: dict[str, ServiceCaller] = {
            _START: self._ros.service(self._start_type, wire.start.name)
        }
        for name in profile.requests:
            self._callers[name] = self._ros.service(Trigger, wire.requests.format(name))
        # The state is latched with depth 1 by its publisher. A reader of that depth would lose all but the
        # last of the short phases that come in one burst.
        listen = partial(self._ros.subscribe, qos=Qos.BACKLOG)
        for kind, channel in (("state", wire.state), ("observation", wire.outcomes)):
            listen(interface_class(channel.type), channel.name, callback=partial(self._keep_message, kind))
        listen(String, STEPS_TOPIC, callback=lambda m: self._keep("step", json.loads(m.data)))

    def _keep_message(self, kind: str, message: Any) -> None:
        self._keep(kind, read(message))

    def _keep(self, kind: str, data: dict[str, Any]) -> None:
        self._arrived.append(Arrival(kind, data, time.monotonic()))

    def spin(self, seconds: float) -> None:
        """Work for at least `seconds`: a wait that is cut short by a message goes on."""
        _spin(self._ros, seconds)

    def take(self) -> list[Arrival]:
        """Return what has arrived since the last call, in order."""
        arrived, self._arrived = self._arrived, []
        return arrived

    # -- the network ------------------------------------------------------------------------------------

    def nodes(self) -> frozenset[str]:
        """Return the names, without namespace, of all nodes but this one."""
        found = self._ros.node.get_node_names_and_namespaces()
        return frozenset(name for name, _ in found if name != self._ros.name)

    def count(self, name: str) -> int:
        """Return how many nodes have that name, namespaces aside."""
        return sum(1 for found, _ in self._ros.node.get_node_names_and_namespaces() if found == name)

    def is_published(self, topic: str) -> bool:
        """Say whether somebody publishes a topic."""
        return bool(self._ros.node.count_publishers(topic))

    def services(self) -> frozenset[str]:
        """Return the full names of all services that somebody serves."""
        return self._served("service")

    def actions(self) -> frozenset[str]:
        """Return the full names of all actions that somebody serves."""
        return self._served("action")

    def _served(self, kind: Kind) -> frozenset[str]:
        node = self._ros.node
        found = interfaces(node, without=[node.get_fully_qualified_name()])
        return frozenset(i.name for i in found if i.kind == kind and i.producers)

    # -- requests ---------------------------------------------------------------------------------------

    def ready(self) -> bool:
        """Say whether the orchestrator's services can be reached."""
        return all(caller.ready() for caller in self._callers.values())

    def start(self, mission: str, given: Mapping[str, Any], timeout: float) -> Answer:
        """Ask for a mission; fields of the request that are not given mean the mission's own defaults."""
        fields = self._wire.start.request_fields(StartRequest(mission, given))
        request = write(self._start_type.Request(), fields)
        return _call(self._ros, self._callers[_START], request, timeout, self._started)

    def ask(self, name: str, timeout: float) -> Answer:
        """Send an operator's request: abort, pause, resume, ..."""
        return _call(self._ros, self._callers[name], Trigger.Request(), timeout, _of_trigger)

    def _started(self, response: Any) -> Answer:
        answer = self._wire.start.read_answer(read(response))
        return Answer(answer.accepted, answer.reason, answer.mission_id)

    def close(self) -> None:
        """Leave the network; nothing can be asked any more."""
        self._ros.leave()
