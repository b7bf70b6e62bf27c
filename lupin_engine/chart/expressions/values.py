"""Reads a value of a file: an expression, or plain data that must already have its type.

A text that is wholly `${ ... }` is an expression, one with `${ ... }` in it is read by `texts`, any other is
itself. A number that has a unit in its type must be written with one: `30` for seconds is an error, not
thirty seconds. Values in a request or a ROS parameter are read elsewhere.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

from lupin_engine.chart.expressions.checker import compile_expression
from lupin_engine.chart.expressions.condition import FREE, Condition, mistaken
from lupin_engine.chart.expressions.evaluation import Constant, Expression, Value
from lupin_engine.chart.expressions.reader import capacity
from lupin_engine.chart.expressions.scope import Fragment, Scope, fragment_of
from lupin_engine.chart.expressions.texts import read_text
from lupin_engine.chart.expressions.units import describe, is_number, join, one
from lupin_engine.chart.findings import Findings
from lupin_engine.chart.nodes import Node, show
from lupin_engine.chart.source import Map, Seq, Text, map_at, text_at
from lupin_engine.errors import Place, nearest
from lupin_engine.plugin.contract import Argument
from lupin_engine.plugin.types import (
    A_LIST,
    ANY,
    BOOL,
    DATE,
    INTEGER,
    NUMBER,
    TEXT,
    TIME_OF_DAY,
    UNITS,
    Fault,
    Notation,
    Type,
    ValueProblem,
    convert,
    converted,
    is_moment,
    list_of,
    number_hint,
    number_in,
    parse_quantity,
    problems,
)

#: The type of a declaration whose own type does not exist: every use of it is right.
MISTAKEN = replace(ANY)
#: The way to a part of a value: names of fields and numbers in lists.
_Steps = tuple[str | int, ...]
#: How a moment is written, by its type.
_MOMENTS = {TIME_OF_DAY.name: "HH:MM from 00:00 to 23:59", DATE.name: "YYYY-MM-DD, a day of the calendar"}


def read_value(
    raw: Any, place: Place, wanted: Type, scope: Scope, findings: Findings, path: str
) -> Value | None:
    """Read an expression or a constant of type `wanted`; None after findings."""
    if is_expression(raw):
        fragment = fragment_of(raw)
        if fragment is not None:
            return compile_expression(fragment, scope, wanted, findings, path)
        if wanted.kind == "text" and "${" in raw:
            return read_text(raw, scope, findings, path)
        hint = "write the whole value as one ${ ... }"
        findings.add(place, "partial-expression", path, "an expression must be the whole value", hint)
        return None
    return read_constant(raw, place, wanted, findings, path)


def read_under(
    holder: Map, key: str, wanted: Type, scope: Scope, findings: Findings, path: str
) -> Value | None:
    """Read the value under a key as `read_value` does, None after findings; KeyError where the key is absent.

    The place of an expression is that of its text, so the mapping is asked for a constant's place only.
    """
    raw = holder[key]
    fragment = fragment_of(raw) if is_expression(raw) else None
    if fragment is not None:
        return compile_expression(fragment, scope, wanted, findings, path)
    return read_value(raw, holder.value_place(key), wanted, scope, findings, path)


def read_literal(holder: Map, key: str, scope: Scope, findings: Findings, path: str) -> Value | None:
    """Read the value under a key without an expected type: a literal has the type of its form.

    None after findings.
    """
    raw = holder[key]
    is_text = is_expression(raw) and fragment_of(raw) is None  # with expressions in it
    return read_under(holder, key, TEXT if is_text else literal_type(raw), scope, findings, path)


def read_key(node: Node, key: str, wanted: Type, scope: Scope, findings: Findings, path: str) -> Value | None:
    """Read the value under `key`; None when there is none, or after findings."""
    raw = getattr(node, key)
    if raw is None:
        return None
    fragment, path = fragment_of(raw) if is_expression(raw) else None, f"{path}.{key}"
    if fragment is not None:
        return compile_expression(fragment, scope, wanted, findings, path)
    return read_value(raw, node.at(key), wanted, scope, findings, path)


def read_list(raw: Any, place: Place, scope: Scope, findings: Findings, path: str) -> Value | None:
    """Read a list of anything; one that is written out has the type that its elements have.

    None after findings: elements of several types, or what `read_value` finds.
    """
    item = ANY
    if isinstance(raw, Seq) and raw:
        item, is_one_type = literal_type(raw[0]), True
        for index, element in enumerate(raw[1:], start=1):
            joined = _both(item, literal_type(element))
            if joined is None:
                first = _Literal(raw[0], raw.place_of(0), item)
                this = _Literal(element, raw.place_of(index), literal_type(element))
                _report_differences(first, this, findings, path)
            item, is_one_type = joined or item, is_one_type and joined is not None
        if not is_one_type:
            return None
    return read_value(raw, place, list_of(item), scope, findings, path)


def literal_type(raw: Any) -> Type:
    """Return the type of a literal; a value outside the language is `any`."""
    if isinstance(raw, bool):
        return BOOL
    if isinstance(raw, (int, float)):
        return INTEGER if isinstance(raw, int) else NUMBER
    if isinstance(raw, str) and not is_expression(raw):
        quantity = parse_quantity(raw)
        return TEXT if quantity is None else number_in(quantity[1])
    if isinstance(raw, Mapping):
        fields = {str(name): literal_type(raw[name]) for name in raw}
        return Type("record", f"record of {', '.join(fields)}", fields=fields)
    kinds = {literal_type(element) for element in raw} if isinstance(raw, list) else set()
    return list_of(kinds.pop()) if len(kinds) == 1 else ANY


def _both(first: Type, second: Type) -> Type | None:
    """Return the common type of two literals, None where they have none.

    A text that looks like a quantity may be a text.
    """
    if first.kind == second.kind == "record":
        if first.fields.keys() != second.fields.keys():
            return None
        fields = {name: _both(kind, second.fields[name]) for name, kind in first.fields.items()}
        known = {name: kind for name, kind in fields.items() if kind is not None}
        return replace(first, fields=known) if len(known) == len(fields) else None
    if {first.kind, second.kind} == {"text", "number"} and (first.unit or second.unit):
        return TEXT
    return join(first, second)


class _Literal(NamedTuple):
    """A literal in a list, or a field of one: its value, its place and its type."""

    raw: Any
    place: Place
    type: Type

    def field(self, name: str) -> _Literal:
        """Return a field of a record."""
        return _Literal(self.raw[name], self.raw.value_place(name), self.type.fields[name])


def _report_differences(
    first: _Literal, this: _Literal, findings: Findings, path: str, name: str = ""
) -> None:
    """Report where an element differs from the first one of its list: each field, at its place."""
    if first.type.kind == this.type.kind == "record" and first.type.fields.keys() == this.type.fields.keys():
        for each, kind in first.type.fields.items():
            if _both(kind, this.type.fields[each]) is None:
                inner = f"{name}.{each}" if name else each
                _report_differences(first.field(each), this.field(each), findings, path, inner)
        return
    known, got = describe(first.type), describe(this.type)
    problem = f"a list holds one type: the first is {known}, this is {got}"
    hint = ""
    if name:
        line = f", in line {first.place.line}," if first.place.line != this.place.line else ""
        problem = f"{name} is {got}, and that of the first{line} is {known}"
        hint = _in_the_unit_of(first, this) or _in_the_unit_of(this, first, " there")
    findings.add(this.place, "wrong-type", path, problem, hint)


def _in_the_unit_of(known: _Literal, bare: _Literal, where: str = "") -> str:
    """Return the spelling of a plain number beside one with a unit; '' for other literals."""
    if not is_number(bare.type) or bare.type.unit or known.type.unit not in UNITS:
        return ""
    return f"write '{show(bare.raw)} {known.type.unit}'{where}"


def check_bound(value: Value, wanted: Type, name: str, findings: Findings, path: str) -> None:
    """Report a list that may have more elements than the variable holds."""
    may = capacity(value.type)
    if wanted.item is None or wanted.maximum is None or isinstance(value, Constant) or may <= wanted.maximum:
        return
    problem = f"{value.source!r} may have {may} elements, but {name!r} holds {wanted.maximum:g}"
    hint = f"raise the 'max' of {name!r}, or say that of the list it is made of"
    findings.add(value.place, "unbounded", path, problem, hint)


@dataclass(frozen=True)
class PerElement:
    """The scope of an expression about an element, `name` of type `type`, and its result's type."""

    name: str
    type: Type
    kinds: Sequence[str]


