"""Evaluation at run time: expressions, their environment, and constants with the same interface."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

from lupin_engine.chart.records import record
from lupin_engine.errors import Place
from lupin_engine.plugin.types import MAX_INTEGER, MAX_TEXT, UNITS, Type, in_base, in_unit

#: What an expression sees: the records param, request, input, event, error, target, itinerary, clock and, in
#: properties, step; `item` (what a `for_each` is at); `context` (variables by name); and the callables
#: `known(input)`, `held(hold)`, `in_state(full_names)` and, in `functions`, those of the plugins by full
#: name.
Environment = Mapping[str, Any]


#: So many elements of a list that does not say how many it holds can be gone through.
MAX_ELEMENTS = 1000


class UnknownValue(Exception):
    """An expression read a missing value; `known` would have been false."""


class UnknownInput(UnknownValue):
    """An expression read a live value that is not known: never reported, or older than its freshness."""

    def __init__(self, name: str) -> None:
        super().__init__(f"input.{name} is unknown")
        self.name = name


def _times(left: Any, right: Any) -> Any:
    """Multiply; OverflowError beyond `_counted`'s limits."""
    return _counted(left * right, left, right)


def _over(left: Any, right: Any) -> Any:
    """Divide; ZeroDivisionError, and OverflowError beyond `_counted`'s limits."""
    return _counted(left / right, left, right)


def _round(value: Any, digits: int | None = None) -> Any:
    """Round; OverflowError beyond `_counted`'s limits."""
    return _counted(round(value, digits), value)


def _counted(result: Any, *operands: Any) -> Any:
    """Return a computed number; a sensor's infinity passes.

    Raises:
        OverflowError: an integer beyond the precision of a float, or finite operands make no finite number.
    """
    if isinstance(result, int):
        if abs(result) > MAX_INTEGER:
            raise OverflowError(f"{float(result):.3g} is too large")
    elif not math.isfinite(result) and all(map(math.isfinite, operands)):
        raise OverflowError(f"{' and '.join(f'{operand:g}' for operand in operands)} make {result:g}")
    return result


def _number(value: Any) -> Any:
    """Return a number that is calculated with; TypeError for anything else: no text may be multiplied."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise TypeError(f"expected a number, got {value!r}")
    return value


def _text(value: Any, unit: str, digits: int | None, computed: str) -> str:
    """Return a value as text; a number with a unit in that unit.

    A sensor's value may be infinite; a `computed` one (its source; '': it was not) raises OverflowError.
    """
    if isinstance(value, (list, tuple)):
        return ", ".join(_text(each, unit, digits, computed) for each in value)
    if isinstance(value, bool):
        return str(value).lower()
    if not isinstance(value, (int, float)):
        return str(value)
    number = in_unit(value, unit) if unit in UNITS else value
    if not math.isfinite(number) and (computed or math.isfinite(value)):
        raise OverflowError(f"{computed or f'{value:g}'} makes {number:g}{unit and f' {unit}'}")
    shown = f"{number:.6g}" if digits is None and isinstance(number, float) else f"{number:.{digits or 0}f}"
    return f"{shown} {unit}" if unit else shown


def _bounded(values: Any) -> Any:
    """Return a list to loop over; TypeError for anything else, ValueError above `MAX_ELEMENTS`."""
    if not isinstance(values, (list, tuple)):
        raise TypeError(f"expected a list, got {values!r}")
    if len(values) > MAX_ELEMENTS:
        raise ValueError(f"a list of {len(values)} elements; at most {MAX_ELEMENTS} can be gone through")
    return values


def _short(values: Any) -> Any:
    """Return a list or text to be read in each pass of a loop; ValueError where it is too long for that."""
    limit = MAX_TEXT if isinstance(values, str) else MAX_ELEMENTS
    if len(values) > limit:
        raise ValueError(f"something of length {len(values)}; in a loop at most {limit} can be looked at")
    return values


def _first(values: Sequence[Any], otherwise: Callable[[], Any]) -> Any:
    """Return the first element of a list, of an empty one something else."""
    return values[0] if values else otherwise()


def _found(values: Iterator[Any], sought: str) -> Any:
    """Return the first of the elements that fit; UnknownValue without one."""
    for value in values:
        return value
    raise UnknownValue(f"{sought} is unknown: there is no such element")


def _named(values: Sequence[Mapping[str, Any]], name: str, sought: str) -> Any:
    """Return the value of a name in a list of records; UnknownValue where the name is not there."""
    for value in values:
        if value["name"] == name:
            return value["value"]
    raise UnknownValue(f"{sought} is unknown: it was not told")


def _known(read: Callable[[], Any]) -> bool:
    """Say whether a value can be read: reading it raises no UnknownValue; other errors go through."""
    try:
        read()
    except UnknownValue:
        return False
    return True


def _same(value: Any) -> Any:
    return value


#: All that compiled code can name besides its environment.
_GLOBALS: dict[str, Any] = {
    "__builtins__": {},
    "len": len,
    "min": min,
    "max": max,
    "abs": abs,
    "round": _round,
    "any": any,
    "all": all,
    "sum": sum,
    "sorted": sorted,
    "_bounded": _bounded,
    "_first": _first,
    "_found": _found,
    "_known": _known,
    "_short": _short,
    "_named": _named,
    "_number": _number,
    "_times": _times,
    "_over": _over,
    "_same": _same,
    "_text": _text,
    "_in_unit": in_unit,
    "_in_base": in_base,
    "inf": math.inf,
}


_ROOT = re.compile(r"\benv\['(\w+)'\]")


def to_function(code: str) -> Callable[[Environment], Any]:
    """Compile checked code to a function of the environment."""
    function: Callable[[Environment], Any] = eval(f"lambda env: {code}", _GLOBALS)
    return function


class Compiled:
    """A function of the environment that is compiled from checked code when it is first needed."""

    __slots__ = ("_function", "code")

    def __init__(self, code: str) -> None:
        self.code = code
        self._function: Callable[[Environment], Any] | None = None

    def __call__(self, env: Environment) -> Any:
        """Evaluate in an environment."""
        return (self._function or self.compiled())(env)

    def compiled(self) -> Callable[[Environment], Any]:
        """Return the plain function, for frequent calls."""
        if self._function is None:
            self._function = to_function(self.code)
        return self._function


def roots_of(code: str) -> frozenset[str]:
    """Return the roots of the environment that checked code reads."""
    return frozenset(_ROOT.findall(code))


def never(_: Environment) -> bool:
    """Replace a condition with mistakes: always false; rules recognise it and report nothing about it."""
    return False


@record(frozen=True)
class Expression:
    """A typed, compiled expression; `evaluate` reads an environment and has no side effect.

    `evaluate` is mostly a `Compiled`, whose plain function is a little faster. `parts` are the operands of
    its outermost and/or/not as (text, function), for saying why a guard failed.
    """

    source: str
    place: Place
    type: Type
    evaluate: Callable[[Environment], Any]
    parts: tuple[tuple[str, Callable[[Environment], Any]], ...] = ()

    @property
    def understood(self) -> bool:
        """Whether it is without mistakes."""
        return self.evaluate is not never

    @property
    def operands(self) -> tuple[tuple[str, Callable[[Environment], Any]], ...]:
        """Its parts, or itself where it has none."""
        return self.parts or ((self.source, self.evaluate),)


@record(frozen=True)
class Constant:
    """A value that is written out; has the same face as an expression."""

    value: Any
    place: Place
    type: Type

    def evaluate(self, _: Environment) -> Any:
        """Return the value."""
        return self.value


Value = Expression | Constant
