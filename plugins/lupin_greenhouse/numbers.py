"""Validates numbers of JSON and YAML: NaN, infinity and booleans are refused."""

from __future__ import annotations

import math
from typing import Any


def finite(value: Any) -> float | None:
    """Return a number as a float; None for anything that is no finite number in a float's range."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return None
    try:
        number = float(value)
    except OverflowError:  # whole numbers of Python are without bounds
        return None
    return number if math.isfinite(number) else None
