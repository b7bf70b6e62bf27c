"""The sensors' vocabulary: names, units, and the type of a measured value."""

from __future__ import annotations

from collections.abc import Mapping

from lupin_engine.plugin import NUMBER, TEXT, Type, number_in

#: The sensors, each with its unit on the wire; soil moisture from 0 to 1.
SENSOR_UNITS: Mapping[str, str] = {
    "temperature": "°C",
    "humidity": "%",
    "co2": "ppm",
    "light": "lx",
    "soil_moisture": "",
}
#: The same as types, for missions that read a value by its name.
MEASURED: Mapping[str, Type] = {name: number_in(unit) for name, unit in SENSOR_UNITS.items()}
#: One measured value; its unit belongs to the name.
SENSOR = Type("record", "sensor", fields={"name": TEXT, "value": NUMBER})
