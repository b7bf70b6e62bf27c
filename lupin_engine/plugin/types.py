"""Types of the mission language, and the conversion of plain data to them.

Values are plain data: `bool`, `int`, `float`, `str`, `list`, and `dict` for records. A number may carry a
unit; inside the engine it is always in the base of its dimension (seconds, metres, radians), so `2 min` in a
file is `120.0` in a value. Angles are radians, frames are `map` unless a field says otherwise.
"""

from __future__ import annotations

import enum
import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from datetime import timezone, tzinfo
from functools import lru_cache
from types import MappingProxyType
from typing import Any, NamedTuple

from lupin_engine.errors import guessed, meant, nearest, shortened

#: unit as written -> (base unit, factor to the base)
UNITS: Mapping[str, tuple[str, float]] = MappingProxyType(
    {
        "ms": ("s", 1e-3),
        "s": ("s", 1.0),
        "min": ("s", 60.0),
        "h": ("s", 3600.0),
        "mm": ("m", 1e-3),
        "cm": ("m", 1e-2),
        "m": ("m", 1.0),
        "km": ("m", 1e3),
        "m2": ("m2", 1.0),
        "deg": ("rad", math.pi / 180.0),
        "rad": ("rad", 1.0),
        "m/s": ("m/s", 1.0),
        "km/h": ("m/s", 1 / 3.6),
        "deg/s": ("rad/s", math.pi / 180.0),
        "rad/s": ("rad/s", 1.0),
        "Hz": ("Hz", 1.0),
        "g": ("kg", 1e-3),
        "kg": ("kg", 1.0),
        "ml": ("l", 1e-3),
        "l": ("l", 1.0),
        "l/min": ("l/s", 1 / 60),
        "l/s": ("l/s", 1.0),
        "ppm": ("ppm", 1.0),
        "lx": ("lx", 1.0),
        "lux": ("lx", 1.0),
        "°C": ("°C", 1.0),
        "degC": ("°C", 1.0),
        "N": ("N", 1.0),
        "V": ("V", 1.0),
        "A": ("A", 1.0),
        "%": ("", 1e-2),
    }
)

#: Whole numbers lie within this: pages, which keep numbers as floats, tell these apart.
MAX_INTEGER = 2**53 - 1
#: The longest duration, in seconds: 100 years of 365.25 days. Clocks of ROS count nanoseconds in 64 bits.
MAX_SECONDS = 100 * 365.25 * 86400.0
#: How many lists may be in each other.
MAX_LISTS = 8
#: The longest text that a variable keeps, in characters.
MAX_TEXT = 10_000
#: Letters that are told of what is wrong with something that a plugin told.
MAX_SHOWN_VALUE = 120

#: Digits that every number keeps on its way through a float.
_CERTAIN_DIGITS = 15
_QUANTITY = re.compile(r"^([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*([A-Za-z°%][A-Za-z0-9/]*)$")
#: A number with something behind it, which may be no unit; and what other languages call no number or no end.
_MEASURED = re.compile(r"[+-]?[0-9.]+(?:[eE][+-]?[0-9]+)?\s*([^\s0-9.].*)")
_ENDLESS = re.compile(r"[+-]?\.?(?:nan|inf|infinity)\b", re.IGNORECASE)


@dataclass(frozen=True)
class Type:
    """A type of the language: a scalar kind, a list of `item`, or a record with `fields`.

    `kind` is one of bool, integer, number, text, list, record, any. `name` is its name in messages and files
    (`duration` is the number with unit s). `unit` is the base unit of a number. A list holds at most
    `maximum` elements, where that is declared; one that is `distinct` is a set: it holds each element once,
    in the order in which they came. `named` are, by name, the types of the values in a list of records of
    `name` and `value`, each in its own unit. `values` are all possible texts, where these are known: a
    comparison with another one is a mistake. `pattern` is the regular expression that a text matches as a
    whole, and `example` one that does.
    """

    kind: str
    name: str
    unit: str = ""
    item: Type | None = None
    fields: Mapping[str, Type] = field(default_factory=dict, hash=False)
    minimum: float | None = None
    maximum: float | None = None
    values: tuple[str, ...] = ()
    pattern: str = ""
    example: str = ""
    distinct: bool = False
    named: Mapping[str, Type] = field(default_factory=dict, hash=False)

    def __str__(self) -> str:
        return self.name

    def __hash__(self) -> int:
        # Types are looked up thousands of times in a large chart; those that differ elsewhere are few.
        return hash((self.kind, self.name, self.unit))


