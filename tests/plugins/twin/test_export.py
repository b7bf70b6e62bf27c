"""What the twin exports, read by programs of others and held against the schemas of its formats."""

from __future__ import annotations

import csv
import io
import json
import math
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from lupin_engine.errors import UsageError
from lupin_twin.export.forms import utc
from lupin_twin.export.geojson import geojson
from lupin_twin.export.georeference import Georeference
from lupin_twin.export.ngsi_ld import CORE, ngsi_ld
from lupin_twin.export.sensorthings import sensorthings
from lupin_twin.export.table import DESCRIPTION, description, table
from lupin_twin.missions import ALL, LATEST, MissionRecord, select, summaries
from lupin_twin.records import Anomaly, Bloom, Box, Corners, Discovery, Flowers, Pin, Reading, Record
from lupin_twin.store import Row

SCHEMAS = Path(__file__).parents[2] / "schemas"
ORIGIN = Georeference(51.9988, 4.3735, 75.0)
T = 1_790_000_000.0

BLOOMS = (Bloom(1.1, 2.1, 0.0, "tulip_red", 0.5, False), Bloom(math.nan, 0.0, 0.0, "", math.nan, True))
CLOCKWISE = ((1.0, 2.0), (1.0, 2.4), (1.6, 2.4), (1.6, 2.0))
#: One that stands on a corner, to a map as to the middle of the greenhouse.
ASKEW = ((5.0, 4.8), (4.8, 5.1), (5.1, 5.4), (5.3, 5.1))


def at(x: float, y: float, heading: float = 0.0) -> Pin:
    return Pin(x, y, math.sin(heading / 2.0), math.cos(heading / 2.0))


#: Ordinary observations, and all that is odd and still may come over the wire.
RECORDS: list[Record] = [
    Discovery("5", at(1.0, 2.0, math.pi / 2.0)),
    Reading("5", T, "m1", "InspectionMission", (("temperature", 20.5), ("humidity", 55.0))),
    Reading("6", T + 1.0, "m1", "InspectionMission", (("co2", 400.0), ("species", 1.0)), at(3.0, 4.0)),
    Flowers("5", T + 2.0, "m1", "aggregator", "tulip_red", 0.75, True, BLOOMS, CLOCKWISE),
    Reading("nowhere", T + 3.0, "m1", "InspectionMission", (("light", 500.0), ("soil_moisture", 0.3))),
    Reading("5", T + 4.0, "m2", "InspectionMission", (("temperature", 21.25),)),
    Reading(
        "7 \u00e4/\n%", T + 5.0, "m2", "Inspection\u00dfMission", (("p.H $", math.nan), ("co2", math.inf))
    ),
    Reading("7 \u00e4/\n%", T + 6.0, "m2", "InspectionMission", (("p.H $", 6.5),), at(1e300, 1.0)),
    Anomaly(T + 7.0, "m2", "aggregator", 2.0, 3.0, 0.0, 'fallen, "plant"\nby the door', 2),
    Anomaly(T + 8.0, "m2", "aggregator", 1e300, 3.0, 0.0, "far away", 0),
    Reading("5", T + 9.0, "", "passive", (("temperature", 22.0),)),
    Box("6", ((2.5, 4.0), (3.5, 4.0))),
]


#: Sensors with the names of other things, as anybody may tell them.
NAMESAKES = Reading(
    "5",
    T + 10.0,
    "m2",
    "",
    tuple((name, 5e-5) for name in ("species", "sensor species", "leaf-wetness", "_x", "x", ".x", "\u00e9~")),
)

#: A place that no twin takes, but a store that was made by hand may have.
NOWHERE: list[Record] = [
    Reading("9", T, "m1", "", (("co2", 400.0),), at(math.nan, 1.0)),
    Anomaly(T, "m1", "", math.inf, 1.0, 0.0, "somewhere", 1),
]


def rows(*records: Record) -> list[Row]:
    return [Row(record, T + 1e6) for record in records]


def record_of(mission: str = ALL, *records: Record) -> MissionRecord:
    return select(rows(*(records or RECORDS)), mission)


# --- which mission ------------------------------------------------------------------------------------------


