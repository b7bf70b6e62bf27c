"""The operator's client of the orchestrator over ROS: receives its topics, and sends requests and commands.

Nothing of rclpy leaves this module: messages become plain data, and every call has a deadline. The owner
calls `spin` from its own loop; there is no thread.
"""

from __future__ import annotations

import getpass
import json
import os
import socket
import time
import uuid
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property, partial
from types import MappingProxyType
from typing import Any

from std_msgs.msg import String
from std_srvs.srv import Trigger

from lupin_engine.errors import LupinError, UsageError
from lupin_engine.plugin import START_VERB, Profile, StartRequest
from lupin_engine.runtime import APART_S, STALE
from lupin_ros.adapter.network import Kind, interfaces, other_participants
from lupin_ros.adapter.node import CallFailure, Qos, RosNode, ServiceCaller
from lupin_ros.interfaces.definitions import interface_class
from lupin_ros.launch.published import Published
from lupin_ros.service.messages import read, wire_of, write
from lupin_ros.service.names import (
    COMMAND_SERVICE,
    COMMAND_TYPE,
    MISSIONS_TOPIC,
    POSSIBLE_TOPIC,
    STEPS_TOPIC,
)

_START = "start"
#: How long more of the last steps are waited for, in seconds.
SETTLE_S = 0.3
#: How long the orchestrator may take to be found, in seconds. Among ten participants that takes up to 3.5 s:
#: what a peer says of its endpoints before it is known itself, it repeats once a second only.
FOUND_S = 10.0
#: How long it may take to answer a command each time, in seconds.
ANSWER_S = 3.0
#: How often a condition is looked at while nothing arrives, in seconds.
POLL_S = 0.1


@dataclass(frozen=True)
class Arrival:
    """A message as plain data, and when it came, in seconds of the monotonic clock."""

    kind: str  #: state, observation or step
    data: dict[str, Any]
    at: float


@dataclass(frozen=True)
class Answer:
    """The orchestrator's answer to a request, or why there is none.

    `reached` is false without an answer in time, `found` is false where there is no orchestrator.
    """

    accepted: bool
    text: str
    mission_id: str = ""
    reached: bool = True
    found: bool = True
    code: str = ""


class Commander:
    """A node that commands the orchestrator, whatever its profile; closed with `close`."""

    def __init__(self) -> None:
        self._ros = RosNode(f"lupin_operator_{os.getpid()}")

    @cached_property
    def _commands(self) -> ServiceCaller:
        return self._ros.service(interface_class(COMMAND_TYPE), COMMAND_SERVICE)

    def command(
        self,
        verb: str,
        mission: str = "",
        request: Mapping[str, Any] = MappingProxyType({}),
        timeout: float = ANSWER_S,
    ) -> Answer:
        """Send a command; without an answer in `timeout` seconds it is sent once more.

        A server is waited for up to `FOUND_S`. A command that is refused as stale is sent again, too: from
        the second one the orchestrator learns the offset of this computer's clock. Both have the same id, so
        it is carried out once.

        Raises:
            UsageError: the interface of commands is not installed.
        """
        fields = {"verb": verb, "mission": mission, "request": json.dumps(dict(request))}
        who = {"command_id": str(uuid.uuid4()), "by": operator_name()}
        try:
            asked = write(interface_class(COMMAND_TYPE).Request(), {**fields, **who})
        except LupinError as problem:
            raise UsageError(f"{problem}; `make environment` builds it, or colcon") from None
        if not self._until(self._commands.ready, FOUND_S):
            return Answer(False, f"{COMMAND_SERVICE}: no server", reached=False, found=False)
        answer = self._call(self._commands, asked, timeout, _of_command)
        if answer.code == STALE:
            self.spin(APART_S)
        elif answer.reached:
            return answer
        return self._call(self._commands, asked, timeout, _of_command)

    def spin(self, seconds: float) -> None:
        """Work for at least `seconds`: a wait that is cut short by a message goes on."""
        self._until(lambda: False, seconds)

    def _until(self, condition: Callable[[], Any], seconds: float) -> bool:
        """Spin until a condition holds, at most so long; return whether it does."""
        until = time.monotonic() + seconds
        while not condition() and (left := until - time.monotonic()) > 0:
            if not self._ros.spin_once(min(left, POLL_S)):
                break
        return bool(condition())

    def _call(
        self, caller: ServiceCaller, request: Any, timeout: float, meaning: Callable[[Any], Answer]
    ) -> Answer:
        """Call a service; return its response read as an answer, or why there is none."""
        answers: list[Any] = []
        call = caller.call(request, timeout, answers.append)
        # The call has its own deadline; this one is for a spin that is stuck.
        self._until(lambda: answers, timeout + 0.5)
        call.cancel()
        if answers and not isinstance(answers[0], CallFailure):
            return meaning(answers[0])
        return Answer(False, answers[0].detail if answers else f"{caller.name}: no answer", reached=False)

    def is_published(self, topic: str) -> bool:
        """Return whether a node publishes a topic."""
        return bool(self._ros.count_publishers(topic))

    def close(self) -> None:
        """Destroy the node; no call is possible any more."""
        self._ros.leave()


