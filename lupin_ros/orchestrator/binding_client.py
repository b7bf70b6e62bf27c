"""The driver of a binding: calls services, actions and topics by type name, as `lupin_engine.bindings` says.

Types are imported at run time. A request or an answer whose expression fails ends the attempt with the
binding's code; a message whose expression fails is dropped, and logged once in a row.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from action_msgs.msg import GoalStatus
from rclpy.publisher import Publisher

from lupin_engine.bindings import Binding, Endpoint, MessageHeard, MessageSent, OperationCall, Sending
from lupin_engine.plugin import Outlet
from lupin_ros.adapter.action_driver import ActionAttempts, ActionOperation, ActionServer
from lupin_ros.adapter.node import CallFailure, Qos, RosNode, RosTimer, peer_mismatches
from lupin_ros.adapter.peers import is_listened_to
from lupin_ros.adapter.qos import OBJECT_BYTES
from lupin_ros.adapter.service_driver import (
    CALL_DEADLINE_S,
    Done,
    Failed,
    ServiceDriver,
    ServiceOperation,
)
from lupin_ros.interfaces.definitions import (
    fill,
    interface_class,
    interface_constants,
    interface_types,
    plain,
)

#: How long after its start a client waits for an undiscovered server, in seconds of real time.
DISCOVERY_S = 3.0
_LOOK_PERIOD_S = 0.05

#: The values of `status` for a goal's end. A restarted server does not know the goal: its status is another.
_STATUS = {
    GoalStatus.STATUS_SUCCEEDED: "succeeded",
    GoalStatus.STATUS_ABORTED: "aborted",
    GoalStatus.STATUS_CANCELED: "canceled",
}
_CALLED = {"srv": "service", "action": "action server"}
_QOS = {"reliable": Qos.EVENT, "latched": Qos.LATCHED, "sensor": Qos.SENSOR}
#: The exceptions of an expression, and of a value that does not fit its field.
_COMPUTING = (ValueError, ArithmeticError, LookupError, TypeError)


class _BindingContext:
    """The node, the outlet and the parameters that all parts of a client share."""

    def __init__(self, ros: RosNode, outlet: Outlet, parameters: Mapping[str, Any]) -> None:
        self.ros = ros
        self.outlet = outlet
        self._parameters = parameters

    def around(self, endpoint: Endpoint) -> dict[str, Any]:
        """Return the names that every expression about an endpoint may read."""
        constants = interface_constants(endpoint.type)
        return {"param": self._parameters, "constant": constants, "now": self.ros.now()}

    def filled(
        self, kind: Any, part: str, endpoint: Endpoint, sending: Sending, arguments: Mapping[str, Any]
    ) -> Any:
        """Return a request, goal or message with computed fields.

        Raises:
            ValueError, ArithmeticError, LookupError, TypeError: an expression fails, or its value misfits.
        """
        data = sending.sent(arguments, self.around(endpoint))
        return fill(kind(), data, interface_types(endpoint.type)[part])

    def missing_server(self, endpoint: Endpoint, said: str) -> str:
        """Return why a server is missing, with a peer's other type or QoS where the graph shows one."""
        name = self.ros.service_name(endpoint.name)
        others = (found for found in peer_mismatches(self.ros) if f"{name}:" in found or f"{name}/" in found)
        return "; ".join([said, *sorted(others)[:1]])

    def is_deaf(self, call: OperationCall) -> bool:
        """Return whether a server that is declared to watch this node does not subscribe to its lifeline."""
        if not (call.watched and self.ros.lifeline):
            return False
        name = self.ros.service_name(call.endpoint.name)
        server = f"{name}/_action/send_goal" if call.endpoint.kind == "action" else name
        return not is_listened_to(self.ros, self.ros.lifeline, server)


