"""Compiles a binding: from its file to a plugin and its calls; reports all errors.

`read_binding` needs no ROS and knows no types of fields; `check_definition` runs where interfaces are
installed.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from lupin_engine.bindings.data import (
    Binding,
    Endpoint,
    Kinds,
    MessageHeard,
    MessageSent,
    OperationCall,
    Sending,
    Taken,
)
from lupin_engine.bindings.file import (
    ArgumentNode,
    BindingNode,
    BoundActionNode,
    BoundEventNode,
    BoundOperationNode,
    BoundValueNode,
    EndpointNode,
    ResultNode,
    ServiceNode,
    TopicNode,
)
from lupin_engine.bindings.meaning import (
    FEEDBACK,
    MESSAGE,
    RESPONSE,
    RESULT,
    TAKEN,
    Definition,
    Seen,
    WireExpressions,
)
from lupin_engine.chart.compose.declare import SEVERITIES, Declarer
from lupin_engine.chart.expressions.scope import WORDS, Usage
from lupin_engine.chart.expressions.units import measured_in, one
from lupin_engine.chart.expressions.values import is_expression, read_constant
from lupin_engine.chart.findings import Findings
from lupin_engine.chart.nodes import Node
from lupin_engine.errors import Place
from lupin_engine.plugin.contract import (
    Action,
    Argument,
    Code,
    EventKind,
    LiveValue,
    Mock,
    OnHold,
    Operation,
    Parameter,
    Plugin,
)
from lupin_engine.plugin.mocks import MockCases
from lupin_engine.plugin.registry import DOTTED_NAME, FREE_NAME, LETTERS, NAME, Catalog
from lupin_engine.plugin.robot import CommonName
from lupin_engine.plugin.types import (
    ANY,
    DURATION,
    ROS_NAME,
    Type,
    innermost,
    units_of,
    within,
)

#: A name over ROS: absolute, relative, or below the node's own (~/).
_CHANNEL = re.compile(ROS_NAME.pattern)
_INTERFACE = re.compile(r"[a-z][a-z0-9_]*/(srv|action|msg)/[A-Z][A-Za-z0-9]*")

#: Returns what an interface consists of (request and response, or goal, result and feedback, or message; and
#: constant), None when its package is not there to be looked at; LookupError says what is wrong with it.
Definitions = Callable[[str], "Definition | None"]


def read_binding(node: BindingNode, catalog: Catalog, findings: Findings) -> Binding:
    """Compile a binding; with findings it is incomplete, but missions can be checked against it.

    `catalog` has the types that arguments, results and values may have.
    """
    return _BindingReader(node, catalog, findings).read()


def check_definition(binding: Binding, definitions: Definitions, findings: Findings) -> None:
    """Compile a binding again with its interfaces' types, and report mismatches.

    An unknown interface is an error; one that is not installed here a warning, and stays unchecked.
    """
    params = _parameter_types(binding.node, binding.plugin)
    for bound in _bound(binding.node):
        definition = _definition(bound, definitions, findings)
        if definition is None:
            continue
        meaning = bound.meaning(binding.plugin, params, definition, findings)
        bound.read(meaning, binding.plugin)


def _definition(bound: _Bound, definitions: Definitions, findings: Findings) -> Definition | None:
    endpoint, path = bound.endpoint, f"{bound.path}.{bound.key}"
    place = endpoint.at("type")
    if not _is_type(endpoint):
        return None  # reported already
    try:
        definition = definitions(endpoint.type)
    except LookupError as error:
        problem, _, hint = str(error.args[0]).partition("; ")
        findings.add(place, "unknown-type", path, problem, hint)
        return None
    if definition is None:
        problem = f"nobody has looked whether this fits {endpoint.type}, which is not installed here"
        findings.warn(place, "unknown-type", path, problem, "check it where it is")
    return definition


def _is_type(endpoint: EndpointNode) -> bool:
    found = _INTERFACE.fullmatch(endpoint.type)
    return found is not None and found[1] == endpoint.KIND


# -- one thing that talks to something ---------------------------------------------------------------------


@dataclass(frozen=True)
class _Bound:
    """A part of a binding with an endpoint, under `key`: `service`, `action` or `topic`."""

    path: str
    name: str
    node: Any
    key: str
    place: Place

    @property
    def endpoint(self) -> EndpointNode:
        """Its endpoint."""
        found: EndpointNode = getattr(self.node, self.key)
        return found

    @property
    def seen(self) -> Seen:
        """The subject of its expressions."""
        return {"service": RESPONSE, "action": RESULT}.get(self.key, MESSAGE)

    def meaning(
        self,
        plugin: Plugin,
        params: Mapping[str, Type],
        definition: Definition | None,
        findings: Findings,
        usage: Usage | None = None,
    ) -> WireExpressions:
        """Return the compiler of its expressions."""
        sends = {"service": "request", "action": "goal"}.get(self.key, "message")
        arguments = self._arguments(plugin)
        return WireExpressions(
            self.path, sends, self.seen, arguments, params, definition, findings, usage or Usage()
        )

    def _arguments(self, plugin: Plugin) -> dict[str, Type]:
        """Return its arguments' types in expressions, by name."""
        node = self.node
        if not isinstance(node, BoundOperationNode | BoundActionNode):
            return {}
        family = plugin.operations if isinstance(node, BoundOperationNode) else plugin.actions
        declared = family[self.name].arguments
        return {name: _kinds(declared[name].type, each.unit).wire for name, each in node.arguments.items()}

    def fields(self, plugin: Plugin) -> dict[str, tuple[ResultNode | BoundValueNode, Kinds, str]]:
        """Return the values it reads, by name: where they are written, their types, and their paths."""
        node, path = self.node, self.path
        if isinstance(node, BoundValueNode):
            return {"value": (node, _kinds(plugin.values[self.name].type, node.unit), f"{path}.from")}
        if isinstance(node, BoundActionNode):
            return {}
        if isinstance(node, BoundOperationNode):
            key, written, declared = "result", node.result, plugin.operations[self.name].result
        else:
            key, written, declared = "fields", node.fields, plugin.events[self.name].fields
        return {
            name: (each, _kinds(declared[name], each.unit), f"{path}.{key}.{name}")
            for name, each in written.items()
        }

    def read(self, meaning: WireExpressions, plugin: Plugin) -> _ReadExpressions:
        """Compile all its expressions."""
        node = self.node
        found = _ReadExpressions()
        if isinstance(node, BoundOperationNode | BoundActionNode):
            found.sending = Sending(meaning.sent(node))
        if isinstance(node, BoundOperationNode):
            found.condition = meaning.condition(node, "done_when", self.seen)
            found.code_when = meaning.conditions(node, "code_when", self.seen)
            found.detail = meaning.text(node, "detail", self.seen)
            if self.key == "action":
                found.progress_values = meaning.progress_values(node, "progress", FEEDBACK)
        elif isinstance(node, BoundEventNode | BoundValueNode):
            found.condition = meaning.condition(node, "when", self.seen)
        read = {name: meaning.taken(*each) for name, each in self.fields(plugin).items()}
        found.fields = {name: taken for name, taken in read.items() if taken is not None}
        return found


