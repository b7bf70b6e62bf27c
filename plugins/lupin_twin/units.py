"""The units of the interface's sensors, in the words of those who exchange data.

A reading on the wire is a name and a number; the unit belongs to the name.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from urllib.parse import quote


@dataclass(frozen=True)
class Quantity:
    """What a sensor measures.

    symbol: the unit for people; name: the unit in full; ucum: its code by the Unified Code for Units of
    Measure; unece: its code by UN/CEFACT recommendation 20; definition: what is measured, as an address.
    """

    label: str
    symbol: str
    name: str
    ucum: str
    unece: str
    definition: str

    @property
    def unit_definition(self) -> str:
        """The unit as an address, of the OGC's register."""
        return f"http://www.opengis.net/def/uom/UCUM/0/{quote(self.ucum, safe='')}"


_KIND = "http://qudt.org/vocab/quantitykind/"

QUANTITIES: Mapping[str, Quantity] = MappingProxyType(
    {
        "temperature": Quantity(
            "air temperature", "°C", "degree Celsius", "Cel", "CEL", f"{_KIND}Temperature"
        ),
        "humidity": Quantity("relative air humidity", "%", "percent", "%", "P1", f"{_KIND}RelativeHumidity"),
        "co2": Quantity(
            "carbon dioxide in air", "ppm", "parts per million", "[ppm]", "59", f"{_KIND}MoleFraction"
        ),
        "light": Quantity("illuminance", "lx", "lux", "lx", "LUX", f"{_KIND}Illuminance"),
        "soil_moisture": Quantity(
            "water in soil, by volume", "1", "unity", "1", "C62", f"{_KIND}VolumeFraction"
        ),
    }
)


def with_unit(sensor: str) -> str:
    """Return a sensor's name for people, with its unit where it has one."""
    quantity = QUANTITIES.get(sensor)
    name = sensor.replace("_", " ")
    return name if quantity is None or quantity.symbol == "1" else f"{name} [{quantity.symbol}]"