def read_per_element(
    node: Node, key: str, wanted: PerElement, scope: Scope, findings: Findings, path: str
) -> Expression | None:
    """Read an expression about the element of a list.

    One that does not read the element is refused: it would make all elements alike. None after findings.
    """
    name, kinds = wanted.name, wanted.kinds
    raw, place, path = getattr(node, key), node.at(key), f"{path}.{key}"
    found = read_value(raw, place, ANY, scope, findings, path)
    fields = [f"{name}.{field}" for field, inner in wanted.type.fields.items() if _kind(inner) in kinds]
    hint = f"write '${{ {fields[0] if fields else name} }}', or another expression of {name}"
    if isinstance(found, Expression) and re.search(rf"\b{re.escape(name)}\b", found.source):
        if _kind(found.type) in (*kinds, "any"):
            return found
        problem = f"expected a {' or a '.join(kinds)}, but {found.source!r} is {describe(found.type)}"
        findings.add(found.place, "wrong-type", path, problem, hint)
    elif found is not None:
        shown = found.source if isinstance(found, Expression) else found.value
        findings.add(place, "wrong-type", path, f"{show(shown)} is the same for every {name}", hint)
    return None


def _kind(kind: Type) -> str:
    return "number" if is_number(kind) else kind.kind


def is_expression(raw: Any) -> bool:
    """Say whether a value is meant to be computed."""
    return isinstance(raw, Text) and ("${" in raw or "{{" in raw)