BOOL = Type("bool", "bool")
TEXT = Type("text", "text")
NUMBER = Type("number", "number")
INTEGER = Type("integer", "integer")
COUNT = Type("integer", "count", minimum=0)
DURATION = Type("number", "duration", unit="s", minimum=0)
LENGTH = Type("number", "length", unit="m")
ANGLE = Type("number", "angle", unit="rad")
ANY = Type("any", "any")
#: What a clock shows; they are ordered as they come.
TIME_OF_DAY = Type("text", "time_of_day", pattern=r"([01][0-9]|2[0-3]):[0-5][0-9]", example="06:30")
#: The days that exist, leap years included: every reader of the pattern, also a page, has the same calendar.
_DAYS = "|".join(
    (
        r"(?!0000)[0-9]{4}-(0[13578]|1[02])-(0[1-9]|[12][0-9]|3[01])",
        r"(?!0000)[0-9]{4}-(0[469]|11)-(0[1-9]|[12][0-9]|30)",
        r"(?!0000)[0-9]{4}-02-(0[1-9]|1[0-9]|2[0-8])",
        r"(?!0000)([0-9]{2}(0[48]|[2468][048]|[13579][26])|([02468][048]|[13579][26])00)-02-29",
    )
)
DATE = Type("text", "date", pattern=f"({_DAYS})", example="2026-11-22")
#: The name of a time zone in the IANA's table; that there is one of that name is looked up.
ZONE = Type("text", "time zone", pattern=r"[A-Za-z0-9_+/-]+", example="Europe/Amsterdam")

#: What a topic, service or action is called; relative ones are in the namespace of the node that uses them.
ROS_NAME = Type(
    "text",
    "ROS name",
    pattern=r"(~?/)?[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*",
    example="/camera/image_raw",
)

#: A place on the floor: metres and radians in frame `map`.
POSE = Type("record", "pose", fields={"x": LENGTH, "y": LENGTH, "yaw": ANGLE})

BUILTIN_TYPES: Mapping[str, Type] = MappingProxyType(
    {
        t.name: t
        for t in (BOOL, TEXT, NUMBER, INTEGER, COUNT, DURATION, LENGTH, ANGLE, POSE, TIME_OF_DAY, DATE, ANY)
    }
)


def is_moment(kind: Type) -> bool:
    """Say whether a type is a time of day or a date."""
    return kind.name in (TIME_OF_DAY.name, DATE.name)


def list_of(item: Type) -> Type:
    """Return the type of a list whose elements are all `item`."""
    return Type("list", f"list of {item.name}", item=item)


def set_of(item: Type) -> Type:
    """Return the type of a set whose elements are all `item`: a list that holds each of them once."""
    return Type("list", f"set of {item.name}", item=item, distinct=True)


def named_values(item: Type, named: Mapping[str, Type]) -> Type:
    """Return the type of a list of records of a `name` and a `value`, of which each name has its type."""
    return replace(list_of(item), named=named)


def one_of(*values: str) -> Type:
    """Return the type of a text that is one of a few words."""
    return Type("text", "text", values=values)


def number_in(unit: str) -> Type:
    """Return the number type with base unit `unit` ('' for a plain number)."""
    known = {"": NUMBER, "s": DURATION, "m": LENGTH, "rad": ANGLE}
    return known.get(unit) or Type("number", f"number in {unit}", unit=unit)


