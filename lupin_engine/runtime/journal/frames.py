"""Frames: records one after the other in a file, each with its length and a checksum.

A frame is the length of its content and the CRC-32 of that, both 4 bytes, little-endian, and the content. A
file begins with `MAGIC`. Bytes after the last whole frame are a torn tail: a write that a crash broke off. A
broken frame that others follow is damage: the frames behind it are out of sequence, and read apart.
"""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass

#: What every file begins with; the number is raised when the form changes, to one that differs in more than
#: one bit (not 0, 3 or 6): a single flipped bit is damage, and no other version.
MAGIC = b"lupin journal 2\n"
#: What it begins with whatever the number is.
FAMILY = b"lupin journal "
#: No content is longer, in bytes: a length beyond it is no length.
MAX_CONTENT = 64 * 1024 * 1024
_HEADER = struct.Struct("<II")
#: What the content of every record begins with.
_BEGIN = b'["'


@dataclass(frozen=True)
class FrameScan:
    """The result of reading: the contents of the good frames, each with its end, and of those behind damage.

    `good` is the number of usable bytes, `torn` that of the rest. `damaged`: the rest is not only a torn
    write, so durable records are lost; `behind` are the whole contents that follow the damage.
    """

    contents: list[bytes]
    ends: list[int]
    good: int
    torn: int
    damaged: bool = False
    behind: tuple[bytes, ...] = ()


def frame(content: bytes) -> bytes:
    """Return the frame of a content."""
    return _HEADER.pack(len(content), zlib.crc32(content)) + content


def read_frames(data: bytes) -> FrameScan:
    """Return the frames of a file; of one that is none, or is broken at once, there are no good ones."""
    contents: list[bytes] = []
    ends: list[int] = []
    if not data.startswith(MAGIC):
        behind = _behind(data, len(MAGIC) - 1) if _is_one_bit_off(data[: len(MAGIC)]) else ()
        is_begun = MAGIC.startswith(data)  # the first write was broken off
        return FrameScan(contents, ends, 0, len(data), damaged=not is_begun, behind=behind)
    at = len(MAGIC)
    while (found := _content(data, at)) is not None:
        at += _HEADER.size + len(found)
        contents.append(found)
        ends.append(at)
    behind = _behind(data, at)
    return FrameScan(contents, ends, at, len(data) - at, damaged=bool(behind), behind=behind)


def _is_one_bit_off(begin: bytes) -> bool:
    return (int.from_bytes(begin, "big") ^ int.from_bytes(MAGIC, "big")).bit_count() == 1


def _content(data: bytes, at: int) -> bytes | None:
    """Return the content of the frame at a place; None where there is no whole one."""
    if len(data) - at < _HEADER.size:
        return None
    length, checksum = _HEADER.unpack_from(data, at)
    begin = at + _HEADER.size
    if not 0 < length <= min(MAX_CONTENT, len(data) - begin):
        return None
    content = data[begin : begin + length]
    return content if zlib.crc32(content) == checksum else None


def _behind(data: bytes, at: int) -> tuple[bytes, ...]:
    """Return the contents of the whole frames after the broken one at a place; contents are JSON lists."""
    found: list[bytes] = []
    begin = data.find(_BEGIN, at + 1)
    while begin >= 0:
        content = _content(data, begin - _HEADER.size) if begin - _HEADER.size > at else None
        if content is not None:
            found.append(content)
            at = begin + len(content) - 1
        begin = data.find(_BEGIN, max(at, begin) + 1)
    return tuple(found)