@dataclass
class _ReadExpressions:
    """The expressions of a thing."""

    sending: Sending = field(default_factory=lambda: Sending({}))
    condition: Any = None
    code_when: Mapping[str, Any] = field(default_factory=dict)
    detail: Any = None
    progress_values: Mapping[str, Any] = field(default_factory=dict)
    fields: Mapping[str, Taken] = field(default_factory=dict)


def _kinds(kept: Type, unit: str | None) -> Kinds:
    """Return a value's type in the engine and on the wire; a wrong `unit` is reported elsewhere."""
    of = innermost(kept)
    if unit is None or of.kind != "number" or unit not in units_of(of.unit):
        return Kinds(kept, kept)
    return Kinds(kept, measured_in(kept, unit))


def _parameter_types(node: BindingNode, plugin: Plugin) -> dict[str, Type]:
    """Return the parameters' types in expressions: in the unit that is written with them."""
    return {n: _kinds(each.type, node.params[n].unit).wire for n, each in plugin.parameters.items()}


def _bound(node: BindingNode) -> Iterator[_Bound]:
    """Yield every part of a file with an endpoint."""
    for family in ("operations", "actions", "values", "events"):
        for name, each in getattr(node, family).items():
            key = "topic"
            if isinstance(each, BoundOperationNode):
                key = "service" if each.service is not None else "action"
            if getattr(each, key) is not None:
                yield _Bound(f"{family}.{name}", name, each, key, node.key_at(family, name))