def units_of(base: str) -> list[str]:
    """Return the units in which a number of a base unit may be written."""
    return [unit for unit, (of, _) in UNITS.items() if of == base]


def innermost(kind: Type) -> Type:
    """Return the element type of a list, also of nested ones; of any other type, the type itself."""
    while kind.kind == "list" and kind.item is not None:
        kind = kind.item
    return kind


def within(kind: Type, minimum: float | None, maximum: float | None) -> Type:
    """Return a type with a range of its own besides the one that it has."""
    if minimum is None and maximum is None:
        return kind
    lows = [low for low in (minimum, kind.minimum) if low is not None]
    highs = [high for high in (maximum, kind.maximum) if high is not None]
    return replace(kind, minimum=max(lows, default=None), maximum=min(highs, default=None))


def in_unit(value: Any, unit: str) -> Any:
    """Convert a number, or each one of a list, from its base unit to `unit`, a key of `UNITS`.

    The result is rounded to 15 digits, so that `60 deg` comes back from radians as 60.0.
    """
    if isinstance(value, (list, tuple)):
        return [in_unit(element, unit) for element in value]
    return float(f"{value / UNITS[unit][1]:.{_CERTAIN_DIGITS}g}")


def in_base(value: Any, unit: str) -> Any:
    """Convert a number, or each one of a list, from `unit`, a key of `UNITS`, to its base unit."""
    if isinstance(value, (list, tuple)):
        return [in_base(element, unit) for element in value]
    return value * UNITS[unit][1]


def parse_type(text: str, known: Mapping[str, Type]) -> Type:
    """Parse a type as missions write it: a name, or `list of TYPE` or `set of TYPE`.

    Raises:
        ValueError: the name is unknown, and the text has the nearest; or more than `MAX_LISTS` are nested.
    """
    words = text.split()
    made: list[Callable[[Type], Type]] = []
    while len(words) > 2 and words[0] in GATHERED and words[1] == "of":
        made.append(GATHERED[words[0]])
        words = words[2:]
    if len(made) > MAX_LISTS:
        raise ValueError(f"more than {MAX_LISTS} lists in each other; use fewer")
    name = " ".join(words) if made else text
    if name not in known:
        before = text.removesuffix(name) if made else ""
        raise ValueError(f"unknown type {name!r}; {_instead_of(name, known, before)}")
    kind = known[name]
    for gather in reversed(made):
        kind = gather(kind)
    return kind


#: What other languages call a type, with its name here.
_ELSEWHERE: Mapping[str, str] = {
    **dict.fromkeys(("string", "str", "char"), "text"),
    **dict.fromkeys(("int", "long", "whole"), "integer"),
    **dict.fromkeys(("float", "double", "real", "decimal"), "number"),
    **dict.fromkeys(("boolean", "flag"), "bool"),
}
_LISTS = frozenset({"array", "list", "sequence", "tuple", "vector"})
_RECORDS = frozenset({"dict", "dictionary", "map", "mapping", "object", "record", "struct"})


def _instead_of(name: str, known: Mapping[str, Type], before: str) -> str:
    """Return what to write for an unknown type; `before` is what stands before its name, as `list of `."""
    words = name.lower().replace("[", " ").split() or [""]
    of = name.partition(" of ")[2]
    if words[0] in _LISTS and of in known:
        return f"did you mean '{before}list of {of}'?"
    if words[0] in _LISTS:
        return "write 'list of TYPE', such as 'list of text'"
    if words[0] == "set":
        return "write 'set of TYPE', such as 'set of text'"
    if words[0] in _RECORDS:
        return "declare its fields under 'types', and write its name here"
    guess = _ELSEWHERE.get(words[0]) or guessed(name, known)
    return f"did you mean {before + guess!r}?" if guess else nearest(name, known)


#: What a type is gathered in, by its word.
GATHERED: Mapping[str, Callable[[Type], Type]] = {"list": list_of, "set": set_of}


