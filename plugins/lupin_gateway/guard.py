"""What stands between pages and the robot: the house rules of all connections, and the guard of each.

A guard says what its client may do, keeps its stop, and writes down its commands. Nothing here waits.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

from lupin_engine.plugin import Access
from lupin_gateway import protocol
from lupin_gateway.audit import AuditLog, Repetitions, command_line, login_line
from lupin_gateway.doors import STOP_TOPIC, Allowance, AllowList, Doors, NotAdmitted, Use, UserRole, Visitor
from lupin_gateway.entry.attempts import WrongAttempts, delay, is_written_down
from lupin_gateway.entry.invitations import Invitations
from lupin_gateway.motion import BASE_TOPIC, TAKE_BASE, MotionGate
from lupin_gateway.people import ACKNOWLEDGE, COMMANDS, HERE, NOTIFICATIONS_TOPIC, PEOPLE_TOPIC, People
from lupin_gateway.stop import KeptStops, OnLinkLost, StopArbiter, stop_of

#: Which stops are engaged, and the link (JSON in a std_msgs/String); the service that resets one by name.
STOPS_TOPIC, RESET_STOP = "/lupin/hmi/stops", "/lupin/hmi/reset_stop"
#: What pages ask about the network. Parameters of nodes, which may have passwords, are not for viewers.
_ASKED = ("action_servers", "action_type", "get_time", "message_details", "nodes", "service_type", "services")
#: What the gateway itself has for pages.
OWN_ACCESS = Access(
    viewer=(
        *(STOP_TOPIC, STOPS_TOPIC, BASE_TOPIC, PEOPLE_TOPIC, NOTIFICATIONS_TOPIC, HERE),
        *(f"/rosapi/{name}" for name in (*_ASKED, "topic_type", "topics")),
    ),
    operator=(RESET_STOP, TAKE_BASE, COMMANDS, ACKNOWLEDGE, "/rosapi/*"),
)
#: Who the gateway itself is in the audit log.
_GATEWAY = {"who": "gateway", "role": "", "from": "", "page": ""}
#: A pause for a lost link that reaches nobody is asked for again so many seconds later.
PAUSE_AGAIN_S = 1.0
#: A frame that says stop is shorter than this, in bytes: a client that is too fast has no longer one read.
STOP_FRAME = 4_000


@dataclass(frozen=True)
class Hands:
    """What the rules do to the robot: tell it the stop, tell pages which stops there are, ask for a pause.

    `tell_base` tells pages who has the base, `halt` ends what pages drive.
    """

    tell_stop: Callable[[bool], None]
    tell_state: Callable[[str], None]
    pause: Callable[[Callable[[Any], None]], None]
    keep: Callable[[KeptStops], object]
    tell_base: Callable[[str], None] = lambda _: None
    halt: Callable[[], None] = lambda: None


@dataclass(frozen=True)
class TwoClocks:
    """Seconds of a clock that never goes back, and of the wall's (UNIX)."""

    steady: Callable[[], float]
    wall: Callable[[], float]