def test_a_mission_is_what_it_observed_and_nothing_else() -> None:
    record = record_of("m1")
    assert [seen.time - T for seen in record.observations] == [0.0, 1.0, 2.0, 3.0]
    assert [tag.tag_id for tag in record.tags] == ["5", "6", "nowhere"]
    assert record.twin.tags["5"].readings == {"temperature": 20.5, "humidity": 55.0}


def test_the_place_of_a_tag_is_what_anybody_has_told() -> None:
    pinned_later = Reading("8", T, "m1", "", (("co2", 1.0),)), Reading("8", T, "m2", "", (), at(5.0, 6.0))
    tag = record_of("m1", *pinned_later).twin.tags["8"]
    assert tag.pin == at(5.0, 6.0)
    assert tag.readings == {"co2": 1.0}


def test_the_latest_mission_is_the_one_that_observed_last() -> None:
    assert record_of(LATEST).name == "m2"
    late = Reading("5", T + 20.0, "m1", "", ())
    assert record_of(LATEST, *RECORDS, late).name == "m1"


def test_all_has_what_was_seen_outside_of_missions_too() -> None:
    record = record_of(ALL)
    assert len(record.observations) == 10
    assert [mission.mission_id for mission in record.missions] == ["m1", "m2", ""]
    assert record.sensors == ["temperature", "humidity", "co2", "light", "soil_moisture", "species", "p.H $"]


def test_missions_are_counted() -> None:
    first, second, outside = summaries(rows(*RECORDS))
    assert (first.readings, first.flowers, first.anomalies, first.first, first.last) == (3, 1, 0, T, T + 3.0)
    assert (second.readings, second.anomalies) == (3, 2)
    assert (outside.mission_id, outside.source, outside.readings) == ("", "passive", 1)


def test_who_reads_is_the_source_of_a_mission_whoever_saw_flowers_before() -> None:
    flowers = Flowers("5", T, "m1", "aggregator", "tulip_red", 0.5, False)
    (seen,) = summaries(rows(flowers))
    assert seen.source == "aggregator"
    (driven,) = summaries(rows(flowers, RECORDS[1], flowers))
    assert driven.source == "InspectionMission"


def test_nothing_is_observed_later_than_it_arrived() -> None:
    (seen,) = select([Row(RECORDS[1], T - 5.0)], "m1").observations
    assert seen.time == T - 5.0


@pytest.mark.parametrize(
    ("records", "wanted", "reason"),
    [
        (RECORDS[:1], LATEST, "nothing has been observed yet: run a mission, or let a twin listen to one"),
        (RECORDS, "m3", "no mission 'm3' has observed anything; allowed: 'all', 'latest', 'm1', 'm2'"),
        (RECORDS, "latst", "no mission 'latst' has observed anything; did you mean 'latest'?"),
        (
            RECORDS[-2:],
            LATEST,
            "no mission has observed anything; what was seen outside of one: --mission all",
        ),
    ],
)
def test_a_mission_that_is_not_there_is_told(records: list[Record], wanted: str, reason: str) -> None:
    with pytest.raises(UsageError) as refused:
        select(rows(*records), wanted)
    assert str(refused.value) == reason


# --- CSV ----------------------------------------------------------------------------------------------------


def parsed(content: bytes) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(content.decode(), newline="")))


def test_a_row_is_an_observation() -> None:
    first, second, flowers = parsed(table(record_of("m1")))[:3]
    assert first == dict.fromkeys(first, "") | {
        "observed_at": utc(T),
        "kind": "reading",
        "mission_id": "m1",
        "source": "InspectionMission",
        "tag_id": "5",
        "x": "1.0",
        "y": "2.0",
        "heading": first["heading"],
        "temperature": "20.5",
        "humidity": "55.0",
    }
    assert float(first["heading"]) == pytest.approx(math.pi / 2.0)
    assert (second["co2"], second["sensor species"], second["species"]) == ("400.0", "1.0", "")
    found = {name: flowers[name] for name in ("species", "species_confidence", "pest", "blooms")}
    assert found == {"species": "tulip_red", "species_confidence": "0.75", "pest": "true", "blooms": "2"}


