"""Parses points in time as recordings and sensors write them."""

from __future__ import annotations

from datetime import datetime

from lupin_bridge.backend import SECONDS_PER_DAY
from lupin_engine.errors import shortened

#: Seconds since 1970 are smaller than this until the year 5138; a larger number is milliseconds.
_MILLISECONDS_FROM = 1e11
_LATEST = 1e14


def number(written: str | float) -> float:
    """Parse a number; NaN and infinity are accepted, too.

    Raises:
        ValueError: it is none; underscores, which Python allows, are refused.
    """
    if isinstance(written, str) and "_" in written:
        raise ValueError(written)
    return float(written)


def seconds_since_1970(written: str | float) -> float:
    """Parse seconds or milliseconds since 1970, or ISO 8601, which without a zone is local time.

    Raises:
        ValueError: it is neither, negative, or larger than 1e14.
    """
    try:
        seconds = number(written)
    except ValueError:
        return _from_iso(str(written).strip())
    if not 0.0 <= seconds < _LATEST:
        raise ValueError(f"{seconds:g} is no time: expected seconds since 1970")
    return seconds / 1000.0 if seconds >= _MILLISECONDS_FROM else seconds


def _from_iso(text: str) -> float:
    try:
        # Python 3.10 does not know Z.
        return datetime.fromisoformat(text[:-1] + "+00:00" if text.endswith("Z") else text).timestamp()
    except (ValueError, OverflowError, OSError):
        raise ValueError(
            f"{shortened(text)!r} is no time: expected seconds since 1970, or such as 2026-05-01T14:30:00"
        ) from None


def time_of_day(stamp: float) -> float:
    """Return the local time of day in [0, 86400) seconds."""
    local = datetime.fromtimestamp(stamp)
    midnight = local.replace(hour=0, minute=0, second=0, microsecond=0)
    return (local - midnight).total_seconds() % SECONDS_PER_DAY
