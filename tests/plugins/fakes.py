"""Stand-ins for the middleware adapter and the engine's outlet; a test moves their time and their world."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

from lupin_engine.plugin.contract import Code, Plugin

if TYPE_CHECKING:
    from lupin_ros.adapter.actions import GoalCallbacks


def defaults(plugin: Plugin, **changed: Any) -> dict[str, Any]:
    """Return the parameters of `plugin` at their defaults, but for `changed`."""
    return {name: parameter.default for name, parameter in plugin.parameters.items()} | changed


@dataclass
class FakeOutlet:
    """Keeps what a driver reported: `reports` of attempts, `values` and `events` by name, all in order."""

    reports: list[tuple[Any, ...]] = field(default_factory=list)
    values: list[tuple[str, Any, float]] = field(default_factory=list)
    events: list[tuple[str, dict[str, Any]]] = field(default_factory=list)

    def accepted(self, attempt: str) -> None:
        self.reports.append(("accepted", attempt))

    def progress(self, attempt: str, detail: str) -> None:
        self.reports.append(("progress", attempt, detail))

    def done(self, attempt: str, result: Mapping[str, Any]) -> None:
        self.reports.append(("done", attempt, dict(result)))

    def failed(self, attempt: str, code: str, detail: str = "") -> None:
        self.reports.append(("failed", attempt, code, detail))

    def cancelled(self, attempt: str, result: Mapping[str, Any] | None = None) -> None:
        self.reports.append(("cancelled", attempt) if result is None else ("cancelled", attempt, result))

    def cancel_refused(self, attempt: str, detail: str) -> None:
        self.reports.append(("cancel_refused", attempt, detail))

    def value(self, name: str, value: Any, stamp: float) -> None:
        self.values.append((name, value, stamp))

    def event(self, name: str, data: Mapping[str, Any]) -> None:
        self.events.append((name, dict(data)))

    def of(self, name: str) -> list[Any]:
        """Return every value that was reported under `name`."""
        return [value for known, value, _ in self.values if known == name]

    def kinds(self, attempt: str) -> list[str]:
        """Return the kinds of reports about one attempt, in order, without progress."""
        return [kind for kind, about, *_ in self.reports if about == attempt and kind != "progress"]


@dataclass
class FakeGoal:
    """A goal that a test accepts, rejects and ends; `cancels` counts the requests to cancel it."""

    request: Any
    accepted: Callable[[], None]
    feedback: Callable[[Any], None]
    ended: Callable[[int, Any], None]
    rejected: Callable[[], None]
    refused: Callable[[], None]
    key: str = ""
    cancels: int = 0

    def cancel(self) -> None:
        self.cancels += 1


class FakeAction:
    """An action server that is up until a test says otherwise."""

    def __init__(self) -> None:
        self.up = True
        self.goals: list[FakeGoal] = []

    def ready(self) -> bool:
        return self.up

    def send(self, request: Any, callbacks: GoalCallbacks, key: str = "") -> FakeGoal:
        self.goals.append(FakeGoal(request, **vars(callbacks), key=key))
        return self.goals[-1]


@dataclass
class FakeCall:
    """A service call that a test answers through `done`."""

    request: Any
    timeout: float
    done: Callable[[Any], None]
    cancelled: bool = False

    def cancel(self) -> None:
        self.cancelled = True


class FakeService:
    """A service that is up until a test says otherwise."""

    def __init__(self) -> None:
        self.name = ""
        self.up = True
        self.calls: list[FakeCall] = []

    def ready(self) -> bool:
        return self.up

    def call(self, request: Any, timeout: float, done: Callable[[Any], None]) -> FakeCall:
        self.calls.append(FakeCall(request, timeout, done))
        return self.calls[-1]


class FakeLog:
    """Keeps warnings as (event, details)."""

    def __init__(self) -> None:
        self.warnings: list[tuple[str, dict[str, Any]]] = []

    def warning(self, event: str, **details: Any) -> None:
        self.warnings.append((event, details))

    error = warning


class FakeTimer:
    """A timer that a test fires by `FakeRos.pass_time`."""

    def __init__(self, period: float, callback: Callable[[], None]) -> None:
        self.period, self.callback, self.running = period, callback, True

    def cancel(self) -> None:
        self.running = False


class FakeGraph:
    """The part of an rclpy node that clients look at: names, and how many publish a topic."""

    def __init__(self) -> None:
        self.publishers = 1

    def resolve_topic_name(self, topic: str) -> str:
        return topic

    def count_publishers(self, topic: str) -> int:
        return self.publishers

    def get_publishers_info_by_topic(self, topic: str) -> list[SimpleNamespace]:
        return [SimpleNamespace(endpoint_gid=[number]) for number in range(self.publishers)]


class FakeRos:
    """What clients use of `RosNode`, with one action server, one service and a clock that a test moves."""

    def __init__(self) -> None:
        self.node = FakeGraph()
        self.lineage = "test"
        self.log = FakeLog()
        self.server = FakeAction()
        self.remote = FakeService()
        self.timers: list[FakeTimer] = []
        self.subscriptions: dict[str, Callable[[Any], None]] = {}
        self.profiles: dict[str, Any] = {}
        self.troubles: dict[str, str] = {}
        self.time = 100.0

    def now(self) -> float:
        return self.time

    def elapsed(self) -> float:
        return self.time

    def stamp(self) -> Any:
        from builtin_interfaces.msg import Time

        return Time(sec=int(self.time))

    def subscribe(self, kind: Any, topic: str, qos: Any, callback: Callable[[Any], None]) -> None:
        self.subscriptions[topic] = callback
        self.profiles[topic] = qos

    def full(self, name: str) -> str:
        return name

    def topic_name(self, name: str) -> str:
        return str(self.node.resolve_topic_name(name))

    def count_publishers(self, topic: str) -> int:
        return int(self.node.count_publishers(topic))

    def action(self, kind: Any, name: str) -> FakeAction:
        return self.server

    def service(self, kind: Any, name: str) -> FakeService:
        self.remote.name = name
        return self.remote

    def trouble(self, about: str, problem: str, code: Code) -> None:
        assert code.advice
        self.troubles[about] = problem

    def timer(self, period: float, callback: Callable[[], None]) -> FakeTimer:
        return self.steady_timer(period, callback)

    def steady_timer(self, period: float, callback: Callable[[], None]) -> FakeTimer:
        self.timers.append(FakeTimer(period, callback))
        return self.timers[-1]

    def call_later(self, delay: float, callback: Callable[[], None]) -> FakeTimer:
        def fire() -> None:
            timer.cancel()
            callback()

        timer = FakeTimer(delay, fire)
        self.timers.append(timer)
        return timer

    def pass_time(self, seconds: float) -> None:
        """Move the clock and fire every running timer as often as its period fits."""
        self.time += seconds
        for timer in self.timers:
            for _ in range(round(seconds / timer.period)):
                if timer.running:
                    timer.callback()
