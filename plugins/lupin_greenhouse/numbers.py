"""Numbers that somebody else wrote: JSON and YAML have some that nothing can be placed by."""

from __future__ import annotations

import math
from typing import Any


def finite(value: Any) -> float | None:
    """Return a number as a float; None for what is none, not finite, or larger than any float."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return None
    try:
        number = float(value)
    except OverflowError:  # whole numbers of Python are without bounds
        return None
    return number if math.isfinite(number) else None