def test_numbers_are_written_as_xml_schema_has_them() -> None:
    values = (0.5, 1e-7, math.inf, -math.inf, math.nan)
    readings = Reading("5", T, "m1", "", tuple((f"s{index}", value) for index, value in enumerate(values)))
    (told,) = parsed(table(record_of(ALL, readings)))
    assert [told[f"s{index}"] for index in range(5)] == ["0.5", "1E-07", "INF", "-INF", "NaN"]


def test_what_is_odd_survives_the_table() -> None:
    content = table(record_of("m2"))
    assert content.count(b"\r\n") == 6
    odd, _, anomaly, _ = parsed(content)[1:]
    assert (odd["tag_id"], odd["p.H $"], odd["co2"]) == ("7 \u00e4/\n%", "NaN", "INF")
    assert (anomaly["description"], anomaly["severity"]) == ('fallen, "plant"\nby the door', "2")
    assert (anomaly["x"], anomaly["y"], anomaly["heading"], anomaly["tag_id"]) == ("2.0", "3.0", "", "")


def test_the_table_is_csv_on_the_web(tmp_path: Path) -> None:
    csvw = pytest.importorskip("csvw")
    record = record_of(ALL)
    (tmp_path / "record.csv").write_bytes(table(record))
    (tmp_path / f"record.csv{DESCRIPTION}").write_bytes(description(record, "record.csv"))
    found = csvw.CSVW(str(tmp_path / f"record.csv{DESCRIPTION}"), validate=True)
    assert found.is_valid
    read = list(found.tables[0])
    assert len(read) == len(record.observations)
    assert read[0]["temperature"] == 20.5
    assert read[0]["observed_at"].timestamp() == T
    assert read[2]["pest"] is True
    assert read[2]["blooms"] == 2
    assert read[0]["light"] is None


def test_a_column_has_a_name_of_its_own_that_templates_can_use() -> None:
    """A variable of RFC 6570 that does not begin with the underscore of the vocabulary's own names."""
    record = record_of(ALL, *RECORDS, NAMESAKES)
    columns = json.loads(description(record, "record.csv"))["tableSchema"]["columns"]
    names = [column["name"] for column in columns]
    assert [n for n in names if not re.fullmatch(r"(?!_)(\w|%[0-9A-F]{2})+", n, re.ASCII)] == []
    assert len(set(names)) == len(names)
    told = next(row for row in parsed(table(record)) if row["x"] and row["leaf-wetness"])
    sensors = ("sensor species", "sensor sensor species", "leaf-wetness", "_x", "sensor x", ".x", "\u00e9~")
    assert {name: told[name] for name in sensors} == dict.fromkeys(sensors, "5E-05")


def test_a_sensor_with_the_name_of_a_column_has_one_of_its_own() -> None:
    (before,) = parsed(table(record_of(ALL, Reading("5", T, "m1", "", (), at(1.0, 2.0)))))
    assert len(before) == 14
    namesakes = Reading("5", T, "m1", "", tuple((name, 7.0) for name in before), at(1.0, 2.0))
    (told,) = parsed(table(record_of(ALL, namesakes)))
    assert told == before | {f"sensor {name}": "7.0" for name in before}


@pytest.mark.parametrize(
    ("records", "mission", "title"),
    [
        (RECORDS, "m1", "mission m1"),
        (RECORDS, ALL, "all missions"),
        (RECORDS[:2], ALL, "all missions"),
        (RECORDS[:2], LATEST, "mission m1"),
    ],
)
def test_the_description_says_what_the_table_is_about(
    records: list[Record], mission: str, title: str
) -> None:
    told = json.loads(description(record_of(mission, *records), "a b.csv"))
    assert (told["dc:title"], told["url"]) == (f"Observations of {title}", "a%20b.csv")


def test_the_description_has_the_units() -> None:
    columns = json.loads(description(record_of(ALL), "record.csv"))["tableSchema"]["columns"]
    units = {
        c["titles"]: (c["schema:unitText"], c["schema:unitCode"]) for c in columns if "schema:unitText" in c
    }
    assert units == {
        "x": ("m", "MTR"),
        "y": ("m", "MTR"),
        "heading": ("rad", "C81"),
        "temperature": ("°C", "CEL"),
        "humidity": ("%", "P1"),
        "co2": ("ppm", "59"),
        "light": ("lx", "LUX"),
        "soil_moisture": ("1", "C62"),
    }
    assert [column["titles"] for column in columns] == list(parsed(table(record_of(ALL)))[0])


