"""Action clients and servers over rclpy whose goals survive an interrupted connection.

rclpy leaves the future of a result pending for ever when the result was sent while the link was down, so a
`Goal` asks again when a server (re-)appears. A cancel request is repeated until the server accepts it or the
goal has ended: neither silence nor a refusal is an end. Closing a client cancels its goals, and waits for the
answers up to `CANCEL_LIMIT_S`; a goal whose server does not answer may go on.
"""

from __future__ import annotations

import uuid
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

from action_msgs.msg import GoalStatus
from action_msgs.srv import CancelGoal
from rclpy.action import ActionClient, ActionServer, CancelResponse, GoalResponse
from rclpy.action.client import ClientGoalHandle
from rclpy.action.server import ServerGoalHandle
from rclpy.task import Future
from unique_identifier_msgs.msg import UUID

from lupin_ros.adapter.host import Host, Repeater, TimerHandle
from lupin_ros.adapter.qos import Qos

#: Period of the check of the servers while a goal is active, in seconds; there is none otherwise.
WATCH_PERIOD_S = 1.0
#: How often a newly found server is asked for a result: an answer is lost while it has not found the client.
ASKS = 3
#: Seconds between two cancel requests, while the server refuses; while it does not answer, twice as many.
CANCEL_PERIOD_S = 0.5
#: The most cancel requests that wait for answers: a server may take longer than their period.
MOST_CANCELS = 8
#: How long a closed client, and the end of a node, waits for the answers of its cancels, in seconds.
CANCEL_LIMIT_S = 2.0

#: How long a server keeps the result of an ended goal, in seconds, for a client that was cut off or
#: restarted. With rclpy's 900 every status message has all goals of a quarter of an hour.
RESULT_KEPT_S = 120

#: The namespace of the ids of goals with a key.
_GOALS = uuid.UUID("6c7570696e20676f616c20696473202e")

#: The status of goals that a server works on.
WORKING = frozenset((GoalStatus.STATUS_ACCEPTED, GoalStatus.STATUS_EXECUTING, GoalStatus.STATUS_CANCELING))
_TERMINAL = frozenset((GoalStatus.STATUS_SUCCEEDED, GoalStatus.STATUS_CANCELED, GoalStatus.STATUS_ABORTED))


def goal_id(action: str, key: str) -> bytes:
    """Return the id of the goal that is sent with a key."""
    return uuid.uuid5(_GOALS, f"{action} {key}").bytes


def _nothing(*_: object) -> None:
    """Report nothing."""


@dataclass(frozen=True)
class GoalCallbacks:
    """What a goal calls, on the node's thread.

    `accepted` comes at most once, then `feedback` any number of times, then `ended(status, result)` with an
    `action_msgs/GoalStatus` (4 succeeded, 5 canceled, 6 aborted, 0 when a restarted server does not know the
    goal). `rejected` comes instead when the goal was never taken. `refused` comes once where the server
    refuses a cancel. While no server answers, nothing comes: deadlines are the caller's.
    """

    accepted: Callable[[], None] = _nothing
    feedback: Callable[[Any], None] = _nothing
    ended: Callable[[int, Any], None] = _nothing
    rejected: Callable[[], None] = _nothing
    refused: Callable[[], None] = _nothing


