"""A mission's record as OGC SensorThings API 1.1 (OGC 18-088) has it.

The document is what a server answers to `Things?$count=true` with `$expand` of all that belongs to a Thing
and `$select` of ids, properties and that: links to the server itself are left out, for there is none. Without
its `@iot.id`, each Thing can be posted to a server with all that belongs to it. A Thing is a tag; its
Datastreams are the sensors there, and what grew there. Anomaly reports, which belong to no tag, are one Thing
of their own.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any

from lupin_twin.export.forms import finite, to_json, urn, utc
from lupin_twin.export.georeference import Georeference
from lupin_twin.missions import MissionRecord, Observation
from lupin_twin.records import Anomaly, Flowers, Reading
from lupin_twin.state import Tag
from lupin_twin.units import QUANTITIES

_TYPES = "http://www.opengis.net/def/observationType/OGC-OM/2.0/"
_GEOJSON = "application/geo+json"

Entity = dict[str, Any]

#: Who tells of a tag.
_SENSOR, _CAMERA = "sensor", "camera"


@dataclass(frozen=True)
class _Stream:
    """What a Datastream is about: its name, type, unit and property, and what an observation says of it.

    `source` is what tells it. A sensor may have any name, also `species`: what a camera tells has longer ids.
    """

    name: str
    source: str
    type: str
    definition: str
    doc: str
    unit: Entity
    result: Callable[[Observation], Any]

    @property
    def id_parts(self) -> tuple[str, ...]:
        """What tells this stream from all others."""
        return (self.name,) if self.source == _SENSOR else (self.source, self.name)


#: What a datastream has that is not measured in anything.
_NO_UNIT = {"name": None, "symbol": None, "definition": None}
_UNKNOWN_UNIT = {"name": "unknown", "symbol": "", "definition": "urn:lupin:unit:unknown"}

#: Words are results of OM_Observation, which may be anything: those of OM_CategoryObservation are addresses.
_FLOWERS = tuple(
    _Stream(name, _CAMERA, f"{_TYPES}{kind}", f"urn:lupin:vocabulary:{name}", doc, _NO_UNIT, result)
    for name, kind, doc, result in (
        ("species", "OM_Observation", "what grows there", lambda seen: seen.record.species),
        ("blooms", "OM_CountObservation", "how many blooms there are", lambda seen: len(seen.record.blooms)),
        ("pest", "OM_TruthObservation", "whether a pest was seen", lambda seen: seen.record.anomaly),
    )
)
_ANOMALIES = _Stream(
    "anomaly",
    _CAMERA,
    f"{_TYPES}OM_Observation",
    "urn:lupin:vocabulary:anomaly",
    "something unusual in the greenhouse",
    _NO_UNIT,
    lambda seen: seen.record.description,  # type: ignore[union-attr]
)


def sensorthings(record: MissionRecord, origin: Georeference) -> bytes:
    """Return the Things with all that belongs to them."""
    things = [*_tags(record, origin), *_reports(record, origin)]
    return to_json({"@iot.count": len(things), "value": things})


def _entity(kind: str, name: str, description: str, *id_parts: str, **more: Any) -> Entity:
    return {"@iot.id": urn("lupin", kind, *id_parts), "name": name, "description": description, **more}


def _tags(record: MissionRecord, origin: Georeference) -> Iterator[Entity]:
    for tag in record.tags:
        yield _tag(record, tag, None if tag.pin is None else origin.point(tag.pin.x, tag.pin.y), origin)


def _tag(record: MissionRecord, tag: Tag, place: Entity | None, origin: Georeference) -> Entity:
    name = f"tag {tag.tag_id}"
    where = f"where {name} is" if place else f"the greenhouse; where in it {name} is, is not known"
    feature = _entity(
        "feature", name, where, tag.tag_id, encodingType=_GEOJSON, feature=place or _map(origin)
    )
    location = _entity("location", name, where, tag.tag_id, encodingType=_GEOJSON, location=place)
    seen = [s for s in record.observations if getattr(s.record, "tag_id", None) == tag.tag_id]
    return _entity(
        "thing",
        name,
        "a tag in the greenhouse, with the sensors and flowers at it",
        tag.tag_id,
        properties=_properties(tag),
        Locations=[location] if place else [],
        Datastreams=[
            _datastream(stream, tag.tag_id, name, observations, lambda _: feature)
            for stream, observations in _streams(record, seen)
        ],
    )


def _map(origin: Georeference) -> Entity:
    """Return the greenhouse as a point, for what has no better one."""
    return {"type": "Point", "coordinates": origin.position(0.0, 0.0)}


def _properties(tag: Tag) -> Entity:
    properties: Entity = {"tag_id": tag.tag_id}
    if tag.pin is not None:
        properties |= {"map_x": finite(tag.pin.x), "map_y": finite(tag.pin.y)}
    return properties


def _streams(record: MissionRecord, seen: list[Observation]) -> Iterator[tuple[_Stream, list[Observation]]]:
    """Yield what was observed at a tag, each with its observations."""
    for sensor in record.sensors:
        measured = [s for s in seen if _value(s, sensor) is not None]
        if measured:
            yield _sensor(sensor), measured
    flowers = [s for s in seen if isinstance(s.record, Flowers)]
    if flowers:
        yield from ((stream, flowers) for stream in _FLOWERS)


def _value(observation: Observation, sensor: str) -> float | None:
    record = observation.record
    value = dict(record.readings).get(sensor) if isinstance(record, Reading) else None
    return None if value is None else finite(value)


def _sensor(sensor: str) -> _Stream:
    known = QUANTITIES.get(sensor)
    definition = urn("lupin", "sensor", sensor) if known is None else known.definition
    unit: Entity = _UNKNOWN_UNIT
    if known is not None:
        unit = {"name": known.name, "symbol": known.symbol, "definition": known.unit_definition}
    doc = "in an unknown unit" if known is None else known.label
    measured = f"{_TYPES}OM_Measurement"
    return _Stream(sensor, _SENSOR, measured, definition, doc, unit, lambda s: _value(s, sensor))


def _datastream(
    stream: _Stream,
    thing: str,
    where: str,
    observations: Iterable[Observation],
    feature: Callable[[Observation], Entity],
) -> Entity:
    observed = [
        {"@iot.id": urn("lupin", "observation", *stream.id_parts, thing, utc(seen.time), str(number))}
        | _observation(stream, seen, feature(seen))
        for number, seen in enumerate(observations, 1)
    ]
    times = sorted(seen["phenomenonTime"] for seen in observed)
    return _entity(
        "datastream",
        f"{stream.name} at {where}",
        f"{stream.doc}, observed by a robot on missions",
        *stream.id_parts,
        thing,
        observationType=stream.type,
        unitOfMeasurement=stream.unit,
        phenomenonTime=f"{times[0]}/{times[-1]}",
        Sensor=_entity(
            "sensor",
            f"{stream.name} {stream.source}",
            f"the {stream.source} that tells {stream.name}",
            *stream.id_parts,
            encodingType="text/html",
            metadata=f"{stream.source} in the greenhouse, read by a Lupin robot",
        ),
        ObservedProperty=_entity(
            "property", stream.name, stream.doc, *stream.id_parts, definition=stream.definition
        ),
        Observations=observed,
    )


def _observation(stream: _Stream, seen: Observation, feature: Entity) -> Entity:
    time = utc(seen.time)
    origin = {"mission_id": seen.record.mission_id, "source": seen.record.source}
    severity = {"severity": seen.record.severity} if isinstance(seen.record, Anomaly) else {}
    return {
        "phenomenonTime": time,
        "resultTime": time,
        "result": stream.result(seen),
        "parameters": origin | severity,
        "FeatureOfInterest": feature,
    }


def _reports(record: MissionRecord, origin: Georeference) -> Iterator[Entity]:
    reports = [seen for seen in record.observations if isinstance(seen.record, Anomaly)]
    if not reports:
        return

    def feature(seen: Observation) -> Entity:
        assert isinstance(seen.record, Anomaly)
        number = str(reports.index(seen) + 1)
        x, y = seen.record.x, seen.record.y
        place = origin.point(x, y) or _map(origin)
        name = f"place of anomaly {number}"
        return _entity("anomaly", name, name, record.name, number, encodingType=_GEOJSON, feature=place)

    yield _entity(
        "thing",
        "greenhouse",
        "the greenhouse itself, for what was seen away from its tags",
        "greenhouse anomalies",
        properties={},
        Locations=[],
        Datastreams=[_datastream(_ANOMALIES, record.name, "the greenhouse", reports, feature)],
    )