# --- where the map is ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("latitude", [0.0, 51.9988, -33.9, 69.0])
@pytest.mark.parametrize("direction", [0.0, 75.0, 90.0, 200.0])
def test_the_map_lies_on_the_ellipsoid(latitude: float, direction: float) -> None:
    geod = pytest.importorskip("pyproj").Geod(ellps="WGS84")
    origin = Georeference(latitude, 4.3735, direction)
    for x, y in ((100.0, 0.0), (0.0, 100.0), (-60.0, 80.0)):
        longitude, found = origin.position(x, y)
        bearing, _, distance = geod.inv(origin.longitude, origin.latitude, longitude, found)
        assert distance == pytest.approx(100.0, abs=0.005)
        expected = direction - math.degrees(math.atan2(y, x))
        assert math.remainder(bearing - expected, 360.0) == pytest.approx(0.0, abs=0.01)


def test_longitudes_go_on_behind_the_date_line() -> None:
    assert Georeference(0.0, 180.0).position(100.0, 0.0)[0] == pytest.approx(-179.9991, abs=1e-4)


@pytest.mark.parametrize(
    ("text", "expected"),
    [("51.9988,4.3735", (51.9988, 4.3735, 90.0)), (" -1, 2 ,3.5", (-1.0, 2.0, 3.5))],
)
def test_an_origin_is_read(text: str, expected: tuple[float, ...]) -> None:
    found = Georeference.parse(text)
    assert (found.latitude, found.longitude, found.direction) == expected


@pytest.mark.parametrize("text", ["", "1", "1,2,3,4", "north,east", "nan,1", "inf,1", "1;2"])
def test_an_origin_that_is_none_is_refused(text: str) -> None:
    with pytest.raises(UsageError) as refused:
        Georeference.parse(text)
    assert str(refused.value) == (
        f"{text!r} is no origin; write LATITUDE,LONGITUDE or LATITUDE,LONGITUDE,DIRECTION in degrees: "
        "51.9988,4.3735,90"
    )


@pytest.mark.parametrize("text", ["89.5,0", "0,181", "0,0,361"])
def test_an_origin_off_the_earth_is_refused(text: str) -> None:
    with pytest.raises(UsageError) as refused:
        Georeference.parse(text)
    limits = "latitude within ±89, longitude within ±180, direction within ±360 degrees"
    assert str(refused.value) == f"{text!r} is no origin: {limits}"


# --- GeoJSON ------------------------------------------------------------------------------------------------


def test_geojson_holds_to_its_standard() -> None:
    models = pytest.importorskip("geojson_pydantic")
    content = geojson(record_of(ALL), ORIGIN)
    found = models.FeatureCollection.model_validate_json(content, strict=True)
    ids = [feature.id for feature in found.features]
    assert len(set(ids)) == len(ids)
    assert "crs" not in json.loads(content)


def test_geojson_opens_in_geopandas(tmp_path: Path) -> None:
    geopandas = pytest.importorskip("geopandas")
    file = tmp_path / "record.geojson"
    file.write_bytes(geojson(record_of(ALL), ORIGIN))
    frame = geopandas.read_file(file)
    assert frame.crs.to_epsg() == 4326
    kinds = frame["kind"].value_counts().to_dict()
    assert kinds == {"reading": 7, "tag": 4, "bloom": 2, "anomaly": 2, "flowers": 1, "box": 1}
    tags = frame[frame["kind"] == "tag"].set_index("tag_id")
    assert tags.loc["5", "sensor_temperature"] == 22.0
    assert tags.loc["5", "species"] == "tulip_red"
    assert tags.loc["5", "map_x"] == 1.0
    assert [tags.geometry[tag] is None for tag in ("5", "6", "nowhere")] == [False, False, True]
    plane = tags.to_crs(frame.estimate_utm_crs()).geometry
    assert plane["5"].distance(plane["6"]) == pytest.approx(math.hypot(2.0, 2.0), rel=2e-3)
    (box,) = frame[frame["kind"] == "box"].geometry
    assert box.is_valid
    assert box.exterior.is_ccw
    assert set(frame[frame["kind"] == "reading"]["observed_at"].dt.year) == {2026}


