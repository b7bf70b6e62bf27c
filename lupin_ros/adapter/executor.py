"""The executor of a node: rclpy's, which also refuses stale requests, and costs less."""

from __future__ import annotations

import contextlib
import time
import weakref
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

from rclpy.action import ActionClient
from rclpy.client import Client
from rclpy.context import Context
from rclpy.exceptions import InvalidHandle
from rclpy.executors import SingleThreadedExecutor
from rclpy.guard_condition import GuardCondition
from rclpy.node import Node
from rclpy.service import Service
from rclpy.task import Task
from structlog.typing import FilteringBoundLogger

#: How old a request may be, in seconds (None: any age), or what judges one: it gets the request and when it
#: was sent, in POSIX time, and returns its age where that is too much.
StaleAfter = float | None | Callable[[Any, float], float | None]


@dataclass(frozen=True)
class Serving:
    """How a service's requests are taken: see `RosNode.serve` and `RosNode.serve_later`."""

    stale_after: StaleAfter
    refuse: Callable[[Any, str], Any] | None
    later: bool


def _send_response(service: Service, header: Any, response: Any) -> None:
    """Send an answer, unless the node has been closed since it was asked."""
    with contextlib.suppress(InvalidHandle):
        service.send_response(response, header)


class LivingEntities(set[Any]):
    """The weak references of a callback group, without those of what is gone.

    rclpy keeps them for ever, one for each timer that there has been.
    """

    def add(self, reference: Any) -> None:
        """Add the reference to an entity, for as long as that lives."""
        super().add(weakref.ref(reference(), self.discard))


class Executor(SingleThreadedExecutor):
    """rclpy's executor, extended by a check of each request's age, and cheaper.

    The callback of a service does not get the header that holds the timestamp, so the taking of the
    request is the one place to look.
    """

    def __init__(self, context: Context, log: FilteringBoundLogger) -> None:
        super().__init__(context=context)
        self._log = log
        self._served: dict[Service, Serving] = {}
        #: Whether only answers of servers are taken, and what is posted: a node that ends begins nothing new.
        self.answers_only = False

    def can_execute(self, entity: Any) -> bool:
        """Say whether something may be waited for, and worked on."""
        answers = (ActionClient, Client, GuardCondition)
        return (not self.answers_only or isinstance(entity, answers)) and super().can_execute(entity)

    def serve(self, service: Service, how: Serving) -> None:
        """Take the requests of `service` here."""
        self._served[service] = how

    def _make_handler(self, entity: Any, node: Node, take_from_wait_list: Callable[[Any], Any]) -> Task:
        """Do what rclpy does for one ready entity, but do not wake this thread afterwards.

        rclpy triggers its guard condition for the sake of other threads, of which there are none here; each
        piece of work then costs a second round through the wait set, 30 % of all processor time. Callbacks
        must be plain functions: nothing would take up a suspended one that has ended.
        """
        entity._executor_event = True

        async def handler() -> None:
            if self._is_shutdown or not entity.callback_group.beginning_execution(entity):
                entity._executor_event = False
                return
            with self._work_tracker:
                callback = take_from_wait_list(entity)
                entity._executor_event = False
                try:
                    if callback is not None:
                        await callback()
                finally:
                    entity.callback_group.ending_execution(entity)

        task = Task(handler, (), executor=self)
        with self._tasks_lock:
            self._tasks.append((task, entity, node))
        return task

    def _take_service(self, srv: Service) -> Any:
        if srv not in self._served:  # rclpy's own parameter services
            return super()._take_service(srv)
        try:
            with srv.handle:
                request, header = srv.handle.service_take_request(srv.srv_type.Request)
        except InvalidHandle:
            return None
        if header is None:
            return None
        reason = self._staleness(srv, header, request)

        async def answer() -> None:
            response = srv.srv_type.Response()
            if reason is not None:
                response = self._refused(srv, reason)
            elif self._served[srv].later:
                srv.callback(request, response, partial(_send_response, srv, header))
                return
            else:
                response = srv.callback(request, response)
            if response is not None:
                srv.send_response(response, header)

        return answer

    def _staleness(self, srv: Service, header: Any, request: Any) -> str | None:
        """Say why a request is too old to be carried out; None when it is not."""
        limit, sent_ns = self._served[srv].stale_after, header.source_timestamp
        if limit is None or sent_ns <= 0:
            return None
        if callable(limit):
            age = limit(request, sent_ns * 1e-9)
        else:
            age = (time.time_ns() - sent_ns) * 1e-9
            age = age if age > limit else None
        if age is None:
            return None
        self._log.warning("request refused: it is stale", service=srv.srv_name, age=round(age, 3))
        return f"refused: the request is {age:.1f} s old, or the clocks of the two computers disagree"

    def _refused(self, srv: Service, reason: str) -> Any:
        refuse = self._served[srv].refuse
        return None if refuse is None else refuse(srv.srv_type.Response(), reason)