def parse_quantity(text: str) -> tuple[float, str] | None:
    """Read `60 s` or `0.5 m` as (value in the base unit, base unit); None when `text` is no quantity."""
    return _parse_quantity(str(text))


@lru_cache(maxsize=1024)
def _parse_quantity(text: str) -> tuple[float, str] | None:
    match = _QUANTITY.match(text.strip())
    if match is None or match.group(2) not in UNITS:
        return None
    base, factor = UNITS[match.group(2)]
    return float(match.group(1)) * factor, base


class Notation(enum.Enum):
    """The source of a value, which decides how a number with a unit may be written.

    FILE: in a file or on the command line, with the unit, such as `60 s`. SETTING: the same, or a bare number
    in the base unit, for so parameters arrive from ROS. DATA: between programs, a bare number in the base
    unit; further fields of a record are ignored.
    """

    FILE = enum.auto()
    SETTING = enum.auto()
    DATA = enum.auto()


class Fault(enum.Enum):
    """The ways in which a value is not of a type."""

    KIND = enum.auto()
    NO_UNIT = enum.auto()
    UNIT = enum.auto()
    NOT_FINITE = enum.auto()
    RANGE = enum.auto()
    WORD = enum.auto()
    PATTERN = enum.auto()
    UNKNOWN_FIELD = enum.auto()
    MISSING_FIELDS = enum.auto()


class ValueProblem(NamedTuple):
    """Why a part of a value is not of its type: `path` leads to it, by names of fields and numbers in lists.

    `wanted` and `value` are the type and the value there; of a field that should not be, those of its record.
    """

    path: tuple[str | int, ...]
    text: str
    fault: Fault
    wanted: Type
    value: Any

    def at(self, where: str = "") -> str:
        """Return the text with the place before it; `where` is the name of the whole value."""
        for step in self.path:
            where += f"[{step}]" if isinstance(step, int) else f".{step}"
        return f"{where}: {self.text}" if where else self.text

    def inside(self) -> str:
        """Return the text for a value whose name goes before it; elements without fields have no place."""
        has_fields = self.wanted.kind == "record" or any(isinstance(step, str) for step in self.path)
        return self.at().removeprefix(".") if has_fields else self.text


def problems(value: Any, wanted: Type, notation: Notation = Notation.SETTING) -> list[ValueProblem]:
    """Return why a value is not of a type, for each part of it; empty when it is.

    This is the one check of values; callers format the result.
    """
    found: list[ValueProblem] = []
    if notation is not Notation.DATA or not _plainly_fits(value, wanted):
        _collect(value, wanted, notation, (), found)
    return found


def _plainly_fits(value: Any, wanted: Type) -> bool:
    """Say whether a value certainly is of a type: the fast path before `_collect`."""
    made, kind, item = type(value), wanted.kind, wanted.item
    if made is float or made is int:
        is_number = kind == "integer" if made is int else kind == "number" and math.isfinite(value)
        return is_number and not _is_outside(value, wanted) and not beyond(value, wanted)
    if isinstance(value, str):
        return kind == "text" and not wanted.values and not wanted.pattern
    if made is dict and kind == "record":
        return _fields_fit(value, wanted)
    if made is list and kind == "list" and item is not None:
        return not _is_outside(len(value), wanted) and all(_plainly_fits(each, item) for each in value)
    return made is bool and kind == "bool"


def _fields_fit(value: Mapping[str, Any], wanted: Type) -> bool:
    for name, inner in wanted.fields.items():
        if name not in value or not _plainly_fits(value[name], inner):
            return False
    return True


def beyond(value: float, kind: Type) -> str:
    """Return the limit of the language that a number of a kind exceeds; else ''."""
    if kind.kind == "integer" and not -MAX_INTEGER <= value <= MAX_INTEGER:
        return f"of at most {MAX_INTEGER}" if value > 0 else f"of at least -{MAX_INTEGER}"
    if kind.unit == "s" and not -MAX_SECONDS <= value <= MAX_SECONDS:
        return f"of at most 100 years ({MAX_SECONDS:.0f} s)"
    return ""