@pytest.mark.parametrize("order", [(0, 1, 2, 3), (3, 2, 1, 0), (0, 2, 1, 3), (0, 0, 1, 2, 3)])
@pytest.mark.parametrize("origin", [ORIGIN, Georeference(-33.9, 18.4, 200.0)])
@pytest.mark.parametrize("told", [CLOCKWISE, ASKEW])
def test_a_box_is_a_ring_however_its_corners_are_told(
    told: Corners, order: tuple[int, ...], origin: Georeference
) -> None:
    shape = pytest.importorskip("shapely.geometry").shape
    box = Box("5", tuple(told[index] for index in order))
    features = json.loads(geojson(record_of(ALL, *RECORDS, box), origin))["features"]
    (found,) = (f["geometry"] for f in features if f["id"] == "urn:lupin:box:5")
    polygon = shape(found)
    assert polygon.is_valid
    assert polygon.exterior.is_ccw
    corners = {tuple(origin.position(x, y)) for x, y in told}
    assert set(polygon.exterior.coords) == corners


@pytest.mark.parametrize(
    "corners",
    [
        ((1.0, 2.0), (1.0, 2.4)),
        ((1.0, 2.0), (1.0, 2.4), (1.0, 3.0)),
        ((1.0, 2.0),) * 4,
        ((1.0, 2.0), (1.0, 2.001), (1.001, 2.0)),
        ((1.0, 2.0), (1.0, 1e300), (2.0, 2.0)),
    ],
)
def test_a_box_that_encloses_nothing_is_none(corners: Any) -> None:
    features = json.loads(geojson(record_of(ALL, *RECORDS, Box("5", corners)), ORIGIN))["features"]
    assert [f for f in features if f["id"] == "urn:lupin:box:5"] == []


def test_what_has_no_place_on_the_earth_has_no_geometry() -> None:
    features = json.loads(geojson(record_of("m2"), ORIGIN))["features"]
    odd = [f for f in features if f["properties"].get("tag_id") == "7 \u00e4/\n%"]
    assert [feature["geometry"] for feature in odd] == [None, None, None]
    assert odd[1]["properties"]["sensor_p.H $"] is None
    near, far = (f for f in features if f["properties"]["kind"] == "anomaly")
    assert near["geometry"]["coordinates"] == ORIGIN.position(2.0, 3.0)
    assert far["geometry"] is None


def test_a_place_that_is_none_is_left_out_everywhere() -> None:
    record = record_of(ALL, *NOWHERE)
    tag, *others = json.loads(geojson(record, ORIGIN))["features"]
    assert (tag["properties"]["map_x"], tag["properties"]["map_y"]) == (None, 1.0)
    assert {feature["geometry"] for feature in (tag, *others)} == {None}
    _, entity, report = json.loads(ngsi_ld(record, ORIGIN))
    assert "mapPosition" not in entity
    assert "mapPosition" not in report
    assert json.loads(sensorthings(record, ORIGIN))["value"][0]["Locations"] == []


def test_geojson_says_what_is_behind_its_numbers() -> None:
    assert json.loads(geojson(record_of("m1"), ORIGIN))["lupin"] == {
        "missions": ["m1"],
        "units": {"temperature": "°C", "humidity": "%", "co2": "ppm", "light": "lx", "soil_moisture": "1"},
        "map_origin": {"latitude": 51.9988, "longitude": 4.3735, "direction_of_x": 75.0},
    }


# --- NGSI-LD ------------------------------------------------------------------------------------------------


def schema() -> Any:
    return json.loads((SCHEMAS / "ngsi-ld-temporal.schema.json").read_text())


@pytest.mark.parametrize("origin", [ORIGIN, None])
@pytest.mark.parametrize("mission", ["m1", "m2", ALL])
def test_ngsi_ld_holds_to_its_standard(mission: str, origin: Georeference | None) -> None:
    entities = json.loads(ngsi_ld(record_of(mission), origin))
    jsonschema.validate(entities, schema(), jsonschema.Draft202012Validator)
    ids = [entity["id"] for entity in entities]
    assert len(set(ids)) == len(ids)


