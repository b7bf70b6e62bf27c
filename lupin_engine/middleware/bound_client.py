"""A client for services that are known by name only: what to send and what an answer means is told as data.

This is the whole driver of a plugin that is written down in a file. The adapter knows nothing of such files;
it sees a `Bound` for each operation.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any, Protocol

from lupin_engine.middleware.definitions import fill, plain, service_class, service_types
from lupin_engine.middleware.node import Failure, RosNode, Timer
from lupin_engine.middleware.service_driver import (
    CALL_DEADLINE_S,
    Done,
    Failed,
    ServiceDriver,
    ServiceOperation,
)
from lupin_engine.plugin.contract import Outlet

#: How long after it was made a client waits for a server that it does not see: discovery takes its time.
DISCOVERY_S = 3.0
_LOOK_PERIOD_S = 0.05


class Meaning(Protocol):
    """What an answer means: the result, or None with a text that says why not."""

    @property
    def result(self) -> Mapping[str, Any] | None:
        """Return the result, None when the operation failed."""

    @property
    def detail(self) -> str:
        """Return why it failed."""


class Bound(Protocol):
    """How an operation becomes a call; see `chart.bindings.ServiceCall`."""

    @property
    def service(self) -> str:
        """Return the name of the service."""

    @property
    def type(self) -> str:
        """Return its type, which is installed and fits."""

    @property
    def code(self) -> str:
        """Return the code that attempts fail with."""

    @property
    def place(self) -> object:
        """Return where all this is written, for people."""

    @property
    def deadline(self) -> float | None:
        """Return when a call counts as lost, in seconds."""

    def sent(self, arguments: Mapping[str, Any]) -> Mapping[str, Any]:
        """Return the fields of the request."""

    def outcome(self, response: Mapping[str, Any]) -> Meaning:
        """Return what an answer means."""


class BoundClient(ServiceDriver):
    """The driver of a plugin that is a file."""

    def __init__(self, ros: RosNode, plugin: str, calls: Mapping[str, Bound], outlet: Outlet) -> None:
        self._ros = ros
        self._bound = calls
        self._patient_until = ros.elapsed() + DISCOVERY_S
        self._waiting: dict[str, Timer] = {}
        super().__init__(plugin, outlet, {name: _operation(ros, call) for name, call in calls.items()})

    def start(self, attempt: str, operation: str, arguments: Mapping[str, Any]) -> None:
        """Call the operation's service, or wait a little for one that was not found yet."""
        if self._may_be_found(operation):
            look = partial(self._look, attempt, operation, arguments)
            self._waiting[attempt] = self._ros.timer(_LOOK_PERIOD_S, look)
            return
        try:
            super().start(attempt, operation, arguments)
        except (ValueError, ArithmeticError, LookupError, TypeError) as problem:
            call = self._bound[operation]
            self._outlet.failed(attempt, call.code, f"{call.place}: {problem}")

    def _may_be_found(self, operation: str) -> bool:
        ready = self._operations[operation].service.ready()
        return not ready and self._ros.elapsed() < self._patient_until

    def _look(self, attempt: str, operation: str, arguments: Mapping[str, Any]) -> None:
        if not self._may_be_found(operation):
            self._waiting.pop(attempt).cancel()
            self.start(attempt, operation, arguments)

    def cancel(self, attempt: str) -> None:
        """End the attempt here; a service call cannot be recalled."""
        waiting = self._waiting.pop(attempt, None)
        if waiting is None:
            super().cancel(attempt)
            return
        waiting.cancel()
        self._outlet.cancelled(attempt)

    def close(self) -> None:
        """Drop every answer that is still to come, and let go of the services."""
        for timer in self._waiting.values():
            timer.cancel()
        self._waiting.clear()
        super().close()
        for operation in self._operations.values():
            operation.service.close()


def _operation(ros: RosNode, call: Bound) -> ServiceOperation:
    kind, types = service_class(call.type), service_types(call.type)
    return ServiceOperation(
        ros.service(kind, call.service),
        lambda arguments: fill(kind.Request(), call.sent(arguments), types.request),
        partial(_outcome, call),
        CALL_DEADLINE_S if call.deadline is None else call.deadline,
    )


def _outcome(call: Bound, _: Mapping[str, Any], answer: Any | Failure) -> Done | Failed:
    if isinstance(answer, Failure):
        return Failed(call.code, answer.detail)
    try:
        meaning = call.outcome(plain(answer))
    except Exception as problem:  # whatever a file computes from an answer that nobody foresaw
        return Failed(call.code, f"{call.place}: {problem}")
    return Failed(call.code, meaning.detail) if meaning.result is None else Done(meaning.result)
