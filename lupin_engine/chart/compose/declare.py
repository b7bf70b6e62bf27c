"""Reads the declarations of a chart's files, before the states: parameters, inputs, codes, holds, ...

Every name is one for the whole chart, whichever file declares it: parameters become ROS parameters, codes
reach one `last_error`. Two files may declare the same name, but then with the same meaning.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Protocol, TypeVar

from lupin_engine.chart.documents import (
    FileNode,
    HoldNode,
    InputNode,
    LevelNode,
    LifecycleNode,
    ParameterNode,
    PartNode,
    RecordFieldNode,
    RecordTypes,
    RequestFieldNode,
    VariableNode,
)
from lupin_engine.chart.expressions.evaluation import Constant
from lupin_engine.chart.expressions.scope import BUILTIN_CALLS, ROOTS, WORDS, Scope, Usage
from lupin_engine.chart.expressions.units import describe, in_lists, is_number, one, with_article
from lupin_engine.chart.expressions.values import (
    MISTAKEN,
    check_bound,
    read_condition,
    read_constant,
    read_key,
    read_value,
)
from lupin_engine.chart.findings import Findings
from lupin_engine.chart.model import Field, FieldRefusal, Hold, Input, Level, Variable
from lupin_engine.chart.nodes import Node
from lupin_engine.chart.records import same_meaning
from lupin_engine.errors import Place, Severity, declared_as, meant, nearest, or_else
from lupin_engine.plugin.contract import Code, Parameter
from lupin_engine.plugin.parameters import POSSIBLE_TYPES, RESERVED, carried_as
from lupin_engine.plugin.registry import LETTERS, Catalog
from lupin_engine.plugin.registry import NAME as LOWER_NAME
from lupin_engine.plugin.types import (
    ANY,
    BOOL,
    BUILTIN_TYPES,
    COUNT,
    DATE,
    DURATION,
    GATHERED,
    NUMBER,
    TIME_OF_DAY,
    UNITS,
    Type,
    innermost,
    number_in,
    parse_type,
    set_of,
    units_of,
    within,
)

NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")

#: What the robot's clock shows.
CLOCK = Type("record", "clock", fields={"today": DATE, "time": TIME_OF_DAY})
#: How bad a code is, by the word that files have for it.
SEVERITIES: Mapping[str, Severity] = {"info": Severity.INFO, "warn": Severity.WARN, "error": Severity.ERROR}

#: What a thing that expressions read cannot be called: those read by their bare name, and those after a dot.
_TAKEN: Mapping[str, frozenset[str]] = {
    **dict.fromkeys(("variable", "element"), ROOTS.union(BUILTIN_CALLS, WORDS)),
    **dict.fromkeys(("parameter", "input", "level", "field", "hold"), WORDS),
}

#: What a field of a request is to whoever starts a mission, by the kind of its type.
_KINDS: Mapping[str, str] = {
    "list": "a list",
    "integer": "a whole number",
    "number": "a number",
    "text": "a text",
    "bool": "yes or no",
}

#: The most fields of a record type, together with those of the records in it.
MAX_FIELDS = 100

_T = TypeVar("_T")


class HasTypes(Protocol):
    """A file that may declare record types."""

    types: RecordTypes

    def key_at(self, key: str, *inner: str) -> Place:
        """Return where a key stands."""


@dataclass
class Declared:
    """The declarations of all files, joined; `places` are those of the first declarations."""

    records: dict[str, Type] = field(default_factory=dict)
    parameters: dict[str, Parameter] = field(default_factory=dict)
    inputs: dict[str, Input] = field(default_factory=dict)
    codes: dict[str, Code] = field(default_factory=dict)
    context: dict[str, Variable] = field(default_factory=dict)
    holds: dict[str, Hold] = field(default_factory=dict)
    by_file: dict[str, dict[str, Parameter]] = field(default_factory=dict)
    places: dict[tuple[str, str], Place] = field(default_factory=dict)
    types: set[str] = field(default_factory=set)


class Declarer:
    """Reads the declarations of one file after the other into one `Declared`."""

    def __init__(self, catalog: Catalog, findings: Findings, usage: Usage) -> None:
        self._catalog = catalog
        self._findings = findings
        self._types = dict(catalog.known_types)
        self._unread: dict[str, HasTypes] = {}
        self._open: list[str] = []
        self._usage = usage
        self.declared = Declared()

    def read(self, files: Iterable[FileNode]) -> Declared:
        """Read the declarations of `files`, the lifecycle first."""
        nodes = list(files)
        self.read_types(nodes)
        for node in nodes:
            self._parameters(node)
        for node in nodes:
            self._codes(node)
            self._inputs(node)
            self._context(node)
        return self.declared

    # -- shared --------------------------------------------------------------------------------------------

    def _put(self, family: str, known: dict[str, _T], name: str, thing: _T, place: Place) -> None:
        """Add a declaration, which must have the meaning of an earlier one of that name."""
        if name in known and not same_meaning(known[name], thing):
            first = self.declared.places[family, name]
            problem = f"{family} {name!r} is declared differently in {first}"
            self._findings.add(
                place, "conflicting-definition", "", problem, "make both the same, or rename one"
            )
        if name not in known:
            known[name] = thing
            self.declared.places[family, name] = place

    def good_name(self, what: str, name: str, place: Place, path: str) -> bool:
        """Say whether a name is allowed; a finding otherwise."""
        formed = NAME.fullmatch(name) is not None
        if formed and name not in _TAKEN.get(what, ()):
            return True
        problem = f"{name!r} cannot be used as the name of {one(what)}"
        hint = "it is a word of expressions" if formed else "use letters, digits and underscores"
        self._findings.add(place, "bad-name", path, problem, hint)
        return False

    def _type(self, text: str, place: Place, path: str) -> Type | None:
        name = next(reversed(text.split()), "")
        if name in self._unread:
            self._record(self._unread[name], name)
        if name in self._open:
            problem, hint = f"{one(name)} would hold itself, without end", "hold its id, a text"
            self._findings.add(place, "wrong-type", path, problem, hint)
            return None
        known = {**self._types, **dict.fromkeys(self._unread, ANY)} if self._unread else self._types
        try:
            kind = parse_type(text, known)
        except ValueError as error:
            problem, _, hint = str(error).partition("; ")
            self._findings.add(place, "unknown-type", path, problem, hint)
            return None
        self.declared.types.add(innermost(kind).name)
        return kind

    # -- record types --------------------------------------------------------------------------------------

    def read_types(self, files: Iterable[HasTypes]) -> dict[str, Type]:
        """Read the record types of files; they may hold each other, in any order."""
        written = [(file, name) for file in files for name in file.types]
        first = {name: file for file, name in reversed(written)}
        self._unread = dict(first)
        for file, name in written:
            if name in self._unread or first[name] is not file:
                self._record(file, name)
        return self.declared.records

    def _record(self, file: HasTypes, name: str) -> None:
        """Read a record type; a field with a mistake is of any type, and all uses are right."""
        place, path = file.key_at("types", name), f"types.{name}"
        self._unread.pop(name, None)
        self._open.append(name)
        fields = {each: self._record_field(file, name, each) for each in file.types[name]}
        self._open.pop()
        kind = Type("record", name, fields=fields)
        if self._is_others(name, kind, place, path):
            return
        self._put("type", self.declared.records, name, kind, place)
        self._types.setdefault(name, kind if self._is_usable(name, kind, place, path) else ANY)

    def _record_field(self, file: HasTypes, record: str, name: str) -> Type:
        path, node = f"types.{record}.{name}", file.types[record][name]
        self._lower_name("field", name, file.key_at("types", record, name), path, WORDS)
        kind = self._bounded(node, path)
        if kind is None:
            return MISTAKEN
        return within(kind, self.limit(node, "min", kind, path), None)

    def _is_others(self, name: str, kind: Type, place: Place, path: str) -> bool:
        """Report a record type whose name is built in, or has another meaning in a plugin."""
        problem, hint = f"the type {name!r} is built in", "rename yours"
        if name not in BUILTIN_TYPES:
            if same_meaning(self._catalog.types.get(name, kind), kind):
                return False
            owner = self._catalog.owners["type", name]
            problem = f"the type {name!r} is declared differently by plugin {owner!r}"
            hint = "use that one, or rename yours"
        self._findings.add(place, "conflicting-definition", path, problem, hint)
        return True

    def _is_usable(self, name: str, kind: Type, place: Place, path: str) -> bool:
        """Report a record type without fields, with too many, or with a wrong name."""
        self._lower_name("type", name, place, path, GATHERED)
        fields = _fields_in(kind)
        if not fields:
            problem, hint = f"the type {name!r} has no fields", f"write '{name}: {{id: text}}'"
            self._findings.add(place, "missing-key", path, problem, hint)
        elif fields > MAX_FIELDS:
            problem = f"{one(name)} has {fields} fields with those inside, at most {MAX_FIELDS} are allowed"
            self._findings.add(place, "too-large", path, problem, "hold the id of a record in its place")
        return 0 < fields <= MAX_FIELDS

    def _lower_name(self, what: str, name: str, place: Place, path: str, taken: Iterable[str]) -> None:
        """Report a name of a type or field that cannot be used."""
        formed = LOWER_NAME.fullmatch(name) is not None
        if not formed or name in taken:
            problem = f"{name!r} cannot be used as the name of {one(what)}"
            hint = "it is a word of the language" if formed else f"use {LETTERS[LOWER_NAME]}"
            self._findings.add(place, "bad-name", path, problem, hint)

    def base_scope(self, file: FileNode | None, functions: bool = True) -> Scope:
        """Return the scope of a file's expressions anywhere: parameters, inputs, variables, functions."""
        known = dict(self._catalog.parameters)
        for name in [next(iter(self.declared.by_file), ""), file.title if file else ""]:
            known.update(self.declared.by_file.get(name, {}))
        names = {
            "param": Type("record", "param", fields={name: known[name].type for name in known}),
            "input": Type(
                "record", "input", fields={n: input_type(i) for n, i in self.declared.inputs.items()}
            ),
            **{name: variable.type for name, variable in self.declared.context.items()},
            "clock": CLOCK,
        }
        absent = {
            "error": ("unknown-name", "only an on_error has one"),
            "request": ("unknown-name", "only the states of a mission have one"),
            "event": ("unknown-name", "nothing has happened yet where this is read"),
            "target": ("missing-itinerary", "no state around this one has an itinerary"),
            "itinerary": ("missing-itinerary", "no state around this one has an itinerary"),
            "this_step": ("unknown-name", "only a property is about steps"),
        }
        if isinstance(file, PartNode):
            reason = "each use of the part names a variable of its own for it"
            absent |= {name: ("unknown-name", reason) for name in file.out if name not in names}
        known_functions = self._catalog.functions if functions else {}
        return Scope(names, known_functions, (), tuple(self.declared.holds), absent, {}, self._usage)

    # -- parameters ----------------------------------------------------------------------------------------

    def _parameters(self, file: FileNode) -> None:
        own = self.declared.by_file.setdefault(file.title, {})
        for name, node in file.params.items():
            place, path = file.key_at("params", name), f"params.{name}"
            if not self.good_name("parameter", name, place, path):
                continue
            parameter = self.parameter(node, path)
            own[name] = parameter
            plugin = self._catalog.parameters.get(name)
            if plugin is not None and not same_meaning(plugin, parameter):
                owner = self._catalog.owners["parameter", name]
                problem = f"parameter {name!r} is declared differently by plugin {owner!r}"
                self._findings.add(
                    place, "conflicting-definition", path, problem, "use that one, or rename yours"
                )
            self._put("parameter", self.declared.parameters, name, parameter, place)

    def parameter(self, node: ParameterNode, path: str) -> Parameter:
        """Read a setting; `min` and `max` of a list are the numbers of its elements, and in its type."""
        kind = self.measured(node, node.type, node.unit, path)
        if kind is None:
            return Parameter(MISTAKEN, None, node.summary)
        counted = kind if kind.item is None else COUNT
        low, high = (self.limit(node, key, counted, path) for key in ("min", "max"))
        if kind.item is not None and self.check_range(node, "default", None, low, high, path):
            kind, low, high = within(kind, low, high), None, None
        default = None
        if "default" in node.model_fields_set:
            default = read_constant(node.default, node.at("default"), kind, self._findings, f"{path}.default")
        value = default.value if default is not None else None
        if isinstance(value, (int, float)):
            self.check_range(node, "default", value, low, high, path)
        return Parameter(kind, value, node.summary, low, high)

    def check_settable(self, name: str, kind: Type, node: ParameterNode, place: Place) -> None:
        """Report a parameter that the orchestrator cannot declare; `place` is that of its name."""
        path = f"params.{name}"
        if name in RESERVED:
            problem = f"every orchestrator has a parameter {name!r} already"
            self._findings.add(place, "bad-name", path, problem, "rename yours")
        if not carried_as(kind) and kind is not MISTAKEN:
            problem = f"the orchestrator can have no parameter of type {str(kind)!r}"
            hint = f"a parameter {POSSIBLE_TYPES}"
            if innermost(kind).kind == "any":
                hint = "declare the fields of a record under 'types', and write its name here"
            self._findings.add(node.at("type"), "wrong-type", path, problem, hint)

    def measured(self, node: Node, kind: str, unit: str | None, path: str) -> Type | None:
        """Read the `type` and `unit` of a node; a plain number with a unit is one of that dimension.

        None after findings about the type; after one about the unit the type is returned without it.
        """
        return self._in_unit(self._type(kind, node.at("type"), path), node, unit, path)

    def _in_unit(self, kind: Type | None, node: Node, unit: str | None, path: str) -> Type | None:
        if kind is None or unit is None:
            return kind
        of = innermost(kind)
        if of is NUMBER and unit in UNITS:
            return in_lists(kind, number_in(UNITS[unit][0]))
        units = units_of(of.unit) if of.kind == "number" else []
        if unit not in units:
            problem, hint = f"{describe(kind)} is not measured in {unit!r}", "leave 'unit' out"
            if units and unit not in UNITS:
                problem, hint = f"unknown unit {unit!r}", nearest(unit, units if of.unit else UNITS)
            elif units:
                hint = f"its units are {', '.join(map(repr, units))}"
            elif of.kind == "integer":
                hint = f"write 'type: {in_lists(kind, NUMBER)}'"
            self._findings.add(node.at("unit"), "wrong-unit", path, problem, hint)
        return kind

    def _bounded(self, node: VariableNode | RequestFieldNode | RecordFieldNode, path: str) -> Type | None:
        """Read a type with its `max`, which of a list is the number of its elements; None after findings."""
        kind = self.measured(node, node.type, node.unit, path)
        if kind is None:
            return None
        return within(kind, None, self.limit(node, "max", kind if kind.item is None else COUNT, path))

    def limit(self, node: Node, key: str, kind: Type, path: str) -> float | None:
        """Read the `min` or `max` of a number; None when there is none, or after findings."""
        raw = getattr(node, key)
        if raw is None:
            return None
        if kind.kind not in ("integer", "number"):
            problem = f"{with_article(kind)} has no {key}"
            self._findings.add(node.key_at(key), "wrong-type", path, problem, f"leave {key!r} out")
            return None
        found = read_constant(raw, node.at(key), kind, self._findings, f"{path}.{key}")
        return None if found is None else float(found.value)

    def check_range(
        self,
        node: Node,
        key: str,
        value: float | None,
        low: float | None,
        high: float | None,
        path: str,
    ) -> bool:
        """Say whether a range is not empty, and holds the value under `key`; a finding otherwise."""
        what, wrong = f"the {key} value" if key == "initial" else f"the {key}", ""
        lowest, highest = (getattr(node, bound) for bound in ("min", "max"))
        if low is not None and value is not None and value < low:
            wrong = f"{what} is below the minimum of {lowest}"
        elif high is not None and value is not None and value > high:
            wrong = f"{what} is above the maximum of {highest}"
        if low is not None and high is not None and low > high:
            key, wrong = "min", f"the minimum of {lowest} is above the maximum of {highest}"
        if wrong:
            self._findings.add(node.at(key), "out-of-range", path, wrong)
        return not wrong

    # -- codes, inputs, variables --------------------------------------------------------------------------

    def _codes(self, file: FileNode) -> None:
        for name, node in file.codes.items():
            place = file.key_at("codes", name)
            if self.good_name("code", name, place, f"codes.{name}"):
                code = Code(name, node.label, SEVERITIES[node.severity], node.advice)
                self._put("code", self.declared.codes, name, code, place)
                known = self.declared.codes[name]
                self.declared.codes[name] = replace(known, advice=known.advice or code.advice)

    def _inputs(self, file: FileNode) -> None:
        scope = self.base_scope(file, functions=False)
        for name, node in file.inputs.items():
            place, path = file.key_at("inputs", name), f"inputs.{name}"
            found = (
                self._input(name, node, place, scope, path)
                if self.good_name("input", name, place, path)
                else None
            )
            if found is not None:
                self._put("input", self.declared.inputs, name, found, place)

    def _input(self, name: str, node: InputNode, place: Place, scope: Scope, path: str) -> Input | None:
        value = self._catalog.values.get(node.value)
        if value is None:
            at = node.at("value")
            self._findings.unknown(at, "unknown-value", path, "live value", node.value, self._catalog.values)
            return None
        initial = self._constant(node, "initial", value.type, value.initial, path)
        freshness = self._constant(node, "freshness", DURATION, value.freshness, path)
        low, high = (self.limit(node, key, value.type, path) for key in ("min", "max"))
        known = initial if isinstance(initial, (int, float)) else None
        self.check_range(node, "initial", known, low, high, path)
        self._check_unit(node, value.type, path)
        levels = [
            self._level(node, key, level, value.type, scope, path) for key, level in node.levels.items()
        ]
        kept = tuple(level for level in levels if level is not None)
        low = value.type.minimum if low is None else low
        high = value.type.maximum if high is None else high
        of_mission = node.since is not None
        kind = within(value.type, low, high) if is_number(value.type) else value.type
        read = [
            read_constant(raw, node.at("classes", index), kind, self._findings, f"{path}.classes")
            for index, raw in enumerate(node.classes)
        ]
        classes = tuple(one.value for one in read if one is not None)
        return Input(
            name, node.value, value.type, place, freshness, initial, kept, low, high, of_mission, classes
        )

    def _constant(self, node: InputNode, key: str, kind: Type, otherwise: Any, path: str) -> Any:
        """Return the constant under `key`, else the plugin's default."""
        raw = getattr(node, key)
        if raw is None:
            return otherwise
        read = read_constant(raw, node.at(key), kind, self._findings, f"{path}.{key}")
        return read.value if read else None

    def _check_unit(self, node: InputNode, kind: Type, path: str) -> None:
        """Report a unit that the value does not have; it is written for people, so it must be right."""
        of_value = [unit for unit, (base, _) in UNITS.items() if is_number(kind) and base == kind.unit]
        if node.unit is None or node.unit in of_value:
            return
        hint = "leave 'unit' out"
        if of_value:
            hint = f"write {' or '.join(map(repr, of_value))}, or {hint}"
        problem = f"{node.value} is {with_article(kind)}, which is not measured in {node.unit!r}"
        self._findings.add(node.at("unit"), "wrong-unit", path, problem, hint)

    def _level(
        self, node: InputNode, name: str, level: LevelNode, kind: Type, scope: Scope, path: str
    ) -> Level | None:
        place, path = node.key_at("levels", name), f"{path}.levels.{name}"
        if not self.good_name("level", name, place, path):
            return None
        if kind.kind not in ("number", "integer"):
            problem = f"a level is drawn from a number, {node.value} is {with_article(kind)}"
            self._findings.add(place, "wrong-type", path, problem)
            return None
        if name == "value":
            self._findings.add(
                place, "bad-name", path, "a level cannot be called 'value', the number itself is"
            )
            return None
        found = {
            key: read_key(level, key, kind, scope, self._findings, path)
            for key in ("below", "above", "hysteresis")
        }
        written = [key for key in ("below", "above") if getattr(level, key) is not None]
        if len(written) == 1:
            begins = found[written[0]] is not None
            return Level(name, found["hysteresis"], place, found["below"], found["above"]) if begins else None
        if not written:
            problem, hint = "it is not said where the level begins", "write 'below: ...' or 'above: ...'"
            self._findings.add(place, "missing-key", path, problem, hint)
        else:
            problem, hint = "a level has either 'below' or 'above'", "make two levels of it"
            self._findings.add(level.key_at("above"), "wrong-shape", path, problem, hint)
        return None

    def _context(self, file: FileNode) -> None:
        scope = self.base_scope(file)
        for name, node in file.context.items():
            place, path = file.key_at("context", name), f"context.{name}"
            if not self.good_name("variable", name, place, path):
                continue
            kind = self._bounded(node, path) or MISTAKEN
            at = node.at("default")
            default = read_value(node.default, at, kind, scope, self._findings, f"{path}.default")
            if default is not None:
                check_bound(default, kind, name, self._findings, f"{path}.default")
            # One with a mistaken default is declared all the same, or each use would be told as well.
            of_mission = not isinstance(file, LifecycleNode)
            variable = Variable(name, kind, default or Constant(None, at, kind), place, of_mission)
            self._put("variable", self.declared.context, name, variable, place)

    # -- holds and requests --------------------------------------------------------------------------------

    def name_holds(self, file: LifecycleNode) -> None:
        """Make the names of the holds known, so that expressions can ask for them."""
        for name, node in file.holds.items():
            place = file.key_at("holds", name)
            if self.good_name("hold", name, place, f"holds.{name}"):
                self.declared.holds[name] = Hold(name, node.engage, tuple(node.release), node.code, place)

    def holds(self, file: LifecycleNode, scope: Scope, codes: Iterable[str]) -> dict[str, Hold]:
        """Read the holds of the lifecycle, whose guards see `scope`."""
        known = set(codes)
        return {
            name: self._hold(name, file.holds[name], hold.place, scope, known)
            for name, hold in self.declared.holds.items()
        }

    def _hold(self, name: str, node: HoldNode, place: Place, scope: Scope, codes: set[str]) -> Hold:
        path, findings = f"holds.{name}", self._findings
        requests = self._catalog.profile.events
        allowed = [*requests, *level_events(self.declared.inputs)]
        if node.engage not in allowed:
            findings.unknown(node.at("engage"), "unknown-event", path, "event", node.engage, allowed)
        for index, event in enumerate(node.release):
            if event not in requests:
                findings.unknown(node.at("release", index), "unknown-event", path, "request", event, requests)
        for key in ("code", "engage_code"):
            code = getattr(node, key)
            if code is not None:
                check_code(code, node.at(key), path, codes, findings)
        if node.engage.startswith("input."):
            for key in ("engage_guard", "engage_code"):
                if getattr(node, key) is not None:
                    problem = f"{key!r} has no effect: {node.engage} engages the hold whenever it is true"
                    hint = "remove it; to engage the hold on a condition, let a request engage it"
                    findings.warn(node.key_at(key), "level-with-guard", path, problem, hint)
        elif node.engage_guard is not None and node.engage_code is None:
            problem = "a request that the guard refuses needs a reason"
            findings.add(node.place, "missing-key", path, problem, "write 'engage_code: ...'")
        return Hold(
            name,
            node.engage,
            tuple(node.release),
            node.code,
            place,
            read_condition(node, "engage_guard", scope, findings, path),
            node.engage_code,
            read_condition(node, "release_guard", scope, findings, path),
        )

    def field(
        self, name: str, node: RequestFieldNode, place: Place, scope: Scope, codes: set[str]
    ) -> Field | None:
        """Read one field of a mission's request; None after findings about its name."""
        path, findings = f"request.{name}", self._findings
        if not self.good_name("field", name, place, path):
            return None
        kind = self._bounded(node, path)
        if kind is None:
            default = read_key(node, "default", MISTAKEN, scope, findings, path)
            return Field(name, MISTAKEN, place, default, None, None, node.summary)
        if node.distinct and kind.item is not None:
            kind = within(set_of(kind.item), None, kind.maximum)
        elif node.distinct:
            problem = f"only what a list holds can be distinct, this is {with_article(kind)}"
            findings.add(node.at("distinct"), "wrong-type", path, problem, "leave 'distinct' out")
        default = None
        if node.default is not None:
            default = read_value(node.default, node.at("default"), kind, scope, findings, f"{path}.default")
        self._can_be_given(name, node, kind, place, path)
        if node.not_empty is not None:
            at = node.at("not_empty")
            if kind.kind != "list":
                problem = f"only a list can be empty, this is {with_article(kind)}"
                findings.add(at, "wrong-type", path, problem)
            else:
                check_code(node.not_empty, at, path, codes, findings)
        low = self.limit(node, "min", kind, path)
        return Field(name, kind, place, default, node.not_empty, low, node.summary)

    def _can_be_given(self, name: str, node: RequestFieldNode, kind: Type, place: Place, path: str) -> None:
        """Report a field that no start can give a value: a mission with it could never begin."""
        fields = self._catalog.profile.request
        carried = fields[name].type.kind if name in fields else None
        if carried is None and node.default is None:
            problem = f"the start service carries {' and '.join(fields)} only, so {name!r} needs a default"
            self._findings.add(place, "missing-key", path, problem, "write 'default: ...'")
        elif carried is not None and kind.kind != carried:
            problem = f"a start carries {name!r} as {_KINDS[carried]}, this is {describe(kind)}"
            self._findings.add(node.at("type"), "wrong-type", path, problem, "choose another name")


