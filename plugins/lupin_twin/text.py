"""Formats numbers, names and units for people."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType


@dataclass(frozen=True)
class MeasuredQuantity:
    """A sensor's quantity for people, its unit's symbol, and its UN/CEFACT code (recommendation 20)."""

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


def number(value: float) -> str:
    """Return a number with four digits, or more where that many are before the point."""
    return f"{value:.0f}" if 1e3 <= abs(value) < 1e7 else f"{value:.4g}"


def printable(text: str) -> str:
    """Return text from the network with control characters replaced."""
    return "".join(letter if letter.isprintable() else "\N{REPLACEMENT CHARACTER}" for letter in text)
