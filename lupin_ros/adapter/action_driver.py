"""Runs attempts as goals of action servers: each attempt gets exactly one report of its end.

A driver chooses the goal and interprets its end. This module cancels abandoned goals, cancels goals of other
clients at a server of ours, and tolerates servers that disappear from discovery for up to `SERVER_GRACE_S`;
then the attempt has failed, and its goal may go on.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from action_msgs.msg import GoalInfo, GoalStatus, GoalStatusArray
from action_msgs.srv import CancelGoal
from unique_identifier_msgs.msg import UUID

from lupin_engine.plugin import CommonName, Outlet
from lupin_ros.adapter.actions import WORKING, GoalCallbacks, goal_id
from lupin_ros.adapter.host import Repeater
from lupin_ros.adapter.node import Goal, Qos, RosNode, ServiceCaller
from lupin_ros.adapter.service_driver import Done, Failed

#: Period of the check whether servers of active goals are still there, in seconds.
WATCH_PERIOD_S = 0.2
#: Time without a server after which its goals count as lost, in seconds of real time. Discovery recovers
#: sooner, and simulated time stops when the simulation dies.
SERVER_GRACE_S = 2.0
#: The same where the server of a process that is gone must be found first.
RECOVERY_GRACE_S = 25.0
#: Timeout of the request to cancel all goals, in seconds. Nothing depends on the answer.
_CLEARING_DEADLINE_S = 3.0


#: Seconds between two requests to cancel a goal of another client, and how many there are at most.
OTHERS_PERIOD_S, OTHERS_ASKS = 0.5, 6
#: How many goals of ours are remembered, to know those of others by.
OWN_GOALS = 100


class _OthersGoals:
    """Cancels goals of other clients at a server of ours before a goal of ours is sent.

    An operator may have driven the robot by hand while the mission was held.
    """

    def __init__(self, ros: RosNode, name: str, cancel: ServiceCaller) -> None:
        self._ros = ros
        self._name = name
        self._cancel = cancel
        self._own: deque[bytes] = deque(maxlen=OWN_GOALS)
        self._working: frozenset[bytes] = frozenset()
        self._waiting: list[Callable[[], None]] = []
        self._asks = 0
        self._asking = Repeater(ros.steady_timer, OTHERS_PERIOD_S, self._ask)
        ros.subscribe(GoalStatusArray, CommonName(f"{name}/_action/status"), Qos.LATCHED, self._on_status)

    def own(self, key: str) -> None:
        """Record the goal with a key as ours."""
        self._own.append(goal_id(self._name, key))

    def ended(self, then: Callable[[], None]) -> None:
        """Call `then` when there are none: at once, or after cancels; after 3 s in any case."""
        if not self._others:
            then()
            return
        self._ros.log.warning("goals of other clients are cancelled before ours is sent", action=self._name)
        self._waiting.append(then)
        self._asks = 0
        self._asking.start()
        self._ask()

    @property
    def _others(self) -> frozenset[bytes]:
        return self._working.difference(self._own)

    def _on_status(self, message: GoalStatusArray) -> None:
        working = [one for one in message.status_list if one.status in WORKING]
        self._working = frozenset(bytes(one.goal_info.goal_id.uuid) for one in working)
        if self._waiting and not self._others:
            self._go_on()

    def _ask(self) -> None:
        if self._asks == OTHERS_ASKS:
            self._ros.log.error("a goal of another client does not end; ours replaces it", action=self._name)
            self._go_on()
            return
        self._asks += 1
        for other in self._others:
            goal = GoalInfo(goal_id=UUID(uuid=list(other)))
            self._cancel.call(CancelGoal.Request(goal_info=goal), OTHERS_PERIOD_S, lambda _: None)

    def _go_on(self) -> None:
        self._asking.stop()
        waiting, self._waiting = self._waiting, []
        for then in waiting:
            then()

    def close(self) -> None:
        """Stop cancelling, and drop waiting calls."""
        self._asking.stop()
        self._waiting.clear()


class ActionServer:
    """A server of an action. One that is `ours` serves this driver only: goals of others are cancelled."""

    def __init__(self, ros: RosNode, kind: Any, name: str, *, ours: bool) -> None:
        self.name = name = ros.full(name)
        self._caller = ros.action(kind, name)
        cancel = CommonName(f"{name}/_action/cancel_goal")
        self._cancel_all = ros.service(CancelGoal, cancel) if ours else None
        self._others = _OthersGoals(ros, name, self._cancel_all) if self._cancel_all is not None else None
        self._clears = False
        self._is_cleared = not ours

    @property
    def ready(self) -> bool:
        """Whether the server is available."""
        return self._caller.ready()

    def missing(self) -> list[str]:
        """Return its name while it is not reachable, or its earlier goals are not yet cancelled.

        A goal of an orchestrator that crashed would otherwise go on unobserved.
        """
        reached = self._cancel_all is None or self._cancel_all.ready()
        if not (self.ready and reached):
            return [f"action server {self.name}"]
        if self._is_cleared:
            return []
        if not self._clears:
            self._clears = True
            self.clear()
        return [f"action server {self.name} to cancel the goals it had"]

    def clear(self) -> None:
        """Ask a server of ours to cancel every goal: a request without id and time means all."""
        if self._cancel_all is not None:
            self._cancel_all.call(CancelGoal.Request(), _CLEARING_DEADLINE_S, self._cleared)

    def _cleared(self, answer: Any) -> None:
        # Also without an answer: a server that does not answer must not keep the node from starting. One that
        # refuses has goals which nobody could tell from ours: it is asked again.
        code = getattr(answer, "return_code", CancelGoal.Response.ERROR_NONE)
        self._is_cleared = code != CancelGoal.Response.ERROR_REJECTED
        self._clears = self._is_cleared

    def when_free(self, then: Callable[[], None]) -> None:
        """Call `then` when no goal of another client is active at a server of ours."""
        if self._others is None:
            then()
        else:
            self._others.ended(then)

    def _own(self, key: str) -> None:
        if self._others is not None:
            self._others.own(key)

    def send(self, goal: Any, key: str, callbacks: GoalCallbacks) -> Goal:
        """Send a goal; see `ActionCaller.send`."""
        self._own(key)
        return self._caller.send(goal, callbacks, key)

    def adopt(self, key: str, callbacks: GoalCallbacks) -> Goal:
        """Follow a goal of an earlier process; see `ActionCaller.adopt`."""
        self._own(key)
        return self._caller.adopt(key, callbacks)

    def close(self) -> None:
        """Release the client; no callback follows."""
        self._caller.close()
        if self._others is not None:
            self._others.close()
        if self._cancel_all is not None:
            self._cancel_all.close()


@dataclass(frozen=True)
class ActionOperation:
    """The interpretation of a server's answers to an operation.

    `outcome` reads the end of a goal (an `action_msgs/GoalStatus` and the result; also 0, of a server that no
    longer knows it), `told` returns the progress text of a feedback, `cut_short` the done data of a goal that
    was cancelled as requested, or None. `refused` is the text where the server refuses to cancel; '' names
    the server.
    """

    server: ActionServer
    outcome: Callable[[int, Any], Done | Failed]
    told: Callable[[Any], str]
    rejected: str
    unavailable: str
    cut_short: Callable[[Any], Mapping[str, Any] | None] = field(default=lambda _: None)
    refused: str = ""

    def failed(self, code: str, state: str) -> Failed:
        """Return a failure whose text names the server and its state."""
        return Failed(code, f"action server {self.server.name} is {state}")


@dataclass
class _GoalAttempt:
    """One attempt at a server."""

    operation: ActionOperation
    goal: Goal | None = None
    cancelling: bool = False
    out_of_sight: float = 0.0  # seconds since the server was last seen
    progress: str = ""


class ActionAttempts:
    """The attempts of one driver; `plugin.contract.Driver` has the contract of `start` and `cancel`."""

    def __init__(self, ros: RosNode, outlet: Outlet) -> None:
        self._ros = ros
        self._outlet = outlet
        self._running: dict[str, _GoalAttempt] = {}
        #: Abandoned goals that a server may still execute.
        self._lost: dict[str, _GoalAttempt] = {}
        self._watching = Repeater(ros.steady_timer, WATCH_PERIOD_S, self._watch)

    def start(self, attempt: str, operation: ActionOperation, goal: Any) -> None:
        """Send a goal; the attempt fails at once without a server."""
        if not operation.server.ready:
            self._fail(attempt, operation.failed(operation.unavailable, "not there"))
            return
        self._running[attempt] = _GoalAttempt(operation)
        self._watching.start()
        operation.server.when_free(partial(self._send, attempt, goal))

    def _send(self, attempt: str, goal: Any) -> None:
        made = self._running.get(attempt)
        if made is None:
            return  # it has ended while goals of others were being cancelled
        made.goal = made.operation.server.send(goal, self._key(attempt), self._callbacks(attempt))

    def _callbacks(self, attempt: str) -> GoalCallbacks:
        return GoalCallbacks(
            accepted=partial(self._on_accepted, attempt),
            feedback=partial(self._on_feedback, attempt),
            ended=partial(self._on_ended, attempt),
            rejected=partial(self._on_rejected, attempt),
            refused=partial(self._on_refused, attempt),
        )

    def recover(self, attempt: str, operation: ActionOperation, *, adopt: bool) -> None:
        """Follow the goal that an earlier process has sent for an attempt; cancel it unless `adopt`.

        Its end is reported as that of any other. Its server may be discovered up to `RECOVERY_GRACE_S` later.
        """
        made = self._running[attempt] = _GoalAttempt(operation, cancelling=not adopt)
        made.out_of_sight = SERVER_GRACE_S - RECOVERY_GRACE_S
        made.goal = operation.server.adopt(self._key(attempt), self._callbacks(attempt))
        self._watching.start()
        if not adopt:
            made.goal.cancel()

    def _key(self, attempt: str) -> str:
        return f"{self._ros.lineage}/{attempt}"

    def runs(self, attempt: str) -> bool:
        """Return whether an attempt has not ended."""
        return attempt in self._running

    def cancel(self, attempt: str) -> None:
        """Cancel an attempt; a goal that is not accepted yet is cancelled when it is."""
        running = self._running.get(attempt)
        if running is None:
            return
        if running.goal is None:  # not sent yet
            del self._running[attempt]
            self._outlet.cancelled(attempt)
        else:
            running.cancelling = True
            running.goal.cancel()

    def close(self) -> None:
        """Request the cancellation of every goal, and report nothing from now on."""
        self._watching.stop()
        for attempt in list(self._running):
            self._abandon(attempt)
        # Also goals that a server has accepted without having answered yet.
        for server in dict.fromkeys(lost.operation.server for lost in self._lost.values()):
            server.clear()

    def _on_accepted(self, attempt: str) -> None:
        lost = self._lost.get(attempt)
        if lost is not None and lost.goal is not None:
            lost.goal.cancel()
        elif attempt in self._running:
            self._outlet.accepted(attempt)

    def _on_rejected(self, attempt: str) -> None:
        self._lost.pop(attempt, None)
        running = self._running.pop(attempt, None)
        if running is not None:
            operation = running.operation
            self._fail(attempt, operation.failed(operation.rejected, "not willing to take the goal"))

    def _on_feedback(self, attempt: str, feedback: Any) -> None:
        running = self._running.get(attempt)
        if running is None:
            return
        progress = running.operation.told(feedback)
        if progress and progress != running.progress:
            running.progress = progress
            self._outlet.progress(attempt, progress)

    def _on_ended(self, attempt: str, status: int, result: Any) -> None:
        self._lost.pop(attempt, None)
        running = self._running.pop(attempt, None)
        if running is None:
            return
        if status == GoalStatus.STATUS_CANCELED and running.cancelling:
            self._outlet.cancelled(attempt, running.operation.cut_short(result))
            return
        outcome = running.operation.outcome(status, result)
        if isinstance(outcome, Done):
            self._outlet.done(attempt, outcome.result)
        else:
            self._fail(attempt, outcome)

    def _on_refused(self, attempt: str) -> None:
        running = self._running.get(attempt)
        if running is not None:
            refusal = f"action server {running.operation.server.name} refuses to stop, and may go on"
            self._outlet.cancel_refused(attempt, running.operation.refused or refusal)

    def _fail(self, attempt: str, failed: Failed) -> None:
        self._outlet.failed(attempt, failed.code, failed.detail)

    # --- the servers' life

    def _watch(self) -> None:
        """Check the servers periodically, but only while an attempt runs: an idle node costs nothing."""
        if not self._running:
            self._watching.stop()
            return
        for attempt, running in list(self._running.items()):
            operation = running.operation
            away = 0.0 if operation.server.ready else running.out_of_sight + WATCH_PERIOD_S
            running.out_of_sight = away
            if away >= SERVER_GRACE_S:
                self._abandon(attempt)
                self._fail(attempt, operation.failed(operation.unavailable, "gone"))

    def _abandon(self, attempt: str) -> None:
        """Stop waiting for an attempt, and cancel its goal.

        The server may only be out of reach and still working: the middleware repeats the request until it is
        answered. A goal whose acceptance never came is cancelled when it comes.
        """
        abandoned = self._lost[attempt] = self._running.pop(attempt)
        if abandoned.goal is not None:
            abandoned.goal.cancel()