class BoundClient:
    """The driver of a binding; `plugin.contract.Driver` has the contract of each method."""

    def __init__(self, ros: RosNode, bound: Binding, outlet: Outlet, parameters: Mapping[str, Any]) -> None:
        self._ros = ros
        self._bound = bound
        self._outlet = outlet
        self._patient_until = time.monotonic() + DISCOVERY_S
        self._waiting: dict[str, RosTimer] = {}
        context = _BindingContext(ros, outlet, parameters)
        self._context = context
        self._called = {n: _called(context, c) for n, c in bound.calls.items() if c.endpoint.kind == "srv"}
        self._services = ServiceDriver(bound.name, outlet, self._called)
        self._servers: dict[str, ActionServer] = {}
        self._goals = {n: self._goal(c) for n, c in bound.calls.items() if c.endpoint.kind == "action"}
        self._attempts = ActionAttempts(ros, outlet)
        self._publishers = {name: _publisher(ros, sent.endpoint) for name, sent in bound.sends.items()}
        self._listeners = [
            *(_Listener(context, heard, partial(self._value, name)) for name, heard in bound.values.items()),
            *(_Listener(context, heard, partial(self._event, name)) for name, heard in bound.events.items()),
        ]

    def _goal(self, call: OperationCall) -> ActionOperation:
        endpoint = call.endpoint
        server = self._servers.get(endpoint.name)
        if server is None:
            of_it = [c for c in self._bound.calls.values() if c.endpoint.name == endpoint.name]
            ours = any(each.moves for each in of_it)
            server = ActionServer(self._ros, interface_class(endpoint.type), endpoint.name, ours=ours)
            self._servers[endpoint.name] = server
        outcome = partial(_ended, self._context, call)
        progress = partial(_progress, self._context, call)
        cut_short = partial(_cut_short, self._context, call)
        return ActionOperation(server, outcome, progress, call.rejected, call.unavailable, cut_short)

    def missing(self) -> list[str]:
        """Return the servers that are not reachable; where all are, those that do not watch this node."""
        unreached = [*self._services.missing(), *(m for s in self._servers.values() for m in s.missing())]
        deaf = [call for call in self._bound.calls.values() if self._context.is_deaf(call)]
        names = dict.fromkeys(f"{_CALLED[call.endpoint.kind]} {call.endpoint.name}" for call in deaf)
        return unreached or [f"{name} to listen to {self._ros.lifeline}" for name in names]

    def start(self, attempt: str, operation: str, arguments: Mapping[str, Any]) -> None:
        """Call the operation's service or send its goal.

        In the first `DISCOVERY_S` of this client it waits for a server that is not discovered yet; later the
        attempt fails at once as unavailable.
        """
        if operation not in self._bound.calls:
            raise ValueError(f"{self._bound.name} has no operation {operation!r}")
        if self._may_be_found(operation):
            look = partial(self._look, attempt, operation, arguments)
            self._waiting[attempt] = self._ros.steady_timer(_LOOK_PERIOD_S, look)
            return
        call = self._bound.calls[operation]
        if self._context.is_deaf(call):
            deaf = (
                f"{_CALLED[call.endpoint.kind]} {call.endpoint.name} does not listen to {self._ros.lifeline}"
            )
            why = f"{deaf}: nobody would end the order if this orchestrator were gone"
            self._outlet.failed(attempt, call.unavailable, why)
            return
        try:
            if operation in self._goals:
                kind = interface_class(call.endpoint.type).Goal
                goal = self._context.filled(kind, "goal", call.endpoint, call.sending, arguments)
                self._attempts.start(attempt, self._goals[operation], goal)
            else:
                self._services.start(attempt, operation, arguments)
        except _COMPUTING as problem:
            self._outlet.failed(attempt, call.code, f"{call.endpoint.place}: {problem}")

    def _may_be_found(self, operation: str) -> bool:
        goal = self._goals.get(operation)
        ready = goal.server.ready if goal is not None else self._called[operation].service.ready()
        found = ready and not self._context.is_deaf(self._bound.calls[operation])
        return not found and time.monotonic() < self._patient_until

    def _look(self, attempt: str, operation: str, arguments: Mapping[str, Any]) -> None:
        if not self._may_be_found(operation):
            self._waiting.pop(attempt).cancel()
            self.start(attempt, operation, arguments)

    def cancel(self, attempt: str) -> None:
        """Cancel an attempt: a call's answer is dropped, a goal is cancelled at its server."""
        waiting = self._waiting.pop(attempt, None)
        if waiting is not None:
            waiting.cancel()
            self._outlet.cancelled(attempt)
            return
        self._services.cancel(attempt)
        self._attempts.cancel(attempt)

    def recover(self, attempt: str, operation: str, *, adopt: bool) -> None:
        """Adopt or cancel a goal of the last process; a call of it is reported as cancelled."""
        if operation in self._goals:
            self._attempts.recover(attempt, self._goals[operation], adopt=adopt)
        else:
            self._outlet.cancelled(attempt)

    def act(self, action: str, arguments: Mapping[str, Any]) -> None:
        """Publish the message of an action; where an expression fails, log it and publish nothing."""
        if action not in self._publishers:
            raise ValueError(f"{self._bound.name} has no action {action!r}")
        sent: MessageSent = self._bound.sends[action]
        endpoint = sent.endpoint
        try:
            kind = interface_class(endpoint.type)
            message = self._context.filled(kind, "message", endpoint, sent.sending, arguments)
        except _COMPUTING as problem:
            text = f"{endpoint.place}: {problem}"
            self._ros.log.warning("nothing was sent", action=f"{self._bound.name}.{action}", problem=text)
            return
        self._publishers[action].publish(message)

    def _value(self, name: str, read: Mapping[str, Any]) -> None:
        self._outlet.value(name, read["value"], self._ros.now())

    def _event(self, name: str, read: Mapping[str, Any]) -> None:
        self._outlet.event(f"{self._bound.name}.{name}", read)

    def close(self) -> None:
        """Cancel goals, drop answers that are still to come, and destroy all clients and subscriptions."""
        for timer in self._waiting.values():
            timer.cancel()
        self._waiting.clear()
        self._services.close()
        self._attempts.close()
        for operation in self._called.values():
            operation.service.close()
        for server in self._servers.values():
            server.close()
        for publisher in self._publishers.values():
            self._ros.node.destroy_publisher(publisher)
        for listener in self._listeners:
            listener.close()