class ActionCaller:
    """The client of one action."""

    def __init__(self, ros: Host, kind: Any, name: str) -> None:
        self.ros = ros
        self.kind = kind
        self.name = name
        services = Qos.SERVICES.profile()  # the default depth of 10 loses requests silently
        self.client = ActionClient(
            ros.node,
            kind,
            name,
            goal_service_qos_profile=services,
            result_service_qos_profile=services,
            cancel_service_qos_profile=services,
        )
        self._goals: list[Goal] = []
        self._servers: frozenset[bytes] = frozenset()
        self._watch = Repeater(ros.steady_timer, WATCH_PERIOD_S, self._check_servers)
        self._limit: TimerHandle | None = None
        self.closed = self.released = False

    def ready(self) -> bool:
        """Return whether a server is matched; a dead one counts for up to 3 s (the discovery lease)."""
        return bool(self.client.server_is_ready())

    def send(self, goal: Any, callbacks: GoalCallbacks, key: str = "") -> Goal:
        """Send `goal`. With a `key` another process can `adopt` it.

        Raises:
            RuntimeError: the client is closed.
        """
        sent = self._follow(Goal(self, callbacks, key))
        sent.send(goal)
        return sent

    def adopt(self, key: str, callbacks: GoalCallbacks) -> Goal:
        """Follow a goal that an earlier process has sent with a `key`; it counts as accepted.

        It ends with status 0 where the server does not know it.

        Raises:
            RuntimeError: the client is closed.
        """
        found = self._follow(Goal(self, callbacks, key))
        found.adopt()
        return found

    def _follow(self, goal: Goal) -> Goal:
        if self.closed:
            raise RuntimeError(f"the client of action {self.name} is closed")
        self._goals.append(goal)
        if not self._watch.running:
            self._servers = self._matched_servers()
            self._watch.start()
        return goal

    def forget(self, goal: Goal) -> None:
        """Stop watching `goal`, which has ended."""
        if goal in self._goals:
            self._goals.remove(goal)
        if not self._goals:
            self._watch.stop()
            if self.closed:
                self.ros.post(self.release)  # rclpy is still working with the client

    def close(self) -> None:
        """Cancel every goal and release the client; no callback follows.

        The client stays until each cancel is answered or its goal has ended, at most `CANCEL_LIMIT_S`. A goal
        that is accepted meanwhile is cancelled, too. Closing twice does no harm.
        """
        if self.closed:
            return
        self.closed = True
        if not self._goals:
            self.release()
            return
        self._limit = self.ros.steady_timer(CANCEL_LIMIT_S, self.release)
        for goal in self._goals:
            goal.abandon()

    def release(self) -> None:
        """Release the client at once. Doing it twice does no harm."""
        if self.released:
            return
        if self.closed and self._goals:
            is_refused = any(goal.is_refused for goal in self._goals)
            why = "a cancel is refused" if is_refused else "no answer to a cancel"
            self.ros.log.warning(f"{why}: the goal may go on", action=self.name, goals=len(self._goals))
        self.closed = self.released = True
        if self._limit is not None:
            self._limit.cancel()
        for goal in list(self._goals):
            goal.drop()
        self.client.destroy()

    def _check_servers(self) -> None:
        before, self._servers = self._servers, self._matched_servers()
        appeared = bool(self._servers - before)
        for goal in list(self._goals):
            goal.restore(appeared)

    def _matched_servers(self) -> frozenset[bytes]:
        # The identity of the status publisher tells a restarted server from the one that took the goal.
        if not self.ready():
            return frozenset()
        infos = self.ros.node.get_publishers_info_by_topic(f"{self.name}/_action/status")
        return frozenset(bytes(info.endpoint_gid) for info in infos)