def read_refusals(
    node: RequestFieldNode, scope: Scope, codes: Iterable[str], findings: Findings, path: str
) -> tuple[FieldRefusal, ...]:
    """Read what a field of a request refuses; `scope` has all fields of the request."""
    path, found = f"{path}.refuse", []
    for each in node.refuse:
        check_code(each.code, each.at("code"), f"{path}.code", codes, findings)
        guard = read_condition(each, "guard", scope, findings, path)
        value = read_key(each, "value", ANY, scope, findings, path)
        found.append(FieldRefusal(guard, each.code, each.place, value))
    return tuple(found)


def _fields_in(kind: Type) -> int:
    """Return how many fields a type has, together with those of the records in it."""
    return sum(1 + _fields_in(innermost(each)) for each in kind.fields.values())


def check_status(status: Any, place: Place, path: str, allowed: Iterable[str], findings: Findings) -> None:
    """Report a status that is none of the profile's."""
    if status not in allowed:
        findings.add(place, "wrong-type", path, f"unknown status {status!r}", nearest(status, allowed))


def check_code(code: str, place: Place, path: str, declared: Iterable[str], findings: Findings) -> None:
    """Report a code that is not declared, so that it has no label."""
    if code not in declared:
        hint = or_else(meant(code, declared), declared_as("codes", code))
        findings.add(place, "undeclared-code", path, f"the code {code!r} is not declared", hint)


def input_type(found: Input) -> Type:
    """Return the type of an input in expressions: the value, or a record of the value and its levels."""
    if not found.levels:
        return found.type
    fields = {"value": found.type, **{level.name: BOOL for level in found.levels}}
    return Type("record", f"input.{found.name}", fields=fields)


def level_events(inputs: Mapping[str, Input]) -> list[str]:
    """Return the events that stand for a level: yes-or-no inputs, and the levels drawn from numbers."""
    plain = [f"input.{name}" for name, found in inputs.items() if found.type.kind == "bool"]
    return plain + [f"input.{name}.{level.name}" for name, found in inputs.items() for level in found.levels]


__all__ = [
    "NAME",
    "SEVERITIES",
    "Declared",
    "Declarer",
    "check_code",
    "check_status",
    "input_type",
    "level_events",
    "read_refusals",
]
