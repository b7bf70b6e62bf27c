"""Types of the mission language, and the conversion of plain data to them.

Values are plain data: `bool`, `int`, `float`, `str`, `list`, and `dict` for records. A number may carry a
unit; inside the engine it is always in the base of its dimension (seconds, metres, radians), so `2 min` in a
file is `120.0` in a value. Angles are radians, frames are `map` unless a field says otherwise.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from types import MappingProxyType
from typing import Any

from lupin_engine.errors import meant, nearest, shortened

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
        "deg": ("rad", math.pi / 180.0),
        "rad": ("rad", 1.0),
        "m/s": ("m/s", 1.0),
        "Hz": ("Hz", 1.0),
        "g": ("kg", 1e-3),
        "kg": ("kg", 1.0),
        "ml": ("l", 1e-3),
        "l": ("l", 1.0),
        "N": ("N", 1.0),
        "V": ("V", 1.0),
        "A": ("A", 1.0),
        "%": ("", 1e-2),
    }
)

#: How many lists may be in each other.
MAX_LISTS = 8
#: Letters that are told of what is wrong with something that a plugin told.
MAX_TOLD = 120

#: Digits that every number keeps on its way through a float.
_CERTAIN_DIGITS = 15
_QUANTITY = re.compile(r"^([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*([A-Za-z/%]+)$")


@dataclass(frozen=True)
class Type:
    """A type of the language: a scalar kind, a list of `item`, or a record with `fields`.

    `kind` is one of bool, integer, number, text, list, record, any. `name` is what messages and files call
    it (`duration` is the number with unit s). `unit` is the base unit of a number. `values` are all that a
    text can be, where that is known: a comparison with another one is a slip of the pen. `pattern` is the
    regular expression that a text matches as a whole, and `example` one that does.
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

#: What a topic, service or action is called; relative ones are in the namespace of the node that uses them.
ROS_NAME = Type(
    "text",
    "ROS name",
    pattern=r"(~?/)?[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*",
    example="/camera/image_raw",
)

#: A place on the floor of the greenhouse: metres and radians in frame `map`.
POSE = Type("record", "pose", fields={"x": LENGTH, "y": LENGTH, "yaw": ANGLE})

BUILTIN_TYPES: Mapping[str, Type] = MappingProxyType(
    {t.name: t for t in (BOOL, TEXT, NUMBER, INTEGER, COUNT, DURATION, LENGTH, ANGLE, POSE, ANY)}
)


def list_of(item: Type) -> Type:
    """Return the type of a list whose elements are all `item`."""
    return Type("list", f"list of {item.name}", item=item)


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
    """Return what a list holds, also one in lists; of any other type, the type itself."""
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
    """Return a number that is kept in the base of `unit` as a number of that unit; a list, each of it.

    What was written as `60 deg` is 60.0, not the nearest number that the way to radians and back leads to.
    """
    if isinstance(value, (list, tuple)):
        return [in_unit(element, unit) for element in value]
    return float(f"{value / UNITS[unit][1]:.{_CERTAIN_DIGITS}g}")


def in_base(value: Any, unit: str) -> Any:
    """Return a number of `unit` as it is kept; of a list, each."""
    if isinstance(value, (list, tuple)):
        return [in_base(element, unit) for element in value]
    return value * UNITS[unit][1]


def parse_type(text: str, known: Mapping[str, Type]) -> Type:
    """Read a type as missions write it: a name, or `list of NAME`.

    Raises:
        ValueError: the name is not known; the text says what is.
    """
    words = text.split()
    lists = 0
    while words[2 * lists : 2 * lists + 2] == ["list", "of"] and len(words) > 2 * lists + 2:
        lists += 1
    if lists > MAX_LISTS:
        raise ValueError(f"more than {MAX_LISTS} lists in each other; use fewer")
    name = " ".join(words[2 * lists :]) if lists else text
    if name not in known:
        raise ValueError(f"unknown type {name!r}; {nearest(name, known)}")
    kind = known[name]
    for _ in range(lists):
        kind = list_of(kind)
    return kind


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


def convert(value: Any, wanted: Type) -> Any:
    """Return `value` as plain data of type `wanted`.

    Numbers with a unit may be given as quantities in text (`"60 s"`); a bare number is taken to be in the
    base unit, because parameters arrive as bare numbers from ROS. Records must have exactly their fields.

    Raises:
        ValueError: the value is not of that type; the text says what was expected and what came.
    """
    converter = _CONVERTERS[wanted.kind]
    return converter(value, wanted)