@pytest.mark.parametrize(
    "spoil",
    [
        lambda tag: tag.pop("@context"),
        lambda tag: tag.update(id="5"),
        lambda tag: tag.update({"p.H": {"type": "Property", "value": 1}}),
        lambda tag: tag["temperature"][0].pop("observedAt"),
        lambda tag: tag["temperature"][0].update(observedAt="yesterday"),
        lambda tag: tag["temperature"][0].update(value=None),
        lambda tag: tag["mapPosition"][0]["value"].update(x=None),
        lambda tag: tag["location"]["value"].update(coordinates=[200.0, 0.0]),
        lambda tag: tag["location"].pop("observedAt"),
        lambda tag: tag.update(location=[tag["location"]]),
        lambda tag: tag.update(mapPosition=tag["mapPosition"][0]),
    ],
)
def test_the_schema_of_ngsi_ld_refuses_what_is_wrong(spoil: Callable[[Any], Any]) -> None:
    entities = json.loads(ngsi_ld(record_of("m1"), ORIGIN))
    spoil(next(entity for entity in entities if entity["id"] == "urn:ngsi-ld:GreenhouseTag:5"))
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(entities, schema(), jsonschema.Draft202012Validator)


def test_ngsi_ld_has_every_value_with_its_time_and_unit() -> None:
    entities = {entity["id"]: entity for entity in json.loads(ngsi_ld(record_of(ALL), ORIGIN))}
    tag = entities["urn:ngsi-ld:GreenhouseTag:5"]
    assert [(one["value"], one["observedAt"], one["unitCode"]) for one in tag["temperature"]] == [
        (20.5, utc(T), "CEL"),
        (21.25, utc(T + 4.0), "CEL"),
        (22.0, utc(T + 9.0), "CEL"),
    ]
    assert tag["temperature"][0]["mission"] == {"type": "Relationship", "object": "urn:ngsi-ld:Mission:m1"}
    assert "mission" not in tag["temperature"][2]
    assert tag["location"]["value"]["coordinates"] == ORIGIN.position(1.0, 2.0)
    odd = entities["urn:ngsi-ld:GreenhouseTag:7%20%C3%A4%2F%0A%25"]
    assert [one["value"] for one in odd["sensor_p_2e_H_20__24_"]] == [6.5]
    assert "location" not in odd
    report = entities["urn:ngsi-ld:AnomalyReport:all-1"]
    assert [one["value"] for one in report["severity"]] == [2]
    assert report["location"]["observedAt"] == report["severity"][0]["observedAt"] == utc(T + 7.0)
    assert tag["location"]["observedAt"] == utc(T + 9.0)


def test_without_an_origin_ngsi_ld_has_the_place_on_the_map_only() -> None:
    tag = next(e for e in json.loads(ngsi_ld(record_of("m1"))) if e["id"] == "urn:ngsi-ld:GreenhouseTag:5")
    assert "location" not in tag
    assert [place["value"] for place in tag["mapPosition"]] == [{"x": 1.0, "y": 2.0}]


@pytest.mark.filterwarnings("ignore:ConjunctiveGraph is deprecated:DeprecationWarning")
def test_ngsi_ld_means_what_it_should_to_readers_of_linked_data() -> None:
    rdflib = pytest.importorskip("rdflib")
    entities = json.loads(ngsi_ld(record_of("m1"), ORIGIN))
    core = json.loads((SCHEMAS / "ngsi-ld-core-terms.json").read_text())["@context"]
    for entity in entities:
        entity["@context"] = [core if part == CORE else part for part in entity["@context"]]
    graph = rdflib.Graph().parse(data=json.dumps(entities), format="json-ld")
    ngsi = rdflib.Namespace("https://uri.etsi.org/ngsi-ld/")
    tag = rdflib.URIRef("urn:ngsi-ld:GreenhouseTag:5")
    assert (tag, rdflib.RDF.type, rdflib.URIRef("urn:lupin:vocabulary:GreenhouseTag")) in graph
    (temperature,) = graph.objects(tag, rdflib.URIRef("http://qudt.org/vocab/quantitykind/Temperature"))
    assert (temperature, rdflib.RDF.type, ngsi.Property) in graph
    assert float(next(graph.objects(temperature, ngsi.hasValue))) == 20.5
    assert str(next(graph.objects(temperature, ngsi.observedAt))) == utc(T)
    default = "https://uri.etsi.org/ngsi-ld/default-context/"
    assert {str(p) for p in graph.predicates() if str(p).startswith(default)} <= {
        f"{default}{name}" for name in ("x", "y", "coordinates")
    }


