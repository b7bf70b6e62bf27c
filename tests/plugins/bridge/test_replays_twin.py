"""What the digital twin exports as CSV can be replayed as a greenhouse."""

from __future__ import annotations

import math
from pathlib import Path

from lupin_bridge.backend import Clocks
from lupin_bridge.recorded import SINCE_START, Recorded, ReplaySettings
from lupin_twin.export.table import table
from lupin_twin.missions import ALL, select
from lupin_twin.records import Anomaly, Flowers, Reading, Record
from lupin_twin.store import StoredRecord

START = 1_777_629_600.0


def test_the_readings_of_an_export_are_served_again(tmp_path: Path) -> None:
    """Everything else in it is passed over: flowers, anomalies with their texts, places, other columns."""
    records: list[tuple[float, Record]] = [
        (0.0, Reading("7", START, "m1", "InspectionMission", (("temperature", 21.5), ("humidity", 60.0)))),
        (10.0, Flowers("7", START + 10, "m1", "aggregator", "tulip_red", 0.9, False)),
        (20.0, Anomaly(START + 20, "m1", "aggregator", 1.0, 2.0, 0.0, 'a "pest",\nperhaps', 1)),
        (30.0, Reading("9", START + 30, "m1", "InspectionMission", (("species", 3.0), ("wind", 2.0)))),
        (
            60.0,
            Reading(
                "7", START + 60, "m1", "InspectionMission", (("temperature", 22.0), ("humidity", math.nan))
            ),
        ),
    ]
    file = tmp_path / "mission.csv"
    file.write_bytes(table(select([StoredRecord(record, START + at) for at, record in records], ALL)))
    now = [0.0]
    backend = Recorded(ReplaySettings(str(file), SINCE_START), None, Clocks(steady=lambda: now[0]))

    def read(tag: str) -> dict[str, float]:
        return {one.sensor: one.value for one in backend.read(tag).sensors}

    assert backend.tags == ("7", "9")
    assert read("7") == {"temperature": 21.5, "humidity": 60.0}
    now[0] = 61.0
    assert read("7") == {"temperature": 22.0}
    assert read("9") == {"species": 3.0, "wind": 2.0}
