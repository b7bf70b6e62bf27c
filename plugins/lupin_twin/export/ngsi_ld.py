"""A mission's record as NGSI-LD (ETSI GS CIM 009): entities in their temporal representation (clause 4.5.7).

An array of one `GreenhouseTag` for each tag, one `AnomalyReport` for each anomaly, and one `Mission` for
each mission. Each attribute is an array of instances with `observedAt`, also where there is only one: the
clause allows that one without an array, the `EntityTemporal` of ETSI's OpenAPI does not. Only a GeoProperty
`location` is one without an array there. It needs to know where the map is; the place on the map is always
there.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

from lupin_twin.export.forms import finite, to_json, urn, utc
from lupin_twin.export.georeference import Georeference
from lupin_twin.missions import MissionRecord, Observation
from lupin_twin.records import Anomaly, Flowers, Pin, Reading
from lupin_twin.state import Tag
from lupin_twin.units import QUANTITIES

#: The context of NGSI-LD itself; it comes last, as the standard wants it.
CORE = "https://uri.etsi.org/ngsi-ld/v1/ngsi-ld-core-context-v1.8.jsonld"

_OWN = "urn:lupin:vocabulary:"
_OWN_TERMS = (
    "GreenhouseTag",
    "Mission",
    "AnomalyReport",
    "mapPosition",
    "species",
    "speciesConfidence",
    "pest",
    "blooms",
    "severity",
    "mission",
    "source",
)
_TERMS = {term: _OWN + term for term in _OWN_TERMS}

Attribute = dict[str, Any]


def ngsi_ld(record: MissionRecord, origin: Georeference | None = None) -> bytes:
    """Return the entities."""
    entities = [*_missions(record), *_tags(record, origin), *_anomalies(record, origin)]
    return to_json(entities)


def _entity(kind: str, name: str, attributes: dict[str, Any], own: dict[str, str]) -> dict[str, Any]:
    return {"id": _id(kind, name), "type": kind, **attributes, "@context": [_TERMS | own, CORE]}


def _id(kind: str, name: str) -> str:
    return urn("ngsi-ld", kind, name)


def _property(value: Any, **more: Any) -> Attribute:
    return {"type": "Property", "value": value, **more}


def _missions(record: MissionRecord) -> Iterator[dict[str, Any]]:
    for mission in record.missions:
        if mission.mission_id:
            source = _property(mission.source, observedAt=utc(mission.first))
            yield _entity("Mission", mission.mission_id, {"source": [source]}, {})


def _tags(record: MissionRecord, origin: Georeference | None) -> Iterator[dict[str, Any]]:
    for tag in record.tags:
        seen = [s for s in record.observations if getattr(s.record, "tag_id", None) == tag.tag_id]
        attributes: dict[str, list[Attribute]] = {}
        own = {}
        for observation in seen:
            for name, term, instance in _instances(observation):
                attributes.setdefault(name, []).append(instance)
                own[name] = term
        yield _entity("GreenhouseTag", tag.tag_id, {**_where(tag, origin), **attributes}, own)


def _instances(observation: Observation) -> Iterator[tuple[str, str, Attribute]]:
    """Yield attribute names with their meaning, and what was observed of them."""
    seen, when = observation.record, _when(observation)
    match seen:
        case Reading():
            for sensor, value in seen.readings:
                if finite(value) is not None:
                    yield attribute_name(sensor), _term(sensor), _property(value, **_unit(sensor), **when)
        case Flowers():
            told = {"species": seen.species, "pest": seen.anomaly, "blooms": len(seen.blooms)}
            told |= {"speciesConfidence": finite(seen.confidence)}
            for name, flower in told.items():
                if flower is not None:
                    yield name, _TERMS[name], _property(flower, **when)


def _when(observation: Observation) -> Attribute:
    """Return what all instances of an observation share."""
    shared: Attribute = {"observedAt": utc(observation.time)}
    mission = observation.record.mission_id
    if mission:
        shared["mission"] = {"type": "Relationship", "object": _id("Mission", mission)}
    return shared


def _unit(sensor: str) -> Attribute:
    quantity = QUANTITIES.get(sensor)
    return {} if quantity is None else {"unitCode": quantity.unece}


def _term(sensor: str) -> str:
    return QUANTITIES[sensor].definition if sensor in QUANTITIES else urn("lupin", "sensor", sensor)


def attribute_name(sensor: str) -> str:
    """Return a sensor's name as an attribute's: letters, digits and _, and none that means something else."""
    if sensor in QUANTITIES:
        return sensor
    # Other letters become their number, so that two names never become one.
    return "sensor_" + re.sub(r"[^A-Za-z0-9]", lambda letter: f"_{ord(letter[0]):x}_", sensor)


def _where(tag: Tag, origin: Georeference | None) -> dict[str, Any]:
    if tag.pin is None or tag.last_observed is None:
        return {}
    return _position(tag.pin, {"observedAt": utc(tag.last_observed)}, origin)


def _position(pin: Pin, when: Attribute, origin: Georeference | None) -> dict[str, Any]:
    if finite(pin.x) is None or finite(pin.y) is None:
        return {}
    found: dict[str, Any] = {"mapPosition": [_property({"x": pin.x, "y": pin.y}, unitCode="MTR", **when)]}
    point = None if origin is None else origin.point(pin.x, pin.y)
    return found if point is None else {"location": {"type": "GeoProperty", "value": point, **when}, **found}


def _anomalies(record: MissionRecord, origin: Georeference | None) -> Iterator[dict[str, Any]]:
    reports = (seen for seen in record.observations if isinstance(seen.record, Anomaly))
    for number, observation in enumerate(reports, 1):
        seen, when = observation.record, _when(observation)
        assert isinstance(seen, Anomaly)
        attributes = {
            **_position(Pin(seen.x, seen.y, 0.0, 1.0), when, origin),
            "description": [_property(seen.description, **when)],
            "severity": [_property(seen.severity, **when)],
        }
        yield _entity("AnomalyReport", f"{record.name}-{number}", attributes, {})
