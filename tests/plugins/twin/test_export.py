"""What the twin exports, read by programs of others and held against its standards.

CSV on the Web: the validator of package `csvw`, and rules that it does not check (column names are variables
of RFC 6570, exponents have a large `E`). GeoJSON: the models of `geojson-pydantic`, and RFC 7946's rules that
they do not check (rings are closed and anticlockwise, ids are of one feature, no `crs`).
"""

from __future__ import annotations

import csv
import io
import json
import math
import re
from collections import Counter
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from lupin_engine.errors import UsageError
from lupin_twin.export.forms import utc
from lupin_twin.export.geojson import geojson
from lupin_twin.export.georeference import Georeference
from lupin_twin.export.table import DESCRIPTION, description, table
from lupin_twin.missions import ALL, LATEST, MissionRecord, select, summaries
from lupin_twin.records import Anomaly, Bloom, BoxOutline, Corners, Discovery, Flowers, Pin, Reading, Record
from lupin_twin.store import StoredRecord

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
    BoxOutline("6", ((2.5, 4.0), (3.5, 4.0))),
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


def rows(*records: Record) -> list[StoredRecord]:
    return [StoredRecord(record, T + 1e6) for record in records]


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
    (seen,) = select([StoredRecord(RECORDS[1], T - 5.0)], "m1").observations
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


#: Where 100 m lead from longitude 4.3735, by PROJ's geodesics on WGS84: latitude and bearing; the place.
GEODESICS = [
    (0.0, 0.0, 4.3735, 0.00090437),
    (0.0, 75.0, 4.37436771, 0.00023407),
    (51.9988, 0.0, 4.3735, 51.99969874),
    (51.9988, 75.0, 4.37490643, 51.9990326),
    (51.9988, 200.0, 4.37300202, 51.99795546),
    (-33.9, 75.0, 4.37454432, -33.89976666),
    (-33.9, 200.0, 4.37313022, -33.90084718),
    (69.0, 75.0, 4.37591422, 69.00023201),
    (69.0, 200.0, 4.3726452, 68.9991576),
]


@pytest.mark.parametrize(("latitude", "bearing", "longitude", "reached"), GEODESICS)
def test_the_map_lies_on_the_ellipsoid(
    latitude: float, bearing: float, longitude: float, reached: float
) -> None:
    """Within 5 mm in each direction, whichever way the map's axes point."""
    degree_m = 111_320.0
    for direction in (0.0, 75.0, 90.0, 200.0):
        turn = math.radians(direction - bearing)
        east, north = Georeference(latitude, 4.3735, direction).position(
            100.0 * math.cos(turn), 100.0 * math.sin(turn)
        )
        assert north == pytest.approx(reached, abs=0.005 / degree_m)
        assert east == pytest.approx(longitude, abs=0.005 / degree_m / math.cos(math.radians(latitude)))


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


def test_geojson_has_a_feature_for_everything_observed() -> None:
    features = json.loads(geojson(record_of(ALL), ORIGIN))["features"]
    kinds = Counter(feature["properties"]["kind"] for feature in features)
    assert kinds == {"reading": 7, "tag": 4, "bloom": 2, "anomaly": 2, "flowers": 1, "box": 1}
    tags = {f["properties"]["tag_id"]: f for f in features if f["properties"]["kind"] == "tag"}
    told = {name: tags["5"]["properties"][name] for name in ("sensor_temperature", "species", "map_x")}
    assert told == {"sensor_temperature": 22.0, "species": "tulip_red", "map_x": 1.0}
    places = [tags[tag]["geometry"] and tags[tag]["geometry"]["coordinates"] for tag in ("5", "6", "nowhere")]
    assert places == [ORIGIN.position(1.0, 2.0), ORIGIN.position(3.0, 4.0), None]
    years = {f["properties"]["observed_at"][:4] for f in features if f["properties"]["kind"] == "reading"}
    assert years == {"2026"}


def turns(ring: list[list[float]]) -> list[float]:
    """Return how far a closed ring turns left at each corner: above 0 everywhere if it is convex."""
    steps = [(bx - ax, by - ay) for (ax, ay), (bx, by) in pairwise([*ring, ring[1]])]
    return [ax * by - ay * bx for (ax, ay), (bx, by) in pairwise(steps)]


@pytest.mark.parametrize("order", [(0, 1, 2, 3), (3, 2, 1, 0), (0, 2, 1, 3), (0, 0, 1, 2, 3)])
@pytest.mark.parametrize("origin", [ORIGIN, Georeference(-33.9, 18.4, 200.0)])
@pytest.mark.parametrize("told", [CLOCKWISE, ASKEW])
def test_a_box_is_a_ring_however_its_corners_are_told(
    told: Corners, order: tuple[int, ...], origin: Georeference
) -> None:
    box = BoxOutline("5", tuple(told[index] for index in order))
    features = json.loads(geojson(record_of(ALL, *RECORDS, box), origin))["features"]
    (found,) = (f["geometry"] for f in features if f["id"] == "urn:lupin:box:5")
    (ring,) = found["coordinates"]
    assert ring[0] == ring[-1]
    corners = [corner for corner, after in pairwise(ring) if corner != after]
    assert min(turns([*corners, corners[0]])) > 0.0, "anticlockwise, and no edge crosses another"
    assert sorted(corners) == sorted(origin.position(x, y) for x, y in told)


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
    features = json.loads(geojson(record_of(ALL, *RECORDS, BoxOutline("5", corners)), ORIGIN))["features"]
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


def test_geojson_says_what_is_behind_its_numbers() -> None:
    assert json.loads(geojson(record_of("m1"), ORIGIN))["lupin"] == {
        "missions": ["m1"],
        "units": {"temperature": "°C", "humidity": "%", "co2": "ppm", "light": "lx", "soil_moisture": "1"},
        "map_origin": {"latitude": 51.9988, "longitude": 4.3735, "direction_of_x": 75.0},
    }


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