def operator_name() -> str:
    """Return the name of the operator at this terminal: the user and the computer."""
    try:
        user = getpass.getuser()
    except (KeyError, OSError):  # a container's user without a name
        user = str(os.getuid())
    return f"{user}@{socket.gethostname()}"


def _of_trigger(response: Any) -> Answer:
    return Answer(response.success, response.message)


def _of_command(response: Any) -> Answer:
    return Answer(response.accepted, response.message, response.mission_id, code=response.code)


class Attendant(Commander, Published):
    """A commander that also receives the orchestrator's steps, available requests and missions."""

    def __init__(self) -> None:
        Commander.__init__(self)
        Published.__init__(self)
        self._ros.subscribe(String, STEPS_TOPIC, Qos.BACKLOG, self._take_step)
        self._ros.subscribe(String, POSSIBLE_TOPIC, Qos.LATCHED, self._take_possible)
        self._ros.subscribe(String, MISSIONS_TOPIC, Qos.LATCHED, self._take_missions)

    def _take_step(self, message: Any) -> None:
        step = json.loads(message.data)
        if self.steps and self.steps[-1].get("boot") != step.get("boot"):
            self.steps.clear()  # the orchestrator was started again
        self.steps.append(step)

    def _take_possible(self, message: Any) -> None:
        self.possible = json.loads(message.data)

    def _take_missions(self, message: Any) -> None:
        self.offer = json.loads(message.data)

    def hear(self) -> bool:
        """Wait for the orchestrator's last steps; return whether they came.

        They come in one burst, the oldest first, which takes time on a busy machine: the wait ends with the
        step of the last record of available requests.
        """
        if not self._until(lambda: self.steps, FOUND_S):
            return False
        self.spin(SETTLE_S)
        self._until(self._is_recent, ANSWER_S)
        return True

    def _is_recent(self) -> bool:
        newest, possible = self.steps[-1], self.possible
        same = newest.get("boot") == possible.get("boot")
        return same and bool(newest["step"]["sequence"] >= possible["sequence"])

    def hear_missions(self) -> bool:
        """Wait for the mission catalogue; return whether it came."""
        return self._until(lambda: self.missions, FOUND_S)

    def is_there(self) -> bool:
        """Return whether an orchestrator is on the network; a killed one still is for some seconds."""
        return self.is_published(STEPS_TOPIC)


class Operator(Commander):
    """A node that follows a mission and sends requests; closed with `close`."""

    def __init__(self, profile: Profile) -> None:
        super().__init__()
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

    def take(self) -> list[Arrival]:
        """Return the arrivals since the last call, in order."""
        arrived, self._arrived = self._arrived, []
        return arrived

    # -- the network ------------------------------------------------------------------------------------

    def nodes(self) -> frozenset[str]:
        """Return the names of this robot's nodes but this one."""
        return frozenset(name for name in self._robots_nodes() if name != self._ros.name)

    def strangers(self) -> int:
        """Return how many participants are known but this one."""
        return other_participants(self._ros.node)

    def count(self, name: str) -> int:
        """Return how many nodes of this robot have that name."""
        return self._robots_nodes().count(name)

    def _robots_nodes(self) -> list[str]:
        """Return the names of all nodes of the namespace; in the root of those in none."""
        here = self._ros.namespace or "/"
        return [name for name, space in self._ros.node.get_node_names_and_namespaces() if space == here]

    def services(self) -> frozenset[str]:
        """Return the names, without this robot's namespace, of its services that a node serves."""
        return self._served("service")

    def actions(self) -> frozenset[str]:
        """Return the names, without this robot's namespace, of its actions that a node serves."""
        return self._served("action")

    def _served(self, kind: Kind) -> frozenset[str]:
        node = self._ros.node
        found = interfaces(node, without=[node.get_fully_qualified_name()])
        served = (i.name for i in found if i.kind == kind and i.producers)
        here = self._ros.namespace
        return frozenset(name[len(here) :] for name in served if name.startswith(f"{here}/"))

    # -- requests ---------------------------------------------------------------------------------------

    def ready(self) -> bool:
        """Return whether the orchestrator's services can be reached."""
        return all(caller.ready() for caller in self._callers.values())

    def start(
        self, mission: str, given: Mapping[str, Any], timeout: float, *, any_field: bool = False
    ) -> Answer:
        """Ask for a mission; fields of the request that are not given mean the mission's own defaults.

        The profile's message has its own fields only, none of them with a unit, and an empty one is not
        given: for `any_field` it is commanded.
        """
        if any_field:
            return self.command(START_VERB, mission, given, timeout)
        fields = self._wire.start.request_fields(StartRequest(mission, given))
        request = write(self._start_type.Request(), fields)
        return self._call(self._callers[_START], request, timeout, self._started)

    def ask(self, name: str, timeout: float) -> Answer:
        """Send an operator's request: abort, pause, resume, ...; KeyError for none of the profile's."""
        return self._call(self._callers[name], Trigger.Request(), timeout, _of_trigger)

    def _started(self, response: Any) -> Answer:
        answer = self._wire.start.read_answer(read(response))
        return Answer(answer.accepted, answer.reason, answer.mission_id)
