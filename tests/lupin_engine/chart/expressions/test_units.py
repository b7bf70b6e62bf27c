"""Units of computed numbers: what may be added and compared, and the unit of a product or a quotient."""

from __future__ import annotations

import pytest

from lupin_engine.chart.expressions.checker import compile_expression
from lupin_engine.chart.expressions.scope import Fragment, Scope
from lupin_engine.chart.expressions.units import arithmetic, number
from lupin_engine.chart.findings import Findings
from lupin_engine.chart.source import text_at
from lupin_engine.errors import Place
from lupin_engine.plugin.types import ANY, UNITS, Type, number_in, parse_quantity

PLACE = Place("m.yaml", 3, 5)
BASES = tuple(dict.fromkeys(base for base, _ in UNITS.values() if base))
NAMES = {
    "way": number_in("m"),
    "time": number_in("s"),
    "turned": number_in("rad"),
    "water": number_in("l"),
    "salt": number_in("kg"),
    "light": number_in("lx"),
    "gas": number_in("ppm"),
    "warm": number_in("°C"),
    "rate": number_in("Hz"),
    "tries": Type("integer", "count"),
}
VALUES = dict.fromkeys(NAMES, 2.0) | {"tries": 2}


def read(source: str) -> tuple[Type, object] | list[str]:
    """Return type and value of an expression, or what is wrong with it."""
    findings, text = Findings(), text_at(source, PLACE)
    found = compile_expression(Fragment(source, text), Scope(NAMES), ANY, findings, "here")
    if found is None:
        return [f"{told.problem} [{told.rule}]" for told in findings.all]
    return found.type, found.evaluate({"context": VALUES})


@pytest.mark.parametrize(
    ("source", "unit", "value"),
    [
        ("way / time", "m/s", 1.0),
        ("way / time * time", "m", 4.0 / 2.0),
        ("way / time / time", "m/s2", 0.5),
        ("turned / time + '90 deg/s' * 0", "rad/s", 1.0),
        ("way / '7.2 km/h'", "s", 1.0),
        ("water / time * '1 min'", "l", 60.0),
        ("water / '2 l/min'", "s", 60.0),
        ("salt / water", "kg/l", 1.0),
        ("salt / water * water", "kg", 2.0),
        ("way * way", "m2", 4.0),
        ("way * way / way", "m", 2.0),
        ("way * turned", "m*rad", 4.0),
        ("1 / time", "Hz", 0.5),
        ("1 / rate", "s", 0.5),
        ("rate * time", "", 4.0),
        ("rate / time", "1/s2", 1.0),
        ("water / water", "", 1.0),
        ("light + '500 lux'", "lx", 502.0),
        ("gas - '400 ppm'", "ppm", -398.0),
        ("warm - '1 degC'", "°C", 1.0),
        ("tries * water", "l", 4.0),
        ("water // '500 ml'", "", 4),
        ("water % '1.5 l'", "l", 0.5),
    ],
)
def test_a_product_or_quotient_has_the_unit_that_physics_gives_it(
    source: str, unit: str, value: float
) -> None:
    """So that a rate times a time is an amount, whatever is measured."""
    found = read(source)
    assert not isinstance(found, list), found
    assert (found[0].unit, found[1]) == (unit, pytest.approx(value))


@pytest.mark.parametrize(
    ("source", "problem"),
    [
        ("water + salt", "cannot compute number in l + number in kg [wrong-unit]"),
        ("water < salt", "cannot compare number in l with number in kg [wrong-unit]"),
        ("light == gas", "cannot compare number in lx with number in ppm [wrong-unit]"),
        ("water / time > '2 l'", "cannot compare number in l/s with number in l [wrong-unit]"),
        ("water > 2", "cannot compare number in l with a plain number [wrong-unit]"),
        ("min(water, salt)", "cannot compare number in l with number in kg [wrong-unit]"),
        ("water if tries > 1 else salt", "one outcome is number in l, the other number in kg [wrong-unit]"),
        ("way" + " * way" * 9, "cannot compute number in m9 * length (m) [wrong-unit]"),
    ],
)
def test_what_differs_in_dimension_is_neither_added_nor_compared(source: str, problem: str) -> None:
    """It would be a number, and mean nothing."""
    assert read(source) == [problem]


@pytest.mark.parametrize("first", BASES)
@pytest.mark.parametrize("second", BASES)
def test_what_is_multiplied_comes_back_by_division(first: str, second: str) -> None:
    """For each pair of units."""
    left, right = number(first), number(second)
    for sign, back in (("*", "/"), ("/", "*")):
        result = arithmetic(sign, left, right)
        assert result is not None
        assert arithmetic(back, result, right) == left


@pytest.mark.parametrize("unit", UNITS)
def test_a_unit_is_read_from_a_text(unit: str) -> None:
    """In its base, which is a unit itself."""
    base, factor = UNITS[unit]
    assert parse_quantity(f"3 {unit}") == (3 * factor, base)
    assert not base or UNITS[base] == (base, 1.0)
