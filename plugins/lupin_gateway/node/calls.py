"""Clients of services and actions that are known by name only; the server's type is looked up for each call.

For the ROS thread; nothing blocks. A call fails at its deadline, a goal after 5 s without acceptance or 3 s
without its server.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from typing import Any

from rclpy.serialization import serialize_message

from lupin_gateway.filling import DoesNotFit, filled
from lupin_gateway.motion import STOPPED
from lupin_gateway.node import types
from lupin_gateway.ports import CallFailed, GoalEnd
from lupin_gateway.shapes import NotCarried
from lupin_ros.adapter import (
    ActionCaller,
    CallFailure,
    Goal,
    GoalCallbacks,
    Repeater,
    RosNode,
    ServiceCaller,
    TimerHandle,
    service_channels,
    type_name,
)

#: Seconds between two looks whether a client has found its server.
MATCH_LOOK_S = 0.02
#: Seconds that a goal may wait for being accepted or rejected.
ACCEPTED_WITHIN_S = 5.0
#: Seconds between two looks at the servers of goals, and that one may be out of sight.
WATCH_S, GONE_AFTER_S = 0.5, 3.0


def service_type(ros: RosNode, name: str) -> str:
    """Return the type of a served service; '' where no node serves it."""
    servers = service_servers(ros, name)
    return type_name(servers[0]).removesuffix("_Request") if servers else ""


def service_servers(ros: RosNode, name: str) -> list[Any]:
    """Return the ends of a service's channel of requests at its servers."""
    requests, _ = service_channels(ros.full(name))
    return list(ros.node.get_subscriptions_info_by_topic(requests, no_mangle=True))


def action_type(ros: RosNode, name: str) -> str:
    """Return the type of a served action; '' where no node serves it."""
    return service_type(ros, f"{name}/_action/send_goal").removesuffix("_SendGoal")


class WaitUntil:
    """Polls a condition; calls `then(True)` when it holds, or `then(False)` after `limit` seconds."""

    def __init__(
        self, ros: RosNode, holds: Callable[[], bool], limit: float, then: Callable[[bool], None]
    ) -> None:
        self._holds = holds
        self._then = then
        self._end = time.monotonic() + limit
        self._looking = Repeater(ros.steady_timer, MATCH_LOOK_S, self._look)
        if holds():
            then(True)
        else:
            self._looking.start()

    def _look(self) -> None:
        holds = self._holds()
        if holds or time.monotonic() >= self._end:
            self._looking.stop()
            self._then(holds)


class Services:
    """Cached clients of services, shared by all pages."""

    def __init__(self, ros: RosNode) -> None:
        self._ros = ros
        self._callers: dict[tuple[str, str], ServiceCaller] = {}

    def call(
        self,
        name: str,
        data: Any,
        limit: float,
        done: Callable[[Any], None],
        still_allowed: Callable[[], bool] = lambda: True,
    ) -> None:
        """Call a service with the fields of its request; `done` gets those of the response, or `CallFailed`.

        The type is that of the server. The deadline includes discovery; `still_allowed` is asked after it, so
        that a stop in the meantime refuses the call.
        """
        type_ = service_type(self._ros, name)
        if not type_:
            done(CallFailed(f"{name}: nobody serves this service now"))
            return
        try:
            request = filled(types.shape(type_, "Request"), data)
            caller = self._caller(name, type_)
        except (NotCarried, DoesNotFit) as problem:
            done(CallFailed(f"{name}: {problem}"))
            return
        end = time.monotonic() + limit

        def found(is_there: bool) -> None:
            if not is_there:
                done(CallFailed(f"{name}: its server was not reached within {limit:g} s"))
                return
            if not still_allowed():
                done(CallFailed(f"{name} {STOPPED}"))
                return
            left = max(0.01, end - time.monotonic())
            caller.call(request, left, partial(_answered, name, type_, limit, done))

        WaitUntil(self._ros, caller.ready, limit, found)

    def _caller(self, name: str, type_: str) -> ServiceCaller:
        if (name, type_) not in self._callers:
            self._callers[name, type_] = self._ros.service(types.class_of(type_), name)
        return self._callers[name, type_]


def _answered(name: str, type_: str, limit: float, done: Callable[[Any], None], answer: Any) -> None:
    if not isinstance(answer, CallFailure):
        done(types.decode(type_, "Response")(serialize_message(answer)))
    elif answer.code == "timeout":
        done(CallFailed(f"{name}: no answer within {limit:g} s; what was asked for may still happen"))
    else:
        done(CallFailed(f"{answer.detail}"))