def misfit(told: Any, wanted: Type) -> str:
    """Return why what a plugin tells is not of a type, with the place in it, or `''` when it is.

    Unlike in a file, a quantity in text is no number here; of a record, further fields do no harm.
    """
    if wanted.kind == "list" and wanted.item is not None and isinstance(told, (list, tuple)):
        inner = ((f"[{index}]", misfit(element, wanted.item)) for index, element in enumerate(told))
    elif wanted.kind == "record" and isinstance(told, Mapping):
        missing = [name for name in wanted.fields if name not in told]
        if missing:
            return f"{' and '.join(missing)} of {wanted} left out"
        inner = ((f".{name}", misfit(told[name], kind)) for name, kind in wanted.fields.items())
    else:
        return _scalar_misfit(told, wanted)
    where, why = next(((where, why) for where, why in inner if why), ("", ""))
    return placed(where, why) if why else ""


def placed(where: str, why: str) -> str:
    """Return what is wrong with a part of something (see `misfit`), with the part's place before it."""
    return f"{where}{'' if why.startswith(('[', '.')) else ': '}{why}"


def _scalar_misfit(told: Any, wanted: Type) -> str:
    try:
        converted = convert(told, wanted)
    except ValueError as problem:
        return shortened(str(problem), MAX_TOLD)
    is_quantity = isinstance(told, str) and not isinstance(converted, str)
    return shortened(str(_wrong(told, wanted)), MAX_TOLD) if is_quantity else ""


def _wrong(value: Any, wanted: Type, hint: str = "") -> ValueError:
    return ValueError(f"expected {wanted}, got {value!r}{hint}")


def _to_bool(value: Any, wanted: Type) -> bool:
    if not isinstance(value, bool):
        raise _wrong(value, wanted, "; write true or false" if isinstance(value, str) else "")
    return value


def _to_integer(value: Any, wanted: Type) -> int:
    if isinstance(value, bool) or not isinstance(value, int):
        raise _wrong(value, wanted)
    _check_range(value, wanted, value)
    return value


def _to_number(value: Any, wanted: Type) -> float:
    number = _from_quantity(value, wanted) if isinstance(value, str) else value
    if isinstance(number, bool) or not isinstance(number, (int, float)) or not _is_finite(number):
        raise _wrong(value, wanted)
    _check_range(number, wanted, value)
    return float(number)


def _from_quantity(text: str, wanted: Type) -> float:
    quantity = parse_quantity(text)
    if quantity is None or quantity[1] != wanted.unit:
        units = ", ".join(map(repr, units_of(wanted.unit)))
        raise _wrong(text, wanted, f"; its units are {units}" if wanted.unit and units else "")
    return quantity[0]


def _is_finite(value: float) -> bool:
    try:
        return math.isfinite(value)
    except OverflowError:  # an integer that no float can hold
        return False


def _check_range(number: float, wanted: Type, written: Any) -> None:
    low, high = wanted.minimum, wanted.maximum
    if (low is not None and number < low) or (high is not None and number > high):
        raise ValueError(f"expected {wanted} {_range(wanted, written)}, got {written!r}")


def _range(kind: Type, written: Any) -> str:
    """Return what numbers of a type are allowed, in the unit that a wrong one was written with."""
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


def _to_text(value: Any, wanted: Type) -> str:
    if not isinstance(value, str):
        raise _wrong(value, wanted)
    if wanted.values and value not in wanted.values:
        guess = meant(value, wanted.values)
        text = f"expected one of {', '.join(wanted.values)}, got {value!r}"
        raise ValueError(f"{text}; {guess}" if guess else text)
    if wanted.pattern and not re.fullmatch(wanted.pattern, value):
        raise _wrong(value, wanted, f", such as {wanted.example}" if wanted.example else "")
    return value


def _to_list(value: Any, wanted: Type) -> list[Any]:
    if not isinstance(value, (list, tuple)) or wanted.item is None:
        raise _wrong(value, wanted)
    return [convert(element, wanted.item) for element in value]


def _to_record(value: Any, wanted: Type) -> dict[str, Any]:
    if not isinstance(value, Mapping) or set(value) != set(wanted.fields):
        fields = ", ".join(wanted.fields)
        raise ValueError(f"expected {wanted} with the fields {fields}, got {value!r}")
    return {name: convert(value[name], kind) for name, kind in wanted.fields.items()}


def _to_any(value: Any, _: Type) -> Any:
    return value


_CONVERTERS = {
    "bool": _to_bool,
    "integer": _to_integer,
    "number": _to_number,
    "text": _to_text,
    "list": _to_list,
    "record": _to_record,
    "any": _to_any,
}