def convert(value: Any, wanted: Type, notation: Notation = Notation.SETTING) -> Any:
    """Check a value, and return it as plain data of type `wanted`: see `converted`.

    Raises:
        ValueError: the value is not of that type, or out of its range; the text is the first problem.
    """
    found = problems(value, wanted, notation)
    if found:
        raise ValueError(found[0].inside())
    return converted(value, wanted)


def converted(value: Any, wanted: Type) -> Any:
    """Return a value without `problems` as plain data: numbers in base units, sets without repetitions."""
    if wanted.kind == "number":
        quantity = parse_quantity(value) if isinstance(value, str) else None
        return float(value if quantity is None else quantity[0])
    if wanted.kind == "list" and wanted.item is not None:
        found = [converted(element, wanted.item) for element in value]
        return unique(found) if wanted.distinct else found
    if wanted.kind == "record":
        return {name: converted(value[name], kind) for name, kind in wanted.fields.items()}
    return value


def unique(values: Sequence[Any]) -> list[Any]:
    """Return the elements of a set: each once, in the order in which they came."""
    try:
        return list(dict.fromkeys(values))
    except TypeError:  # records
        found: list[Any] = []
        for value in values:
            if value not in found:
                found.append(value)
        return found


def fitted(value: Any, kind: Type) -> Any:
    """Return a computed value of type `kind`, in base units, as it is stored: of a set, each element once.

    Raises:
        ValueError: a number is out of range or not finite, a text is longer than `MAX_TEXT` or does not match
            its pattern, or a list has too many elements.
    """
    if isinstance(value, str) and len(value) > MAX_TEXT:
        raise ValueError(f"a text of {len(value)} characters; at most {MAX_TEXT} are kept")
    if isinstance(value, float) and not math.isfinite(value):
        raise ValueError(f"a {kind}, got {value!r}")
    if kind.kind in ("integer", "number") and (allowed := beyond(value, kind)):
        raise ValueError(f"a {kind} {allowed}, got {value!r}")
    if kind.kind == "record" and isinstance(value, dict):
        fields = {name: fitted(value[name], inner) for name, inner in kind.fields.items() if name in value}
        return {**value, **fields}
    if kind.kind != "list" or kind.item is None:
        _check_bounds(value, kind)
        return value
    kept = unique(value) if kind.distinct else list(value)
    if kind.maximum is not None and len(kept) > kind.maximum:
        raise ValueError(f"a {kind} of at most {kind.maximum:g} elements, got {len(kept)}")
    return [fitted(element, kind.item) for element in kept]


def _check_bounds(value: Any, kind: Type) -> None:
    """Raise ValueError where a computed value that is no list is not as its type bounds it."""
    low, high = kind.minimum, kind.maximum
    if low is not None and value < low:
        raise ValueError(f"a {kind} of at least {low:g}, got {value!r}")
    if high is not None and value > high:
        raise ValueError(f"a {kind} of at most {high:g}, got {value!r}")
    if kind.pattern and not re.fullmatch(kind.pattern, value):
        raise ValueError(f"a {kind} such as {kind.example}, got {value!r}")


def _collect(
    value: Any, wanted: Type, notation: Notation, path: tuple[str | int, ...], found: list[ValueProblem]
) -> None:
    """Add the problems of a value, whose place is `path`, to those found."""
    kind = wanted.kind
    if kind == "list" and wanted.item is not None and isinstance(value, (list, tuple)):
        if _is_outside(len(value), wanted):
            text = f"expected {elements_of(wanted)}, got {len(value)}"
            found.append(ValueProblem(path, text, Fault.RANGE, wanted, value))
        for index, element in enumerate(value):
            _collect(element, wanted.item, notation, (*path, index), found)
    elif kind == "record" and isinstance(value, Mapping):
        for wrong, field, text in _wrong_fields(value, wanted, notation):
            found.append(ValueProblem((*path, *field), text, wrong, wanted, value))
        for name in filter(value.__contains__, wanted.fields):
            _collect(value[name], wanted.fields[name], notation, (*path, name), found)
    elif kind != "any":
        found += _scalar_problems(value, wanted, notation, path)


