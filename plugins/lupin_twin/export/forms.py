"""Numbers, times and names in the form that all export formats share."""

from __future__ import annotations

import json
import math
from datetime import datetime, timedelta, timezone
from typing import Any
from urllib.parse import quote

_EPOCH = datetime(1970, 1, 1, tzinfo=timezone.utc)
_LAST_S = (datetime(9999, 12, 31, tzinfo=timezone.utc) - _EPOCH).total_seconds()


def utc(seconds: float) -> str:
    """Return a time as RFC 3339, in UTC with microseconds, clamped; NaN and infinity become 1970."""
    bounded = min(max(seconds, 0.0), _LAST_S) if math.isfinite(seconds) else 0.0
    return (_EPOCH + timedelta(seconds=bounded)).isoformat(timespec="microseconds").replace("+00:00", "Z")


def finite(value: float) -> float | None:
    """Return the value; None for values that JSON cannot represent."""
    return value if math.isfinite(value) else None


def urn(*parts: str) -> str:
    """Return a URN of parts with any characters, escaped."""
    return ":".join(["urn", *(quote(part, safe="-_.") for part in parts)])


def to_json(document: Any) -> bytes:
    """Return a document as strict JSON, indented."""
    return (json.dumps(document, ensure_ascii=False, indent=2, allow_nan=False) + "\n").encode()