def read_guard(raw: Any, place: Place, scope: Scope, findings: Findings, path: str) -> Expression | None:
    """Read a condition, an expression without `${ }`; None when there is none or after findings."""
    if raw is None:
        return None
    if not isinstance(raw, (str, bool, int, float)):
        findings.add(place, "wrong-shape", path, f"expected a condition, got {show(raw)}")
        return None
    text = raw if isinstance(raw, Text) else text_at(show(raw), place)
    if "${" in text or "{{" in text:
        hint = "it is always an expression, so write it without"
        findings.add(place, "partial-expression", path, "a condition has no ${ }", hint)
        return None
    return compile_expression(Fragment(str(text), text), scope, BOOL, findings, path)


def read_condition(node: Node, key: str, scope: Scope, findings: Findings, path: str) -> Condition:
    """Read the condition under a key; with findings it is `mistaken`, so that rules still know of it."""
    raw = getattr(node, key)
    if raw is None:
        return FREE
    place = node.at(key)
    found = read_guard(raw, place, scope, findings, f"{path}.{key}")
    if found is None:
        return mistaken(raw, place)
    return Condition(found.source, found.place, found.type, found.evaluate, found.parts)


def read_constant(raw: Any, place: Place, wanted: Type, findings: Findings, path: str) -> Constant | None:
    """Read plain data of type `wanted`, numbers with the unit that the type has; None after findings."""
    found = problems(raw, wanted, Notation.FILE)
    literal = [problem for problem in found if not is_expression(problem.value)]
    for problem in literal:
        _report(problem, raw, place, findings, path)
    inside = list(_expressions_in(raw, place))
    for where, steps in inside:
        if not any(p.fault is Fault.KIND and steps[: len(p.path)] == p.path for p in literal):
            hint = "an expression stands for the whole value here"
            findings.add(where, "partial-expression", path, "an expression inside a list or record", hint)
    return None if inside or found else Constant(converted(plain(raw), wanted), place, wanted)


def plain(raw: Any) -> Any:
    """Return a read value as plain data, without places."""
    if isinstance(raw, str):
        return str(raw)
    if isinstance(raw, Mapping):
        return {str(key): plain(value) for key, value in raw.items()}
    if isinstance(raw, list):
        return [plain(value) for value in raw]
    if isinstance(raw, bool) or not isinstance(raw, (int, float)):
        return raw
    return int(raw) if isinstance(raw, int) else float(raw)


def _expressions_in(raw: Any, place: Place, steps: _Steps = ()) -> Iterator[tuple[Place, _Steps]]:
    """Yield where expressions stand inside of a value, with the way to them; they may not be there."""
    if is_expression(raw):
        yield place, steps
    elif isinstance(raw, Map):
        for key in raw:
            yield from _expressions_in(raw[key], raw.value_place(key), (*steps, key))
    elif isinstance(raw, Seq):
        for index, (value, where) in enumerate(zip(raw, raw.places, strict=True)):
            yield from _expressions_in(value, where, (*steps, index))