# --- SensorThings -------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def server() -> Any:
    """The models of what a server of SensorThings 1.1 takes and answers."""
    pytest.importorskip("sensorthings")
    import django
    from django.conf import settings

    settings.configure(
        INSTALLED_APPS=["sensorthings.versions.v1_1"],
        LOGGING_CONFIG=None,
        # The server is told which kinds of ids and results it has; the standard leaves both open.
        SENSORTHINGS_V1_1_ID_TYPE=str,
        SENSORTHINGS_V1_1_OBSERVATION_TYPE_SCHEMA=bool | int | float | str,
    )
    django.setup()
    from sensorthings.versions.v1_1 import schemas

    return schemas


def without_ids(told: Any) -> Any:
    """Return Things as they are posted: with an id, a server takes what has it for what it has already."""
    if isinstance(told, list):
        return [without_ids(part) for part in told]
    if isinstance(told, dict):
        return {name: without_ids(part) for name, part in told.items() if name != "@iot.id"}
    return told


def with_units(things: Any) -> Any:
    """Return Things with the units that the server wants of streams in which nothing is measured.

    The standard wants null there (8.2.4), and gets it; this server takes texts only.
    """
    for stream in (stream for thing in things for stream in thing["Datastreams"]):
        if not stream["observationType"].endswith("OM_Measurement"):
            assert stream["unitOfMeasurement"] == {"name": None, "symbol": None, "definition": None}
            stream["unitOfMeasurement"] = {"name": "", "symbol": "", "definition": ""}
    return things


@pytest.mark.parametrize("mission", ["m1", "m2", ALL])
def test_sensorthings_is_what_a_server_would_answer_and_take(server: Any, mission: str) -> None:
    answer = json.loads(sensorthings(record_of(mission), ORIGIN))
    things = with_units(answer["value"])
    assert server.ThingCollectionResponse.model_validate(answer).iot_count == len(things) > 0
    for thing in things:
        taken = server.ThingPostBody.model_validate(without_ids(thing))
        told = [(stream.name, len(stream.observations)) for stream in taken.datastreams]
        assert told == [(stream["name"], len(stream["Observations"])) for stream in thing["Datastreams"]]


@pytest.mark.parametrize(
    "spoil",
    [
        lambda thing: thing.pop("description"),
        lambda thing: thing["Datastreams"][0].pop("unitOfMeasurement"),
        lambda thing: thing["Datastreams"][0].update(observationType="temperature"),
        lambda thing: thing["Datastreams"][0].pop("Sensor"),
        lambda thing: thing["Datastreams"][0]["Observations"][0].update(phenomenonTime="noon"),
        lambda thing: thing["Locations"][0].update(encodingType="text/plain"),
    ],
)
def test_a_server_of_sensorthings_refuses_what_is_wrong(server: Any, spoil: Callable[[Any], Any]) -> None:
    thing = with_units(json.loads(sensorthings(record_of("m1"), ORIGIN))["value"])[0]
    spoil(thing)
    with pytest.raises(ValueError, match="validation error"):
        server.ThingPostBody.model_validate(without_ids(thing))


def test_entities_that_are_the_same_have_the_same_id() -> None:
    things = json.loads(sensorthings(record_of(ALL), ORIGIN))["value"]
    streams = [stream for thing in things for stream in thing["Datastreams"]]
    co2 = [stream for stream in streams if stream["ObservedProperty"]["name"] == "co2"]
    assert len({stream["@iot.id"] for stream in streams}) == len(streams)
    assert {stream["Sensor"]["@iot.id"] for stream in co2} == {"urn:lupin:sensor:co2"}
    observations = [seen["@iot.id"] for stream in streams for seen in stream["Observations"]]
    assert len(set(observations)) == len(observations)


