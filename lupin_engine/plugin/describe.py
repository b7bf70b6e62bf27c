"""Describes a plugin's catalog as text, for `lupin plugin show` and the page of the catalog."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from lupin_engine.plugin.contract import Argument, Code, OnHold, Operation, Parameter, Plugin
from lupin_engine.plugin.parameters import narrowed
from lupin_engine.plugin.types import ANY, Type, in_unit, units_of

#: What a hold does to an attempt.
HOLDS: Mapping[OnHold, str] = {
    OnHold.CANCEL: "cancelled, and begun again on release",
    OnHold.FINISH: "it may finish; its end waits for the release",
}


@dataclass(frozen=True)
class Entry:
    """One thing of a catalog: its name, its effect, its arguments, and further facts."""

    name: str
    doc: str
    arguments: tuple[tuple[str, str, str], ...] = ()
    facts: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True)
class Section:
    """Things of one kind."""

    title: str
    entries: tuple[Entry, ...]


def sections(plugin: Plugin) -> list[Section]:
    """Return a plugin's catalog, kind by kind; empty kinds are left out."""
    found = (
        Section("Operations", tuple(_operations(plugin))),
        Section("Actions", tuple(_actions(plugin))),
        Section("Functions", tuple(_functions(plugin))),
        Section("Live values", tuple(_values(plugin))),
        Section("Events", tuple(_events(plugin))),
        Section("Types", tuple(_types(plugin))),
        Section("Parameters", tuple(_parameters(plugin))),
        Section("Nodes", tuple(_nodes(plugin))),
    )
    return [section for section in found if section.entries]


def _operations(plugin: Plugin) -> Iterator[Entry]:
    for name, operation in plugin.operations.items():
        facts = tuple(_operation_facts(operation))
        yield Entry(f"{plugin.name}.{name}", operation.doc, _arguments(operation.arguments), facts)


def _operation_facts(operation: Operation) -> Iterator[tuple[str, str]]:
    if operation.result:
        yield "gives", _fields(operation.result)
    if operation.codes:
        yield "fails with", _codes(operation.codes)
    if operation.classes:
        yield "proven with", "; ".join(_result(one, operation.result) for one in operation.classes)
    yield "when held", HOLDS[operation.on_hold]
    if operation.cut_short:
        yield "when cancelled", "it gives what it gives as far as it came"
    if operation.updates:
        yield "when updated", "its server takes a new goal in place of the old one"
    if operation.adopts:
        yield "when restarted", "it goes on"
    if operation.uses:
        yield "uses", ", ".join(operation.uses)


def _actions(plugin: Plugin) -> Iterator[Entry]:
    for name, action in plugin.actions.items():
        held = "it waits for the release" if action.moves else "it is carried out"
        yield Entry(f"{plugin.name}.{name}", action.doc, _arguments(action.arguments), (("when held", held),))


def _functions(plugin: Plugin) -> Iterator[Entry]:
    for name, function in plugin.functions.items():
        returns = (("returns", type_text(function.returns)),)
        yield Entry(
            f"{name}({', '.join(function.arguments)})", function.doc, _arguments(function.arguments), returns
        )


def _values(plugin: Plugin) -> Iterator[Entry]:
    for name, value in plugin.values.items():
        facts = [("type", type_text(value.type))]
        if value.initial is not None:
            facts.append(("before the first report", value_text(value.initial, value.type)))
        if value.freshness is not None:
            facts.append(("known for", f"{value.freshness:g} s after a report"))
        if value.classes:
            facts.append(("proven with", ", ".join(value_text(one, value.type) for one in value.classes)))
        yield Entry(name, value.doc, facts=tuple(facts))


def _events(plugin: Plugin) -> Iterator[Entry]:
    for name, event in plugin.events.items():
        facts = (("carries", _fields(event.fields)),) if event.fields else ()
        yield Entry(f"{plugin.name}.{name}", event.doc, facts=facts)


