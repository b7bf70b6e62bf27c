"""The units of the interface's sensors, in the words of those who exchange data.

A reading on the wire is a name and a number; the unit belongs to the name.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType


@dataclass(frozen=True)
class MeasuredQuantity:
    """What a sensor measures: for people, the unit's symbol, and its UN/CEFACT code (recommendation 20)."""

    label: str
    symbol: str
    unece: str


QUANTITIES: Mapping[str, MeasuredQuantity] = MappingProxyType(
    {
        "temperature": MeasuredQuantity("air temperature", "°C", "CEL"),
        "humidity": MeasuredQuantity("relative air humidity", "%", "P1"),
        "co2": MeasuredQuantity("carbon dioxide in air", "ppm", "59"),
        "light": MeasuredQuantity("illuminance", "lx", "LUX"),
        "soil_moisture": MeasuredQuantity("water in soil, by volume", "1", "C62"),
    }
)


def with_unit(sensor: str) -> str:
    """Return a sensor's name for people, with its unit where it has one."""
    quantity = QUANTITIES.get(sensor)
    name = sensor.replace("_", " ")
    return name if quantity is None or quantity.symbol == "1" else f"{name} [{quantity.symbol}]"
