"""Events go into the machine, commands come out of it; both are plain frozen data."""

from __future__ import annotations

import reprlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

from lupin_engine.chart.expressions.evaluation import UnknownValue
from lupin_engine.chart.records import record
from lupin_engine.plugin.profile import ANSWER, START, Publish

#: The data of an event that has none.
NOTHING: Mapping[str, Any] = MappingProxyType({})


@record(frozen=True)
class Event:
    """Something that happened outside: a request, a report of an attempt, a live value."""

    name: str
    data: Mapping[str, Any] = field(default_factory=lambda: NOTHING)

    @property
    def is_request(self) -> bool:
        """Requests come from a person and are answered: accepted, or refused with a reason."""
        return self.name == START or self.name.startswith(("operator.", ANSWER))

    @property
    def is_attempt_event(self) -> bool:
        """Whether a server reports the progress or the end of an attempt."""
        return self.name.startswith("attempt.")


#: What waits for a release in place of the answer that an attempt keeps.
ANSWERED = "attempt.answered"
#: How far the robot's clock is ahead of the machine's, when that has changed.
CLOCK = "clock"
#: Told by whoever runs the machine: another process goes on with it, a code to report, an own hold to engage,
#: that it goes in circles without time, an own hold to release, a property that its run breaks.
RUNNERS = (
    *("engine.resumed", "engine.reported", "engine.held", "engine.standstill", "engine.released"),
    "engine.breached",
)
RESUMED, CODE_REPORTED, HELD_BACK, STANDSTILL, RELEASED, PROPERTY_BROKEN = RUNNERS
#: Names that journals of earlier versions have.
FORMER_NAMES: Mapping[str, str] = MappingProxyType({"engine.told": CODE_REPORTED})
#: The fields of what servers and sensors say, and of which type they are.
_FIELDS: Mapping[str, Mapping[str, type | tuple[type, ...]]] = MappingProxyType(
    {
        "attempt.accepted": {"attempt": str},
        "attempt.progress": {"attempt": str, "detail": str},
        "attempt.done": {"attempt": str, "result": (dict, Mapping)},
        "attempt.failed": {"attempt": str, "code": str, "detail": str},
        "attempt.cancelled": {"attempt": str},
        "attempt.cancel_refused": {"attempt": str, "detail": str},
        "value": {"name": str, "value": object, "stamp": (int, float)},
        CLOCK: {"ahead": (int, float)},
        RESUMED: {"detail": str, "held": bool, "away": (int, float)},
        CODE_REPORTED: {"code": str, "detail": str},
        HELD_BACK: {"hold": str, "detail": str},
        STANDSTILL: {"detail": str},
        RELEASED: {"hold": str},
        PROPERTY_BROKEN: {"property": str, "detail": str},
    }
)
#: Those that are times. No clock shows more seconds; it keeps sums finite and exact enough, and dates ours.
_TIMES: Mapping[str, str] = MappingProxyType({"value": "stamp", CLOCK: "ahead"})
_END_OF_TIME = 1e11


class Failure(dict[str, Any]):
    """The error of an attempt. A missing field is unknown to expressions, such as the `result` of one."""

    def __missing__(self, name: str) -> Any:
        raise UnknownValue(f"error.{name} is unknown")


class Trigger:
    """Why something is evaluated: the event's data, the error of an attempt, a `for_each`'s element."""

    __slots__ = ("error", "event", "item")

    def __init__(
        self, event: Mapping[str, Any] = NOTHING, error: Mapping[str, Any] = NOTHING, item: Any = None
    ) -> None:
        self.event = event
        self.error = error
        self.item = item


NO_TRIGGER = Trigger()


@dataclass(slots=True)
class InternalEvent:
    """An event that the machine itself raises. With `state` only that state's transitions listen to it."""

    name: str
    state: str | None = None
    trigger: Trigger = NO_TRIGGER


def flaw(event: Event) -> str:
    """Return the error in the form of a request, a report or a value, or an empty text."""
    if not isinstance(event.name, str):
        return f"the name of an event is no text: {reprlib.repr(event.name)}"
    fields = _FIELDS.get(event.name)
    if fields is None and not event.is_request:
        return f"there is no report {event.name!r}" if event.is_attempt_event else ""
    data = event.data
    if type(data) is not dict and not isinstance(data, Mapping):
        return f"{event.name} has no fields"
    wrong = _wrong_field(event.name, fields or {}, data)
    if wrong:
        return wrong
    time = _TIMES.get(event.name)
    if time is not None and (isinstance(data[time], bool) or not abs(data[time]) <= _END_OF_TIME):
        return f"{event.name} has a wrong {time}: {reprlib.repr(data[time])}"
    if event.name == START and not isinstance(data.get("mission_type", ""), str):
        return f"mission.start has a wrong mission_type: {reprlib.repr(data['mission_type'])}"
    return ""


def _wrong_field(event: str, fields: Mapping[str, Any], data: Mapping[str, Any]) -> str:
    for name, kind in fields.items():
        if name not in data:
            return f"{event} has no {name}"
        if not isinstance(data[name], kind):
            return f"{event} has a wrong {name}: {reprlib.repr(data[name])}"
    return ""


def accepted(attempt: str) -> Event:
    """The server took the attempt."""
    return Event("attempt.accepted", {"attempt": attempt})


def progress(attempt: str, detail: str) -> Event:
    """The reason for which the attempt waits; it becomes the detail of a timeout."""
    return Event("attempt.progress", {"attempt": attempt, "detail": detail})


def done(attempt: str, result: Mapping[str, Any]) -> Event:
    """The attempt succeeded."""
    return Event("attempt.done", {"attempt": attempt, "result": result})


def failed(attempt: str, code: str, detail: str = "") -> Event:
    """The attempt ended in one of its operation's codes."""
    return Event("attempt.failed", {"attempt": attempt, "code": code, "detail": detail})


def cancelled(attempt: str, result: Mapping[str, Any] | None = None) -> Event:
    """The attempt ended because it was asked to, with a result as far as it came."""
    given = {} if result is None else {"result": result}
    return Event("attempt.cancelled", {"attempt": attempt, **given})


def cancel_refused(attempt: str, detail: str) -> Event:
    """The server refuses to end the attempt; the detail is the consequence for people."""
    return Event("attempt.cancel_refused", {"attempt": attempt, "detail": detail})


def observed(name: str, value: Any, stamp: float) -> Event:
    """The live value `name` (the plugin's name for it) was `value` at time `stamp`."""
    return Event("value", {"name": name, "value": value, "stamp": stamp})


def clock(ahead: float) -> Event:
    """The robot's clock, in POSIX time, is so many seconds ahead of the machine's."""
    return Event(CLOCK, {"ahead": ahead})


@record(frozen=True)
class Start:
    """Begin an attempt of an operation: the `tries`th of the activation of `state` that it serves.

    One that `updates` an earlier attempt is sent while that runs; the server takes it in place of that one.
    """

    attempt: str
    operation: str
    arguments: Mapping[str, Any]
    state: str = ""
    tries: int = 1
    updates: str = ""


@record(frozen=True)
class Cancel:
    """Ask that an attempt ends."""

    attempt: str
    operation: str


@record(frozen=True)
class Act:
    """Carry out a plugin's action and don't wait."""

    action: str
    arguments: Mapping[str, Any]


@record(frozen=True)
class Report:
    """The mission's last word: every visit with its outcome."""

    mission: str
    mission_id: str
    visits: tuple[Mapping[str, Any], ...]


Command = Start | Cancel | Act | Publish | Report