def _scalar_problems(
    value: Any, wanted: Type, notation: Notation, path: tuple[str | int, ...]
) -> Iterator[ValueProblem]:
    fault, text = _SCALARS.get(wanted.kind, _no_scalar)(value, wanted, notation)
    if fault is not None:
        shown = shortened(text, MAX_SHOWN_VALUE) if notation is Notation.DATA else text
        yield ValueProblem(path, shown, fault, wanted, value)


def _wrong_fields(
    value: Mapping[str, Any], wanted: Type, notation: Notation
) -> Iterator[tuple[Fault, tuple[str, ...], str]]:
    """Yield which fields of a record should not be there, and that some are not."""
    if notation is not Notation.DATA:
        for name in value:
            if name not in wanted.fields:
                yield (
                    Fault.UNKNOWN_FIELD,
                    (name,),
                    f"a {wanted} has no {name!r}; {nearest(str(name), wanted.fields)}",
                )
    missing = [name for name in wanted.fields if name not in value]
    if missing:
        left_out = f"{' and '.join(missing)} of {wanted} left out"
        yield Fault.MISSING_FIELDS, (), left_out


#: What to write where one record stands for a list of them.
A_LIST = "a list is wanted: write [ ... ]"


def elements_of(kind: Type) -> str:
    """Return how many elements a list may have: it has a minimum, a maximum, or both."""
    low, high = kind.minimum, kind.maximum
    if low is not None and high is not None:
        return f"{low:g} to {high:g} elements"
    bound, count = ("at least", low) if high is None else ("at most", high)
    return f"{bound} {count:g} element{'' if count == 1 else 's'}"


def _expected_record(value: Any, wanted: Type) -> str:
    return f"expected {wanted} with the fields {', '.join(wanted.fields)}, got {value!r}"


_Answer = tuple[Fault | None, str]
_FINE: _Answer = (None, "")


def _expected(wanted: Type, value: Any, hint: str = "", fault: Fault = Fault.KIND) -> _Answer:
    return fault, f"expected {wanted}, got {value!r}{hint}"


def _no_scalar(value: Any, wanted: Type, _: Notation) -> _Answer:
    if wanted.kind == "record":
        return Fault.KIND, _expected_record(value, wanted)
    if wanted.kind == "list" and isinstance(value, Mapping):
        return Fault.KIND, f"expected {wanted}, got a record alone; {A_LIST}"
    return _expected(wanted, value, "; write [] for an empty list" if value == "" else "")


def _bool(value: Any, wanted: Type, _: Notation) -> _Answer:
    if isinstance(value, bool):
        return _FINE
    return _expected(wanted, value, "; write true or false" if isinstance(value, str) else "")


def _number(value: Any, wanted: Type, notation: Notation) -> _Answer:
    if isinstance(value, str) and wanted.kind == "number" and notation is not Notation.DATA:
        return _quantity(value, wanted)
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return _expected(wanted, value)
    if wanted.kind == "number" and not _is_finite(value):
        hint = "" if notation is Notation.DATA else f"; {_finite(wanted)}"
        return _expected(wanted, value, hint, Fault.NOT_FINITE)
    if notation is Notation.FILE and wanted.unit:
        return Fault.NO_UNIT, f"{value!r} has no unit; write '{value!r} {wanted.unit}'"
    if wanted.kind == "integer" and not isinstance(value, int):
        return _expected(wanted, value)
    return _in_range(value, value, wanted)


