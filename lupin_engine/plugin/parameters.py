"""Checks values of parameters, with one text for each mistake wherever they are given."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from lupin_engine.errors import meant, nearest
from lupin_engine.plugin.contract import Parameter
from lupin_engine.plugin.types import Notation, Type, convert, innermost, within

_SCALARS = ("bool", "integer", "number", "text")
#: What a parameter can be, for people.
POSSIBLE_TYPES = f"can be {', '.join(_SCALARS)}, a record, or a list of one of these"
#: Parameters that every orchestrator has itself, and those of every node of ROS.
RESERVED = frozenset(
    {
        "allow_bundles",
        "journal_days",
        "journal_megabytes",
        "journal_missions",
        "journal_path",
        "journal_required",
        "log_bytes",
        "log_files",
        "log_path",
        "may_repeat_outcomes",
        "mission_id_prefix",
        "missions",
        "missions_path",
        "require_signed",
        "resume_policy",
        "start_type_description_service",
        "state_publish_rate_hz",
        "use_sim_time",
    }
)

#: Reads a value of the parameter that is named; ValueError says what is wrong with it.
Reader = Callable[[str, Parameter, Any], Any]


def carried_as(kind: Type) -> str:
    """Return how a node has a parameter of a type: 'number', 'list of number', ...; '' where it cannot.

    A record of numbers is a list of them, and any other one, alone or in lists, a text: see `is_json`.
    """
    if is_json(kind):
        return "text"
    if kind.kind == "record":
        return "list of number"
    if kind.kind == "list" and kind.item is not None and kind.item.kind in _SCALARS:
        return f"list of {kind.item.kind}"
    return kind.kind if kind.kind in _SCALARS else ""


def is_json(kind: Type) -> bool:
    """Say whether a node has a parameter of a type as a text of JSON: one with records, but a pose."""
    inner = innermost(kind)
    numbers = all(field.kind == "number" for field in inner.fields.values())
    return inner.kind == "record" and (kind is not inner or not numbers)


def narrowed(spec: Parameter) -> Type:
    """Return the type of a parameter with the parameter's own range in it."""
    return within(spec.type, spec.minimum, spec.maximum)


def accepted(spec: Parameter, value: Any, notation: Notation = Notation.SETTING) -> Any:
    """Return a value as plain data in base units; ValueError names the allowed values and the given one."""
    return convert(value, narrowed(spec), notation)


def named(name: str, spec: Parameter, value: Any, notation: Notation = Notation.SETTING) -> Any:
    """Return a value as `accepted` does; the text of its ValueError begins with the parameter."""
    try:
        return accepted(spec, value, notation)
    except ValueError as problem:
        raise ValueError(f"parameter {name!r}: {problem}") from None


def sorted_out(
    declared: Mapping[str, Parameter],
    given: Mapping[str, Any],
    read: Reader = named,
    elsewhere: Callable[[str], str] = lambda name: "",
) -> tuple[dict[str, Any], list[str]]:
    """Return the valid values, and an error for each of the others.

    An unknown name is reported with the nearest one, else with the place that `elsewhere` returns for it (''
    for none), else with a list of all names, once.
    """
    values: dict[str, Any] = {}
    problems: list[str] = []
    listing = f"; {nearest('', declared)}"
    for name, value in given.items():
        if name not in declared:
            hint = meant(name, declared) or elsewhere(name)
            problems.append(f"unknown parameter {name!r}" + (f"; {hint}" if hint else listing))
            listing = listing if hint else ""
            continue
        try:
            values[name] = read(name, declared[name], value)
        except ValueError as problem:
            problems.append(str(problem))
    return values, problems