class Goal:
    """One active goal; ends in exactly one of rejected and ended."""

    def __init__(self, caller: ActionCaller, callbacks: GoalCallbacks, key: str = "") -> None:
        self._caller = caller
        self._client = caller.client
        self._report = callbacks
        self._id = UUID(uuid=list(goal_id(caller.name, key) if key else uuid.uuid4().bytes))
        self._handle = self._own_handle()
        self._accepted = False
        self._over = False
        self._result_overdue = False
        self._asks_left = 0
        self._cancelling: list[Future] = []
        self._unanswered = 0  # looks in a row that found no answer
        self._cancels = Repeater(caller.ros.steady_timer, CANCEL_PERIOD_S, self._repeat_cancel)
        self.is_refused = False
        self._abandoned = False

    def cancel(self) -> None:
        """Request a cancel, repeated until the server accepts it.

        Before the goal is accepted this does nothing: the caller cancels when `accepted` comes.
        """
        if self._accepted and not self._over:
            self._cancels.start()
            self._send_cancel()

    def send(self, goal: Any) -> None:
        """Send the goal request (called once, by the caller object)."""
        guard = self._caller.ros.guarded
        goal = self._caller.ros.frames.outgoing(goal)
        future = self._client.send_goal_async(goal, guard(self._on_feedback), self._id)
        future.add_done_callback(guard(self._on_answer))

    def adopt(self) -> None:
        """Ask for the result of a goal that another process sent (called once, by the caller object)."""
        self._accepted = True
        self._client._feedback_callbacks[bytes(self._id.uuid)] = self._caller.ros.guarded(self._on_feedback)
        if self._caller.ready():
            self._ask_result()

    def restore(self, server_appeared: bool) -> None:
        """Ask again for a result that an outage may have lost; called periodically."""
        finished = self._handle.status in _TERMINAL
        if server_appeared:
            self._asks_left = ASKS
        if self._asks_left or (finished and self._result_overdue):
            self._ask_result()
        self._asks_left = max(0, self._asks_left - 1)
        self._result_overdue = finished

    def abandon(self) -> None:
        """Cancel the goal, accepted or not, and make no callback any more."""
        self._report = GoalCallbacks(accepted=self.cancel)
        self._abandoned = True
        self._cancels.start()
        if not self._cancelling:
            self._send_cancel()

    def drop(self) -> None:
        """Drop the goal without a callback."""
        self._over = True
        self._cancels.stop()
        self._caller.forget(self)

    def _own_handle(self) -> ClientGoalHandle:
        # The answer to the goal request may be lost: with a handle of our own the result can be asked for.
        response = self._caller.kind.Impl.SendGoalService.Response(accepted=True)
        return ClientGoalHandle(self._client, self._id, response)

    def _on_answer(self, future: Future) -> None:
        handle = future.result()
        if self._over:
            if handle.accepted:
                handle.cancel_goal_async()  # taken after it was reported as rejected: must not run on
        elif handle.accepted:
            self._handle = handle  # this one is kept up to date by the status topic
            self._accept()
        else:
            self._end(self._report.rejected)

    def _accept(self) -> None:
        if self._accepted:
            return
        self._accepted = True
        self._ask_result()
        self._report.accepted()

    def _on_feedback(self, message: Any) -> None:
        if self._over:
            return
        self._accept()  # feedback may overtake the answer to the goal request
        self._report.feedback(self._caller.ros.frames.incoming(message.feedback))

    def _ask_result(self) -> None:
        future = self._handle.get_result_async()
        future.add_done_callback(self._caller.ros.guarded(self._on_result))

    def _on_result(self, future: Future) -> None:
        response = future.result()
        if self._over:
            return
        if not self._accepted and response.status == GoalStatus.STATUS_UNKNOWN:
            self._end(self._report.rejected)
            return
        if not self._accepted:
            self._accepted = True
            self._report.accepted()
        result = self._caller.ros.frames.incoming(response.result)
        self._end(partial(self._report.ended, int(response.status), result))

    def _end(self, report: Callable[[], None]) -> None:
        self._over = True
        self._cancels.stop()
        self._caller.forget(self)
        # rclpy forgets the feedback callback only with the result, so a rejected goal would leave it behind.
        self._client._feedback_callbacks.pop(bytes(self._id.uuid), None)
        report()

    def _repeat_cancel(self) -> None:
        self._unanswered = self._unanswered + 1 if self._cancelling else 0
        if self._unanswered % 2 == 0 and self._caller.ready():
            self._send_cancel()

    def _send_cancel(self) -> None:
        if len(self._cancelling) == MOST_CANCELS:
            self._client._remove_pending_cancel_request(self._cancelling.pop(0))
        sent = self._handle.cancel_goal_async()
        self._cancelling.append(sent)
        sent.add_done_callback(self._caller.ros.guarded(self._on_cancel_answer))

    def _on_cancel_answer(self, future: Future) -> None:
        if future in self._cancelling:
            self._cancelling.remove(future)
        answer: CancelGoal.Response = future.result()
        if self._over:
            return
        if self._is_refusal(answer):
            self._be_refused()
            return
        self._cancels.stop()
        if self._abandoned:
            self._end_abandoned(answer.return_code)
        elif answer.return_code != CancelGoal.Response.ERROR_NONE:
            self._ask_result()  # the goal is unknown or has ended: the result says which

    def _is_refusal(self, answer: CancelGoal.Response) -> bool:
        """Return whether the server refuses; one of rclpy only leaves the goal out."""
        ids = [bytes(info.goal_id.uuid) for info in answer.goals_canceling]
        left_out = answer.return_code == CancelGoal.Response.ERROR_NONE and bytes(self._id.uuid) not in ids
        return left_out or bool(answer.return_code == CancelGoal.Response.ERROR_REJECTED)

    def _be_refused(self) -> None:
        if not self.is_refused:
            self.is_refused = True
            self._caller.ros.log.warning("the server refuses to cancel the goal", action=self._caller.name)
            self._report.refused()

    def _end_abandoned(self, code: int) -> None:
        # A server may look at the cancel before it takes the goal: then the acceptance has it sent again.
        if self._accepted or code != CancelGoal.Response.ERROR_UNKNOWN_GOAL_ID:
            self._end(_nothing)