def _quantity(value: str, wanted: Type) -> _Answer:
    quantity = parse_quantity(value)
    if quantity is None or quantity[1] != wanted.unit:
        hint = number_hint(value, wanted)
        fault = Fault.KIND if quantity is None else Fault.UNIT
        return _expected(wanted, value, f"; {hint}" if hint else "", fault)
    if not _is_finite(quantity[0]):
        return _expected(wanted, value, f"; {_finite(wanted)}", Fault.NOT_FINITE)
    return _in_range(quantity[0], value, wanted)


def _in_range(number: float, value: Any, wanted: Type) -> _Answer:
    """Say whether a number, which was written as a value, lies where its type allows."""
    allowed = _range(wanted, value) if _is_outside(number, wanted) else beyond(number, wanted)
    return (Fault.RANGE, f"expected {wanted} {allowed}, got {value!r}") if allowed else _FINE


def _is_outside(number: float, wanted: Type) -> bool:
    """Say whether a number is below the minimum of a type, or above its maximum."""
    low, high = wanted.minimum, wanted.maximum
    return (low is not None and number < low) or (high is not None and number > high)


def number_hint(text: str, wanted: Type) -> str:
    """Return a correct spelling for a text that is no number of a type; '' where none is known."""
    if _ENDLESS.match(text.strip()):
        return _finite(wanted)
    measured = _MEASURED.fullmatch(text.strip())
    if not wanted.unit:
        whole = "write a whole number without a unit"
        number = whole if wanted.kind == "integer" else "write a number without a unit, or in %"
        return number if measured else ""
    units = units_of(wanted.unit)
    guess = meant(measured[1], units) if measured and measured[1] not in UNITS else ""
    return guess or (f"its units are {', '.join(map(repr, units))}" if units else "")


def _finite(wanted: Type) -> str:
    return f"write a finite number, such as '5 {wanted.unit}'" if wanted.unit else "write a finite number"


def _is_finite(value: float) -> bool:
    try:
        return math.isfinite(value)
    except OverflowError:  # an integer that no float can hold
        return False


def _range(kind: Type, written: Any) -> str:
    """Return the range of numbers of a type, in the unit of a given wrong one."""
    quantity = _QUANTITY.match(written.strip()) if isinstance(written, str) else None
    chosen = quantity[2] if quantity is not None else kind.unit
    unit = f" {chosen}" if chosen and chosen not in kind.name.split() else ""
    low, high = (
        limit if limit is None or chosen not in UNITS else in_unit(limit, chosen)
        for limit in (kind.minimum, kind.maximum)
    )
    if low is not None and high is not None:
        return f"between {low:g} and {high:g}{unit}"
    return f"of at least {low:g}{unit}" if low is not None else f"of at most {high:g}{unit}"


def _text(value: Any, wanted: Type, _: Notation) -> _Answer:
    if not isinstance(value, str):
        return _expected(wanted, value)
    if wanted.values and value not in wanted.values:
        guess = meant(value, wanted.values)
        text = f"expected one of {', '.join(wanted.values)}, got {value!r}"
        return Fault.WORD, f"{text}; {guess}" if guess else text
    if wanted.pattern and not re.fullmatch(wanted.pattern, value):
        return _expected(
            wanted, value, f", such as {wanted.example}" if wanted.example else "", Fault.PATTERN
        )
    if wanted.name == ZONE.name:
        try:
            zone_called(value)
        except ValueError as problem:
            return Fault.WORD, str(problem)
    return _FINE


def zone_called(name: str) -> tzinfo:
    """Return a time zone by its IANA name.

    Raises:
        ValueError: there is none of that name; the text has the nearest.
    """
    if name == "UTC":  # as nearly everywhere: that needs no table of zones
        return timezone.utc
    from zoneinfo import ZoneInfo, available_timezones

    with suppress(OSError, KeyError, ValueError):
        return ZoneInfo(name)
    hint = meant(name, available_timezones()) or f"write one such as {ZONE.example}"
    raise ValueError(f"there is no time zone {name!r}; {hint}")


_SCALARS = {"bool": _bool, "integer": _number, "number": _number, "text": _text}
