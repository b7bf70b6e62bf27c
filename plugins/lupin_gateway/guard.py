"""Enforces roles, limits and the stop: `GatewayRules` for the whole gateway, and a `Guard` per connection.

A guard decides whether an operation is allowed, passes on its page's stop, and writes commands to the audit
log. Nothing here blocks; all of it runs on the event loop. `session` asks the guard, `server` calls `tick`.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any, TypedDict

from lupin_engine.plugin import Access, Progress
from lupin_gateway import protocol
from lupin_gateway.access import (
    STOP_TOPIC,
    AccessControl,
    Allowance,
    AllowList,
    NotAdmitted,
    Use,
    UserRole,
    Visitor,
)
from lupin_gateway.audit import AuditLog, Repetitions, command_line, login_line
from lupin_gateway.entry.attempts import WrongAttempts, delay, is_written_down
from lupin_gateway.entry.invitations import Invitations
from lupin_gateway.motion import BASE_TOPIC, TAKE_BASE, MotionGate
from lupin_gateway.people import ACKNOWLEDGE, COMMANDS, HERE, NOTIFICATIONS_TOPIC, PEOPLE_TOPIC, People
from lupin_gateway.stop import KeptStops, OnLinkLost, StopArbiter, stop_of

#: Which stops are engaged, and the link (JSON in a std_msgs/String); the service that resets one by name.
STOPS_TOPIC, RESET_STOP = "/lupin/hmi/stops", "/lupin/hmi/reset_stop"
#: What clients ask about the network. Parameters of nodes, which may have passwords, are not for viewers.
_ASKED = (
    *("get_ros_version", "get_time", "interfaces", "message_details", "node_details", "nodes"),
    *("topics", "topic_type", "topics_for_type", "publishers", "subscribers"),
    *("services", "service_type", "services_for_type", "service_node", "service_providers"),
    *("service_request_details", "service_response_details", "action_servers", "action_type"),
    *("action_goal_details", "action_result_details", "action_feedback_details"),
)
#: What the gateway itself has for pages.
OWN_ACCESS = Access(
    viewer=(
        *(STOP_TOPIC, STOPS_TOPIC, BASE_TOPIC, PEOPLE_TOPIC, NOTIFICATIONS_TOPIC, HERE),
        *(f"/rosapi/{name}" for name in _ASKED),
    ),
    operator=(RESET_STOP, TAKE_BASE, COMMANDS, ACKNOWLEDGE, "/rosapi/*", "*/list_parameters"),
)
#: Who the gateway itself is in the audit log.
_GATEWAY = {"who": "gateway", "role": "", "from": "", "page": ""}
#: A pause for a lost link that reaches nobody is asked for again so many seconds later.
PAUSE_AGAIN_S = 1.0
#: A frame that says stop is shorter than this, in bytes: a client that is too fast has no longer one read.
STOP_FRAME = 4_000


@dataclass(frozen=True)
class RuleOutputs:
    """The rules' effects on ROS: publish the stop and the list of stops, request a pause, save the stops.

    `publish_base` publishes who has the base, `halt` ends all motion that pages have started.
    """

    publish_stop: Callable[[bool], None]
    publish_stops: Callable[[str], None]
    pause: Callable[[Callable[[Any], None]], None]
    keep: Callable[[KeptStops], object]
    publish_base: Callable[[str], None] = lambda _: None
    halt: Callable[[], None] = lambda: None


class RobotRecord(TypedDict):
    """What a robot does, for a list of them: the mission's state, what stops it, and its open questions.

    `stops` are names of pages, and sources of other stops. Not `heard`: its orchestrator is silent.
    """

    robot: str
    heard: bool
    lifecycle: str
    mission: str
    target: str
    paused: bool
    stops: list[str]
    questions: list[str]


@dataclass(frozen=True)
class ClockPair:
    """A steady clock and the wall clock (UNIX), in seconds."""

    steady: Callable[[], float]
    wall: Callable[[], float]


class GatewayRules:
    """The state that all connections share: access, stops, motion, people, and the audit log."""

    def __init__(
        self,
        access: AccessControl,
        allowed: AllowList,
        stops: StopArbiter,
        log: AuditLog | None,
        clocks: ClockPair,
        outputs: RuleOutputs,
    ) -> None:
        self.access = access
        self.allowed = allowed
        self.stops = stops
        self.clocks = clocks
        self.people = People()
        self.motion = MotionGate()
        #: The mission's state that was published last.
        self.progress = Progress()
        self._base = ""
        #: Links by which people log in; None: there are none.
        self.invitations: Invitations | None = None
        #: Logs what is wrong for a while.
        self.warn: Callable[[str], object] = lambda _: None
        self._log = log
        self._outputs = outputs
        self._connections = 0
        self._wrong = WrongAttempts()
        self._published: tuple[bool, str] | None = None
        self._kept = stops.kept()
        #: When the pause for a lost link is asked for again, which has reached nobody.
        self._pause_at: float | None = None

    def enter(self, visitor: Visitor, address: str, browser: str) -> Guard:
        """Register a client that has connected; its guard's `leave` must be called."""
        self._connections += 1
        guard = Guard(self, self._connections, visitor, address, browser)
        self.publish_changes()
        return guard

    def refused_entry(self, address: str, refused: NotAdmitted) -> float:
        """Count and log a refused client; return how many seconds its answer is to wait."""
        if not refused.wrong:
            return 0.0
        times = self._wrong.count(address, self.clocks.steady())
        if is_written_down(times):
            self.write_login("", address, False, str(refused), times=times)
        return delay(times)

    def use_invitation(self, code: str) -> str:
        """Return the name that a one-time code was made for; the code is used up.

        Raises:
            NotAdmitted: the code is unknown, used or expired.
        """
        name = self.invitations.use(code, self.clocks.wall()) if self.invitations else ""
        if not name:
            text = "this link was used already, or is older than 10 minutes; ask for a new one (lupin invite)"
            raise NotAdmitted(401, text, wrong=True)
        return name

    def write_login(self, who: str, address: str, accepted: bool, answer: str, **more: int) -> None:
        """Log a login, a refused one, or a connection that is ended."""
        if self._log is not None:
            self._log.write({**login_line(self.clocks.wall(), who, address, accepted, answer), **more})

    def tick(self) -> None:
        """Publish the stop, and act on a lost link; to be called `PUBLISH_HZ` times a second.

        A pause that no orchestrator answers is requested again every `PAUSE_AGAIN_S` while the link is lost.
        """
        now = self.clocks.steady()
        decision = self.stops.link_lost(now)
        again = self._pause_at is not None and now >= self._pause_at and self.stops.link_is_lost
        if decision is OnLinkLost.PAUSE or again:
            self._pause_at = None
            self._outputs.pause(partial(self._paused, is_first=not again))
        elif decision is OnLinkLost.STOP:
            self._decided("stop", {"accepted": True})
        self._outputs.publish_stop(self.stops.stopped)
        self.people.nodes.look(self.clocks.wall(), self.clocks.steady())
        self.publish_changes()

    def _paused(self, answer: Any, is_first: bool) -> None:
        """Take the answer to a pause; without one, ask again: the orchestrator may be starting."""
        is_answer = isinstance(answer, Mapping)
        if not is_answer:
            self._pause_at = self.clocks.steady() + PAUSE_AGAIN_S
        if is_answer or is_first:
            self._decided("pause", answer)

    def _decided(self, what: str, answer: Any) -> None:
        recorded = answer if isinstance(answer, Mapping) else str(getattr(answer, "text", answer))
        self.write(_GATEWAY, "on_link_lost", what, {}, recorded)

    def hear_stops(self, sources: Iterable[str]) -> None:
        """Take the names of the engaged sources of the robot's stop."""
        self.motion.hear_stops(sources)
        self.settle_motion()

    def settle_motion(self) -> None:
        """Evaluate the motion gate, end motion that is no longer allowed, publish who has the base."""
        driver = self.motion.taken_by
        if self.motion.settle(self.stops.stopped, self.clocks.steady()):
            self._outputs.halt()
        if driver and not self.motion.taken_by:
            self.write(_GATEWAY, "base_taken_back", driver, {}, {"accepted": True, **self.motion.state()})
        state = json.dumps(self.motion.state())
        if state != self._base:
            self._base = state
            self._outputs.publish_base(state)

    def summary(self, robot: str) -> RobotRecord:
        """Return what the robot does, what stops it, and what it asks, for a list of robots."""
        now, mission = self.clocks.steady(), self.progress
        pages = [stop["name"] for stop in self.stops.state(now)["stops"]]
        others = [source for source in self.motion.state()["stops"] if not (source == "pages" and pages)]
        return {
            "robot": robot,
            "heard": not self.motion.is_silent(now),
            "lifecycle": mission.lifecycle,
            "mission": mission.mission,
            "target": mission.target,
            "paused": mission.paused,
            "stops": [*pages, *others],
            "questions": list(self.people.steps.asked.values()),
        }

    def give_back_base(self, page: str) -> None:
        """Take the base from a page and end its motion; does nothing where that page has not taken it."""
        if page and self.motion.taken_by == page:
            self.motion.taken_by = ""
            self._outputs.halt()
            self.settle_motion()

    def publish_changes(self) -> None:
        """Publish and save all changes; the stop goes first."""
        now, stopped = self.clocks.steady(), self.stops.stopped
        state = self.stops.state(now)
        stops = [{**stop, "age": 0.0} for stop in state["stops"]]
        published = (stopped, json.dumps({**state, "stops": stops}))
        before, self._published = self._published, published
        if before is None or before[0] is not stopped:
            self._outputs.publish_stop(stopped)
        self.settle_motion()
        if before != published:
            self._outputs.publish_stops(json.dumps(state))
        if (kept := self.stops.kept()) != self._kept:
            self._kept = kept
            self._outputs.keep(kept)
        self.people.stops.take([stop["name"] for stop in state["stops"]], self.clocks.wall())
        self.people.publish_changes()

    def write(self, who: Mapping[str, str], what: str, name: str, sent: Any, answer: Any) -> None:
        """Write a line of the audit log."""
        line = command_line(self.clocks.wall(), who, what, name, sent, answer)
        if self._log is not None:
            self._log.write(line)
        self.people.commanded(line)


