"""Describes the structure of message types as plain data: scalars, lists and structures. Knows no ROS."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

#: Scalars by the names that rclpy's classes have for them: the code of `struct`, the type of numpy.
NUMBERS: Mapping[str, tuple[str, str]] = {
    "boolean": ("?", "?"), "octet": ("B", "u1"), "char": ("B", "u1"),
    "int8": ("b", "i1"), "uint8": ("B", "u1"), "int16": ("h", "<i2"), "uint16": ("H", "<u2"),
    "int32": ("i", "<i4"), "uint32": ("I", "<u4"), "int64": ("q", "<i8"), "uint64": ("Q", "<u8"),
    "float": ("f", "<f4"), "double": ("d", "<f8"),
}  # fmt: skip
TEXT = "string"
#: Lists of these are bytes: base64 in JSON, a byte string in CBOR.
BYTES = frozenset({"uint8", "octet", "char"})

_LIST = re.compile(r"sequence<(?P<of>[^,]+?)(?:, *(?P<most>\d+))?>$")
_ARRAY = re.compile(r"(?P<of>.+)\[(?P<length>\d+)\]$")
_BOUND = re.compile(r"string<\d+>$")


class NotCarried(Exception):
    """A type or message that the gateway does not support; the text is for the user."""


@dataclass(frozen=True)
class Listed:
    """A list: of fixed `length`, or of at most `most` elements; None means any number."""

    of: str | MessageShape
    length: int | None = None
    most: int | None = None


@dataclass(frozen=True)
class MessageShape:
    """A message: its name such as `geometry_msgs/msg/Pose`, its fields in wire order, and how one is made."""

    name: str
    fields: Mapping[str, str | Listed | MessageShape] = field(hash=False)
    make: Callable[[], Any] = field(hash=False, compare=False)


def shape_of(kind: Any, find: Callable[[str], Any], name: str) -> MessageShape:
    """Return the shape of a generated class of ROS; `find` gives the class of `geometry_msgs/Pose`.

    Raises:
        NotCarried: it has a field of a type that cannot be carried.
    """
    return _ShapeReader(find).shape(kind, name)


class _ShapeReader:
    """Builds shapes, one for each class."""

    def __init__(self, find: Callable[[str], Any]) -> None:
        self._find = find
        self._known: dict[str, MessageShape] = {}

    def shape(self, kind: Any, name: str) -> MessageShape:
        declared = kind.get_fields_and_field_types()
        fields = {each: self._field(text, f"{name}.{each}") for each, text in declared.items()}
        return MessageShape(name, fields, kind)

    def _field(self, text: str, where: str) -> str | Listed | MessageShape:
        if found := _LIST.match(text):
            most = found["most"]
            return Listed(self._element(found["of"], where), None, int(most) if most else None)
        if found := _ARRAY.match(text):
            return Listed(self._element(found["of"], where), int(found["length"]))
        return self._element(text, where)

    def _element(self, text: str, where: str) -> str | MessageShape:
        if text in NUMBERS or text == TEXT:
            return text
        if _BOUND.match(text):
            return TEXT
        if "/" not in text:
            raise NotCarried(f"{where} is of type {text}, which the gateway cannot carry")
        if text not in self._known:
            self._known[text] = self.shape(self._find(text), text.replace("/", "/msg/"))
        return self._known[text]
