"""Decodes serialized messages (little-endian CDR, as DDS sends them) to plain data.

For each message type the source of one decoder is generated and compiled once: neighbouring numbers become
one `struct`, nested structures included, and lists of numbers are numpy views of the bytes. Building rclpy's
objects, and reading those, takes several times as long (docs/decisions/ros.md).
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np

from lupin_gateway.shapes import BYTES, NUMBERS, TEXT, Listed, MessageShape, NotCarried

#: Bytes before the message: representation (little-endian CDR) and options.
_HEAD = 4
_LITTLE_ENDIAN = b"\x00\x01"

Reader = Callable[[bytes, int], tuple[Any, int]]


def decoder(shape: MessageShape) -> Callable[[bytes], dict[str, Any]]:
    """Return the decoder of a type: it gives dictionaries, lists, scalars, bytes and numpy arrays.

    The arrays are views of the given bytes. It raises `NotCarried` for bytes that are no such message.
    """
    read = _reader(shape)

    def decode(serialized: bytes) -> dict[str, Any]:
        if serialized[:2] != _LITTLE_ENDIAN:
            raise NotCarried(f"a {shape.name} came in a representation other than little-endian CDR")
        try:
            found: dict[str, Any] = read(serialized[_HEAD:], 0)[0]
        except (struct.error, ValueError, IndexError) as problem:
            raise NotCarried(f"what came is no {shape.name}: {problem}") from None
        return found

    return decode


@lru_cache(maxsize=1024)
def _reader(shape: MessageShape) -> Reader:
    return _DecoderSource().function(shape)


def _aligned(codes: str) -> tuple[list[Callable[..., tuple[Any, ...]]], list[int]]:
    """Return readers of consecutive numbers and their padded sizes, by the first one's offset modulo 8."""
    readers: list[Callable[..., tuple[Any, ...]]] = []
    sizes: list[int] = []
    for start in range(8):
        layout, place = "<", start
        for code in codes:
            width = struct.calcsize("<" + code)
            gap = -place % width
            layout += f"{gap}x" * bool(gap) + code
            place += gap + width
        readers.append(struct.Struct(layout).unpack_from)
        sizes.append(place - start)
    return readers, sizes


def _text(data: bytes, at: int) -> tuple[str, int]:
    """Read a text at an offset: its length with the closing zero, then UTF-8; ValueError if it is cut off."""
    begin = (at + 3 & -4) + 4
    end = begin + int.from_bytes(data[begin - 4 : begin], "little")
    if end > len(data):
        raise ValueError("it ends in the middle of a text")
    return data[begin : end - 1].decode("utf-8", "replace"), end


def _numbers(data: bytes, at: int, kind: np.dtype[Any], count: int) -> tuple[Any, int]:
    """Return numbers in a row as a view of the bytes, with the offset behind them."""
    width = kind.itemsize
    begin = at + -at % width if count else at
    return np.frombuffer(data, kind, count, begin), begin + count * width


def _raw(data: bytes, at: int, count: int) -> tuple[bytes, int]:
    end = at + count
    if end > len(data):
        raise ValueError("it ends in the middle of a list of bytes")
    return data[at:end], end


def _texts(data: bytes, at: int, count: int) -> tuple[list[str], int]:
    found = []
    for _ in range(count):
        text, at = _text(data, at)
        found.append(text)
    return found, at


def _structures(data: bytes, at: int, count: int, read: Reader) -> tuple[list[Any], int]:
    found = []
    for _ in range(count):
        each, at = read(data, at)
        found.append(each)
    return found, at


class _DecoderSource:
    """Writes the source of one function, which reads one structure."""

    def __init__(self) -> None:
        self._lines: list[str] = []
        self._names: dict[str, Any] = {
            "text": _text, "numbers": _numbers, "raw": _raw, "texts": _texts, "structures": _structures,
        }  # fmt: skip
        self._run: list[tuple[str, str]] = []  # numbers that are read together: variable, code
        self._count = 0

    def function(self, shape: MessageShape) -> Reader:
        result = self._structure(shape)
        self._end_run()
        body = "\n    ".join([*self._lines, f"return {result}, at"])
        exec(f"def read(data, at):\n    {body}\n", self._names)
        read: Reader = self._names["read"]
        return read

    def _structure(self, shape: MessageShape) -> str:
        if not shape.fields:  # on the wire it has one byte all the same
            self._number("uint8")
            return "{}"
        return "{" + ", ".join(f"{name!r}: {self._field(kind)}" for name, kind in shape.fields.items()) + "}"

    def _field(self, kind: str | Listed | MessageShape) -> str:
        if isinstance(kind, MessageShape):
            return self._structure(kind)
        if isinstance(kind, Listed):
            return self._list(kind)
        return self._read("text(data, at)") if kind == TEXT else self._number(kind)

    def _number(self, kind: str) -> str:
        variable = self._variable()
        self._run.append((variable, NUMBERS[kind][0]))
        return variable

    def _list(self, kind: Listed) -> str:
        count = str(kind.length) if kind.length is not None else self._number("uint32")
        self._end_run()
        if isinstance(kind.of, MessageShape):
            return self._read(f"structures(data, at, {count}, {self._constant(_reader(kind.of))})")
        if kind.of == TEXT:
            return self._read(f"texts(data, at, {count})")
        if kind.of in BYTES:
            return self._read(f"raw(data, at, {count})")
        dtype = self._constant(np.dtype(NUMBERS[kind.of][1]))
        return self._read(f"numbers(data, at, {dtype}, {count})")

    def _read(self, expression: str) -> str:
        self._end_run()
        variable = self._variable()
        self._lines.append(f"{variable}, at = {expression}")
        return variable

    def _end_run(self) -> None:
        if not self._run:
            return
        readers, sizes = _aligned("".join(code for _, code in self._run))
        variables = "".join(f"{variable}, " for variable, _ in self._run)
        self._lines.append(f"{variables} = {self._constant(readers)}[at & 7](data, at)")
        self._lines.append(f"at += {self._constant(sizes)}[at & 7]")
        self._run = []

    def _variable(self) -> str:
        self._count += 1
        return f"v{self._count}"

    def _constant(self, value: Any) -> str:
        name = f"c{len(self._names)}"
        self._names[name] = value
        return name
