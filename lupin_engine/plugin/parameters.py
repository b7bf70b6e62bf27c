"""Checks values of parameters, with one text for each mistake wherever they are given."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from lupin_engine.errors import meant, nearest
from lupin_engine.plugin.contract import Parameter
from lupin_engine.plugin.types import Notation, Type, converted, innermost, problems, within

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
        "frame_prefix",
        "use_sim_time",
    }
)

#: How many letters are shown of what stands before a place in a text.
MAX_BEFORE = 24

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
    """Return a value as plain data in base units.

    Raises:
        ValueError: names the allowed values and the given one, a line for each part that is wrong.
    """
    wanted = narrowed(spec)
    found = problems(value, wanted, notation)
    if found:
        raise ValueError("\n".join(problem.inside() for problem in found))
    return converted(value, wanted)


def named(name: str, spec: Parameter, value: Any, notation: Notation = Notation.SETTING) -> Any:
    """Return a value as `accepted` does; each line of its ValueError begins with the parameter."""
    try:
        return accepted(spec, value, notation)
    except ValueError as problem:
        lines = (f"parameter {name!r}: {line}" for line in str(problem).split("\n"))
        raise ValueError("\n".join(lines)) from None


def without_repetition(pairs: Sequence[tuple[str, Any]]) -> dict[str, Any]:
    """Return an object of JSON as a mapping; ValueError names the keys that it has twice."""
    found = dict(pairs)
    if len(found) < len(pairs):
        keys = [key for key, _ in pairs]
        twice = ", ".join(repr(key) for key in found if keys.count(key) > 1)
        raise ValueError(f"a record has {twice} twice; leave one out")
    return found


def broken_text(text: str, at: int, problem: str) -> str:
    """Return why a text cannot be read as data: it ends too early, or is wrong `at` that letter."""
    read = text[:at].rstrip()
    if len(read) == len(text.rstrip()):
        return f"unfinished: it ends after {read[-MAX_BEFORE:]!r}"
    return f"cannot be read from letter {at + 1} on, after {read[-MAX_BEFORE:]!r}: {problem}"


def sorted_out(
    declared: Mapping[str, Parameter],
    given: Mapping[str, Any],
    read: Reader = named,
    elsewhere: Callable[[str], str] = lambda name: "",
) -> tuple[dict[str, Any], list[str]]:
    """Return the valid values, and the errors of the others: one for each part of a value that is wrong.

    An unknown name is reported with the nearest one, else with the place that `elsewhere` returns for it (''
    for none), else with a list of all names, once.
    """
    values: dict[str, Any] = {}
    wrong: list[str] = []
    listing = f"; {nearest('', declared)}"
    for name, value in given.items():
        if name not in declared:
            hint = meant(name, declared) or elsewhere(name)
            wrong.append(f"unknown parameter {name!r}" + (f"; {hint}" if hint else listing))
            listing = listing if hint else ""
            continue
        try:
            values[name] = read(name, declared[name], value)
        except ValueError as problem:
            wrong += str(problem).split("\n")
    return values, wrong
