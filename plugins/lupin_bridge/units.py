"""Units: each sensor's unit, conversions to it, and the range of possible values."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

from lupin_engine.errors import Problems, meant, nearest, shortened

#: A sensor that is not known here has no unit; its values must be smaller than this.
UNKNOWN_LIMIT = 1e9


@dataclass(frozen=True)
class UnitRange:
    """A unit, the range of possible values, and other units as (factor, offset): value · factor + offset."""

    unit: str
    minimum: float
    maximum: float
    others: Mapping[str, tuple[float, float]]


#: Physically possible ranges, not what is good for plants: a sensor with values outside is broken.
QUANTITIES: Mapping[str, UnitRange] = MappingProxyType(
    {
        "temperature": UnitRange(
            "°C",
            -60.0,
            100.0,
            {
                "c": (1.0, 0.0),
                "degc": (1.0, 0.0),
                "celsius": (1.0, 0.0),
                "k": (1.0, -273.15),
                "°f": (5.0 / 9.0, -160.0 / 9.0),
                "f": (5.0 / 9.0, -160.0 / 9.0),
            },
        ),
        # Sensors that are wet show a little more than 100 %.
        "humidity": UnitRange("%", 0.0, 110.0, {"%rh": (1.0, 0.0), "1": (100.0, 0.0)}),
        "co2": UnitRange("ppm", 0.0, 100_000.0, {"%": (10_000.0, 0.0)}),
        "light": UnitRange("lx", 0.0, 300_000.0, {"lux": (1.0, 0.0), "klx": (1000.0, 0.0)}),
        "soil_moisture": UnitRange("1", 0.0, 1.0, {"%": (0.01, 0.0), "m³/m³": (1.0, 0.0)}),
    }
)


def unit_of(sensor: str) -> str:
    """Return the unit in which the bridge serves a sensor; '' for an unknown sensor."""
    return QUANTITIES[sensor].unit if sensor in QUANTITIES else ""


def checked(sensor: str, value: float, unit: str = "") -> float:
    """Return a value converted to its sensor's unit; `unit` '' means it is in that one.

    The value of a sensor without a known quantity is returned as it is, up to `UNKNOWN_LIMIT`.
    Raises:
        ValueError: it is not finite, the unit does not fit the sensor, or the value is impossible.
    """
    if not math.isfinite(value):
        raise ValueError(f"{value} is no measurement")
    quantity = QUANTITIES.get(sensor)
    if quantity is None:
        if abs(value) >= UNKNOWN_LIMIT:
            raise ValueError(f"{value:g} is too large")
        return value
    factor, offset = _conversion(sensor, quantity, unit)
    converted = value * factor + offset
    if not quantity.minimum <= converted <= quantity.maximum:
        of = "" if quantity.unit == "1" else f" {quantity.unit}"
        limits = f"{quantity.minimum:g} ... {quantity.maximum:g}{of}"
        raise ValueError(f"{converted:g}{of} is outside of {limits}")
    return converted


def units_that_fit(sensor: str, value: float) -> list[str]:
    """Return the other units in which a value of a sensor would be possible."""
    quantity = QUANTITIES.get(sensor)
    if quantity is None:
        return []
    found = {unit: value * factor + offset for unit, (factor, offset) in quantity.others.items()}
    return [unit for unit, converted in found.items() if quantity.minimum <= converted <= quantity.maximum]


def given_units(written: Iterable[str]) -> Mapping[str, str]:
    """Return the unit of each sensor of a setting: `SENSOR=UNIT`, such as `soil_moisture=%`.

    Raises:
        LupinError: all unknown sensors, and units that do not fit.
    """
    problems, found = Problems(), dict[str, str]()
    for text in written:
        sensor, _, unit = text.partition("=")
        if sensor not in QUANTITIES or not unit:
            like = "" if sensor in QUANTITIES else meant(sensor, QUANTITIES)
            hint = like or f"sensors are {', '.join(QUANTITIES)}"
            problems.add(f"mqtt_units {shortened(text)!r}: expected SENSOR=UNIT; {hint}")
            continue
        try:
            _conversion(sensor, QUANTITIES[sensor], unit)
        except ValueError as problem:
            problems.add(f"mqtt_units {shortened(text)!r}: {problem}")
        found[sensor] = unit
    problems.raise_any()
    return found


def _conversion(sensor: str, quantity: UnitRange, unit: str) -> tuple[float, float]:
    written = unit.strip().lower()
    if written in ("", quantity.unit.lower()):
        return 1.0, 0.0
    if written not in quantity.others:
        allowed = (quantity.unit, *quantity.others)
        raise ValueError(f"{shortened(unit)!r} is no unit of {sensor}; {nearest(shortened(unit), allowed)}")
    return quantity.others[written]
