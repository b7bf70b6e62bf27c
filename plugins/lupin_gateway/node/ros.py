"""The adapter of `RosPort` to rclpy: posts each request to the ROS thread, and each result back to the loop.

While the robot is stopped, every goal is refused, and so are publications and calls that move it; also those
that wait for their server when the stop comes.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from lupin_gateway.access import UseRefusal
from lupin_gateway.encoding import Sample
from lupin_gateway.motion import STOPPED
from lupin_gateway.motion.names import MotionNames
from lupin_gateway.node.calls import Actions, PendingGoal, Services
from lupin_gateway.node.rosapi import Rosapi
from lupin_gateway.node.topics import Publishers, Subscription, Subscriptions
from lupin_gateway.ports import CallFailed, GoalEnd
from lupin_ros.adapter import RosNode

Post = Callable[..., None]

#: Seconds for which a message that moves the robot counts: a base obeys a velocity no longer.
DRIVES_S = 1.0


class RosAdapter:
    """The robot as a `ports.RosPort`; `post` schedules a call on the event loop."""

    def __init__(self, ros: RosNode, post: Post) -> None:
        self._ros = ros
        self._post = post
        self._subscriptions = Subscriptions(ros, post)
        self._publishers = Publishers(ros, self._subscriptions.published)
        self._services = Services(ros)
        self._actions = Actions(ros)
        self._rosapi = Rosapi(ros, self._services)
        #: What moves the robot; while it is stopped none is sent, also not what a page asked for before.
        self.moving = MotionNames(())
        #: Returns whether a call commands the mission, other than to pause.
        self.commands: Callable[[str, Any], bool] = lambda *_: False
        #: When pages last published what moves the robot, by topic.
        self._moved_at: dict[str, float] = {}
        self._stopped = False
        self._stops = 0

    def about(self) -> Mapping[str, Any]:
        """Return the mode `robot`."""
        return {"mode": "robot"}

    def listen(
        self,
        topic: str,
        type_: str,
        on_sample: Callable[[Sample, bool], None],
        problem: Callable[[str], None],
    ) -> _HeldSubscription:
        """Subscribe to a topic on the ROS thread; return the feed, which may be closed at once."""
        feed = _HeldSubscription(self._ros, self._subscriptions)
        self._ros.post(lambda: feed.open(topic, type_, on_sample, problem))
        return feed

    def advertise(self, topic: str, type_: str, latch: bool, problem: Callable[[str], None]) -> None:
        """Prepare to publish; `problem` gets why that is not possible."""
        self._ros.post(lambda: self._report(problem, self._publishers.advertise(topic, type_, latch)))

    def unadvertise(self, topic: str) -> None:
        """Stop publishing, once every page that advertised the topic has called this."""
        self._ros.post(lambda: self._publishers.unadvertise(topic))

    def publish(self, topic: str, data: Any, problem: Callable[[str], None]) -> None:
        """Publish a message by its fields; `problem` gets why not, such as a stop."""
        self._ros.post(lambda: self._report(problem, self._publish(topic, data)))

    def _publish(self, topic: str, data: Any) -> str:
        moves = self.moving.published(topic, data)
        if moves and (refused := self._refused):
            return f"{topic} {refused}"
        self._moved_at.pop(topic, None)
        if moves:
            self._moved_at[topic] = time.monotonic()
        return self._publishers.publish(topic, data)

    def _report(self, problem: Callable[[str], None], text: str) -> None:
        if text:
            self._post(problem, text)

    def call(self, service: str, data: Any, limit: float, done: Callable[[Any], None]) -> None:
        """Call a service; `done` gets the response or `CallFailed`, which a stop meanwhile causes, too."""
        answer = partial(self._post, done)
        moves = self.moving.called(service)

        def call() -> None:
            if self._ros.inactive and (moves or self.commands(service, data)):
                answer(CallFailed(f"{service} refused: {self._ros.inactive}"))
                return
            stops = self._stops
            still = partial(self._still_allowed, stops) if moves else _always
            self._services.call(service, data, limit, answer, still)

        self._ros.post(call)

    def _still_allowed(self, stops: int) -> bool:
        """Return whether no stop came since the `stops`-th: a call may have waited for its server."""
        return not self._refused and self._stops == stops

    def send_goal(
        self,
        action: str,
        data: Any,
        feedback: Callable[[Mapping[str, Any]], None],
        done: Callable[[GoalEnd | CallFailed], None],
    ) -> Callable[[], None]:
        """Send a goal, `CallFailed` while stopped; return the function that cancels it."""
        pending = PendingGoal(action, partial(self._post, feedback), partial(self._post, done))
        self._ros.post(lambda: self._send_goal(pending, data))
        return lambda: self._ros.post(pending.cancel)

    def _send_goal(self, pending: PendingGoal, data: Any) -> None:
        if refused := self._refused:
            pending.end(CallFailed(f"{pending.name} {refused}"))
        else:
            self._actions.send(pending, data)

    # -- what stops ---------------------------------------------------------------------------------------

    @property
    def _refused(self) -> str:
        """Why nothing may move the robot now; '' where it may."""
        return STOPPED if self._stopped else self._ros.inactive and f"refused: {self._ros.inactive}"

    def what_moves(self) -> str:
        """Return by which name a page moves the robot now; '' where none does. On the ROS thread."""
        since = time.monotonic() - DRIVES_S
        driven = (topic for topic, at in self._moved_at.items() if at > since)
        return next(driven, "") or self._actions.under_way

    def end_all_motion(self) -> None:
        """End all motion of pages, also what waits for its server; on the ROS thread."""
        self._stops += 1
        self._end_motion()

    def hear_stop(self, engaged: bool) -> None:
        """Record whether the robot is stopped; on the ROS thread. A stop ends all motion of pages."""
        if engaged and not self._stopped:
            self.end_all_motion()
        self._stopped = engaged

    def halt(self) -> None:
        """End all motion of pages: cancel their goals, drop waiting messages, publish zero velocities."""
        self._ros.post(self._end_motion)

    def _end_motion(self) -> None:
        self._actions.cancel_all()
        self._publishers.halt(self.moving)

    def ask(self, question: str, data: Any, refusal: UseRefusal, done: Callable[[Any], None]) -> bool:
        """Answer a call of `/rosapi/QUESTION` by `done`; False where there is no such question."""
        if question not in self._rosapi.questions:
            return False
        self._ros.post(lambda: self._rosapi.answer(question, data, refusal, partial(self._post, done)))
        return True


def _always() -> bool:
    return True


class _HeldSubscription:
    """A subscription of the web side; made and closed on the ROS thread."""

    def __init__(self, ros: RosNode, subscriptions: Subscriptions) -> None:
        self._ros = ros
        self._subscriptions = subscriptions
        self._subscription: Subscription | None = None
        self._is_closed = False

    def open(self, *arguments: Any) -> None:
        """Subscribe, unless it was closed in the meantime."""
        if not self._is_closed:
            self._subscription = self._subscriptions.add(*arguments)

    def close(self) -> None:
        """End the subscription; no sample follows after the ROS thread has done so."""
        self._is_closed = True
        self._ros.post(self._end)

    def _end(self) -> None:
        if self._subscription is not None:
            self._subscriptions.remove(self._subscription)