class ActionHost:
    """The server of one action; its owner executes goals by timers, never in a callback.

    `admit(goal)` returns whether a goal is accepted; `started(served)` hands it over; `cancelled(served)` is
    called when a client cancels it, and the owner then ends it with a method of `served`. A goal is rejected
    or aborted where these raise.
    """

    def __init__(
        self,
        ros: Host,
        kind: Any,
        name: str,
        *,
        admit: Callable[[Any], bool],
        started: Callable[[ServedGoal], None],
        cancelled: Callable[[ServedGoal], None],
    ) -> None:
        self._ros = ros
        self._kind = kind
        self._admit = admit
        #: Returns whether the cancel of a goal is refused.
        self.refuses: Callable[[ServedGoal], bool] = lambda _: False
        self._started = started
        self._cancelled = ros.guarded(cancelled)
        self._served: dict[bytes, ServedGoal] = {}
        self.closed = False
        services = Qos.SERVICES.profile()
        self._server = ActionServer(
            ros.node,
            kind,
            name,
            self._until_finished,
            goal_callback=self._on_request,
            handle_accepted_callback=self._on_accepted,
            cancel_callback=self._on_cancel,
            goal_service_qos_profile=services,
            result_service_qos_profile=services,
            cancel_service_qos_profile=services,
            result_timeout=RESULT_KEPT_S,
        )

    @property
    def is_serving(self) -> bool:
        """Whether a goal is under way, or its result is still to be sent."""
        return bool(self._served)

    def close(self) -> None:
        """Release the server. Closing twice does no harm."""
        if not self.closed:
            self.closed = True
            self._server.destroy()

    def _on_request(self, request: Any) -> GoalResponse:
        try:
            taken = self._admit(self._ros.frames.incoming(request))
        except Exception:
            self._ros.log.exception("admitting a goal failed; it is rejected")
            taken = False
        return GoalResponse.ACCEPT if taken else GoalResponse.REJECT

    def _on_accepted(self, handle: ServerGoalHandle) -> None:
        served = ServedGoal(self._ros, handle, self._forget)
        self._served[served.key] = served
        handle.execute()
        try:
            self._started(served)
        except Exception:
            self._ros.log.exception("beginning with a goal failed; it is aborted")
            served.abort(self._kind.Result())

    def _on_cancel(self, handle: ServerGoalHandle) -> CancelResponse:
        served = self._served.get(bytes(handle.goal_id.uuid))
        if served is None or self.refuses(served):
            return CancelResponse.REJECT
        # rclpy marks the goal as cancelling only after this callback: call the owner afterwards.
        self._ros.post(lambda: self._cancelled(served))
        return CancelResponse.ACCEPT

    async def _until_finished(self, handle: ServerGoalHandle) -> Any:
        # rclpy sends the result when this coroutine returns; it rests here without a thread.
        return await self._served[bytes(handle.goal_id.uuid)].result

    def _forget(self, served: ServedGoal) -> None:
        # After the coroutine has read the result.
        self._ros.post(partial(self._served.pop, served.key, None))


class ServedGoal:
    """A goal that this node works on; ends once, by succeed, abort or cancel."""

    def __init__(self, ros: Host, handle: ServerGoalHandle, forget: Callable[[ServedGoal], None]) -> None:
        self._ros = ros
        self._handle = handle
        self._forget = forget
        self.key = bytes(handle.goal_id.uuid)
        self.request = ros.frames.incoming(handle.request)
        self.result: Future = Future()

    @property
    def active(self) -> bool:
        """Whether the goal has not ended yet."""
        return not self.result.done()

    def feedback(self, message: Any) -> None:
        """Publish feedback."""
        if self.active:
            self._handle.publish_feedback(self._ros.frames.outgoing(message))

    def succeed(self, result: Any) -> None:
        """End the goal: reached."""
        self._end(self._handle.succeed, result)

    def abort(self, result: Any) -> None:
        """End the goal: given up."""
        self._end(self._handle.abort, result)

    def cancel(self, result: Any) -> None:
        """End the goal on its client's request; an error before the client asked."""
        self._end(self._handle.canceled, result)

    def _end(self, transition: Callable[[], None], result: Any) -> None:
        if not self.active:
            return
        transition()
        self.result.set_result(self._ros.frames.outgoing(result))
        self._forget(self)  # posting wakes the executor, which then resumes the waiting coroutine