def shared_entities(things: Any) -> list[tuple[str, str]]:
    """Return ids and contents of what more than one thing may have: sensors, properties and features."""
    streams = [stream for thing in things for stream in thing["Datastreams"]]
    found = [stream[kind] for stream in streams for kind in ("Sensor", "ObservedProperty")]
    found += [seen["FeatureOfInterest"] for stream in streams for seen in stream["Observations"]]
    return [(entity["@iot.id"], json.dumps(entity, sort_keys=True)) for entity in found]


def test_an_id_is_of_one_entity_also_if_sensors_have_the_names_of_other_things() -> None:
    flowers = Flowers("5", T + 11.0, "m2", "aggregator", "tulip_red", 0.5, False)
    things = json.loads(sensorthings(record_of(ALL, *RECORDS, NAMESAKES, flowers), ORIGIN))["value"]
    entities = shared_entities(things)
    assert len({content for _, content in entities}) == len({name for name, _ in entities})
    streams = [stream["@iot.id"] for thing in things for stream in thing["Datastreams"]]
    assert len(set(streams)) == len(streams)
    observations = [o["@iot.id"] for t in things for s in t["Datastreams"] for o in s["Observations"]]
    assert len(set(observations)) == len(observations)


#: What the results of each type are, by 18-088, 8.2.4.
RESULTS: dict[str, Callable[[Any], bool]] = {
    "OM_CategoryObservation": lambda result: re.match(r"[a-z][a-z0-9+.-]*:[!-~]+$", result) is not None,
    "OM_CountObservation": lambda result: type(result) is int,
    "OM_Measurement": lambda result: type(result) is float,
    "OM_Observation": lambda result: result is not None,
    "OM_TruthObservation": lambda result: type(result) is bool,
}


def test_results_are_of_the_type_that_their_datastream_tells() -> None:
    things = json.loads(sensorthings(record_of(ALL), ORIGIN))["value"]
    streams = [stream for thing in things for stream in thing["Datastreams"]]
    told = [
        (s["observationType"].rpartition("/")[2], o["result"]) for s in streams for o in s["Observations"]
    ]
    assert [(kind, result) for kind, result in told if not RESULTS[kind](result)] == []
    assert {kind for kind, _ in told} == RESULTS.keys() - {"OM_CategoryObservation"}


def test_sensorthings_has_every_value() -> None:
    things = {t["name"]: t for t in json.loads(sensorthings(record_of(ALL), ORIGIN))["value"]}
    assert list(things) == ["tag 5", "tag 6", "tag nowhere", "tag 7 \u00e4/\n%", "greenhouse"]
    streams = {s["name"]: s for s in things["tag 5"]["Datastreams"]}
    temperature = streams["temperature at tag 5"]
    assert [(o["result"], o["phenomenonTime"]) for o in temperature["Observations"]] == [
        (20.5, utc(T)),
        (21.25, utc(T + 4.0)),
        (22.0, utc(T + 9.0)),
    ]
    assert temperature["unitOfMeasurement"] == {
        "name": "degree Celsius",
        "symbol": "°C",
        "definition": "http://www.opengis.net/def/uom/UCUM/0/Cel",
    }
    assert temperature["phenomenonTime"] == f"{utc(T)}/{utc(T + 9.0)}"
    results = {
        name: s["Observations"][0]["result"] for name, s in streams.items() if "temperature" not in name
    }
    expected = {"humidity": 55.0, "species": "tulip_red", "blooms": 2, "pest": True}
    assert results == {f"{name} at tag 5": value for name, value in expected.items()}
    (location,) = things["tag 5"]["Locations"]
    assert location["location"]["coordinates"] == ORIGIN.position(1.0, 2.0)
    assert things["tag nowhere"]["Locations"] == []
    reports = things["greenhouse"]["Datastreams"][0]["Observations"]
    assert [o["result"] for o in reports] == ['fallen, "plant"\nby the door', "far away"]


# --- times --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (0.25, "1970-01-01T00:00:00.250000Z"),
        (T, "2026-09-21T14:13:20.000000Z"),
        (-5.0, "1970-01-01T00:00:00.000000Z"),
        (1e300, "9999-12-31T00:00:00.000000Z"),
        (math.nan, "1970-01-01T00:00:00.000000Z"),
    ],
)
def test_times_are_dates_whatever_was_told(seconds: float, text: str) -> None:
    assert utc(seconds) == text
