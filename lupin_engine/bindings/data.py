"""Bindings: what a file says of services, actions and topics, as a plugin and as what is sent and understood.

Reading needs no ROS: the types of fields on the wire are not known here, so what is read of an answer or a
message fits everywhere. Where the definition is known, `binding_reader.check_definition` reads the same
expressions again with its types. Fields on the wire have no units; they carry what the engine keeps (seconds,
metres, radians), or what the binding says with `unit`: expressions see the number of an argument or parameter
in that unit, and the number that they make of an answer or message is taken to be in it.

What expressions see besides the arguments or the answer is handed over as `around`: `param` (the binding's
parameters), `constant` (of the interface, by name) and `now` (seconds).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

from lupin_engine.chart.expressions.evaluation import Environment, Expression, Value
from lupin_engine.errors import Place
from lupin_engine.plugin.contract import Plugin
from lupin_engine.plugin.types import Type, convert, in_base, innermost
from lupin_engine.plugin.wire import pose_from

if TYPE_CHECKING:
    from lupin_engine.bindings.file import BindingNode

#: Fields of a message by name; what is a message itself is a mapping of its fields, what is a list a list.
Fields = Mapping[str, "Value | Fields | list[Value | Fields]"]
#: See the top of this module.
Around = Mapping[str, Any]


class Outcome(NamedTuple):
    """What an answer means: the result, or None with a code and a text that says why not."""

    result: Mapping[str, Any] | None
    code: str = ""
    detail: str = ""


@dataclass(frozen=True)
class Endpoint:
    """What something talks to: `kind` is srv, action or msg; `deadline` is in seconds."""

    kind: str
    name: str
    type: str
    place: Place
    deadline: float | None
    qos: str


class Kinds(NamedTuple):
    """How a value is kept, and how expressions about the wire see it: its numbers perhaps in another unit."""

    kept: Type
    wire: Type


class Taken(NamedTuple):
    """What is read of an answer or a message."""

    kinds: Kinds
    value: Value


@dataclass(frozen=True)
class Sending:
    """What is sent to an endpoint, worked out from arguments."""

    fields: Fields

    def sent(self, arguments: Mapping[str, Any], around: Around) -> dict[str, Any]:
        """Return the fields as plain data; raises what their expressions raise."""
        return _sent(self.fields, _seeing(arguments, around))


@dataclass(frozen=True)
class OperationCall:
    """What an attempt of an operation sends, and what the answer means."""

    endpoint: Endpoint
    sending: Sending
    done_when: Value | None
    result: Mapping[str, Taken]
    code: str
    code_when: Mapping[str, Value]
    unavailable: str
    rejected: str
    detail: Value | None
    told: Mapping[str, Value]
    moves: bool
    cut_short: bool
    watched: bool

    def given(self, answer: Mapping[str, Any], around: Around) -> Mapping[str, Any] | None:
        """Return what a goal that was cancelled comes to, if it is said that it comes to anything."""
        return _taken(self.result, _seeing(answer, around)) if self.cut_short else None

    def outcome(self, answer: Mapping[str, Any], around: Around) -> Outcome:
        """Return what `response`, or `status` and `result`, mean; raises what the expressions raise."""
        seen = _seeing(answer, around)
        if self.done_when is not None and self.done_when.evaluate(seen):
            return Outcome(_taken(self.result, seen))
        code = next((name for name, when in self.code_when.items() if when.evaluate(seen)), self.code)
        return Outcome(None, code, str(self.detail.evaluate(seen)) if self.detail is not None else "")

    def progress(self, feedback: Mapping[str, Any], around: Around) -> str:
        """Return what people are told of feedback; raises what the expressions raise."""
        seen = _seeing({"feedback": feedback}, around)
        said = ((name, _shown(value.evaluate(seen))) for name, value in self.told.items())
        return ", ".join(f"{name} {value}".strip() for name, value in said)


@dataclass(frozen=True)
class MessageSent:
    """An action: a message that is published."""

    endpoint: Endpoint
    sending: Sending


@dataclass(frozen=True)
class MessageHeard:
    """A live value or an event: what is read of the messages of a topic.

    `fields` are those of the event, or the one field `value`.
    """

    endpoint: Endpoint
    when: Value | None
    fields: Mapping[str, Taken]

    def heard(self, message: Mapping[str, Any], around: Around) -> Mapping[str, Any] | None:
        """Return what a message tells; None when it is passed over. Raises what the expressions raise."""
        seen = _seeing({"message": message}, around)
        if self.when is not None and not self.when.evaluate(seen):
            return None
        return _taken(self.fields, seen)


@dataclass(frozen=True, eq=False)
class Binding:
    """A plugin made of a file. Equal only to itself.

    `calls` are its operations, `sends` its actions, `events` its events by local name; `values` its live
    values by their own.
    """

    plugin: Plugin
    calls: Mapping[str, OperationCall]
    sends: Mapping[str, MessageSent]
    values: Mapping[str, MessageHeard]
    events: Mapping[str, MessageHeard]
    node: BindingNode = field(repr=False)

    @property
    def name(self) -> str:
        """The name of the plugin."""
        return self.plugin.name


def _seeing(things: Mapping[str, Any], around: Around) -> Environment:
    return {"param": around["param"], "context": {**around, **things}}


def _sent(fields: Fields, env: Environment) -> dict[str, Any]:
    return {name: _value(value, env) for name, value in fields.items()}


def _value(value: Any, env: Environment) -> Any:
    if isinstance(value, Mapping):
        return _sent(value, env)
    if isinstance(value, list):
        return [_value(element, env) for element in value]
    return value.evaluate(env)


def _taken(fields: Mapping[str, Taken], seen: Environment) -> dict[str, Any]:
    return {name: _kept(taken, seen) for name, taken in fields.items()}


def _kept(taken: Taken, seen: Environment) -> Any:
    found = taken.value.evaluate(seen)
    if not isinstance(taken.value, Expression):
        return found
    kept, wire = taken.kinds
    if wire is not kept:
        found = in_base(convert(found, wire), innermost(wire).unit)
    return convert(pose_from(found, kept), kept)


def _shown(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


__all__ = [
    "Around",
    "Binding",
    "Endpoint",
    "Fields",
    "Kinds",
    "MessageHeard",
    "MessageSent",
    "OperationCall",
    "Outcome",
    "Sending",
    "Taken",
]