# -- the whole file ----------------------------------------------------------------------------------------


class _BindingReader:
    """Compiles one file."""

    def __init__(self, node: BindingNode, catalog: Catalog, findings: Findings) -> None:
        self._node = node
        self._findings = findings
        self._usage = Usage()
        self._declarer = Declarer(catalog, findings, self._usage)

    def read(self) -> Binding:
        """Compile everything, and report all errors."""
        node = self._node
        self._good_name(NAME, "binding", node.binding, node.at("binding"), "binding")
        types = self._declarer.read_types([node])
        parameters = dict(self._parameters())
        codes = dict(self._codes())
        values = {name: self._value(name, each) for name, each in node.values.items()}
        plugin = Plugin(
            node.binding,
            node.summary,
            operations={n: self._operation(n, each, codes, values) for n, each in node.operations.items()},
            actions={name: self._action(name, each) for name, each in node.actions.items()},
            values=values,
            events={name: self._event(name, each) for name, each in node.events.items()},
            types=types,
            parameters=parameters,
        )
        binding = self._talking(plugin)
        self._unused_codes(codes)
        self._unused_parameters()
        return binding

    def _talking(self, plugin: Plugin) -> Binding:
        """Compile all requests and interpretations of answers."""
        found: dict[str, dict[str, Any]] = {"operations": {}, "actions": {}, "values": {}, "events": {}}
        params = _parameter_types(self._node, plugin)
        self._one_type_each()
        for bound in _bound(self._node):
            meaning = bound.meaning(plugin, params, None, self._findings, self._usage)
            endpoint = self._endpoint(bound)
            made = self._made(bound, endpoint, bound.read(meaning, plugin))
            found[bound.path.partition(".")[0]][bound.name] = made
        return Binding(
            plugin, found["operations"], found["actions"], found["values"], found["events"], self._node
        )

    def _one_type_each(self) -> None:
        """Report names over ROS with two types: there would be one server, or topic, for both."""
        known: dict[tuple[str, str], EndpointNode] = {}
        for bound in _bound(self._node):
            endpoint = bound.endpoint
            first = known.setdefault((endpoint.KIND, endpoint.name.lstrip("/")), endpoint)
            if first.type != endpoint.type:
                place, path = endpoint.at("type"), f"{bound.path}.{bound.key}"
                problem = f"{endpoint.name!r} is {first.type} in line {first.at('type').line}"
                self._findings.add(place, "wrong-type", path, problem, "one name has one type")

    def _made(self, bound: _Bound, endpoint: Endpoint, read: _ReadExpressions) -> Any:
        node = bound.node
        if isinstance(node, BoundOperationNode):
            return OperationCall(
                endpoint,
                read.sending,
                read.condition,
                read.fields,
                node.code,
                read.code_when,
                node.unavailable or node.code,
                node.rejected or node.code,
                read.detail,
                read.progress_values,
                moves=node.on_hold == "cancel",
                cut_short=node.cut_short,
                watched=node.watch is not None,
            )
        if isinstance(node, BoundActionNode):
            return MessageSent(endpoint, read.sending)
        return MessageHeard(endpoint, read.condition, read.fields)

    def _endpoint(self, bound: _Bound) -> Endpoint:
        node, path = bound.endpoint, f"{bound.path}.{bound.key}"
        such_type, such_name = node.SUCH_AS
        if not _CHANNEL.fullmatch(node.name):
            problem = f"{node.name!r} is no name of {'a topic' if bound.key == 'topic' else node.CALLED}"
            hint = f"write it with slashes, such as {such_name!r}"
            self._findings.add(node.at("name"), "bad-name", path, problem, hint)
        if not _is_type(node):
            problem = f"{node.type!r} is no type of {node.CALLED}"
            hint = f"write PACKAGE/{node.KIND}/NAME, such as {such_type!r}"
            self._findings.add(node.at("type"), "bad-name", path, problem, hint)
        deadline = None
        if isinstance(node, ServiceNode):
            deadline = self._duration(
                node, "deadline", path, "a call would be too late as soon as it is made"
            )
        qos = node.qos if isinstance(node, TopicNode) else ""
        name = CommonName(node.name) if node.common else node.name
        return Endpoint(node.KIND, name, node.type, bound.place, deadline, qos)

    # -- parameters and codes ------------------------------------------------------------------------------

    def _parameters(self) -> Iterator[tuple[str, Parameter]]:
        for name, written in self._node.params.items():
            place, path = self._node.key_at("params", name), f"params.{name}"
            self._good_name(NAME, "parameter", name, place, path, WORDS)
            parameter = self._declarer.parameter(written, path)
            self._declarer.check_settable(name, parameter.type, written, place)
            yield name, parameter

    def _unused_parameters(self) -> None:
        for name in self._node.params:
            if name not in self._usage.parameters:
                place = self._node.key_at("params", name)
                problem = f"nothing in the binding reads the parameter {name!r}"
                hint = f"read it as param.{name}, or declare it in the mission that does"
                self._findings.warn(place, "unused-parameter", f"params.{name}", problem, hint)

    def _codes(self) -> Iterator[tuple[str, Code]]:
        for name, written in self._node.codes.items():
            place, path = self._node.key_at("codes", name), f"codes.{name}"
            if not written.label:
                problem, hint = f"the code {name!r} has no label for people", "write 'label: ...'"
                self._findings.add(written.at("label"), "missing-key", path, problem, hint)
            elif self._good_name(FREE_NAME, "code", name, place, path):
                yield name, Code(name, written.label, SEVERITIES[written.severity], written.advice)

    def _unused_codes(self, codes: Mapping[str, Code]) -> None:
        used = {name for each in self._node.operations.values() for name, _ in _codes_of(each)}
        for name in codes:
            if name not in used:
                place = self._node.key_at("codes", name)
                problem = f"no operation fails with the code {name!r}"
                hint = "write 'code: ...' in an operation, or remove it"
                self._findings.warn(place, "unused-code", f"codes.{name}", problem, hint)

    # -- what missions see ---------------------------------------------------------------------------------

    def _operation(
        self, name: str, node: BoundOperationNode, known: Mapping[str, Code], values: Mapping[str, LiveValue]
    ) -> Operation:
        path = self._named("operations", name, NAME, "operation")
        self._one_endpoint(node, path)
        codes = dict.fromkeys(self._codes_that_fail(node, path, known))
        arguments = self._arguments(node, path)
        result = self._result(node, "result", path)
        for index, resource in enumerate(node.uses):
            self._good_name(NAME, "resource", resource, node.at("uses", index), f"{path}.uses")
        return Operation(
            node.summary,
            arguments,
            result,
            tuple(codes),
            tuple(node.uses),
            OnHold(node.on_hold),
            self._cut_short(node, path),
            self._mock(node, path, result, {name: value.type for name, value in values.items()}, arguments),
            adopts=self._adopts(node, path),
            updates=self._updates(node, path),
        )

    def _adopts(self, node: BoundOperationNode, path: str) -> bool:
        if node.on_restart != "finish":
            return False
        problem = ""
        if node.action is None:
            problem = "only an action goes on: the answer to a call is lost with the process that has called"
        elif node.on_hold == "cancel":
            problem = "a restart is a hold, and on_hold cancels it"
        elif node.watch is not None:
            problem = "its server ends it when the client falls silent, which a restart does"
        if problem:
            self._findings.add(node.key_at("on_restart"), "wrong-shape", path, problem, "leave it out")
        return True

    def _cut_short(self, node: BoundOperationNode, path: str) -> bool:
        if node.cut_short and (node.action is None or not node.result):
            problem = "only an action with a result gives one when it is cancelled"
            self._findings.add(node.key_at("cut_short"), "wrong-shape", path, problem, "leave it out")
        return node.cut_short

    def _updates(self, node: BoundOperationNode, path: str) -> bool:
        if node.updates and node.action is None:
            problem = "only an action takes a new goal in place of one: a call is answered once"
            self._findings.add(node.key_at("updates"), "wrong-shape", path, problem, "leave it out")
        return node.updates

    def _one_endpoint(self, node: BoundOperationNode, path: str) -> None:
        if node.service is None and node.action is None:
            problem = "it is not said what is called: the key 'service' or 'action' is missing"
            hint = "write 'service: {name: ..., type: ...}'"
            self._findings.add(node.place, "missing-key", path, problem, hint)
        elif node.service is not None:
            of_actions = [key for key in ("action", "progress", "rejected") if getattr(node, key) is not None]
            for key in of_actions:
                problem = f"a service has no {key!r}, only an action has"
                problem = "an operation has either 'service' or 'action'" if key == "action" else problem
                hint = "make two operations of it" if key == "action" else "leave it out"
                self._findings.add(node.key_at(key), "wrong-shape", path, problem, hint)

    def _codes_that_fail(
        self, node: BoundOperationNode, path: str, known: Mapping[str, Code]
    ) -> Iterator[Code]:
        for code, key in _codes_of(node):
            if code in known:
                yield known[code]
            elif code not in self._node.codes:
                place = node.key_at(key, code) if key == "code_when" else node.at(key)
                self._findings.unknown(place, "undeclared-code", f"{path}.{key}", "code", code, known)

    def _action(self, name: str, node: BoundActionNode) -> Action:
        path = self._named("actions", name, NAME, "action")
        return Action(node.summary, self._arguments(node, path), node.moves)

    def _value(self, name: str, node: BoundValueNode) -> LiveValue:
        path = self._named("values", name, DOTTED_NAME, "value")
        kind = self._declarer.measured(node, node.type, node.unit, path)
        initial = None
        if kind is not None and node.initial is not None:
            read = read_constant(node.initial, node.at("initial"), kind, self._findings, f"{path}.initial")
            initial = read.value if read else None
        freshness = self._duration(node, "freshness", path, "a message would be old as soon as it is there")
        return LiveValue(node.summary, kind or ANY, freshness, initial)

    def _event(self, name: str, node: BoundEventNode) -> EventKind:
        path = self._named("events", name, NAME, "event")
        return EventKind(node.summary, self._result(node, "fields", path))

    def _arguments(self, node: BoundOperationNode | BoundActionNode, path: str) -> dict[str, Argument]:
        found = {}
        for name, written in node.arguments.items():
            place, inner = node.key_at("arguments", name), f"{path}.arguments.{name}"
            self._good_name(NAME, "argument", name, place, inner, TAKEN)
            found[name] = self._argument(written, inner)
        return found

    def _argument(self, written: ArgumentNode, path: str) -> Argument:
        kind = self._declarer.measured(written, written.type, written.unit, path)
        default = None
        if kind is not None:
            low, high = (self._declarer.limit(written, key, kind, path) for key in ("min", "max"))
            if written.default is not None:
                place, inner = written.at("default"), f"{path}.default"
                read = read_constant(written.default, place, kind, self._findings, inner)
                default = read.value if read else None
            known = default if isinstance(default, (int, float)) else None
            if self._declarer.check_range(written, "default", known, low, high, path):
                kind = within(kind, low, high)
            else:
                default = None
        # A default that is wrong has been reported; missions are not blamed for relying on it.
        return Argument(kind or ANY, written.summary, default, optional=written.default is not None)

    def _result(self, node: BoundOperationNode | BoundEventNode, key: str, path: str) -> dict[str, Type]:
        found = {}
        for name, written in getattr(node, key).items():
            place, inner = node.key_at(key, name), f"{path}.{key}.{name}"
            self._good_name(NAME, "field", name, place, inner)
            found[name] = self._declarer.measured(written, written.type, written.unit, inner) or ANY
        return found

    # -- how it is simulated -------------------------------------------------------------------------------

    def _mock(
        self,
        node: BoundOperationNode,
        path: str,
        result: Mapping[str, Type],
        values: Mapping[str, Type],
        arguments: Mapping[str, Argument],
    ) -> Mock:
        mock = node.mock
        if mock is None:
            if result:
                problem = "nobody says what a simulation gets: the key 'mock' is missing"
                hint = f"write 'mock: {{after: 1 s, result: {{{next(iter(result))}: ...}}}}'"
                self._findings.add(node.place, "missing-key", path, problem, hint)
            return Mock()
        path = f"{path}.mock"
        after = self._duration(mock, "after", path) or 0.0
        given = self._mocked(mock, "result", result, path, "field of the result")
        for name in result:
            if name not in mock.result:
                problem, hint = f"the mock has no {name!r}", f"add '{name}: ...'"
                self._findings.add(mock.at("result"), "missing-key", f"{path}.result", problem, hint)
        values_given = self._mocked(mock, "values", values, path, "live value of this binding")
        if not mock.when:
            return Mock(after, given, values_given)
        kinds = {name: argument.type for name, argument in arguments.items()}
        for_results, for_values = [], []
        for index, case in enumerate(mock.when):
            at = f"{path}.when.{index}"
            wanted = self._mocked(case, "with", kinds, at, "argument of the operation")
            for_results.append((wanted, self._mocked(case, "result", result, at, "field of the result")))
            changed = self._mocked(case, "values", values, at, "live value of this binding")
            for_values.append((wanted, changed))
        return Mock(after, MockCases(given, tuple(for_results)), MockCases(values_given, tuple(for_values)))

    def _mocked(
        self, mock: Node, key: str, kinds: Mapping[str, Type], path: str, what: str
    ) -> dict[str, Any]:
        found = {}
        rules = {"result": "wrong-type", "with": "unknown-argument"}
        for name, raw in (mock.mapping(key) or {}).items():
            if is_expression(raw):
                problem = "a mock is written out, so there are no expressions"
                hint = "write the usual value, and 'when: {with: {ARGUMENT: VALUE}, result: {FIELD: VALUE}}'"
                inner = f"{path}.{key}.{name}"
                self._findings.add(mock.value_at(key, name), "bad-expression", inner, problem, hint)
                continue
            if name not in kinds:
                rule = rules.get(key, "unknown-value")
                self._findings.unknown(mock.key_at(key, name), rule, path, what, name, kinds)
                continue
            at = mock.value_at(key, name)
            read = read_constant(raw, at, kinds[name], self._findings, f"{path}.{key}.{name}")
            found[name] = read.value if read else None
        return found

    # -- shared --------------------------------------------------------------------------------------------

    def _named(self, family: str, name: str, form: re.Pattern[str], what: str) -> str:
        """Check a thing's name; return its path."""
        path = f"{family}.{name}"
        self._good_name(form, what, name, self._node.key_at(family, name), path)
        return path

    def _good_name(
        self,
        form: re.Pattern[str],
        what: str,
        name: str,
        place: Place,
        path: str,
        taken: frozenset[str] = frozenset(),
    ) -> bool:
        """Return whether a name is valid; else report it."""
        if form.fullmatch(name) and name not in taken:
            return True
        problem = f"{name!r} cannot be used as the name of {one(what)}"
        hint = "it is a word of expressions" if name in taken else f"use {LETTERS[form]}"
        self._findings.add(place, "bad-name", path, problem, hint)
        return False

    def _duration(self, node: Node, key: str, path: str, zero: str = "") -> float | None:
        """Compile a duration, in seconds; None where the key is absent, and after findings.

        `zero` is the text of the finding about 0 s; '': 0 s is allowed.
        """
        raw = getattr(node, key)
        if raw is None:
            return None
        read = read_constant(raw, node.at(key), DURATION, self._findings, f"{path}.{key}")
        if read is not None and zero and read.value == 0:
            self._findings.add(node.at(key), "out-of-range", path, zero, "write a time above 0 s")
            return None
        return float(read.value) if read else None


def _codes_of(node: BoundOperationNode) -> Iterator[tuple[str, str]]:
    """Yield every code of an operation, with the key that names it."""
    yield node.code, "code"
    for name in node.code_when:
        yield name, "code_when"
    for key in ("unavailable", "rejected"):
        if getattr(node, key) is not None:
            yield getattr(node, key), key


__all__ = ["Definitions", "check_definition", "read_binding"]