class _Listener:
    """Subscribes to a topic and reports its messages as the binding reads them."""

    def __init__(
        self, context: _BindingContext, heard: MessageHeard, report: Callable[[Mapping[str, Any]], None]
    ) -> None:
        self._context = context
        self._heard = heard
        self._report = report
        self._is_logged = False
        endpoint = heard.endpoint
        kind = interface_class(endpoint.type)
        # Each message becomes plain data, number by number.
        self._subscription = context.ros.subscribe(
            kind, endpoint.name, _QOS[endpoint.qos], self._take, OBJECT_BYTES
        )

    def _take(self, message: Any) -> None:
        endpoint = self._heard.endpoint
        try:
            read = self._heard.heard(plain(message), self._context.around(endpoint))
        except _COMPUTING as problem:
            self._pass_over(endpoint, problem)
            return
        self._is_logged = False
        if read is not None:
            self._report(read)

    def _pass_over(self, endpoint: Endpoint, problem: Exception) -> None:
        """Log a problem once in a row: a topic of ten messages a second would fill the log."""
        if not self._is_logged:
            self._is_logged = True
            text = f"{endpoint.place}: {problem}"
            self._context.ros.log.warning("message passed over", topic=endpoint.name, problem=text)

    def close(self) -> None:
        """Unsubscribe."""
        self._context.ros.node.destroy_subscription(self._subscription)


def _publisher(ros: RosNode, endpoint: Endpoint) -> Publisher:
    return ros.publisher(interface_class(endpoint.type), endpoint.name, _QOS[endpoint.qos])


# -- services ----------------------------------------------------------------------------------------------


def _called(context: _BindingContext, call: OperationCall) -> ServiceOperation:
    endpoint = call.endpoint
    kind = interface_class(endpoint.type)
    return ServiceOperation(
        context.ros.service(kind, endpoint.name),
        partial(context.filled, kind.Request, "request", endpoint, call.sending),
        partial(_answered, context, call),
        CALL_DEADLINE_S if endpoint.deadline is None else endpoint.deadline,
    )


def _answered(
    context: _BindingContext, call: OperationCall, _: Mapping[str, Any], answer: Any | CallFailure
) -> Done | Failed:
    if not isinstance(answer, CallFailure):
        return _outcome(context, call, {"response": plain(answer)})
    if answer.code == "unavailable":
        return Failed(call.unavailable, context.missing_server(call.endpoint, answer.detail))
    return Failed(call.code, answer.detail)


def _outcome(context: _BindingContext, call: OperationCall, answer: Mapping[str, Any]) -> Done | Failed:
    try:
        meaning = call.outcome(answer, context.around(call.endpoint))
    except Exception as problem:  # an expression may raise anything for an unexpected answer
        return Failed(call.code, f"{call.endpoint.place}: {problem}")
    return Failed(meaning.code, meaning.detail) if meaning.result is None else Done(meaning.result)


# -- actions -----------------------------------------------------------------------------------------------


def _ended(context: _BindingContext, call: OperationCall, status: int, result: Any) -> Done | Failed:
    word = _STATUS.get(status)
    if word is None:
        return Failed(call.unavailable, f"action server {call.endpoint.name} no longer knows the goal")
    return _outcome(context, call, {"status": word, "result": plain(result)})


def _cut_short(context: _BindingContext, call: OperationCall, result: Any) -> Mapping[str, Any] | None:
    """Return the done data of a cancelled goal; None where the binding gives none, or it fails."""
    try:
        return call.given({"status": "canceled", "result": plain(result)}, context.around(call.endpoint))
    except Exception as problem:  # as with any other answer; the end of the attempt is what counts
        context.ros.log.warning("no result of a cancelled goal", problem=f"{call.endpoint.place}: {problem}")
        return None


def _progress(context: _BindingContext, call: OperationCall, feedback: Any) -> str:
    try:
        return call.progress(plain(feedback), context.around(call.endpoint))
    except _COMPUTING as problem:
        return f"{call.endpoint.place}: {problem}"
