"""Values for parameters, checked: whoever gave them, and wherever, a mistake is told in the same words."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from lupin_engine.errors import meant, nearest
from lupin_engine.plugin.contract import Parameter
from lupin_engine.plugin.types import Notation, Type, convert, within

#: Reads a value of the parameter that is named; ValueError says what is wrong with it.
Reader = Callable[[str, Parameter, Any], Any]


def narrowed(spec: Parameter) -> Type:
    """Return the type of a parameter with the parameter's own range in it."""
    return within(spec.type, spec.minimum, spec.maximum)


def accepted(spec: Parameter, value: Any, notation: Notation = Notation.SETTING) -> Any:
    """Return a value as plain data in base units; ValueError says what is allowed, and what came."""
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
    """Return the given values that can be used, and what is wrong with each of the others.

    An unknown name is told with the nearest one, else with where it belongs: `elsewhere` says that of a name,
    '' where it knows nothing. Else all names that there are are listed, once.
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
