"""Reading a value that a file writes: an expression, or plain data that must already have its type.

A text that is wholly `${ ... }` is an expression, any other text is itself. A number that has a unit in its
type must be written with one: `30` where seconds are meant is an error, not thirty seconds. What stands in a
request or a ROS parameter is not read here.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from typing import Any

from lupin_engine.chart.documents import Node, show
from lupin_engine.chart.expressions.checker import compile_expression
from lupin_engine.chart.expressions.evaluation import Constant, Expression, Value
from lupin_engine.chart.expressions.scope import Fragment, Scope, fragment_of
from lupin_engine.chart.expressions.units import describe, is_number, one
from lupin_engine.chart.findings import Findings
from lupin_engine.chart.source import Map, Seq, Text, map_at, text_at
from lupin_engine.errors import Place, nearest
from lupin_engine.plugin.contract import Argument
from lupin_engine.plugin.types import ANY, BOOL, UNITS, Type, convert, parse_quantity


def read_value(
    raw: Any, place: Place, wanted: Type, scope: Scope, findings: Findings, path: str
) -> Value | None:
    """Read an expression or a constant of type `wanted`; None after findings."""
    if is_expression(raw):
        fragment = fragment_of(raw)
        if fragment is not None:
            return compile_expression(fragment, scope, wanted, findings, path)
        hint = "write the whole value as one ${ ... }"
        findings.add(place, "partial-expression", path, "an expression must be the whole value", hint)
        return None
    return read_constant(raw, place, wanted, findings, path)


def read_under(
    holder: Map, key: str, wanted: Type, scope: Scope, findings: Findings, path: str
) -> Value | None:
    """Read the value under a key as `read_value` does; where it stands is asked for constants only."""
    raw = holder[key]
    fragment = fragment_of(raw) if is_expression(raw) else None
    if fragment is not None:
        return compile_expression(fragment, scope, wanted, findings, path)
    return read_value(raw, holder.value_place(key), wanted, scope, findings, path)


def read_key(node: Node, key: str, wanted: Type, scope: Scope, findings: Findings, path: str) -> Value | None:
    """Read what a mapping says under `key`; None when it says nothing, or after findings."""
    raw = getattr(node, key)
    if raw is None:
        return None
    fragment, path = fragment_of(raw) if is_expression(raw) else None, f"{path}.{key}"
    if fragment is not None:
        return compile_expression(fragment, scope, wanted, findings, path)
    return read_value(raw, node.at(key), wanted, scope, findings, path)


def read_per_element(
    node: Node,
    key: str,
    name: str,
    kind: Type,
    kinds: Sequence[str],
    scope: Scope,
    findings: Findings,
    path: str,
) -> Expression | None:
    """Read an expression about the element of a list, which it calls `name`; its value is one of `kinds`.

    One that does not look at the element is refused: it would make all elements alike.
    """
    raw, place, path = getattr(node, key), node.at(key), f"{path}.{key}"
    found = read_value(raw, place, ANY, scope, findings, path)
    fields = [f"{name}.{field}" for field, inner in kind.fields.items() if _kind(inner) in kinds]
    hint = f"write '${{ {fields[0] if fields else name} }}', or another expression of {name}"
    if isinstance(found, Expression) and re.search(rf"\b{re.escape(name)}\b", found.source):
        if _kind(found.type) in (*kinds, "any"):
            return found
        wanted = " or a ".join(kinds)
        problem = f"expected a {wanted}, but {found.source!r} is {describe(found.type)}"
        findings.add(found.place, "wrong-type", path, problem, hint)
    elif found is not None:
        shown = found.source if isinstance(found, Expression) else found.value
        findings.add(place, "wrong-type", path, f"{show(shown)} is the same for every {name}", hint)
    return None


def _kind(kind: Type) -> str:
    return "number" if is_number(kind) else kind.kind


def is_expression(raw: Any) -> bool:
    """Tell whether a value is meant to be computed."""
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


def read_constant(raw: Any, place: Place, wanted: Type, findings: Findings, path: str) -> Constant | None:
    """Read plain data of type `wanted`, numbers with the unit that the type has; None after findings."""
    if not _fits(raw, place, wanted, findings, path):
        return None
    try:
        return Constant(convert(plain(raw), wanted), place, wanted)
    except ValueError as error:
        findings.add(place, "wrong-type", path, str(error))
        return None


def plain(raw: Any) -> Any:
    """Return what was read as plain data, without places."""
    if isinstance(raw, str):
        return str(raw)
    if isinstance(raw, Mapping):
        return {str(key): plain(value) for key, value in raw.items()}
    return [plain(value) for value in raw] if isinstance(raw, list) else raw


def _fits(raw: Any, place: Place, wanted: Type, findings: Findings, path: str) -> bool:
    """Report where data and type part, at the innermost place; what is left for `convert` are ranges."""
    if wanted.kind == "any":
        return _is_plain(raw, place, findings, path)
    if is_expression(raw):
        hint = "an expression stands for the whole value here"
        findings.add(place, "partial-expression", path, "an expression inside a list or record", hint)
        return False
    if wanted.kind in ("integer", "number"):
        return _fits_number(raw, place, wanted, findings, path)
    if wanted.kind == "list" and isinstance(raw, Seq) and wanted.item is not None:
        fits = [_fits(v, p, wanted.item, findings, path) for v, p in zip(raw, raw.places, strict=True)]
        return all(fits)
    if wanted.kind == "record" and isinstance(raw, Map):
        return _fits_record(raw, wanted, findings, path)
    return _fits_scalar(raw, place, wanted, findings, path)


def _fits_scalar(raw: Any, place: Place, wanted: Type, findings: Findings, path: str) -> bool:
    if isinstance(raw, {"text": str, "bool": bool}.get(wanted.kind, ())):
        return True
    hint = ""
    if wanted.kind == "text" and isinstance(raw, (int, float)):
        hint = f"quote it: '{show(raw)}'"
    elif wanted.kind == "bool":
        hint = "write true or false"
    elif wanted.kind == "record":
        hint = f"write a mapping with {', '.join(wanted.fields)}" if wanted.fields else ""
    findings.add(place, "wrong-type", path, f"expected {describe(wanted)}, got {show(raw)}", hint)
    return False


def _is_plain(raw: Any, place: Place, findings: Findings, path: str) -> bool:
    children: list[tuple[Any, Place]] = []
    if isinstance(raw, Map):
        children = [(raw[key], raw.value_place(key)) for key in raw]
    elif isinstance(raw, Seq):
        children = list(zip(raw, raw.places, strict=True))
    for value, where in children:
        if is_expression(value):
            hint = "an expression stands for the whole value here"
            findings.add(where, "partial-expression", path, "an expression inside a list or record", hint)
            return False
        if not _is_plain(value, where, findings, path):
            return False
    return True


def _fits_number(raw: Any, place: Place, wanted: Type, findings: Findings, path: str) -> bool:
    if isinstance(raw, str):
        return _fits_quantity(raw, place, wanted, findings, path)
    if isinstance(raw, bool) or not isinstance(raw, (int, float)):
        findings.add(place, "wrong-type", path, f"expected {describe(wanted)}, got {show(raw)}")
        return False
    if wanted.unit:
        problem = f"{show(raw)} has no unit, but {one(str(wanted))} needs one"
        findings.add(place, "no-unit", path, problem, f"write '{show(raw)} {wanted.unit}'")
        return False
    if wanted.kind == "integer" and not isinstance(raw, int):
        findings.add(place, "wrong-type", path, f"expected a whole number, got {show(raw)}")
        return False
    return _is_finite(raw, raw, place, findings, path)


def _fits_quantity(raw: str, place: Place, wanted: Type, findings: Findings, path: str) -> bool:
    quantity = parse_quantity(raw)
    if quantity is None or wanted.kind == "integer":
        bare = _is_bare_number(raw) and not quantity
        hint = f"write '{raw} {wanted.unit}'" if bare and wanted.unit else ""
        rule = "no-unit" if hint else "wrong-type"
        if wanted.minimum is not None and wanted.maximum is not None:
            hint = f"write a number from {wanted.minimum:g} to {wanted.maximum:g}"
        findings.add(place, rule, path, f"expected {describe(wanted)}, got {show(raw)}", hint)
        return False
    if quantity[1] != wanted.unit:
        units = ", ".join(repr(unit) for unit, (base, _) in UNITS.items() if base == wanted.unit)
        hint = f"its units are {units}" if wanted.unit else "write a number without a unit, or in %"
        findings.add(place, "wrong-unit", path, f"expected {describe(wanted)}, got {show(raw)}", hint)
        return False
    return _is_finite(quantity[0], raw, place, findings, path)


def _is_finite(value: float, raw: Any, place: Place, findings: Findings, path: str) -> bool:
    """Report a number that is too large to be kept, such as `1e400 s`."""
    if abs(value) < math.inf:
        return True
    findings.add(place, "wrong-type", path, f"{show(raw)} is too large")
    return False


def _is_bare_number(raw: str) -> bool:
    try:
        float(raw)
    except ValueError:
        return False
    return True


def _fits_record(raw: Map, wanted: Type, findings: Findings, path: str) -> bool:
    fits = True
    for name in raw:
        if name not in wanted.fields:
            problem, hint = f"a {wanted} has no {name!r}", nearest(name, wanted.fields)
            findings.add(raw.key_place(name), "wrong-type", path, problem, hint)
            fits = False
        elif not _fits(raw[name], raw.value_place(name), wanted.fields[name], findings, f"{path}.{name}"):
            fits = False
    missing = [name for name in wanted.fields if name not in raw]
    if missing:
        findings.add(raw.place, "wrong-type", path, f"this {wanted} has no {', '.join(missing)}")
    return fits and not missing


def read_arguments(
    what: str,
    wanted: Mapping[str, Argument],
    given: Map | None,
    place: Place,
    scope: Scope,
    findings: Findings,
    path: str,
) -> dict[str, Value]:
    """Read the arguments of an operation or action called `what`; defaults stand in for what is not given."""
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