class Guard:
    """The permissions, limits and stop of one connection."""

    def __init__(
        self, rules: GatewayRules, number: int, visitor: Visitor, address: str, browser: str
    ) -> None:
        self._rules = rules
        self._number = number
        self.visitor = visitor
        self._allowance = Allowance()
        self._repetitions = Repetitions()
        #: The name of the connection, by which its stop is reset.
        self.name = f"{visitor.name}-{number}"
        self._who = {"who": visitor.name, "role": visitor.role.word, "from": address, "page": self.name}
        self._was_stopped = False
        operator = visitor.role >= UserRole.OPERATOR
        rules.stops.joined(number, self.name, operator=operator, browser=browser)
        rules.people.presence.joined(
            number, self.name, visitor.name, visitor.role.word, browser, rules.clocks.wall()
        )

    # -- what it may ----------------------------------------------------------------------------------------

    def frame_refusal(self, frame: str | bytes) -> str:
        """Return why a frame is dropped unread; '' where it is read. Short frames pass the rate limit."""
        size = len(frame) if isinstance(frame, bytes) or frame.isascii() else len(frame.encode())
        refused = self._allowance.frame(size)
        if not refused and size > STOP_FRAME:
            return self._allowance.long_frame(size, self._rules.clocks.steady())
        return refused

    def refusal(self, operation: protocol.Operation | protocol.BadFrame, subscriptions: int) -> str:
        """Return why an operation is not carried out; '' where it is. `subscriptions` are those it has.

        Frames that cannot be parsed count as operations. A stop is never counted or refused; a release only
        where the token has expired.
        """
        if isinstance(operation, protocol.PublishMessage) and operation.topic == STOP_TOPIC:
            return (
                self.visitor.has_expired(self._rules.clocks.wall()) if not stop_of(operation.message) else ""
            )
        if too_fast := self._allowance.operation(self._rules.clocks.steady()):
            return too_fast
        if isinstance(operation, protocol.BadFrame):
            return ""
        refused = self.visitor.has_expired(self._rules.clocks.wall()) or self._name_refusal(operation)
        refused = refused or self._motion_refusal(operation)
        if refused and (named := _command(operation)) and not self._is_repeated(operation):
            self._rules.write(self._who, *named, refused)
        if not refused and isinstance(operation, protocol.SubscribeTopic):
            return self._allowance.subscription(subscriptions)
        return refused

    def _name_refusal(self, operation: protocol.Operation) -> str:
        match operation:
            case protocol.SubscribeTopic(topic=name):
                use = Use.SUBSCRIBE
            case protocol.PublishMessage(topic=name) | protocol.Advertise(topic=name):
                use = Use.PUBLISH
            case protocol.CallService(service=name):
                use = Use.CALL
            case protocol.SendGoal(action=name) | protocol.CancelGoalById(action=name):
                use = Use.ACTION
            case _:
                return ""
        return self.use_refusal(use, name)

    def use_refusal(self, use: Use, name: str) -> str:
        """Return why the client may not use a name so, or know of it; '' where it may. From every thread."""
        return self._rules.allowed.refusal(self.visitor, use, name)

    def _motion_refusal(self, operation: protocol.Operation) -> str:
        """Return why an operation may not move the robot; '' where it may, or moves nothing."""
        name = self._rules.allowed.moving.moved_by(operation)
        if not name:
            return ""
        self._rules.settle_motion()
        reason = self._rules.motion.refusal(self.name)
        return reason and f"{name} refused: {reason}"

    # -- what it does -----------------------------------------------------------------------------------

    def report_stop(self, message: Any) -> str:
        """Report the page's stop to the arbiter; return why it is refused, '' where it is not."""
        rules, stopped = self._rules, stop_of(message)
        refused = rules.stops.report(self._number, stopped, rules.clocks.steady())
        rules.publish_changes()
        if stopped is not self._was_stopped:
            rules.write(self._who, "publish", STOP_TOPIC, {"data": stopped}, refused or None)
        self._was_stopped = stopped
        return refused

    def serve(self, service: str, arguments: Any) -> Mapping[str, Any] | None:
        """Return the response of a service that the gateway itself offers; None for every other service."""
        own = {
            RESET_STOP: self._reset_stop,
            HERE: self._is_here,
            COMMANDS: self._rules.people.commands,
            ACKNOWLEDGE: self._acknowledge,
            TAKE_BASE: self._take_base,
        }
        if self._rules.motion.is_command(service):
            self._rules.give_back_base(self._rules.motion.taken_by)
        found = own.get(service)
        return found and found(arguments)

    def _is_here(self, arguments: Any) -> Mapping[str, Any]:
        """Record which view the page shows; return the name of its connection."""
        view = arguments.get("view") if isinstance(arguments, Mapping) else None
        page = self._rules.people.presence.shows(self._number, view if isinstance(view, str) else "")
        self._rules.people.publish_changes()
        return {"page": page}

    def _acknowledge(self, arguments: Any) -> Mapping[str, Any]:
        people = self._rules.people
        answer = people.acknowledge(arguments, self.name, self._rules.clocks.wall())
        people.publish_changes()
        return answer

    def _reset_stop(self, arguments: Any) -> Mapping[str, Any]:
        """Release a stop by its name."""
        given = arguments.get("name") if isinstance(arguments, Mapping) else None
        name = given if isinstance(given, str) else ""
        refused = self._rules.stops.reset(name)
        self._rules.publish_changes()
        return {"success": not refused, "message": refused or f"the stop of {name} is released"}

    def _take_base(self, arguments: Any) -> Mapping[str, Any]:
        """Take the base of a mission that is held, or give it back with `take: false`."""
        if isinstance(arguments, Mapping) and arguments.get("take") is False:
            self._rules.give_back_base(self.name)
            return {"success": True, "message": f"{self.name} has not taken the base"}
        self._rules.settle_motion()
        refused = self._rules.motion.take(self.name)
        self._rules.settle_motion()
        return {"success": not refused, "message": refused or f"{self.name} has the base"}

    def _is_repeated(self, operation: protocol.Operation) -> bool:
        """Return whether a publication repeats the last one: only the first is logged."""
        if not isinstance(operation, protocol.PublishMessage):
            return False
        now = self._rules.clocks.steady()
        return not self._repetitions.is_command(operation.topic, operation.message, now)

    def published(self, operation: protocol.PublishMessage) -> None:
        """Log a publication, unless it repeats the last one."""
        if not self._is_repeated(operation):
            self._rules.write(self._who, "publish", operation.topic, operation.message, None)

    def answered(self, operation: protocol.Operation, answer: Any) -> None:
        """Log a command with its answer: fields by name, or an error. Reading calls are not logged."""
        if named := _command(operation):
            what, name, _ = named
            is_call = what == "call_service"
            reads = is_call and (
                name == COMMANDS or self._rules.allowed.least(Use.CALL, name) is UserRole.VIEWER
            )
            if not reads:
                self._rules.write(self._who, *named, answer)
                self._rules.people.publish_changes()

    def log_disconnect(self, reason: str) -> None:
        """Log that the server ends this connection."""
        self._rules.write_login(self.visitor.name, self._who["from"], False, f"{self.name}: {reason}")

    def leave(self) -> None:
        """The client has disconnected: give back the base; its stop stays engaged."""
        self._rules.give_back_base(self.name)
        self._rules.stops.gone(self._number, self._rules.clocks.steady())
        self._rules.people.presence.gone(self._number)
        self._rules.publish_changes()


def _command(operation: protocol.Operation) -> tuple[str, str, Any] | None:
    """Return kind, name and payload of a command for the log; None for an operation that commands nothing."""
    match operation:
        case protocol.CallService(service=name, arguments=sent):
            return "call_service", name, sent
        case protocol.PublishMessage(topic=name, message=sent):
            return "publish", name, sent
        case protocol.SendGoal(action=name, arguments=sent):
            return "send_action_goal", name, sent
        case protocol.CancelGoalById(action=name, id=sent):
            return "cancel_action_goal", name, {"id": sent}
        case _:
            return None
