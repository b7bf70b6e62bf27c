"""Numbers and names as people read them."""

from __future__ import annotations

import pytest

from lupin_twin.text import QUANTITIES, number, printable, with_unit


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        (0.0, "0"),
        (0.21, "0.21"),
        (21.456, "21.46"),
        (-0.00012345, "-0.0001234"),
        (999.4, "999.4"),
        (999.96, "1000"),
        (1000.0, "1000"),
        (-1000.4, "-1000"),
        (1_234_567.0, "1234567"),
        (9_999_999.0, "9999999"),
        (10_000_000.0, "1e+07"),
        (-12_345_678.0, "-1.235e+07"),
        (1e30, "1e+30"),
        (float("nan"), "nan"),
        (float("inf"), "inf"),
    ],
)
def test_a_number_has_four_digits_or_all_before_the_point(value: float, shown: str) -> None:
    assert number(value) == shown


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("", ""),
        ("tulip \u00e4 \u8336", "tulip \u00e4 \u8336"),
        ("a\nb", "a\ufffdb"),
        ("\x1b[2Jx\t", "\ufffd[2Jx\ufffd"),
        ("left\u202eright\u200b", "left\ufffdright\ufffd"),
    ],
)
def test_what_orders_a_terminal_about_is_not_shown(text: str, shown: str) -> None:
    assert printable(text) == shown


def test_a_sensor_is_called_by_its_name_and_unit() -> None:
    assert [with_unit(sensor) for sensor in (*QUANTITIES, "leaf_wetness")] == [
        "temperature [°C]",
        "humidity [%]",
        "co2 [ppm]",
        "light [lx]",
        "soil moisture",
        "leaf wetness",
    ]