def _types(plugin: Plugin) -> Iterator[Entry]:
    for name, kind in plugin.types.items():
        doc = f"A record of {_fields(kind.fields)}." if kind.fields else f"A {type_text(kind)}."
        code = plugin.readers[name].code if name in plugin.readers else None
        facts = (("what a request carries is refused with", _codes((code,))),) if code else ()
        yield Entry(name, doc, facts=facts)


def _parameters(plugin: Plugin) -> Iterator[Entry]:
    for name, parameter in plugin.parameters.items():
        facts = (
            ("type", _parameter_type(parameter)),
            ("default", value_text(parameter.default, parameter.type)),
        )
        yield Entry(name, parameter.doc, facts=facts)


def _parameter_type(parameter: Parameter) -> str:
    kind = parameter.type
    if kind.kind not in ("number", "integer"):
        return type_text(kind)
    return type_text(narrowed(parameter))


def _nodes(plugin: Plugin) -> Iterator[Entry]:
    for name, target in plugin.nodes.items():
        instead = ", ".join(plugin.stands_in.get(name, ()))
        guarded = ", ".join(plugin.guards.get(name, ()))
        pairs = (("not started where there is", instead), ("looks after", guarded))
        facts = tuple((what, names) for what, names in pairs if names)
        yield Entry(name, f"Runs {target}.", facts=facts)


def _arguments(declared: Mapping[str, Argument]) -> tuple[tuple[str, str, str], ...]:
    return tuple((name, _argument_type(argument), argument.doc) for name, argument in declared.items())


def _argument_type(argument: Argument) -> str:
    if argument.default is not None:
        return f"{type_text(argument.type)}, default {value_text(argument.default, argument.type)}"
    return f"{type_text(argument.type)}{', optional' if argument.optional else ''}"


def type_text(kind: Type) -> str:
    """Return a type with its unit, its limits and its values."""
    unit = f" in {kind.unit}" if kind.unit and kind.unit not in kind.name.split() else ""
    values = f", one of {', '.join(kind.values)}" if kind.values else ""
    named = f", by name: {_fields(kind.named)}" if kind.named else ""
    return f"{kind.name}{unit}{_limits(kind)}{values}{named}"


def number_text(value: float, unit: str) -> tuple[str, str]:
    """Return a number that is kept in `unit` as people would write it, and its unit.

    That is another one only where it takes fewer digits to say exactly the same: 90 deg, not 1.5708 rad.
    """
    for other in (unit, *units_of(unit)):
        number = in_unit(value, other) if other else value
        if float(f"{number:g}") == number:
            return f"{number:g}", other
    return f"{value:g}", unit


def value_text(value: object, kind: Type = ANY) -> str:
    """Return a value of a type as a mission would write it; in the base unit without that."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, Mapping):
        inside = (f"{name}: {value_text(one, kind.fields.get(name, ANY))}" for name, one in value.items())
        return "{" + ", ".join(inside) + "}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(value_text(one, kind.item or ANY) for one in value) + "]"
    return _number(value, kind.unit) if isinstance(value, float) else f"{value}" or '""'


def _number(value: float, unit: str) -> str:
    number, other = number_text(value, unit)
    return number if other == unit else f"{number} {other}"


def _fields(fields: Mapping[str, Type]) -> str:
    return ", ".join(f"{name} ({type_text(kind)})" for name, kind in fields.items())


def _result(result: Mapping[str, Any], fields: Mapping[str, Type]) -> str:
    return ", ".join(f"{name}: {value_text(value, fields[name])}" for name, value in result.items())


def _codes(codes: tuple[Code, ...]) -> str:
    return ", ".join(f"{code.name} ({code.label})" for code in codes)


def _limits(kind: Type) -> str:
    lowest = "" if kind.minimum is None else f", at least {_number(kind.minimum, kind.unit)}"
    return lowest + ("" if kind.maximum is None else f", at most {_number(kind.maximum, kind.unit)}")
