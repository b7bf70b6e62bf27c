"""The session of one connection: carries out its frames, and sends each answer when it arrives.

Nothing here waits for ROS, so a call never delays a publication, above all a stop. Answers that come after
the connection has closed are dropped.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from lupin_gateway import protocol
from lupin_gateway.access import STOP_TOPIC
from lupin_gateway.encoding import Compression, reply, status
from lupin_gateway.guard import Guard
from lupin_gateway.hub import Hub, Outbox, Subscriber
from lupin_gateway.ports import CallFailed, GoalEnd, RosPort

#: Services that the gateway answers itself.
ROSAPI = "/rosapi/"
#: Which compression a client gets that asked for several.
_PREFERRED: tuple[Compression, ...] = ("cbor", "cbor-raw")
#: Goals of one connection that may be under way.
MOST_GOALS = 20


@dataclass(frozen=True)
class Limits:
    """Limits of calls in seconds: `usual`, or `slow` for names that begin with a slow service's."""

    usual: float = 5.0
    slow: float = 15.0
    slow_services: tuple[str, ...] = ("/lupin/arm/",)

    def of(self, service: str, wanted: float) -> float:
        """Return the limit of a call; a client may only shorten it (0: no wish)."""
        limit = self.slow if service.startswith(self.slow_services) else self.usual
        return min(limit, wanted) if wanted else limit


@dataclass(eq=False)
class _Wishes:
    """All subscriptions of one client to one topic, by id; they share one `Subscriber`."""

    subscriber: Subscriber
    by_id: dict[str | None, protocol.SubscribeTopic] = field(default_factory=dict)

    def settle(self) -> None:
        """Merge their options: the shortest throttle, the longest queue, CBOR if any wants it."""
        wishes = list(self.by_id.values())
        asked = {wish.compression for wish in wishes}
        self.subscriber.id = wishes[0].id
        self.subscriber.throttle = min(wish.throttle for wish in wishes)
        self.subscriber.queue = 0 if any(w.queue == 0 for w in wishes) else max(w.queue for w in wishes)
        self.subscriber.compression = next((each for each in _PREFERRED if each in asked), "none")


