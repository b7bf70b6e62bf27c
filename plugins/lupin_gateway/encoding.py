"""Encodes frames for clients: JSON, CBOR with typed arrays, and `cbor-raw` (the serialized message in CBOR).

orjson and cbor2 write numpy arrays directly, never number by number. In JSON, NaN and infinity are null and
a list of bytes is base64; in CBOR it is a byte string.
"""

from __future__ import annotations

import base64
from collections.abc import Callable, Mapping
from typing import Any, Literal

import cbor2
import numpy as np
import orjson

from lupin_gateway.shapes import NotCarried

#: What a subscriber may ask for; `png` is refused.
Compression = Literal["none", "cbor", "cbor-raw"]
#: A frame as it is sent: text is JSON, bytes are CBOR.
FrameData = str | bytes

#: Tags of typed arrays in CBOR (RFC 8746, little-endian); lists of bytes have none, as with rosbridge.
_TAGS = {"i1": 72, "u2": 69, "u4": 70, "u8": 71, "i2": 77, "i4": 78, "i8": 79, "f4": 85, "f8": 86}


def as_json(data: Any) -> bytes:
    """Return plain data, bytes and arrays as JSON; TypeError for anything else."""
    return orjson.dumps(data, _other_json, orjson.OPT_SERIALIZE_NUMPY | orjson.OPT_NON_STR_KEYS)


def _other_json(value: Any) -> Any:
    if isinstance(value, (bytes, bytearray, memoryview)):
        return base64.b64encode(value).decode("ascii")
    if isinstance(value, np.ndarray):  # of a kind that orjson does not know, or not in one piece
        return value.tolist()
    raise TypeError(f"no JSON for {type(value).__name__}")


def as_cbor(data: Any) -> bytes:
    """Return plain data, bytes and arrays as CBOR; TypeError for anything else."""
    return cbor2.dumps(data, default=_other_cbor)


def _other_cbor(encoder: cbor2.CBOREncoder, value: Any) -> None:
    if not isinstance(value, np.ndarray):
        raise TypeError(f"no CBOR for {type(value).__name__}")
    tag = _TAGS.get(value.dtype.str[1:])
    encoder.encode(value.tolist() if tag is None else cbor2.CBORTag(tag, value.tobytes()))


class Sample:
    """One message of a topic; decoded once, and encoded once for each compression, on demand."""

    def __init__(
        self,
        topic: str,
        serialized: bytes,
        stamp_ns: int,
        decode: Callable[[bytes], Mapping[str, Any]],
        at: float | None = None,
    ) -> None:
        """`stamp_ns` is when it was published, in ns of the publisher's wall clock.

        `at` is its time for pages whose clock is not the real one, in ms since 1970; None: not sent.
        """
        self._at = "" if at is None else f'"at":{at:.3f},'
        self.topic = topic
        self.serialized = serialized
        self.stamp_ns = stamp_ns
        self.decode = decode
        self._decoded: Mapping[str, Any] | None = None
        self._frames: dict[Compression, FrameData] = {}

    def same(self, other: Sample) -> bool:
        """Return whether both are the same message, delivered twice."""
        return self.stamp_ns == other.stamp_ns and self.serialized == other.serialized

    def frame(self, compression: Compression) -> FrameData:
        """Return the publish frame for a client; a status frame with the error where decoding fails."""
        found = self._frames.get(compression)
        if found is None:
            try:
                found = self._encoded(compression)
            except NotCarried as problem:
                found = status("error", f"{self.topic}: {problem}")
            self._frames[compression] = found
        return found

    def _encoded(self, compression: Compression) -> FrameData:
        if compression == "cbor-raw":
            seconds, rest = divmod(self.stamp_ns, 1_000_000_000)
            return self._cbor({"secs": seconds, "nsecs": rest, "bytes": self.serialized})
        if self._decoded is None:
            self._decoded = self.decode(self.serialized)
        if compression == "cbor":
            return self._cbor(self._decoded)
        topic = as_json(self.topic).decode()
        return f'{{"op":"publish","topic":{topic},{self._at}"msg":{as_json(self._decoded).decode()}}}'

    def _cbor(self, message: Any) -> bytes:
        return as_cbor({"op": "publish", "topic": self.topic, "msg": message})


def reply(operation: str, **fields: Any) -> str:
    """Return a frame that answers a client; fields that are None are left out."""
    given = {name: value for name, value in fields.items() if value is not None}
    return as_json({"op": operation, **given}).decode()


def status(level: str, text: str, about: str | None = None) -> str:
    """Return a status frame: `level` is error, warning or info, `about` the id of the frame it answers."""
    return reply("status", level=level, msg=text, id=about)
