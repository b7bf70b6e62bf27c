"""Generates example values of every type."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from lupin_engine.plugin import Argument, Parameter, Type, convert

#: The example of a text without further restriction.
TEXT = "example"


def example(kind: Type) -> Any:
    """Return a value of a type: short and deterministic."""
    return _EXAMPLES[kind.kind](kind)


def arguments_for(declared: Mapping[str, Argument], given: Mapping[str, Any]) -> dict[str, Any]:
    """Return arguments for a call: given ones, else defaults, else examples where one is required.

    An optional argument without any is left out, and so is a given one that is not declared.

    Raises:
        ValueError: a given value does not fit its type.
    """
    found: dict[str, Any] = {}
    for name, argument in declared.items():
        if name in given:
            found[name] = convert(given[name], argument.type)
        elif argument.default is not None:
            found[name] = convert(argument.default, argument.type)
        elif not argument.optional:
            found[name] = example(argument.type)
    return found


def defaults_of(declared: Mapping[str, Parameter]) -> dict[str, Any]:
    """Return every parameter at its default, in base units; ValueError where one does not fit its type."""
    return {name: convert(parameter.default, parameter.type) for name, parameter in declared.items()}


def _number(kind: Type) -> float:
    return float(_within(0.5, kind))


def _integer(kind: Type) -> int:
    return int(_within(1, kind))


def _within(value: float, kind: Type) -> float:
    lowest = value if kind.minimum is None else max(value, kind.minimum)
    return lowest if kind.maximum is None else min(lowest, kind.maximum)


def _list(kind: Type) -> list[Any]:
    return [] if kind.item is None else [example(kind.item)]


def _record(kind: Type) -> dict[str, Any]:
    return {name: example(field) for name, field in kind.fields.items()}


_EXAMPLES: Mapping[str, Callable[[Type], Any]] = {
    "bool": lambda _: True,
    "integer": _integer,
    "number": _number,
    "text": lambda kind: kind.values[0] if kind.values else kind.example or TEXT,
    "list": _list,
    "record": _record,
    "any": lambda _: TEXT,
}
