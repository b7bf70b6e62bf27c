"""Compiles the expressions of a binding, each with the names of its place.

`with` sees the arguments and `now`; expressions about an answer or a message see only that; `param` and
`constant` are seen everywhere. Where the interface's definition is known, its fields have its names and
types; else they may be anything. Numbers of arguments and parameters are in the binding's unit.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

from lupin_engine.bindings.data import Fields, Kinds, Taken
from lupin_engine.bindings.file import BoundValueNode, ResultNode
from lupin_engine.chart.expressions import units as q
from lupin_engine.chart.expressions.evaluation import Expression, Value
from lupin_engine.chart.expressions.scope import BUILTIN_CALLS, ROOTS, WORDS, Scope, Usage
from lupin_engine.chart.expressions.values import is_expression, read_constant, read_guard, read_value
from lupin_engine.chart.findings import Findings
from lupin_engine.chart.nodes import Node
from lupin_engine.chart.source import Map, Seq
from lupin_engine.errors import Place, nearest
from lupin_engine.plugin.types import ANY, DURATION, POSE, TEXT, UNITS, Type, innermost
from lupin_engine.plugin.wire import POSE_MESSAGE, TIMES

#: What an interface consists of (request, response, goal, ..., constant), as types.
Definition = Mapping[str, Type]

#: How the goal of an action can have ended.
STATUS = Type("text", "text", values=("succeeded", "aborted", "canceled"))
#: Reads the same everywhere: the settings, and the constants of the interface.
_AROUND = ("param", "constant")
_NOW = "now"


class Seen(NamedTuple):
    """The subject of some expressions, and its names there."""

    what: str
    names: tuple[str, ...]

    def __str__(self) -> str:
        return " and ".join(map(repr, self.names))


RESPONSE = Seen("answer", ("response",))
RESULT = Seen("answer", ("status", "result"))
FEEDBACK = Seen("feedback", ("feedback",))
MESSAGE = Seen("message", ("message",))
_OF_THE_WIRE = ("response", "status", "result", "feedback", "message")

#: What an argument cannot be called, because expressions read it by its bare name.
TAKEN = ROOTS.union(BUILTIN_CALLS, WORDS, _OF_THE_WIRE, (*_AROUND, _NOW))


@dataclass(frozen=True)
class WireExpressions:
    """Compiles the expressions about one endpoint.

    `sends` is the part of the definition that `with` fills: request, goal or message. `answer` is the subject
    of expressions about answers.
    """

    path: str
    sends: str
    answer: Seen
    arguments: Mapping[str, Type]
    params: Mapping[str, Type]
    definition: Definition | None
    findings: Findings
    usage: Usage = field(default_factory=Usage)

    # -- what is seen where --------------------------------------------------------------------------------

    def sending(self) -> Scope:
        """Return the scope of a request, goal or message: arguments, without the answer."""
        later = "the answer is there in 'done_when', 'result' and 'detail'"
        later = "nothing has been heard yet, this is sent" if self.sends == "message" else later
        names = {name: kind for name, kind in self.arguments.items() if name not in TAKEN}
        absent = dict.fromkeys(_OF_THE_WIRE, ("unknown-name", later))
        absent |= dict.fromkeys(sorted(ROOTS), ("unknown-name", "a binding sees its arguments only"))
        return self._scope({**names, _NOW: q.number("s")}, absent)

    def hearing(self, seen: Seen) -> Scope:
        """Return the scope of expressions about received data."""
        only = ("unknown-name", f"only the {seen.what} is seen here, {seen}")
        handed = ("unknown-name", f"it is handed over by 'with'; the {seen.what} is {seen}")
        absent = dict.fromkeys((*_OF_THE_WIRE, *sorted(ROOTS), _NOW), only)
        absent |= dict.fromkeys(self.arguments, handed)
        return self._scope({name: self._heard(name) for name in seen.names}, absent)

    def _heard(self, name: str) -> Type:
        if name == "status":
            return STATUS
        return q.WIRE if self.definition is None else on_the_wire(self.definition[name])

    def _scope(self, names: Mapping[str, Type], absent: Mapping[str, tuple[str, str]]) -> Scope:
        constants = q.WIRE if self.definition is None else self.definition["constant"]
        around = {"param": Type("record", "param", fields=self.params), "constant": constants}
        absent = {name: reason for name, reason in absent.items() if name not in {**names, **around}}
        return Scope({**names, **around}, absent=absent, usage=self.usage)

    # -- what is sent --------------------------------------------------------------------------------------

    def sent(self, node: Node) -> Fields:
        """Compile `with`; where the definition is known, each field must be of its type."""
        raw = node.mapping("with")
        wanted = ANY if self.definition is None else self.definition[self.sends]
        return {} if raw is None else self._fields(raw, wanted, self.sending(), f"{self.path}.with")

    def _fields(self, raw: Map, wanted: Type, scope: Scope, path: str) -> Fields:
        found: dict[str, Any] = {}
        for name in raw:
            if wanted.kind == "record" and name not in wanted.fields:
                problem, hint = f"{wanted} has no field {name!r}", nearest(name, wanted.fields)
                self.findings.add(raw.key_place(name), "unknown-argument", path, problem, hint)
                continue
            kind = wanted.fields[name] if wanted.kind == "record" else ANY
            part = self._part(raw[name], raw.value_place(name), kind, scope, f"{path}.{name}")
            if part is not None:
                found[name] = part
        return found

    def _part(self, raw: Any, place: Place, kind: Type, scope: Scope, path: str) -> Any:
        if isinstance(raw, Map) and kind.kind in ("record", "any"):
            return self._fields(raw, kind, scope, path)
        if isinstance(raw, Seq) and kind.kind in ("list", "any"):
            inner = zip(raw, raw.places, strict=True)
            parts = [self._part(value, where, kind.item or ANY, scope, path) for value, where in inner]
            return parts if None not in parts else None
        return self._fitting(raw, place, kind, scope, path, is_read=False)

    # -- what is heard -------------------------------------------------------------------------------------

    def condition(self, node: Node, key: str, seen: Seen) -> Expression | None:
        """Compile the condition under a key; None when there is none, and after findings."""
        raw, path = getattr(node, key), f"{self.path}.{key}"
        return read_guard(raw, node.at(key), self.hearing(seen), self.findings, path)

    def conditions(self, node: Node, key: str, seen: Seen) -> dict[str, Value]:
        """Compile the conditions in the mapping under a key, by name; those with findings are left out."""
        found: dict[str, Value] = {}
        scope = self.hearing(seen)
        for name, raw in getattr(node, key).items():
            place, path = node.value_at(key, name), f"{self.path}.{key}.{name}"
            read = read_guard(raw, place, scope, self.findings, path)
            if read is not None:
                found[name] = read
        return found

    def text(self, node: Node, key: str, seen: Seen) -> Value | None:
        """Compile the text under a key; None when there is none, and after findings."""
        raw, path = getattr(node, key), f"{self.path}.{key}"
        if raw is None:
            return None
        return read_value(raw, node.at(key), TEXT, self.hearing(seen), self.findings, path)

    def progress_values(self, node: Node, key: str, seen: Seen) -> dict[str, Value]:
        """Compile the values of a progress text: one, or several by label; none for findings."""
        raw, path, scope = getattr(node, key), f"{self.path}.{key}", self.hearing(seen)
        written = node.mapping(key)
        if written is None:
            places = {} if raw is None else {"": (raw, node.at(key), path)}
        else:
            places = {n: (written[n], written.value_place(n), f"{path}.{n}") for n in written}
        read = {
            name: read_value(value, place, ANY, scope, self.findings, inner)
            for name, (value, place, inner) in places.items()
        }
        return {name: value for name, value in read.items() if value is not None}

    def taken(self, node: ResultNode | BoundValueNode, kinds: Kinds, path: str) -> Taken | None:
        """Compile `from`: the source of a field of a result or an event, or of a live value.

        None after findings.
        """
        raw, place = node.from_, node.at("from")
        value = self._fitting(raw, place, kinds.kept, self.hearing(self.answer), path, is_read=True)
        if isinstance(value, Expression) and not self._has_unit(value, kinds.wire, path):
            return None
        return None if value is None else Taken(kinds, value)

    def _has_unit(self, found: Expression, wanted: Type, path: str) -> bool:
        """Say whether a number has the wanted unit or none; a finding where it has another known one."""
        unit, got = innermost(wanted).unit, innermost(found.type).unit
        if not unit or got in ("", "*", unit):
            return True
        same = got in UNITS and unit in UNITS and UNITS[got][0] == UNITS[unit][0]
        problem = f"expected {q.describe(wanted)}, but {found.source!r} is {q.describe(found.type)}"
        self.findings.add(found.place, "wrong-unit", path, problem, f"write 'unit: {got}'" if same else "")
        return False

    # -- types ---------------------------------------------------------------------------------------------

    def _fitting(
        self, raw: Any, place: Place, kind: Type, scope: Scope, path: str, *, is_read: bool
    ) -> Value | None:
        """Compile a value of a type; None after findings. Units are ignored: fields on the wire have none."""
        if not is_expression(raw):
            wanted = DURATION if kind.name in TIMES else kind
            return read_constant(raw, place, wanted, self.findings, path)
        found = read_value(raw, place, ANY, scope, self.findings, path)
        if isinstance(found, Expression) and not _fits(kind, found.type):
            self._misfit(found, kind, is_read, path)
            return None
        return found

    def _misfit(self, found: Expression, kind: Type, is_read: bool, path: str) -> None:
        wanted, got, hint = q.describe(kind), q.describe(found.type), _instead(kind, found)
        if kind.kind == "integer" and found.type.kind == "number":
            wanted, got = "a whole number", "one with digits"
            hint = "write 'type: number'" if is_read else f"write 'round({found.source})'"
        elif kind.name in TIMES:
            wanted = "a time"
        problem = f"expected {wanted}, but {found.source!r} is {got}"
        self.findings.add(found.place, "wrong-type", path, problem, hint)


def _instead(kind: Type, found: Expression) -> str:
    """Return a hint where a message needs more than a value, or a time its seconds."""
    if kind.name in TIMES and UNITS.get(found.type.unit, ("", 0.0))[0] == "s":
        return "a time is sent in s: leave 'unit' out, or divide by '1 s'"
    inner = [name for name, each in kind.fields.items() if _fits(each, found.type)]
    if inner:
        return f"write '{inner[0]}: ${{ {found.source} }}' inside of it"
    given = found.type.fields
    for name, each in kind.fields.items() if given else ():
        if name not in given:
            return f"it has no {name!r}"
        if not _fits(each, given[name]):
            return f"its {name!r} is {q.describe(given[name])}"
    return ""


def _fits(wanted: Type, got: Type) -> bool:
    """Return whether a value can stand for another, one of them on the wire: units are ignored."""
    if wanted.kind == "list" and got.kind == "list":
        return _fits(wanted.item or ANY, got.item or ANY)
    if wanted.name in TIMES and q.is_number(got):
        return got.unit in ("s", "", "*")
    if {wanted.name, got.name} == {POSE.name, POSE_MESSAGE}:
        return True
    if wanted.kind == got.kind == "record":
        fields = wanted.fields.items()
        return all(name in got.fields and _fits(each, got.fields[name]) for name, each in fields)
    return q.accepts(_bare(wanted), _bare(got))


def _bare(kind: Type) -> Type:
    """Return a type without its units."""
    return replace(_inside(kind, _bare), unit="")


def on_the_wire(kind: Type) -> Type:
    """Return the type of a message's field in expressions: numbers of any unit, times as seconds."""
    if kind.name in TIMES:
        return q.number("s")
    return _NUMBERS.get(kind.kind) or _inside(kind, on_the_wire)


_NUMBERS: Mapping[str, Type] = {"integer": q.ZERO, "number": q.ZERO_NUMBER}


def _inside(kind: Type, each: Callable[[Type], Type]) -> Type:
    item = None if kind.item is None else each(kind.item)
    return replace(kind, item=item, fields={name: each(inner) for name, inner in kind.fields.items()})


__all__ = [
    "FEEDBACK",
    "MESSAGE",
    "RESPONSE",
    "RESULT",
    "STATUS",
    "TAKEN",
    "Definition",
    "Seen",
    "WireExpressions",
    "on_the_wire",
]
