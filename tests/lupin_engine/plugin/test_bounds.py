"""The one bound of whole numbers, and that of durations: the same at every door, with the same words."""

from __future__ import annotations

import math
from calendar import monthrange
from typing import Any

import pytest

from lupin_engine.chart.expressions.evaluation import to_function
from lupin_engine.machine.timers import seconds
from lupin_engine.plugin.contract import Parameter
from lupin_engine.plugin.parameters import named
from lupin_engine.plugin.types import (
    COUNT,
    DATE,
    DURATION,
    INTEGER,
    MAX_INTEGER,
    MAX_SECONDS,
    Notation,
    Type,
    fitted,
    list_of,
    number_in,
    problems,
)

HIGH = f"of at most {MAX_INTEGER}, got {MAX_INTEGER + 1}"
LOW = f"of at least -{MAX_INTEGER}, got -{MAX_INTEGER + 1}"
LONG = "of at most 100 years (3155760000 s), got"


@pytest.mark.parametrize("notation", Notation)
@pytest.mark.parametrize(
    ("kind", "value", "told"),
    [
        (INTEGER, MAX_INTEGER + 1, f"expected integer {HIGH}"),
        (INTEGER, -MAX_INTEGER - 1, f"expected integer {LOW}"),
        (COUNT, MAX_INTEGER + 1, f"expected count {HIGH}"),
        (list_of(INTEGER), [1, MAX_INTEGER + 1], f"expected integer {HIGH}"),
        (INTEGER, MAX_INTEGER, ""),
        (INTEGER, -MAX_INTEGER, ""),
        (Type("number", "number"), 1e300, ""),
    ],
)
def test_whole_numbers(notation: Notation, kind: Type, value: Any, told: str) -> None:
    found = problems(value, kind, notation)
    assert [problem.text for problem in found] == ([told] if told else [])


@pytest.mark.parametrize(
    ("value", "notation", "told"),
    [
        ("1e11 s", Notation.FILE, f"expected duration {LONG} '1e11 s'"),
        ("101000 h", Notation.SETTING, ""),
        ("876601 h", Notation.SETTING, f"expected duration {LONG} '876601 h'"),
        (1e11, Notation.SETTING, f"expected duration {LONG} 100000000000.0"),
        (1e11, Notation.DATA, f"expected duration {LONG} 100000000000.0"),
        (math.inf, Notation.DATA, "expected duration, got inf"),
        (math.nan, Notation.DATA, "expected duration, got nan"),
        (MAX_SECONDS, Notation.DATA, ""),
    ],
)
def test_durations(value: Any, notation: Notation, told: str) -> None:
    found = problems(value, DURATION, notation)
    assert [problem.text for problem in found] == ([told] if told else [])


def test_parameters() -> None:
    """As on the command line, in files of ROS, and set while a node runs."""
    with pytest.raises(ValueError, match=r"^parameter 'wait': expected duration of at most 100 years"):
        named("wait", Parameter(number_in("s"), 1.0, "how long"), 1e11)


@pytest.mark.parametrize("value", [1e11, math.inf, math.nan, -math.inf])
def test_what_is_computed_for_a_timer(value: float) -> None:
    """It would be an error of every callback that follows, and not of the state that computes it."""
    with pytest.raises(ValueError, match=r"s is (too long|no time) to wait"):
        seconds(value)


@pytest.mark.parametrize(
    ("kind", "value"),
    [(INTEGER, 2**60), (DURATION, 1e11), (Type("number", "number"), math.inf), (INTEGER, -(2**60))],
)
def test_what_is_computed_for_a_variable(kind: Type, value: float) -> None:
    with pytest.raises(ValueError, match=rf"^a {kind}(, got| of at)"):
        fitted(value, kind)


def test_what_is_computed_for_a_variable_of_a_record_type() -> None:
    """Each field is as its type bounds it; what a record has besides is kept."""
    beds = Type("list", "set of integer", item=INTEGER, distinct=True, maximum=2)
    ward = Type(
        "record", "ward", fields={"door": Type("number", "length", unit="m", minimum=0.5), "beds": beds}
    )
    assert fitted({"door": 0.5, "beds": [1, 1], "more": 1}, ward) == {"door": 0.5, "beds": [1], "more": 1}
    for wrong in ({"door": 0.4, "beds": []}, {"door": 1.0, "beds": [1, 2, 3]}):
        with pytest.raises(ValueError, match=r"^a (length of at least 0\.5|set of integer of at most 2)"):
            fitted([wrong], list_of(ward))


@pytest.mark.parametrize("notation", Notation)
@pytest.mark.parametrize("year", [1, 1900, 2000, 2023, 2024, 2100, 9996, 9999])
def test_a_date_is_a_day_that_exists(year: int, notation: Notation) -> None:
    """Every day of the month is, and none behind it."""
    for month in range(14):
        last = monthrange(year, month)[1] if 1 <= month <= 12 else 0
        for day in range(33):
            found = problems(f"{year:04}-{month:02}-{day:02}", DATE, notation)
            assert bool(found) is not (1 <= day <= last), (year, month, day)
    assert problems("0000-01-01", DATE, notation)


@pytest.mark.parametrize(
    ("code", "told"),
    [
        ("_times(1e200, 1e200)", r"^1e\+200 and 1e\+200 make inf$"),
        ("_over(1e200, -1e-200)", r"^1e\+200 and -1e-200 make -inf$"),
        ("_times(2**52, 4)", r"^1.8e\+16 is too large$"),
        ("round(1e300)", r"^1e\+300 is too large$"),
    ],
)
def test_what_is_computed_on_the_way(code: str, told: str) -> None:
    """Also where it is only told or handed on, and kept nowhere."""
    with pytest.raises(OverflowError, match=told):
        to_function(code)({})


def test_what_a_sensor_tells_of_infinity() -> None:
    """A range finder that sees nothing does: to compute with it is no overflow."""
    assert to_function("_times(inf, 2.0)")({}) == math.inf
