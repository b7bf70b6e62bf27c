"""Converts metres on the greenhouse's map to longitude and latitude; pure.

The map is the tangent plane of the WGS84 ellipsoid in its origin: right to 5 mm within 100 m, to decimetres
within 1 km.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from lupin_engine.errors import UsageError
from lupin_twin.records import is_near

#: The ellipsoid of WGS84: half its larger axis in metres, and the square of its eccentricity.
_AXIS_M = 6378137.0
_ECCENTRICITY_2 = 6.69437999014e-3

#: Latitudes beyond have no longitude to speak of.
_HIGHEST = 89.0

#: Digits behind the point of a degree: about a millimetre.
DIGITS = 8

#: How an origin is written.
FORM = "LATITUDE,LONGITUDE or LATITUDE,LONGITUDE,DIRECTION"


@dataclass(frozen=True)
class Georeference:
    """The origin of the map, and the direction of its x axis, in degrees (clockwise from north)."""

    latitude: float
    longitude: float
    direction: float = 90.0

    @classmethod
    def parse(cls, text: str) -> Georeference:
        """Parse an origin as written by a person.

        Raises:
            UsageError: it is invalid; the text says what is allowed.
        """
        try:
            numbers = [float(part) for part in text.split(",")]
        except ValueError:
            numbers = []
        if len(numbers) not in (2, 3) or not all(map(math.isfinite, numbers)):
            raise UsageError(f"{text!r} is no origin; write {FORM} in degrees: 51.9988,4.3735,90")
        found = cls(*numbers)
        if abs(found.latitude) > _HIGHEST or abs(found.longitude) > 180.0 or abs(found.direction) > 360.0:
            raise UsageError(
                f"{text!r} is no origin: latitude within ±{_HIGHEST:g}, longitude within ±180, "
                "direction within ±360 degrees"
            )
        return found

    def position(self, x: float, y: float) -> list[float]:
        """Return longitude and latitude, in this order, of a place on the map."""
        turn, latitude = math.radians(self.direction), math.radians(self.latitude)
        # x points to the bearing, y to the left of it.
        east = x * math.sin(turn) - y * math.cos(turn)
        north = x * math.cos(turn) + y * math.sin(turn)
        bend = 1.0 - _ECCENTRICITY_2 * math.sin(latitude) ** 2
        meridian = _AXIS_M * (1.0 - _ECCENTRICITY_2) / bend**1.5
        parallel = _AXIS_M / math.sqrt(bend) * math.cos(latitude)
        longitude = self.longitude + math.degrees(east / parallel)
        found = (longitude + 180.0) % 360.0 - 180.0, self.latitude + math.degrees(north / meridian)
        return [round(number, DIGITS) for number in found]

    def point(self, x: float, y: float) -> dict[str, Any] | None:
        """Return a place on the map as a GeoJSON point; None if it is not in a greenhouse (`is_near`)."""
        if not is_near(x, y):
            return None
        return {"type": "Point", "coordinates": self.position(x, y)}
