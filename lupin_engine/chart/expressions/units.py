"""Relations between types of the language: subtyping, joins, and units in arithmetic.

Numbers differ by unit, whole numbers fit where numbers do, `any` fits everywhere. A written zero has any unit
(`*`): there is no other zero to be confused with.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cache

from lupin_engine.plugin.types import (
    ANY,
    BOOL,
    INTEGER,
    NUMBER,
    TEXT,
    UNITS,
    Type,
    innermost,
    list_of,
    number_in,
    within,
)

#: A written 0: a whole number of any unit.
ZERO = Type("integer", "integer", unit="*")
#: A written 0.0.
ZERO_NUMBER = Type("number", "number", unit="*")
#: What came over the wire and was not looked up: anything, and a number where it is calculated with.
WIRE = Type("any", "any", unit="*")

#: How often a base unit may be multiplied with itself.
MAX_POWER = 9
_POWER = re.compile(r"(\D+)(\d?)")
#: Records that are not called by a type's name.
_ROOTS = frozenset({"param", "request", "input", "event", "error", "itinerary", "clock", "this_step"})
_EXAMPLES: Mapping[str, str] = {
    "s": "'5 s'",
    "m": "'0.5 m'",
    "rad": "'90 deg'",
    "m/s": "'0.3 m/s'",
    "Hz": "'2 Hz'",
}


def is_number(kind: Type) -> bool:
    """Say whether arithmetic can use a value of this type."""
    return kind.kind in ("integer", "number")


@cache
def number(unit: str) -> Type:
    """Return the number type of a computed value: a difference of durations may be negative."""
    return NUMBER if not unit else Type("number", number_in(unit).name, unit=unit)


@cache
def whole(unit: str) -> Type:
    """Return the type of a number that was rounded to whole ones of its unit."""
    return Type("integer", number(unit).name, unit=unit) if unit else INTEGER


def measured_in(kind: Type, unit: str) -> Type:
    """Return the type of a number or a list of numbers as it is counted in another unit of its dimension."""
    return kind if innermost(kind).unit == unit else in_lists(kind, number(unit))


def in_lists(kind: Type, item: Type) -> Type:
    """Return the type of as many lists in each other as `kind` is, with `item` innermost."""
    return item if kind.item is None else list_of(in_lists(kind.item, item))


def plain(kind: Type) -> Type:
    """Return a numeric type without its range, as a computed value has it."""
    if kind.unit:
        return kind if kind.unit == "*" else number(kind.unit)
    return INTEGER if kind.kind == "integer" else NUMBER


def describe(kind: Type) -> str:
    """Return a type as messages call it, with its unit."""
    if kind.kind == "record" and (not kind.name.isidentifier() or kind.name in _ROOTS):
        return f"a record of {', '.join(kind.fields) or 'nothing'}"
    if not is_number(kind) or kind.unit in ("", "*"):
        return {
            "": "unknown",
            "integer": "a plain number",
            "number": "a plain number",
            "count": "a plain number",
        }.get(kind.name, str(kind))
    return f"{kind.name} ({kind.unit})" if kind.unit not in kind.name else kind.name


def named_in(kind: Type) -> tuple[str, Type] | None:
    """Return '' and a type that has named values, else the first field of a record whose type has some.

    None where neither has any.
    """
    if kind.named:
        return "", kind
    return next(((name, inner) for name, inner in kind.fields.items() if inner.named), None)


def with_article(kind: Type) -> str:
    """Return a type as messages call it, with an article."""
    return one(describe(kind).removeprefix("a "))


def one(name: str) -> str:
    """Return a name with its article."""
    return f"an {name}" if name[0] in "aeiou" else f"a {name}"


def unit_hint(wanted: Type, got: Type) -> str:
    """Return a correct spelling for a plain number where one with a unit is needed."""
    for unit, other in ((wanted.unit, got.unit), (got.unit, wanted.unit)):
        if unit in UNITS and not other:
            example = _EXAMPLES.get(unit, f"'5 {unit}'")
            return f"write the number with its unit as a text, such as {example}"
    return ""


def same_unit(first: Type, second: Type) -> bool:
    """Say whether two numbers can be compared or added."""
    return first.unit == second.unit or "*" in (first.unit, second.unit)


def accepts(wanted: Type, got: Type) -> bool:
    """Say whether a value of type `got` may stand where `wanted` is expected."""
    if "any" in (wanted.kind, got.kind):
        return True
    if is_number(wanted) and is_number(got):
        return same_unit(wanted, got) and (wanted.kind == "number" or got.kind == "integer")
    if wanted.kind != got.kind:
        return False
    if wanted.kind == "list":
        return accepts(wanted.item or ANY, got.item or ANY)
    if wanted.kind == "record":
        return all(
            name in got.fields and accepts(kind, got.fields[name]) for name, kind in wanted.fields.items()
        )
    return True


def difference(wanted: Type, got: Type) -> str:
    """Return which field keeps a record from standing for another one; '' where that is no field."""
    while wanted.kind == got.kind == "list":
        wanted, got = wanted.item or ANY, got.item or ANY
    if not (wanted.kind == got.kind == "record"):
        return ""
    for name, kind in wanted.fields.items():
        if name not in got.fields:
            return f"it has no {name}"
        if not accepts(kind, got.fields[name]):
            inside = difference(kind, got.fields[name])
            return inside or f"its {name} is {describe(got.fields[name])}, {with_article(kind)} is wanted"
    return ""


def _join_lists(first: Type, second: Type) -> Type | None:
    item = join(first.item or ANY, second.item or ANY)
    limits = (first.maximum, second.maximum)
    most = None if None in limits else max(limit for limit in limits if limit is not None)
    return None if item is None else within(list_of(item), None, most)


def join(first: Type, second: Type) -> Type | None:
    """Return the type that holds both, or None when they have nothing in common."""
    if "any" in (first.kind, second.kind):
        return ANY
    if is_number(first) and is_number(second):
        return _join_numbers(first, second)
    if first.kind != second.kind:
        return None
    if first.kind == "list":
        return _join_lists(first, second)
    if first.kind == "record":
        return first if accepts(first, second) else second if accepts(second, first) else None
    if first.kind == "text":
        return first if first == second else TEXT
    return BOOL if first.kind == "bool" else first


def _join_numbers(first: Type, second: Type) -> Type | None:
    if first is second:
        return first
    if not same_unit(first, second):
        return None
    if first == second:
        return first
    unit = second.unit if first.unit == "*" else first.unit
    if unit == "*":
        return ZERO_NUMBER
    return whole(unit) if first.kind == second.kind == "integer" else number(unit)


def arithmetic(sign: str, left: Type, right: Type) -> Type | None:
    """Return the type of `left sign right` for two numbers, or None when the units do not allow it."""
    if sign in ("+", "-", "%"):
        return _sum(left, right)
    unit = _combined(_unit(left), _unit(right), 1 if sign == "*" else -1)
    if unit is None:
        return None
    whole = left.kind == right.kind == "integer" and sign != "/"
    return INTEGER if whole and not unit else number(unit)


@cache
def _combined(first: str, second: str, power: int) -> str | None:
    """Return the unit of `first` times `second` to a power of 1 or -1; None if there is no such unit."""
    if first == second and power == -1:
        return ""
    if not second or (not first and power == 1):
        return first or second
    if any(unit in UNITS and UNITS[unit][0] != unit for unit in (first, second)):
        return None
    powers = _powers(first)
    for name, times in _powers(second).items():
        powers[name] = powers.get(name, 0) + power * times
    above = [f"{name}{times if times > 1 else ''}" for name, times in sorted(powers.items()) if times > 0]
    below = [f"/{name}{-times if times < -1 else ''}" for name, times in sorted(powers.items()) if times < 0]
    if any(abs(times) > MAX_POWER for times in powers.values()):
        return None
    unit = ("*".join(above) or "1" * bool(below)) + "".join(below)
    return "Hz" if unit == "1/s" else unit


def _powers(unit: str) -> dict[str, int]:
    """Return which base units a unit is made of, and how often: of m/s2, m once and s minus twice."""
    above, *below = ("1/s" if unit == "Hz" else unit).split("/")
    parts = [(1, part) for part in above.split("*")] + [(-1, part) for part in below]
    matches = [(sign, _POWER.fullmatch(part)) for sign, part in parts]
    return {match[1]: sign * int(match[2] or 1) for sign, match in matches if match is not None}


def _sum(left: Type, right: Type) -> Type | None:
    joined = _join_numbers(left, right)
    return None if joined is None else plain(joined)


def _unit(kind: Type) -> str:
    return "" if kind.unit == "*" else kind.unit