def _report(problem: ValueProblem, raw: Any, place: Place, findings: Findings, path: str) -> None:
    """Report the mistake in a part of a value, at that part's place."""
    fault, wanted = problem.fault, problem.wanted
    for step in problem.path:
        is_field = isinstance(raw, Map)
        if is_field and fault is Fault.UNKNOWN_FIELD and step not in wanted.fields and raw is problem.value:
            hint = nearest(str(step), wanted.fields)
            findings.add(raw.key_place(step), "wrong-type", path, f"a {wanted} has no {step!r}", hint)
            return
        place = raw.value_place(step) if is_field else raw.place_of(step)
        raw, path = raw[step], f"{path}.{step}" if is_field else path
    if fault is Fault.MISSING_FIELDS:
        known = (name for name, kind in wanted.fields.items() if kind is not MISTAKEN)
        missing = ", ".join(name for name in known if name not in raw)
        if missing:
            findings.add(raw.place, "wrong-type", path, f"this {wanted} has no {missing}")
    elif wanted.kind in ("integer", "number"):
        findings.add(place, *_wrong_number(problem, path))
    elif fault is Fault.KIND or is_moment(wanted):
        text = f"expected {describe(wanted)}, got {show(raw)}"
        findings.add(place, "wrong-type", path, text, _instead(raw, wanted))
    else:
        findings.add(place, "wrong-type", path, problem.text)


def _instead(raw: Any, wanted: Type) -> str:
    """Return a correct spelling for a value of another kind."""
    if is_moment(wanted):
        return f'write {_MOMENTS[wanted.name]}, in quotes: "{wanted.example}"'
    if wanted.kind == "text" and isinstance(raw, bool):
        return "quote it"  # the file may have `True`
    if wanted.kind == "text" and isinstance(raw, (int, float)):
        return f"quote it: '{show(raw)}'"
    if wanted.kind == "bool":
        return "write true or false"
    if wanted.kind == "list" and isinstance(raw, Mapping):
        return A_LIST
    return f"write a mapping with {', '.join(wanted.fields)}" if wanted.fields else ""


def _wrong_number(problem: ValueProblem, path: str) -> tuple[str, str, str, str]:
    """Return rule, path, problem and hint for a value that is no number of the type."""
    raw, wanted, fault = problem.value, problem.wanted, problem.fault
    expected = f"expected {describe(wanted)}, got {show(raw)}"
    if fault is Fault.RANGE:
        return "wrong-type", path, problem.text, ""
    if fault is Fault.NOT_FINITE:
        return "wrong-type", path, f"{show(raw)} is too large", ""
    if fault is Fault.NO_UNIT:
        text = f"{show(raw)} has no unit, but {one(str(wanted))} needs one"
        number = show(raw if parse_quantity(f"{raw!r} s") else plain(raw))  # not `0x1F s`
        return "no-unit", path, text, f"write '{number} {wanted.unit}'"
    if fault is Fault.UNIT:
        return "wrong-unit", path, expected, number_hint(raw, wanted)
    if not isinstance(raw, str):
        is_broken = wanted.kind == "integer" and isinstance(raw, float)
        return "wrong-type", path, f"expected a whole number, got {show(raw)}" if is_broken else expected, ""
    is_bare = _is_bare_number(raw) and wanted.unit
    hint = f"write '{raw} {wanted.unit}'" if is_bare else number_hint(raw, wanted)
    rule = "no-unit" if is_bare else "wrong-type"
    if wanted.minimum is not None and wanted.maximum is not None and not wanted.unit:
        hint = f"write a number from {wanted.minimum:g} to {wanted.maximum:g}"
    return rule, path, expected, hint


def _is_bare_number(raw: str) -> bool:
    try:
        return math.isfinite(float(raw))
    except ValueError:
        return False


@dataclass(frozen=True)
class Signature:
    """The name of an operation or action, and the arguments that it takes."""

    name: str
    arguments: Mapping[str, Argument]


def read_arguments(
    signature: Signature, given: Map | None, place: Place, scope: Scope, findings: Findings, path: str
) -> dict[str, Value]:
    """Read the arguments of an operation or action; missing ones get their defaults."""
    what, wanted = signature.name, signature.arguments
    found: dict[str, Value] = {}
    written = map_at(place) if given is None else given
    for name in written:
        if name not in wanted:
            problem, hint = f"{what} has no argument {name!r}", nearest(name, wanted)
            findings.add(written.key_place(name), "unknown-argument", path, problem, hint)
            continue
        value = read_under(written, name, wanted[name].type, scope, findings, f"{path}.{name}")
        if value is not None:
            found[name] = value
    for name, argument in wanted.items():
        if name in written:
            continue
        if argument.default is not None:
            found[name] = Constant(convert(argument.default, argument.type), place, argument.type)
        elif not argument.optional:
            problem = f"{what} needs the argument {name!r}: {argument.doc}"
            findings.add(place, "missing-argument", path, problem, f"add '{name}: ...'")
    return found