class Session:
    """The operations of one client, until it disconnects."""

    def __init__(self, ros: RosPort, hub: Hub, outbox: Outbox, limits: Limits, guard: Guard) -> None:
        self._ros = ros
        self._hub = hub
        self._outbox = outbox
        self._limits = limits
        self._guard = guard
        self._level = protocol.LEVELS.index("info")
        self._wishes: dict[str, _Wishes] = {}
        self._advertised: set[str] = set()
        self._goals: dict[str, Callable[[], None]] = {}
        self._closed = False

    def receive(self, frame: str | bytes) -> None:
        """Check, parse and carry out a frame; refusals are answered."""
        refused = self._guard.frame_refusal(frame)
        if refused:
            self.send_status("error", refused)
            return
        operation = protocol.parse(frame)
        subscriptions = sum(len(wishes.by_id) for wishes in self._wishes.values())
        refused = self._guard.refusal(operation, subscriptions)
        if refused:
            self._answer_bad(_as_bad(operation, refused))
            return
        if isinstance(operation, protocol.BadFrame):
            self._answer_bad(operation)
            return
        _HANDLERS[type(operation)](self, operation)

    def close(self) -> None:
        """The client has disconnected: end its subscriptions and goals."""
        self._closed = True
        self._guard.leave()
        for wishes in self._wishes.values():
            self._hub.unsubscribe(wishes.subscriber)
        for topic in self._advertised:
            self._ros.unadvertise(topic)
        for cancel in list(self._goals.values()):
            cancel()

    # --- status frames

    def send_status(self, level: str, text: str, about: str | None = None) -> None:
        """Send a status frame, unless it is below the client's level."""
        if text and protocol.LEVELS.index(level) <= self._level:
            self._send(status(level, text, about))

    def _answer_bad(self, bad: protocol.BadFrame) -> None:
        self.send_status("error", bad.text, bad.id)
        if bad.operation == "call_service" and bad.id is not None:
            self._answer(protocol.CallService(bad.name, id=bad.id), CallFailed(bad.text))
        elif bad.operation == "send_action_goal" and bad.id is not None:
            self._end(protocol.SendGoal(bad.name, "", bad.id), CallFailed(bad.text))

    def _send(self, frame: str) -> None:
        if not self._closed:
            self._outbox.put(frame)

    # --- topics

    def _subscribe(self, operation: protocol.SubscribeTopic) -> None:
        """Add or change a subscription; several of a client to one topic get each message once."""
        wishes = self._wishes.setdefault(operation.topic, _Wishes(Subscriber(operation.topic, self._outbox)))
        other = next((wish.type for wish in wishes.by_id.values() if wish.type), "")
        if operation.type and other and operation.type != other:
            text = f"{operation.topic} is subscribed to as {other} already, not as {operation.type}"
            self.send_status("error", text, operation.id)
            return
        is_first = not wishes.by_id
        wishes.by_id[operation.id] = operation
        wishes.settle()
        if is_first:
            self._hub.subscribe(wishes.subscriber, operation.type)

    def _unsubscribe(self, operation: protocol.UnsubscribeTopic) -> None:
        wishes = self._wishes.get(operation.topic)
        if wishes is None:
            return
        if operation.id is None:
            wishes.by_id.clear()
        wishes.by_id.pop(operation.id, None)
        if wishes.by_id:
            wishes.settle()
        else:
            del self._wishes[operation.topic]
            self._hub.unsubscribe(wishes.subscriber)

    def _advertise(self, operation: protocol.Advertise) -> None:
        if operation.topic == STOP_TOPIC:
            return  # pages tell it to the gateway, which alone tells ROS
        if operation.topic in self._advertised:
            self._ros.unadvertise(operation.topic)
        self._advertised.add(operation.topic)
        report = partial(self.send_status, "error", about=operation.id)
        self._ros.advertise(operation.topic, operation.type, operation.latch, report)

    def _unadvertise(self, operation: protocol.Unadvertise) -> None:
        if operation.topic in self._advertised:
            self._advertised.remove(operation.topic)
            self._ros.unadvertise(operation.topic)

    def _publish(self, operation: protocol.PublishMessage) -> None:
        if operation.topic == STOP_TOPIC:
            self.send_status("error", self._guard.report_stop(operation.message), operation.id)
            return
        self._guard.published(operation)
        self._ros.publish(
            operation.topic, operation.message, partial(self.send_status, "error", about=operation.id)
        )

    # --- services

    def _call(self, operation: protocol.CallService) -> None:
        answer = partial(self._answered, operation)
        own = self._guard.serve(operation.service, operation.arguments)
        if own is not None:
            answer(own)
            return
        if operation.service.startswith(ROSAPI):
            question = operation.service[len(ROSAPI) :]
            if not self._ros.ask(question, operation.arguments, self._guard.use_refusal, answer):
                answer(CallFailed(f"{operation.service}: the gateway does not offer it"))
            return
        limit = self._limits.of(operation.service, operation.timeout)
        self._ros.call(operation.service, operation.arguments, limit, answer)

    def _answered(self, operation: protocol.CallService, outcome: Any) -> None:
        self._guard.answered(operation, outcome.text if isinstance(outcome, CallFailed) else outcome)
        self._answer(operation, outcome)

    def _answer(self, operation: protocol.CallService, outcome: Any) -> None:
        failed = isinstance(outcome, CallFailed)
        self._send(
            reply(
                "service_response",
                id=operation.id,
                service=operation.service,
                values=outcome.text if failed else outcome,
                result=not failed,
            )
        )

    # --- actions

    def _send_goal(self, operation: protocol.SendGoal) -> None:
        if operation.id in self._goals:
            self._end(
                operation, CallFailed(f"{operation.action}: a goal with the id {operation.id!r} is under way")
            )
            return
        if len(self._goals) >= MOST_GOALS:
            self._end(
                operation, CallFailed(f"{operation.action}: {MOST_GOALS} goals of this client are under way")
            )
            return
        feedback = partial(self._send_feedback, operation) if operation.feedback else _nobody
        done = partial(self._ended, operation)
        cancel = self._ros.send_goal(operation.action, operation.arguments, feedback, done)
        self._goals[operation.id] = cancel
        self._guard.answered(operation, None)

    def _cancel_goal(self, operation: protocol.CancelGoalById) -> None:
        cancel = self._goals.get(operation.id)
        if cancel is None:
            known = f"{operation.action}: no goal with the id {operation.id!r} is under way"
            self.send_status("error", known, operation.id)
            return
        self._guard.answered(operation, None)
        cancel()

    def _send_feedback(self, operation: protocol.SendGoal, values: Mapping[str, Any]) -> None:
        self._send(reply("action_feedback", id=operation.id, action=operation.action, values=values))

    def _ended(self, operation: protocol.SendGoal, outcome: GoalEnd | CallFailed) -> None:
        self._goals.pop(operation.id, None)
        self._guard.answered(operation, _log_entry(outcome))
        self._end(operation, outcome)

    def _end(self, operation: protocol.SendGoal, outcome: GoalEnd | CallFailed) -> None:
        failed = isinstance(outcome, CallFailed)
        self._send(
            reply(
                "action_result",
                id=operation.id,
                action=operation.action,
                values=outcome.text if isinstance(outcome, CallFailed) else outcome.result,
                status=0 if isinstance(outcome, CallFailed) else outcome.status,
                result=not failed,
            )
        )

    def _set_level(self, operation: protocol.SetLevel) -> None:
        self._level = protocol.LEVELS.index(operation.level)


def _log_entry(outcome: GoalEnd | CallFailed) -> str | Mapping[str, Any]:
    """Return the end of a goal for the audit log."""
    if isinstance(outcome, CallFailed):
        return outcome.text
    return {"accepted": True, "message": f"ended with status {outcome.status}"}


def _nobody(_: Mapping[str, Any]) -> None:
    """Drop feedback that the client does not want."""


def _as_bad(operation: protocol.Operation | protocol.BadFrame, text: str) -> protocol.BadFrame:
    """Return a refusal as a `BadFrame`: both are answered alike."""
    if isinstance(operation, protocol.CallService):
        return protocol.BadFrame(text, operation.id, "call_service", operation.service)
    if isinstance(operation, protocol.SendGoal):
        return protocol.BadFrame(text, operation.id, "send_action_goal", operation.action)
    return protocol.BadFrame(text, operation.id)


_HANDLERS: Mapping[type, Callable[[Session, Any], None]] = {
    protocol.SubscribeTopic: Session._subscribe,
    protocol.UnsubscribeTopic: Session._unsubscribe,
    protocol.Advertise: Session._advertise,
    protocol.Unadvertise: Session._unadvertise,
    protocol.PublishMessage: Session._publish,
    protocol.CallService: Session._call,
    protocol.SendGoal: Session._send_goal,
    protocol.CancelGoalById: Session._cancel_goal,
    protocol.SetLevel: Session._set_level,
}
