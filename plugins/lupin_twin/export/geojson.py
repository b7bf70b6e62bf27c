"""Exports a mission's record as GeoJSON (RFC 7946): longitude and latitude, WGS84.

A feature's `kind` is `tag` (its place and latest state), `reading`, `flowers` and `bloom` (as observed, with
the time), `box` (a planter box) or `anomaly`. Without a place its geometry is null.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from lupin_twin.export.forms import finite, to_json, urn, utc
from lupin_twin.export.georeference import Georeference
from lupin_twin.missions import MissionRecord, Observation
from lupin_twin.records import Anomaly, Corners, Flowers, Reading, is_near
from lupin_twin.state import TwinTag
from lupin_twin.text import QUANTITIES

#: Twice the area of the smallest planter box: of a smaller one the corners are in one place on the earth.
SMALLEST_M2 = 1e-4


def geojson(record: MissionRecord, origin: Georeference) -> bytes:
    """Return the features; foreign member `lupin` has the units and the georeference."""
    features = [*_tags(record, origin), *_observed(record, origin)]
    units = {name: QUANTITIES[name].symbol for name in record.sensors if name in QUANTITIES}
    return to_json(
        {
            "type": "FeatureCollection",
            "features": features,
            "lupin": {
                "missions": [mission.mission_id for mission in record.missions],
                "units": units,
                "map_origin": {
                    "latitude": origin.latitude,
                    "longitude": origin.longitude,
                    "direction_of_x": origin.direction,
                },
            },
        }
    )


def _feature(kind: str, name: str, geometry: dict[str, Any] | None, **properties: Any) -> dict[str, Any]:
    return {
        "type": "Feature",
        "id": urn("lupin", kind, name),
        "geometry": geometry,
        "properties": {"kind": kind, **properties},
    }


def _tags(record: MissionRecord, origin: Georeference) -> Iterator[dict[str, Any]]:
    for tag in record.tags:
        yield _feature(
            "tag",
            tag.tag_id,
            _place(tag, origin),
            tag_id=tag.tag_id,
            observed_at=None if tag.last_observed is None else utc(tag.last_observed),
            **_on_map(tag),
            species=tag.species,
            species_confidence=finite(tag.confidence),
            pest=tag.anomaly,
            blooms=len(tag.blooms),
            **_values(tag.readings),
        )
        ring = _ring(tag.footprint, origin)
        if ring:
            box = {"type": "Polygon", "coordinates": [ring]}
            yield _feature("box", tag.tag_id, box, tag_id=tag.tag_id)


def _observed(record: MissionRecord, origin: Georeference) -> Iterator[dict[str, Any]]:
    for number, observation in enumerate(record.observations, 1):
        seen, shared = observation.record, _shared(observation)
        match seen:
            case Reading():
                place = _place(record.twin.tags[seen.tag_id], origin)
                values = _values(dict(seen.readings))
                yield _feature("reading", str(number), place, tag_id=seen.tag_id, **shared, **values)
            case Flowers():
                yield from _flowers(
                    str(number), seen, _place(record.twin.tags[seen.tag_id], origin), shared, origin
                )
            case Anomaly():
                found = {"description": seen.description, "severity": seen.severity}
                yield _feature("anomaly", str(number), origin.point(seen.x, seen.y), **shared, **found)


def _flowers(
    name: str, seen: Flowers, place: dict[str, Any] | None, shared: dict[str, Any], origin: Georeference
) -> Iterator[dict[str, Any]]:
    shared = {"tag_id": seen.tag_id, **shared}
    confidence = finite(seen.confidence)
    properties = {"species": seen.species, "species_confidence": confidence, "pest": seen.anomaly}
    yield _feature("flowers", name, place, **shared, **properties, blooms=len(seen.blooms))
    for index, bloom in enumerate(seen.blooms, 1):
        properties = {
            "species": bloom.species,
            "species_confidence": finite(bloom.confidence),
            "pest": bloom.anomaly,
        }
        yield _feature("bloom", f"{name}-{index}", origin.point(bloom.x, bloom.y), **shared, **properties)


def _shared(observation: Observation) -> dict[str, Any]:
    record = observation.record
    return {"observed_at": utc(observation.time), "mission_id": record.mission_id, "source": record.source}


def _values(readings: dict[str, float]) -> dict[str, float | None]:
    """Return values under unique names; None for those that JSON cannot represent."""
    return {f"sensor_{name}": finite(value) for name, value in readings.items()}


def _on_map(tag: TwinTag) -> dict[str, float | None]:
    return {} if tag.pin is None else {"map_x": finite(tag.pin.x), "map_y": finite(tag.pin.y)}


def _place(tag: TwinTag, origin: Georeference) -> dict[str, Any] | None:
    return None if tag.pin is None else origin.point(tag.pin.x, tag.pin.y)


def _ring(corners: Corners, origin: Georeference) -> list[list[float]]:
    """Return corners as a closed ring, anticlockwise as the standard wants it; [] if they enclose nothing.

    A planter box is convex, so its corners are sorted by direction from its middle: in the order of the wire
    the sides could cross.
    """
    if len(corners) < 3 or not all(is_near(x, y) for x, y in corners):
        return []
    middle_x, middle_y = (sum(axis) / len(corners) for axis in zip(*corners, strict=True))
    ordered = sorted(corners, key=lambda corner: math.atan2(corner[1] - middle_y, corner[0] - middle_x))
    area = sum(x * v - u * y for (x, y), (u, v) in zip(ordered, (*ordered[1:], ordered[0]), strict=True))
    if abs(area) < SMALLEST_M2:
        return []
    return [origin.position(x, y) for x, y in (*ordered, ordered[0])]