class PendingGoal:
    """A goal of a page; `cancel` may come at any time, also before it is sent or accepted.

    `feedback` gets the fields of each feedback; `done` is called exactly once.
    """

    def __init__(
        self, name: str, feedback: Callable[[Any], None], done: Callable[[GoalEnd | CallFailed], None]
    ) -> None:
        self.name = name
        self.feedback = feedback
        self._done = done
        self.caller: ActionCaller | None = None
        self.goal: Goal | None = None
        self.deadline: TimerHandle | None = None
        self.is_cancelled = self.is_over = False
        #: Seconds since its server was last seen.
        self.out_of_sight = 0.0

    def cancel(self) -> None:
        """Ask the server to cancel it; a goal that is accepted later is cancelled then."""
        self.is_cancelled = True
        if self.goal is not None:
            self.goal.cancel()

    def accepted(self) -> None:
        """The server has accepted it; it is cancelled where that was asked for, or it has failed already."""
        if self.deadline is not None:
            self.deadline.cancel()
        if self.is_cancelled or self.is_over:
            self.cancel()

    def fail(self, why: str) -> None:
        """End it without a result, and cancel it on the server should it run there."""
        self.end(CallFailed(f"{self.name}: {why}"))
        self.cancel()

    def end(self, outcome: GoalEnd | CallFailed) -> None:
        """Report how it ended, once."""
        if self.deadline is not None:
            self.deadline.cancel()
        if not self.is_over:
            self.is_over = True
            self._done(outcome)


class Actions:
    """Cached clients of actions, and the goals of all pages."""

    def __init__(self, ros: RosNode) -> None:
        self._ros = ros
        self._callers: dict[tuple[str, str], ActionCaller] = {}
        self._pending: list[PendingGoal] = []
        self._watching = Repeater(ros.steady_timer, WATCH_S, self._watch)

    def send(self, pending: PendingGoal, data: Any) -> None:
        """Send a goal given by its fields; the type is that of the server."""
        name = pending.name
        type_ = action_type(self._ros, name)
        if not type_:
            pending.fail("nobody serves this action now")
            return
        try:
            goal = filled(types.shape(type_, "Goal"), data)
            caller = pending.caller = self._caller(name, type_)
        except (NotCarried, DoesNotFit) as problem:
            pending.fail(str(problem))
            return
        late = f"the goal was not accepted within {ACCEPTED_WITHIN_S:g} s"
        pending.deadline = self._ros.steady_timer(ACCEPTED_WITHIN_S, lambda: pending.fail(late))
        self._pending.append(pending)
        self._watching.start()
        WaitUntil(
            self._ros, caller.ready, ACCEPTED_WITHIN_S, partial(self._found, pending, caller, type_, goal)
        )

    @property
    def under_way(self) -> str:
        """The action of a goal that has not ended; '' where there is none."""
        return next((each.name for each in self._pending if not each.is_over), "")

    def cancel_all(self) -> None:
        """Cancel all goals, also those that wait to be sent or accepted."""
        for each in list(self._pending):
            each.cancel()

    def _found(
        self, pending: PendingGoal, caller: ActionCaller, type_: str, goal: Any, is_there: bool
    ) -> None:
        if pending.is_cancelled or not is_there:
            pending.fail("cancelled before it was sent" if is_there else "its server was not reached")
            return

        def fed_back(message: Any) -> None:
            pending.feedback(types.decode(type_, "Feedback")(serialize_message(message)))

        def ended(status: int, result: Any) -> None:
            pending.end(GoalEnd(status, types.decode(type_, "Result")(serialize_message(result))))

        pending.goal = caller.send(
            goal,
            GoalCallbacks(
                accepted=pending.accepted,
                feedback=fed_back,
                ended=ended,
                rejected=lambda: pending.fail("the goal was rejected"),
            ),
        )

    def _caller(self, name: str, type_: str) -> ActionCaller:
        if (name, type_) not in self._callers:
            self._callers[name, type_] = self._ros.action(types.class_of(type_), name)
        return self._callers[name, type_]

    def _watch(self) -> None:
        """Fail goals whose server has been gone for `GONE_AFTER_S`: no result would come."""
        self._pending = [each for each in self._pending if not each.is_over]
        for each in self._pending:
            is_there = each.caller is not None and each.caller.ready()
            each.out_of_sight = 0.0 if is_there else each.out_of_sight + WATCH_S
            if each.out_of_sight >= GONE_AFTER_S:
                each.fail("its server is gone")
        if not self._pending:
            self._watching.stop()
