"""Compiled bindings: a plugin, and the expressions that build requests and interpret answers.

Needs no ROS: field types on the wire are unknown here, so an answer's fields fit everywhere. Where the
definition is known, `reader.check_definition` compiles the expressions again with its types. Fields on the
wire have no units: they are in the engine's (seconds, metres, radians), or in the binding's `unit`, to and
from which arguments, parameters and results are converted.

Besides arguments or answer, expressions see `around`: `param` (the binding's parameters), `constant` (of the
interface, by name) and `now` (seconds).
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
    """The interpretation of an answer: the result, or None with a code and a text."""

    result: Mapping[str, Any] | None
    code: str = ""
    detail: str = ""


@dataclass(frozen=True)
class Endpoint:
    """A service, action or topic: `kind` is srv, action or msg; `deadline` is in seconds."""

    kind: str
    name: str
    type: str
    place: Place
    deadline: float | None
    qos: str


class Kinds(NamedTuple):
    """The engine's type of a value, and its type in wire expressions: its numbers may have another unit."""

    kept: Type
    wire: Type


class Taken(NamedTuple):
    """A value that is read from an answer or a message."""

    kinds: Kinds
    value: Value


@dataclass(frozen=True)
class Sending:
    """The fields of a request, goal or message, as expressions over arguments."""

    fields: Fields

    def sent(self, arguments: Mapping[str, Any], around: Around) -> dict[str, Any]:
        """Return the fields as plain data; raises errors of their expressions."""
        return _sent(self.fields, _seeing(arguments, around))


@dataclass(frozen=True)
class OperationCall:
    """The request of an operation, and the interpretation of its answer."""

    endpoint: Endpoint
    sending: Sending
    done_when: Value | None
    result: Mapping[str, Taken]
    code: str
    code_when: Mapping[str, Value]
    unavailable: str
    rejected: str
    detail: Value | None
    progress_values: Mapping[str, Value]
    moves: bool
    cut_short: bool
    watched: bool

    def given(self, answer: Mapping[str, Any], around: Around) -> Mapping[str, Any] | None:
        """Return the result of a cancelled goal; None where none is declared. Raises expressions' errors."""
        return _taken(self.result, _seeing(answer, around)) if self.cut_short else None

    def outcome(self, answer: Mapping[str, Any], around: Around) -> Outcome:
        """Interpret `response`, or `status` and `result`; raises errors of the expressions."""
        seen = _seeing(answer, around)
        if self.done_when is not None and self.done_when.evaluate(seen):
            return Outcome(_taken(self.result, seen))
        code = next((name for name, when in self.code_when.items() if when.evaluate(seen)), self.code)
        return Outcome(None, code, str(self.detail.evaluate(seen)) if self.detail is not None else "")

    def progress(self, feedback: Mapping[str, Any], around: Around) -> str:
        """Return the progress text of feedback; raises errors of the expressions."""
        seen = _seeing({"feedback": feedback}, around)
        said = ((name, _shown(value.evaluate(seen))) for name, value in self.progress_values.items())
        return ", ".join(f"{name} {value}".strip() for name, value in said)


@dataclass(frozen=True)
class MessageSent:
    """An action: a message to publish."""

    endpoint: Endpoint
    sending: Sending


@dataclass(frozen=True)
class MessageHeard:
    """A live value or an event: the values read from a topic's messages.

    `fields` are those of the event, or the one field `value`.
    """

    endpoint: Endpoint
    when: Value | None
    fields: Mapping[str, Taken]

    def heard(self, message: Mapping[str, Any], around: Around) -> Mapping[str, Any] | None:
        """Return a message's values; None where its condition is false. Raises expressions' errors."""
        seen = _seeing({"message": message}, around)
        if self.when is not None and not self.when.evaluate(seen):
            return None
        return _taken(self.fields, seen)


@dataclass(frozen=True, eq=False)
class Binding:
    """A plugin made of a file. Compared by identity.

    `calls` are its operations, `sends` its actions, `events` its events by local name; `values` its live
    values by their own names.
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
