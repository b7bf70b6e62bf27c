"""Bindings: from what a file says of a service to a plugin, and to what its calls send and mean.

Reading needs no ROS: the types of a service's fields are not known here, so what is read of `response` fits
everywhere. Where the service's definition is known, `check_definition` reads the same expressions again with
its types. Fields on the wire have no units; they carry what the engine keeps: seconds, metres, radians.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from lupin_engine.chart import quantities as q
from lupin_engine.chart.binding_file import ArgumentNode, BindingNode, BoundOperationNode
from lupin_engine.chart.declare import SEVERITIES
from lupin_engine.chart.expressions import BUILTIN_CALLS, ROOTS, WORDS, Scope
from lupin_engine.chart.findings import Findings
from lupin_engine.chart.model import Environment, Expression, Value
from lupin_engine.chart.source import Map
from lupin_engine.chart.values import is_expression, read_constant, read_guard, read_value
from lupin_engine.errors import Place, nearest
from lupin_engine.plugin.contract import Argument, Code, Mock, OnHold, Operation, Plugin
from lupin_engine.plugin.types import ANY, DURATION, TEXT, Type, convert, parse_type

#: What expressions of a binding call the answer of the service.
RESPONSE = "response"

_NAME = re.compile(r"[a-z][a-z0-9_]*")
_CODE = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
_SERVICE = re.compile(r"[~/]?[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*")
_INTERFACE = re.compile(r"[a-z][a-z0-9_]*/srv/[A-Z][A-Za-z0-9]*")
#: What an argument cannot be called, because expressions read it by its bare name.
_TAKEN = ROOTS.union(BUILTIN_CALLS, WORDS, {RESPONSE})

#: What is told of a number where there must be no digits behind the point.
_DIGITS = ("a whole number", "one with digits")

#: Fields of a request by name; a field that is a message itself is a mapping of its fields.
Fields = Mapping[str, "Value | Fields"]


@dataclass(frozen=True)
class ServiceCall:
    """What an attempt of an operation sends, and what the answer means; `deadline` is in seconds."""

    service: str
    type: str
    request: Fields
    done_when: Value | None
    result: Mapping[str, tuple[Type, Value]]
    code: str
    place: Place
    detail: Value | None = None
    deadline: float | None = None

    def sent(self, arguments: Mapping[str, Any]) -> dict[str, Any]:
        """Return the fields of the request as plain data; raises what their expressions raise."""
        return _sent(self.request, {"context": arguments})

    def outcome(self, response: Mapping[str, Any]) -> Outcome:
        """Return what an answer means; raises what the expressions raise."""
        seen = {"context": {RESPONSE: response}}
        if self.done_when is not None and self.done_when.evaluate(seen):
            return Outcome(
                {name: convert(value.evaluate(seen), kind) for name, (kind, value) in self.result.items()}
            )
        return Outcome(None, str(self.detail.evaluate(seen)) if self.detail is not None else "")


@dataclass(frozen=True)
class Outcome:
    """What an answer means: the result, or None with a text that says why not."""

    result: Mapping[str, Any] | None
    detail: str = ""


@dataclass(frozen=True, eq=False)
class Binding:
    """A plugin made of a file; `calls` are its operations by local name. Equal only to itself."""

    plugin: Plugin
    calls: Mapping[str, ServiceCall]
    node: BindingNode = field(repr=False)

    @property
    def name(self) -> str:
        """The name of the plugin."""
        return self.plugin.name


def _sent(fields: Fields, env: Environment) -> dict[str, Any]:
    return {
        name: _sent(value, env) if isinstance(value, Mapping) else value.evaluate(env)
        for name, value in fields.items()
    }


def read_binding(node: BindingNode, types: Mapping[str, Type], findings: Findings) -> Binding:
    """Read what a file says; after findings it has holes, but missions can be checked against it.

    `types` are those that arguments and results may have.
    """
    return _Reader(node, types, findings).read()


class _Reader:
    """Reads one file."""

    def __init__(self, node: BindingNode, types: Mapping[str, Type], findings: Findings) -> None:
        self._node = node
        self._types = types
        self._findings = findings

    def read(self) -> Binding:
        """Read everything, and tell everything that is wrong."""
        node = self._node
        self._good_name("binding", node.binding, node.at("binding"), "binding")
        codes = dict(self._codes())
        operations, calls = {}, {}
        for name, written in node.operations.items():
            place, path = node.key_at("operations", name), f"operations.{name}"
            self._good_name("operation", name, place, path)
            reader = _OperationReader(written, path, self._types, codes, self._findings)
            operations[name], calls[name] = reader.operation(), reader.call(place)
        self._unused_codes(codes)
        return Binding(Plugin(node.binding, node.summary, operations=operations), calls, node)

    def _codes(self) -> Iterator[tuple[str, Code]]:
        for name, written in self._node.codes.items():
            place, path = self._node.key_at("codes", name), f"codes.{name}"
            if not written.label:
                problem, hint = f"the code {name!r} has no label for people", "write 'label: ...'"
                self._findings.add(written.at("label"), "missing-key", path, problem, hint)
            elif _good_name(_CODE, "code", name, place, path, self._findings):
                yield name, Code(name, written.label, SEVERITIES[written.severity])

    def _unused_codes(self, codes: Mapping[str, Code]) -> None:
        used = {operation.code for operation in self._node.operations.values()}
        for name in codes:
            if name not in used:
                place, problem = (
                    self._node.key_at("codes", name),
                    f"no operation fails with the code {name!r}",
                )
                hint = "write 'code: ...' in an operation, or remove it"
                self._findings.warn(place, "unused-code", f"codes.{name}", problem, hint)

    def _good_name(self, what: str, name: str, place: Place, path: str) -> None:
        _good_name(_NAME, what, name, place, path, self._findings)


def _good_name(
    form: re.Pattern[str], what: str, name: str, place: Place, path: str, findings: Findings
) -> bool:
    """Tell whether a thing can be called that; a finding otherwise."""
    if form.fullmatch(name):
        return True
    problem = f"{name!r} cannot be used as the name of {'an' if what[0] in 'aeiou' else 'a'} {what}"
    letters = "lower case letters" if form is _NAME else "letters"
    findings.add(place, "bad-name", path, problem, f"use {letters}, digits and underscores")
    return False


class _OperationReader:
    """Reads one operation."""

    def __init__(
        self,
        node: BoundOperationNode,
        path: str,
        types: Mapping[str, Type],
        codes: Mapping[str, Code],
        findings: Findings,
    ) -> None:
        self._node = node
        self._path = path
        self._types = types
        self._findings = findings
        self._code = codes.get(node.code)
        if self._code is None and node.code not in codes:
            findings.unknown(node.at("code"), "undeclared-code", f"{path}.code", "code", node.code, codes)
        self._arguments = dict(self._read_arguments())
        self._result = dict(self._read_result_types())

    # -- what missions see ---------------------------------------------------------------------------------

    def operation(self) -> Operation:
        """Return the operation as missions see it."""
        node = self._node
        for index, resource in enumerate(node.uses):
            place, path = node.at("uses", index), f"{self._path}.uses"
            _good_name(_NAME, "resource", resource, place, path, self._findings)
        return Operation(
            node.summary,
            self._arguments,
            self._result,
            (self._code,) if self._code else (),
            tuple(node.uses),
            OnHold(node.on_hold),
            self._mock(),
        )

    def _read_arguments(self) -> Iterator[tuple[str, Argument]]:
        for name, written in self._node.arguments.items():
            place, path = self._node.key_at("arguments", name), f"{self._path}.arguments.{name}"
            if name in _TAKEN:
                problem = f"{name!r} cannot be used as the name of an argument"
                self._findings.add(place, "bad-name", path, problem, "it is a word of expressions")
            else:
                _good_name(_NAME, "argument", name, place, path, self._findings)
            yield name, self._argument(written, path)

    def _argument(self, written: ArgumentNode, path: str) -> Argument:
        kind = self._type(written.type, written.at("type"), path)
        default = None
        if written.default is not None and kind is not None:
            read = read_constant(
                written.default, written.at("default"), kind, self._findings, f"{path}.default"
            )
            default = read.value if read else None
        return Argument(kind or ANY, written.summary, default)

    def _read_result_types(self) -> Iterator[tuple[str, Type]]:
        for name, written in self._node.result.items():
            place, path = self._node.key_at("result", name), f"{self._path}.result.{name}"
            _good_name(_NAME, "field", name, place, path, self._findings)
            yield name, self._type(written.type, written.at("type"), path) or ANY

    def _type(self, text: str, place: Place, path: str) -> Type | None:
        try:
            return parse_type(text, self._types)
        except ValueError as error:
            problem, _, hint = str(error).partition("; ")
            self._findings.add(place, "unknown-type", path, problem, hint)
            return None

    def _mock(self) -> Mock:
        node, path, after = self._node.mock, f"{self._path}.mock", 0.0
        if node is None:
            if self._result:
                problem = "nobody says what a simulation gets: the key 'mock' is missing"
                hint = f"write 'mock: {{after: 1 s, result: {{{next(iter(self._result))}: ...}}}}'"
                self._findings.add(self._node.place, "missing-key", self._path, problem, hint)
            return Mock()
        if node.after is not None:
            read = read_constant(node.after, node.at("after"), DURATION, self._findings, f"{path}.after")
            after = read.value if read else 0.0
        result = {}
        for name, raw in node.result.items():
            if name not in self._result:
                place = node.key_at("result", name)
                self._findings.unknown(place, "wrong-type", path, "field of the result", name, self._result)
                continue
            at = node.value_at("result", name)
            found = read_constant(raw, at, self._result[name], self._findings, f"{path}.result.{name}")
            result[name] = found.value if found else None
        for name in self._result:
            if name not in node.result:
                problem, hint = f"the mock has no {name!r}", f"add '{name}: ...'"
                self._findings.add(node.at("result"), "missing-key", f"{path}.result", problem, hint)
        return Mock(after, result)

    # -- what is called ------------------------------------------------------------------------------------

    def call(self, place: Place) -> ServiceCall:
        """Return what is sent and what the answer means, as far as that can be known without ROS."""
        node, service = self._node, self._node.service
        path = f"{self._path}.service"
        if not _SERVICE.fullmatch(service.name):
            problem = f"{service.name!r} is no name of a service"
            hint = "write it with slashes, such as '/camera/take_photo'"
            self._findings.add(service.at("name"), "bad-name", path, problem, hint)
        if not _INTERFACE.fullmatch(service.type):
            problem = f"{service.type!r} is no type of a service"
            hint = "write PACKAGE/srv/NAME, such as 'std_srvs/srv/Trigger'"
            self._findings.add(service.at("type"), "bad-name", path, problem, hint)
        deadline = None
        if service.deadline is not None:
            read = read_constant(
                service.deadline, service.at("deadline"), DURATION, self._findings, f"{path}.deadline"
            )
            deadline = read.value if read else None
        meaning = _Meaning(node, self._path, self._scope(), None, self._findings)
        request = meaning.request(None)
        result = {
            name: (kind, value)
            for name, kind in self._result.items()
            if (value := meaning.result_field(name, kind)) is not None
        }
        return ServiceCall(
            service.name,
            service.type,
            request,
            meaning.done_when(),
            result,
            node.code,
            place,
            meaning.detail(),
            deadline,
        )

    def _scope(self) -> Scope:
        return _scope({name: argument.type for name, argument in self._arguments.items()})


def _scope(arguments: Mapping[str, Type]) -> Scope:
    """Return what the request of a call sees: the arguments. The answer comes later."""
    reason = "the answer is there in 'done_when', 'result' and 'detail'"
    absent = {RESPONSE: ("unknown-name", reason)}
    absent |= dict.fromkeys(sorted(ROOTS), ("unknown-name", "a binding sees its arguments only"))
    return Scope({name: kind for name, kind in arguments.items() if name not in _TAKEN}, absent=absent)


@dataclass(frozen=True)
class _Meaning:
    """Reads the expressions of an operation, where `response` has a type or, without ROS, any."""

    node: BoundOperationNode
    path: str
    scope: Scope
    response: Type | None
    findings: Findings

    @property
    def _answered(self) -> Scope:
        handed, seen = "it is handed over by 'with'; the answer is 'response'", "only the answer is seen here"
        absent = dict.fromkeys(sorted(ROOTS), ("unknown-name", f"{seen}, 'response'"))
        absent |= dict.fromkeys(self.scope.names, ("unknown-name", handed))
        return Scope({RESPONSE: self.response or ANY}, absent=absent)

    def done_when(self) -> Expression | None:
        """Read the condition of success."""
        node, path = self.node, f"{self.path}.done_when"
        return read_guard(node.done_when, node.at("done_when"), self._answered, self.findings, path)

    def detail(self) -> Value | None:
        """Read the text beside the code."""
        raw, path = self.node.detail, f"{self.path}.detail"
        if raw is None:
            return None
        return read_value(raw, self.node.at("detail"), TEXT, self._answered, self.findings, path)

    def result_field(self, name: str, kind: Type) -> Value | None:
        """Read where a field of the result comes from."""
        written, path = self.node.result[name], f"{self.path}.result.{name}"
        return self._fitting(written.from_, written.at("from"), kind, self._answered, path)

    def request(self, wanted: Type | None) -> Fields:
        """Read what is sent; with `wanted`, the type of the request, each field must be of it."""
        raw = self.node.mapping("with")
        return {} if raw is None else self._fields(raw, wanted, f"{self.path}.with")

    def _fields(self, raw: Map, wanted: Type | None, path: str) -> Fields:
        found: dict[str, Value | Fields] = {}
        for name, value in raw.items():
            kind, inner = ANY, f"{path}.{name}"
            if wanted is not None and name not in wanted.fields:
                problem, hint = f"{wanted} has no field {name!r}", nearest(name, wanted.fields)
                self.findings.add(raw.key_place(name), "unknown-argument", path, problem, hint)
                continue
            if wanted is not None:
                kind = wanted.fields[name]
            if isinstance(value, Map) and (wanted is None or kind.kind == "record"):
                found[name] = self._fields(value, kind if wanted else None, inner)
                continue
            read = self._fitting(value, raw.value_place(name), kind, self.scope, inner)
            if read is not None:
                found[name] = read
        return found

    def _fitting(self, raw: Any, place: Place, kind: Type, scope: Scope, path: str) -> Value | None:
        """Read a value of a type; units do not count, because the fields on the wire have none."""
        if not is_expression(raw):
            return read_constant(raw, place, kind, self.findings, path)
        found = read_value(raw, place, ANY, scope, self.findings, path)
        if isinstance(found, Expression) and not q.accepts(_bare(kind), _bare(found.type)):
            whole = kind.kind == "integer" and found.type.kind == "number"
            wanted, got = (
                ("a whole number", "one with digits") if whole else map(q.describe, (kind, found.type))
            )
            problem, hint = f"expected {wanted}, but {found.source!r} is {got}", ""
            if whole and scope.names.keys() == {RESPONSE}:
                hint = "write 'type: number'"
            self.findings.add(found.place, "wrong-type", path, problem, hint)
            return None
        return found


def _bare(kind: Type) -> Type:
    """Return a type without its units."""
    return replace(
        kind,
        unit="",
        item=_bare(kind.item) if kind.item is not None else None,
        fields={name: _bare(inner) for name, inner in kind.fields.items()},
    )


# -- where the definition is known ------------------------------------------------------------------------


#: Returns the fields of request and response of a type of service, None when its package is not there to be
#: looked at; LookupError says what is wrong with the type.
Definitions = Callable[[str], "tuple[Type, Type] | None"]


def check_definition(binding: Binding, definitions: Definitions, findings: Findings) -> None:
    """Read a binding again with the types of its services, and tell what does not fit them."""
    for name, node in binding.node.operations.items():
        place, path = node.service.at("type"), f"operations.{name}"
        if not _INTERFACE.fullmatch(node.service.type):
            continue  # that has been told
        try:
            definition = definitions(node.service.type)
        except LookupError as error:
            problem, _, hint = str(error.args[0]).partition("; ")
            findings.add(place, "unknown-type", f"{path}.service", problem, hint)
            continue
        if definition is None:
            problem = f"nobody has looked whether this fits {node.service.type}, which is not installed here"
            findings.warn(place, "unknown-type", f"{path}.service", problem, "check it where it is")
            continue
        request, response = definition
        operation = binding.plugin.operations[name]
        scope = _scope({word: argument.type for word, argument in operation.arguments.items()})
        meaning = _Meaning(node, path, scope, response, findings)
        meaning.request(request)
        meaning.done_when()
        meaning.detail()
        for word, kind in operation.result.items():
            meaning.result_field(word, kind)


__all__ = [
    "RESPONSE",
    "Binding",
    "Definitions",
    "Outcome",
    "ServiceCall",
    "check_definition",
    "read_binding",
]
