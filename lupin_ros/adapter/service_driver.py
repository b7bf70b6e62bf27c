"""A driver whose operations are one service call each; a plugin gives the request and reads the answer."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from lupin_engine.plugin import Outlet
from lupin_ros.adapter.host import TimerHandle
from lupin_ros.adapter.node import CallFailure, ServiceCall, ServiceCaller

#: The deadline of a call, in seconds. A mission's own timeout is shorter and cancels the attempt; this one is
#: for a mission with `timeout: never`.
CALL_DEADLINE_S = 60.0


@dataclass(frozen=True)
class Done:
    """The attempt succeeded."""

    result: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Failed:
    """The attempt ended in one of its operation's codes."""

    code: str
    detail: str = ""


@dataclass(frozen=True)
class ServiceOperation:
    """An operation as a call: `request` makes it from the arguments, `outcome` reads these and the answer.

    After `deadline` seconds without an answer the attempt has failed.
    """

    service: ServiceCaller
    request: Callable[[Mapping[str, Any]], Any]
    outcome: Callable[[Mapping[str, Any], Any | CallFailure], Done | Failed]
    deadline: float = CALL_DEADLINE_S


class ServiceDriver:
    """Runs attempts as service calls; `plugin.contract.Driver` has the contract of each method."""

    def __init__(self, plugin: str, outlet: Outlet, operations: Mapping[str, ServiceOperation]) -> None:
        """Make the driver of `plugin` with its operations by local name."""
        self._plugin = plugin
        self._outlet = outlet
        self._operations = operations
        self._calls: dict[str, ServiceCall | TimerHandle] = {}

    def missing(self) -> list[str]:
        """Return the services that are not reachable."""
        services = {operation.service.name: operation.service for operation in self._operations.values()}
        return [f"service {name}" for name, service in services.items() if not service.ready()]

    def start(self, attempt: str, operation: str, arguments: Mapping[str, Any]) -> None:
        """Call the operation's service; ValueError where the plugin has no such operation."""
        if operation not in self._operations:
            raise ValueError(f"{self._plugin} has no operation {operation!r}")
        wanted = self._operations[operation]
        request = wanted.request(arguments)
        self._outlet.accepted(attempt)  # services do not acknowledge: a sent request counts as accepted
        self._ask(attempt, wanted, arguments, request)

    def _ask(
        self, attempt: str, operation: ServiceOperation, arguments: Mapping[str, Any], request: Any
    ) -> None:
        answered = partial(self._answered, attempt, operation, arguments)
        self._calls[attempt] = operation.service.call(request, operation.deadline, answered)

    def _answered(
        self,
        attempt: str,
        operation: ServiceOperation,
        arguments: Mapping[str, Any],
        answer: Any | CallFailure,
    ) -> None:
        del self._calls[attempt]
        outcome = operation.outcome(arguments, answer)
        if isinstance(outcome, Done):
            self._outlet.done(attempt, outcome.result)
        else:
            self._outlet.failed(attempt, outcome.code, outcome.detail)

    def cancel(self, attempt: str) -> None:
        """End the attempt here; a service call cannot be recalled, its answer is dropped."""
        call = self._calls.pop(attempt, None)
        if call is not None:
            call.cancel()
            self._outlet.cancelled(attempt)

    def act(self, action: str, arguments: Mapping[str, Any]) -> None:
        """Raise ValueError: such a plugin has no actions."""
        raise ValueError(f"{self._plugin} has no action {action!r}")

    def close(self) -> None:
        """Drop every answer that is still to come."""
        for call in self._calls.values():
            call.cancel()
        self._calls.clear()
