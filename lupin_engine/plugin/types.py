"""Types of the mission language, and the conversion of plain data to them.

Values are plain data: `bool`, `int`, `float`, `str`, `list`, and `dict` for records. A number may carry a
unit; inside the engine it is always in the SI base of its dimension (seconds, metres, radians), so `2 min`
in a file is `120.0` in a value. Angles are radians, frames are `map` unless a field says otherwise.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from types import MappingProxyType
from typing import Any

from lupin_engine.errors import nearest

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
        "%": ("", 1e-2),
    }
)

#: How many lists may be in each other.
MAX_LISTS = 8

_QUANTITY = re.compile(r"^([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*([A-Za-z/%]+)$")


@dataclass(frozen=True)
class Type:
    """A type of the language: a scalar kind, a list of `item`, or a record with `fields`.

    `kind` is one of bool, integer, number, text, list, record, any. `name` is what messages and files call
    it (`duration` is the number with unit s). `unit` is the base unit of a number. `values` are all that a
    text can be, where that is known: a comparison with another one is a slip of the pen.
    """

    kind: str
    name: str
    unit: str = ""
    item: Type | None = None
    fields: Mapping[str, Type] = field(default_factory=dict, hash=False)
    minimum: float | None = None
    maximum: float | None = None
    values: tuple[str, ...] = ()

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

#: A place on the floor of the greenhouse: metres and radians in frame `map`.
POSE = Type("record", "pose", fields={"x": LENGTH, "y": LENGTH, "yaw": ANGLE})

BUILTIN_TYPES: Mapping[str, Type] = MappingProxyType(
    {t.name: t for t in (BOOL, TEXT, NUMBER, INTEGER, COUNT, DURATION, LENGTH, ANGLE, POSE, ANY)}
)


def list_of(item: Type) -> Type:
    """Return the type of a list whose elements are all `item`."""
    return Type("list", f"list of {item.name}", item=item)


def number_in(unit: str) -> Type:
    """Return the number type with base unit `unit` ('' for a plain number)."""
    known = {"": NUMBER, "s": DURATION, "m": LENGTH, "rad": ANGLE}
    return known.get(unit) or Type("number", f"number in {unit}", unit=unit)


def units_of(base: str) -> list[str]:
    """Return the units in which a number of a base unit may be written."""
    return [unit for unit, (of, _) in UNITS.items() if of == base]


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


def _wrong(value: Any, wanted: Type, hint: str = "") -> ValueError:
    return ValueError(f"expected {wanted}, got {value!r}{hint}")


def _to_bool(value: Any, wanted: Type) -> bool:
    if not isinstance(value, bool):
        raise _wrong(value, wanted, "; write true or false" if isinstance(value, str) else "")
    return value


def _to_integer(value: Any, wanted: Type) -> int:
    if isinstance(value, bool) or not isinstance(value, int):
        raise _wrong(value, wanted)
    _check_range(value, wanted)
    return value


def _to_number(value: Any, wanted: Type) -> float:
    if isinstance(value, str):
        quantity = parse_quantity(value)
        if quantity is None or quantity[1] != wanted.unit:
            units = ", ".join(map(repr, units_of(wanted.unit)))
            raise _wrong(value, wanted, f"; its units are {units}" if wanted.unit and units else "")
        value = quantity[0]
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not _is_finite(value):
        raise _wrong(value, wanted)
    _check_range(value, wanted)
    return float(value)


def _is_finite(value: float) -> bool:
    try:
        return math.isfinite(value)
    except OverflowError:  # an integer that no float can hold
        return False


def _check_range(value: float, wanted: Type) -> None:
    if wanted.minimum is not None and value < wanted.minimum:
        raise ValueError(f"expected {wanted} of at least {wanted.minimum:g}, got {value!r}")
    if wanted.maximum is not None and value > wanted.maximum:
        raise ValueError(f"expected {wanted} of at most {wanted.maximum:g}, got {value!r}")


def _to_text(value: Any, wanted: Type) -> str:
    if not isinstance(value, str):
        raise _wrong(value, wanted)
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
