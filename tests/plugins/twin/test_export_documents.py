"""Whole documents of every export, as others have stored them: nothing in them changes unseen."""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from pathlib import Path

import pytest

from lupin_twin.export.geojson import geojson
from lupin_twin.export.georeference import Georeference
from lupin_twin.export.table import DESCRIPTION, description, table
from lupin_twin.missions import ALL, MissionRecord, select
from lupin_twin.records import Anomaly, Bloom, BoxOutline, Flowers, Pin, Reading, Record
from lupin_twin.store import StoredRecord

FOLDER = Path(__file__).with_name("export")
ORIGIN = Georeference(51.9988, 4.3735, 75.0)
T = 1_790_000_000.0

#: A tag with sensors, flowers and a box; one that nobody has placed; anomalies at a place and at none.
RECORDS: list[Record] = [
    Reading(
        "5",
        T,
        "m1",
        "InspectionMission",
        (("temperature", 20.5), ("humidity", 55.0), ("light", 900.0), ("soil_moisture", 0.25), ("p.H", 6.5)),
        Pin(1.0, 2.0, 0.6, 0.8),
    ),
    Flowers(
        "5",
        T + 1.0,
        "m1",
        "aggregator",
        "tulip_red",
        0.75,
        True,
        (Bloom(1.5, 2.25, 0.0, "tulip_red", 0.5, False), Bloom(1.25, 2.5, 0.0, "", 0.0, True)),
    ),
    Reading("N\u00f6rd/1", T + 2.5, "", "passive", (("co2", 400.0), ("light", math.nan))),
    Flowers("N\u00f6rd/1", T + 3.0, "m1", "aggregator", "", math.nan, False),
    Anomaly(T + 4.0, "m1", "aggregator", 2.0, 3.0, 0.5, "fallen plant", 2),
    Anomaly(T + 5.0, "m1", "aggregator", 1e300, 3.0, 0.0, "far away", 0),
    BoxOutline("5", ((1.0, 2.0), (1.0, 2.5), (1.75, 2.5), (1.75, 2.0))),
]


#: How every document is made, by the name of its file.
DOCUMENTS: dict[str, Callable[[MissionRecord], bytes]] = {
    "record.geojson": lambda record: geojson(record, ORIGIN),
    "record.csv": table,
    f"record.csv{DESCRIPTION}": lambda record: description(record, "record.csv"),
}


@pytest.mark.parametrize("name", DOCUMENTS)
def test_a_document_is_what_it_was(name: str) -> None:
    """Who reads them has programs that know these names; ACCEPT=1 writes the documents anew."""
    file, made = (
        FOLDER / name,
        DOCUMENTS[name](select([StoredRecord(one, T + 100.0) for one in RECORDS], ALL)),
    )
    if os.environ.get("ACCEPT"):
        file.write_bytes(made)
    assert made.decode() == file.read_bytes().decode()


def test_every_document_is_still_made() -> None:
    assert {file.name for file in FOLDER.iterdir()} == set(DOCUMENTS)
