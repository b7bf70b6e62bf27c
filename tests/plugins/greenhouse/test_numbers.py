"""Numbers that somebody else wrote."""

from __future__ import annotations

import math
from typing import Any

import pytest

from lupin_greenhouse.numbers import finite


@pytest.mark.parametrize(("value", "number"), [(2, 2.0), (-0.5, -0.5), (0, 0.0)])
def test_a_number_is_a_float(value: float, number: float) -> None:
    found = finite(value)
    assert found == number
    assert isinstance(found, float)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 10**400, True, "1", None, [1.0]])
def test_what_is_no_finite_number_is_none(value: Any) -> None:
    assert finite(value) is None
