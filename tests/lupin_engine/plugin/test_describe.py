"""What a plugin offers, in words: numbers as people write them."""

from __future__ import annotations

import math

import pytest

from lupin_engine.plugin.contract import LiveValue, Operation, Plugin
from lupin_engine.plugin.describe import number_text, sections, type_text, value_text
from lupin_engine.plugin.types import ANGLE, DURATION, NUMBER, POSE, Type, in_base, in_unit, list_of, within


@pytest.mark.parametrize(
    ("value", "unit", "shown"),
    [
        (math.pi / 2, "rad", ("90", "deg")),
        (0.5, "rad", ("0.5", "rad")),
        (1.23456789, "rad", ("1.23457", "rad")),
        (1234567.0, "m", ("1.23457e+06", "m")),
        (0.02, "m", ("0.02", "m")),
        (1e6, "s", ("1e+06", "s")),
        (1 / 3, "", ("0.333333", "")),
        (0.0, "kg", ("0", "kg")),
    ],
)
def test_a_number_is_shown_in_the_unit_that_says_it(value: float, unit: str, shown: tuple[str, str]) -> None:
    """In its base, unless only another one takes few digits; what no unit says shortly is rounded."""
    assert number_text(value, unit) == shown


def test_a_range_is_told_as_it_was_written() -> None:
    """Its limits are kept in radians."""
    kind = within(ANGLE, in_base(-90, "deg"), in_base(90, "deg"))
    assert type_text(kind) == "angle in rad, at least -90 deg, at most 90 deg"
    assert type_text(within(DURATION, None, 60.0)) == "duration in s, at least 0, at most 60"


def test_a_value_is_told_by_its_type() -> None:
    """Also inside of records and lists."""
    place = {"x": 1.5, "y": 0.0, "yaw": in_base(60, "deg")}
    assert value_text([place], list_of(POSE)) == "[{x: 1.5, y: 0, yaw: 60 deg}]"
    assert value_text(in_base(60, "deg")) == "1.0472"
    assert value_text(True, Type("bool", "bool")) == "true"


def test_a_number_comes_back_from_its_base() -> None:
    """Lists too, whatever they are made of."""
    assert in_unit(in_base([[60, 57.5], []], "deg"), "deg") == [[60.0, 57.5], []]
    assert in_unit((0.035, 0.57), "%") == [3.5, 57.0]


def test_the_classes_that_missions_are_proven_with_are_told() -> None:
    """Of results with the names of their fields, in the units of people."""
    dim = Operation(
        "Dim it.", result={"level": NUMBER, "turn": ANGLE}, classes=({"level": 0.5}, {"turn": 1.5})
    )
    value = LiveValue("How it hangs.", ANGLE, classes=(0.0, in_base(90, "deg")))
    operations, values = sections(Plugin("lamp", "A lamp.", {"dim": dim}, values={"lamp.turn": value}))
    assert dict(operations.entries[0].facts)["proven with"] == "level: 0.5; turn: 1.5"
    assert dict(values.entries[0].facts)["proven with"] == "0, 90 deg"
