"""Points in time as recordings and sensors write them, and the time of the day."""

from __future__ import annotations

from datetime import datetime

from lupin_bridge.backend import SECONDS_PER_DAY

#: Seconds since 1970 are smaller than this until the year 5138; a larger number is milliseconds.
_MILLISECONDS_FROM = 1e11
_LATEST = 1e14


def seconds_since_1970(written: str | float) -> float:
    """Read seconds or milliseconds since 1970, or ISO 8601, which without a zone is local time.

    Raises:
        ValueError: it is neither.
    """
    try:
        number = float(written)
    except ValueError:
        return _from_iso(str(written).strip())
    if not 0.0 <= number < _LATEST:
        raise ValueError(f"{number:g} is no time: expected seconds since 1970")
    return number / 1000.0 if number >= _MILLISECONDS_FROM else number


def _from_iso(text: str) -> float:
    try:
        # Python 3.10 does not know Z.
        return datetime.fromisoformat(text[:-1] + "+00:00" if text.endswith("Z") else text).timestamp()
    except (ValueError, OverflowError, OSError):
        raise ValueError(
            f"{text[:40]!r} is no time: expected seconds since 1970, or such as 2026-05-01T14:30:00"
        ) from None


def time_of_day(stamp: float) -> float:
    """Return the local time of day in [0, 86400) seconds."""
    local = datetime.fromtimestamp(stamp)
    midnight = local.replace(hour=0, minute=0, second=0, microsecond=0)
    return (local - midnight).total_seconds() % SECONDS_PER_DAY