class HouseRules:
    """What holds for all connections of the gateway."""

    def __init__(
        self,
        doors: Doors,
        allowed: AllowList,
        stops: StopArbiter,
        log: AuditLog | None,
        clocks: TwoClocks,
        hands: Hands,
    ) -> None:
        self.doors = doors
        self.allowed = allowed
        self.stops = stops
        self.clocks = clocks
        self.people = People()
        self.motion = MotionGate()
        self._base = ""
        #: Links by which people log in; None: there are none.
        self.invitations: Invitations | None = None
        #: Logs what is wrong for a while.
        self.warn: Callable[[str], object] = lambda _: None
        self._log = log
        self._hands = hands
        self._connections = 0
        self._wrong = WrongAttempts()
        self._told: tuple[bool, str] | None = None
        self._kept = stops.kept()
        #: When the pause for a lost link is asked for again, which has reached nobody.
        self._pause_at: float | None = None

    def enter(self, visitor: Visitor, address: str, browser: str) -> Guard:
        """Return the guard of a client that has connected; its `leave` is to be called."""
        self._connections += 1
        guard = Guard(self, self._connections, visitor, address, browser)
        self.tell_changes()
        return guard

    def refused_entry(self, address: str, refused: NotAdmitted) -> float:
        """Take notice that somebody was not let in; return how many seconds the answer is to wait."""
        if not refused.wrong:
            return 0.0
        times = self._wrong.count(address, self.clocks.steady())
        if is_written_down(times):
            self.write_login("", address, False, str(refused), times=times)
        return delay(times)

    def use_invitation(self, code: str) -> str:
        """Return whom the code of a link lets in; it is used up by that.

        Raises:
            NotAdmitted: it is no code, or not any more.
        """
        name = self.invitations.use(code, self.clocks.wall()) if self.invitations else ""
        if not name:
            text = "this link was used already, or is older than 10 minutes; ask for a new one (lupin invite)"
            raise NotAdmitted(401, text, wrong=True)
        return name

    def write_login(self, who: str, address: str, accepted: bool, answer: str, **more: int) -> None:
        """Write a line of the audit log about who came in, or did not, or had to go."""
        if self._log is not None:
            self._log.write({**login_line(self.clocks.wall(), who, address, accepted, answer), **more})

    def tick(self) -> None:
        """Tell the stop, and decide about a lost link; to be called `TELL_HZ` times a second."""
        now = self.clocks.steady()
        decision = self.stops.link_lost(now)
        again = self._pause_at is not None and now >= self._pause_at and self.stops.link_is_lost
        if decision is OnLinkLost.PAUSE or again:
            self._pause_at = None
            self._hands.pause(partial(self._paused, is_first=not again))
        elif decision is OnLinkLost.STOP:
            self._decided("stop", {"accepted": True})
        self._hands.tell_stop(self.stops.stopped)
        self.people.nodes.look(self.clocks.wall(), self.clocks.steady())
        self.tell_changes()

    def _paused(self, answer: Any, is_first: bool) -> None:
        """Take the answer to a pause for a lost link; without one the orchestrator may just be starting."""
        is_answer = isinstance(answer, Mapping)
        if not is_answer:
            self._pause_at = self.clocks.steady() + PAUSE_AGAIN_S
        if is_answer or is_first:
            self._decided("pause", answer)

    def _decided(self, what: str, answer: Any) -> None:
        told = answer if isinstance(answer, Mapping) else str(getattr(answer, "text", answer))
        self.write(_GATEWAY, "on_link_lost", what, {}, told)

    def hear_stops(self, sources: Iterable[str]) -> None:
        """Take the names of the sources of the stop that hold the robot."""
        self.motion.hear_stops(sources)
        self.settle_motion()

    def settle_motion(self) -> None:
        """Look at what keeps pages from moving the robot, end what they drive, tell who has the base."""
        driver = self.motion.taken_by
        if self.motion.settle(self.stops.stopped, self.clocks.steady()):
            self._hands.halt()
        if driver and not self.motion.taken_by:
            self.write(_GATEWAY, "base_taken_back", driver, {}, {"accepted": True, **self.motion.state()})
        told = json.dumps(self.motion.state())
        if told != self._base:
            self._base = told
            self._hands.tell_base(told)

    def give_back_base(self, page: str) -> None:
        """End the drive of the page that has taken the base; nothing happens where it has not."""
        if page and self.motion.taken_by == page:
            self.motion.taken_by = ""
            self._hands.halt()
            self.settle_motion()

    def tell_changes(self) -> None:
        """Tell what has changed: the stop first of all."""
        now, stopped = self.clocks.steady(), self.stops.stopped
        state = self.stops.state(now)
        stops = [{**stop, "age": 0.0} for stop in state["stops"]]
        told = (stopped, json.dumps({**state, "stops": stops}))
        before, self._told = self._told, told
        if before is None or before[0] is not stopped:
            self._hands.tell_stop(stopped)
        self.settle_motion()
        if before != told:
            self._hands.tell_state(json.dumps(state))
        if (kept := self.stops.kept()) != self._kept:
            self._kept = kept
            self._hands.keep(kept)
        self.people.stops.take([stop["name"] for stop in state["stops"]], self.clocks.wall())
        self.people.tell_changes()

    def write(self, who: Mapping[str, str], what: str, name: str, sent: Any, answer: Any) -> None:
        """Write a line of the audit log."""
        line = command_line(self.clocks.wall(), who, what, name, sent, answer)
        if self._log is not None:
            self._log.write(line)
        self.people.commanded(line)


