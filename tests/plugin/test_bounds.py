"""The one bound of whole numbers, and that of durations: the same at every door, with the same words."""

from __future__ import annotations

import math
from typing import Any

import pytest

from lupin_engine.machine.timers import seconds
from lupin_engine.plugin.contract import Parameter
from lupin_engine.plugin.parameters import named
from lupin_engine.plugin.types import (
    COUNT,
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
