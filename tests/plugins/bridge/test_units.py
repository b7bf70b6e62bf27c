"""What a value becomes in the unit of its sensor, and which values cannot be."""

from __future__ import annotations

import math

import pytest

from lupin_bridge.units import QUANTITIES, UNKNOWN_LIMIT, checked, unit_of

#: Two values in each unit and what they are in that of the sensor: a line has two points.
CONVERTED = {
    ("temperature", "c"): ((-40.0, -40.0), (21.5, 21.5)),
    ("temperature", "degc"): ((-40.0, -40.0), (21.5, 21.5)),
    ("temperature", "celsius"): ((-40.0, -40.0), (21.5, 21.5)),
    ("temperature", "k"): ((273.15, 0.0), (373.15, 100.0)),
    ("temperature", "°f"): ((32.0, 0.0), (212.0, 100.0)),
    ("temperature", "f"): ((32.0, 0.0), (212.0, 100.0)),
    ("humidity", "%rh"): ((0.0, 0.0), (55.0, 55.0)),
    ("humidity", "1"): ((0.0, 0.0), (0.55, 55.0)),
    ("co2", "%"): ((0.0, 0.0), (0.04, 400.0)),
    ("light", "lux"): ((0.0, 0.0), (900.0, 900.0)),
    ("light", "klx"): ((0.0, 0.0), (0.9, 900.0)),
    ("soil_moisture", "%"): ((0.0, 0.0), (45.0, 0.45)),
    ("soil_moisture", "m³/m³"): ((0.0, 0.0), (0.45, 0.45)),
}

LIMITS = {
    "temperature": (-60.0, 100.0, "°C"),
    "humidity": (0.0, 110.0, "%"),
    "co2": (0.0, 100_000.0, "ppm"),
    "light": (0.0, 300_000.0, "lx"),
    "soil_moisture": (0.0, 1.0, "1"),
}


def test_every_unit_is_converted() -> None:
    assert set(CONVERTED) == {(sensor, unit) for sensor, one in QUANTITIES.items() for unit in one.others}
    for (sensor, unit), points in CONVERTED.items():
        for written, expected in points:
            assert checked(sensor, written, unit) == pytest.approx(expected), (sensor, unit)
            assert checked(sensor, written, f" {unit.upper()} ") == pytest.approx(expected), (sensor, unit)


@pytest.mark.parametrize("sensor", LIMITS)
def test_a_value_at_its_limit_is_one_and_beyond_it_the_sensor_is_broken(sensor: str) -> None:
    low, high, unit = LIMITS[sensor]
    assert unit_of(sensor) == unit
    assert [checked(sensor, value) for value in (low, high)] == [low, high]
    assert checked(sensor, high, unit) == high
    for beyond in (low - 1.0, high + 1.0):
        with pytest.raises(ValueError, match="is outside of") as refused:
            checked(sensor, beyond)
        of = "" if unit == "1" else f" {unit}"
        assert str(refused.value) == f"{beyond:g}{of} is outside of {low:g} ... {high:g}{of}"


def test_limits_hold_for_what_was_converted() -> None:
    with pytest.raises(ValueError, match=r"^115 % is outside of 0 \.\.\. 110 %$"):
        checked("humidity", 1.15, "1")
    with pytest.raises(ValueError, match=r"^-273\.15 °C is outside of -60 \.\.\. 100 °C$"):
        checked("temperature", 0.0, "K")


def test_a_sensor_that_nobody_knows_has_any_unit_and_nearly_any_value() -> None:
    assert unit_of("wind") == ""
    assert checked("wind", -3.0, "furlong") == -3.0
    with pytest.raises(ValueError, match=r"^1e\+09 is too large$"):
        checked("wind", UNKNOWN_LIMIT)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("sensor", ["co2", "wind"])
def test_what_is_not_finite_is_no_measurement(sensor: str, value: float) -> None:
    with pytest.raises(ValueError, match=f"^{value} is no measurement$"):
        checked(sensor, value)