class Guard:
    """One connection: who is there, and what that client may do."""

    def __init__(self, rules: HouseRules, number: int, visitor: Visitor, address: str, browser: str) -> None:
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
        """Return why a frame is not even read; '' where it is."""
        size = len(frame) if isinstance(frame, bytes) or frame.isascii() else len(frame.encode())
        refused = self._allowance.frame(size)
        if not refused and size > STOP_FRAME:
            return self._allowance.long_frame(size, self._rules.clocks.steady())
        return refused

    def refusal(self, operation: protocol.Operation | protocol.BadFrame, subscriptions: int) -> str:
        """Return why an operation is not carried out; '' where it is. `subscriptions` are those it has.

        What is not understood counts like an operation. A stop does not count, and is never too much.
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
        return self._rules.allowed.refusal(self.visitor, use, name)

    def _motion_refusal(self, operation: protocol.Operation) -> str:
        """Return why an operation does not move the robot; '' where it does, or moves nothing."""
        name = self._rules.allowed.moving.moved_by(operation)
        if not name:
            return ""
        self._rules.settle_motion()
        reason = self._rules.motion.refusal(self.name)
        return reason and f"{name} refused: {reason}"

    # -- what it does -----------------------------------------------------------------------------------

    def told_stop(self, message: Any) -> str:
        """Take what the page says of its stop; return why it is not taken, '' where it is."""
        rules, stopped = self._rules, stop_of(message)
        refused = rules.stops.told(self._number, stopped, rules.clocks.steady())
        rules.tell_changes()
        if stopped is not self._was_stopped:
            rules.write(self._who, "publish", STOP_TOPIC, {"data": stopped}, refused or None)
        self._was_stopped = stopped
        return refused

    def serve(self, service: str, arguments: Any) -> Mapping[str, Any] | None:
        """Return the response of a service that the gateway itself offers; None where it does not."""
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
        """Take which view the page shows, and return the name of its connection."""
        view = arguments.get("view") if isinstance(arguments, Mapping) else None
        page = self._rules.people.presence.shows(self._number, view if isinstance(view, str) else "")
        self._rules.people.tell_changes()
        return {"page": page}

    def _acknowledge(self, arguments: Any) -> Mapping[str, Any]:
        people = self._rules.people
        answer = people.acknowledge(arguments, self.name, self._rules.clocks.wall())
        people.tell_changes()
        return answer

    def _reset_stop(self, arguments: Any) -> Mapping[str, Any]:
        """Release a stop by its name."""
        given = arguments.get("name") if isinstance(arguments, Mapping) else None
        name = given if isinstance(given, str) else ""
        refused = self._rules.stops.reset(name)
        self._rules.tell_changes()
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
        """Whether a publication repeats the last one: it is written down once."""
        if not isinstance(operation, protocol.PublishMessage):
            return False
        now = self._rules.clocks.steady()
        return not self._repetitions.is_command(operation.topic, operation.message, now)

    def published(self, operation: protocol.PublishMessage) -> None:
        """Write down a publication, unless it repeats the last one."""
        if not self._is_repeated(operation):
            self._rules.write(self._who, "publish", operation.topic, operation.message, None)

    def answered(self, operation: protocol.Operation, answer: Any) -> None:
        """Write down a command with its answer: fields by name, or why there are none."""
        if named := _command(operation):
            what, name, _ = named
            is_call = what == "call_service"
            reads = is_call and (
                name == COMMANDS or self._rules.allowed.least(Use.CALL, name) is UserRole.VIEWER
            )
            if not reads:
                self._rules.write(self._who, *named, answer)
                self._rules.people.tell_changes()

    def turned_out(self, reason: str) -> None:
        """The client has to go."""
        self._rules.write_login(self.visitor.name, self._who["from"], False, f"{self.name}: {reason}")

    def leave(self) -> None:
        """The client has gone; its stop stays."""
        self._rules.give_back_base(self.name)
        self._rules.stops.gone(self._number, self._rules.clocks.steady())
        self._rules.people.presence.gone(self._number)
        self._rules.tell_changes()


def _command(operation: protocol.Operation) -> tuple[str, str, Any] | None:
    """Return what a command is called, of what, with what was sent; None for what commands nothing."""
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
