"""Validates a client's JSON against a message type and writes it into a ROS message; reports all errors at
once.

The generated classes do not do: they check nothing under `python -O`, report one value at a time, and ignore
unknown fields.
"""

from __future__ import annotations

import base64
import binascii
import math
from collections.abc import Mapping
from typing import Any

from lupin_engine.errors import nearest
from lupin_gateway.shapes import BYTES, NUMBERS, TEXT, Listed, MessageShape

#: The largest value of a float32.
_LARGEST_FLOAT = 3.4028234663852886e38
#: The most problems of one message that are reported; in a long list every number may be wrong.
MOST_PROBLEMS = 10


class DoesNotFit(ValueError):
    """The data does not fit the type; the text names up to `MOST_PROBLEMS` fields by their paths."""


def filled(shape: MessageShape, data: Any) -> Any:
    """Return a new message with `data`: an object by field, or a list of the fields in their order.

    Other fields keep their defaults. Numbers without fraction fit integers; null is NaN in a float, and
    the default elsewhere; a list of bytes may be base64 or numbers.

    Raises:
        DoesNotFit: something does not fit its field, or there is no such field.
    """
    problems = _ProblemList()
    if isinstance(data, list):
        if len(data) > len(shape.fields):
            raise DoesNotFit(f"{len(data)} values for the {len(shape.fields)} fields of {shape.name}")
        data = dict(zip(shape.fields, data, strict=False))
    message = _structure(shape, data, "", problems)
    if problems.texts:
        raise DoesNotFit("; ".join(problems.texts))
    return message


class _ProblemList:
    """Collects up to `MOST_PROBLEMS` errors."""

    def __init__(self) -> None:
        self.texts: list[str] = []

    @property
    def enough(self) -> bool:
        return len(self.texts) >= MOST_PROBLEMS

    def add(self, where: str, text: str) -> None:
        if not self.enough:
            self.texts.append(f"{where}: {text}" if where else text)


def _structure(shape: MessageShape, data: Any, where: str, problems: _ProblemList) -> Any:
    message = shape.make()
    if data is None:
        return message
    if not isinstance(data, Mapping):
        problems.add(where, f"a {shape.name} is an object of fields, not {_described(data)}")
        return message
    for name, value in data.items():
        inside = f"{where}.{name}" if where else name
        if name not in shape.fields:
            problems.add(inside, f"{shape.name} has no such field; {nearest(name, shape.fields)}")
        elif value is not None or shape.fields[name] in ("float", "double"):
            before = len(problems.texts)
            fitting = _value(shape.fields[name], value, inside, problems)
            if len(problems.texts) == before:
                setattr(message, name, fitting)
    return message


def _value(kind: str | Listed | MessageShape, value: Any, where: str, problems: _ProblemList) -> Any:
    if isinstance(kind, MessageShape):
        return _structure(kind, value, where, problems)
    if isinstance(kind, Listed):
        return _list(kind, value, where, problems)
    try:
        return _scalar(kind, value)
    except ValueError as problem:
        problems.add(where, str(problem))
        return None


def _scalar(kind: str, value: Any) -> Any:
    if kind == TEXT:
        if not isinstance(value, str) or "\0" in value:
            raise ValueError(f"expected a text, got {_described(value)}")
        return value
    if kind == "boolean":
        if not isinstance(value, bool):
            raise ValueError(f"expected true or false, got {_described(value)}")
        return value
    if kind in ("float", "double"):
        return _float(kind, value)
    number = _integer(kind, value)
    return bytes([number]) if kind == "octet" else number


def _float(kind: str, value: Any) -> float:
    if value is None:
        return math.nan
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise ValueError(f"expected a number, got {_described(value)}")
    if kind == "float" and _LARGEST_FLOAT < abs(value) < math.inf:
        raise ValueError(f"{value} is too large for a float32")
    return float(value)


def _integer(kind: str, value: Any) -> int:
    is_whole = value.is_integer() if isinstance(value, float) else isinstance(value, int)
    if isinstance(value, bool) or not is_whole:
        raise ValueError(f"expected a whole number, got {_described(value)}")
    code = NUMBERS[kind][1]
    bits = 8 * int(code[-1])
    low, high = (0, 2**bits - 1) if "u" in code else (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)
    if not low <= value <= high:
        raise ValueError(f"{value} is not from {low} to {high}")
    return int(value)


def _list(kind: Listed, value: Any, where: str, problems: _ProblemList) -> Any:
    if isinstance(value, str) and kind.of in BYTES:
        value = _from_base64(value, where, problems)
    if not isinstance(value, list):
        if value is not None:
            problems.add(where, f"expected a list, got {_described(value)}")
        return None
    if wrong := _wrong_length(kind, len(value)):
        problems.add(where, wrong)
        return None
    if isinstance(kind.of, str) and _are_plain_numbers(kind.of, value):
        return value if kind.of not in ("float", "double") else list(map(float, value))
    elements = []
    for index, each in enumerate(value):
        if problems.enough:
            break
        elements.append(_value(kind.of, each, f"{where}[{index}]", problems))
    return elements


def _wrong_length(kind: Listed, length: int) -> str:
    """Return what is wrong with the length of a list; '' where it fits."""
    if kind.length is not None and length != kind.length:
        return f"expected {kind.length} elements, got {length}"
    if kind.most is not None and length > kind.most:
        return f"expected at most {kind.most} elements, got {length}"
    return ""


def _are_plain_numbers(kind: str, value: list[Any]) -> bool:
    """Return whether all elements fit, judged by their types, minimum and maximum only: lists may be long."""
    wanted = {int, float} if kind in ("float", "double") else {int}
    if (
        kind not in NUMBERS
        or kind in ("boolean", "octet")
        or not value
        or not wanted >= set(map(type, value))
    ):
        return False
    try:
        return all(_scalar(kind, each) is not None for each in (min(value), max(value)))
    except ValueError:
        return False


def _from_base64(text: str, where: str, problems: _ProblemList) -> list[int] | None:
    try:
        return list(base64.b64decode(text, validate=True))
    except (binascii.Error, ValueError):
        problems.add(where, "a list of bytes is base64, or a list of numbers from 0 to 255")
        return None


def _described(value: Any) -> str:
    """Return a value for an error message, shortened to one line."""
    if value is None:
        return "null"
    if isinstance(value, (Mapping, list)):
        return "an object" if isinstance(value, Mapping) else "a list"
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
