"""What the greenhouse bridge offers to missions, as data."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from lupin_engine.plugin.contract import (
    Argument,
    Code,
    Mock,
    OnHold,
    Operation,
    Parameter,
    Parameters,
    Plugin,
)
from lupin_engine.plugin.types import NUMBER, TEXT, Type, list_of, number_in

#: One measured value; the unit belongs to the name (temperature °C, humidity %, co2 ppm, light lx, soil 0-1).
SENSOR = Type("record", "sensor", fields={"name": TEXT, "value": NUMBER})

#: What the sensors at one tag measured in one poll; `stamp` is seconds of the bridge's clock.
READING = Type(
    "record",
    "reading",
    fields={
        "tag_id": TEXT,
        "stamp": number_in("s"),
        "sim_time_of_day_seconds": number_in("s"),
        "readings": list_of(SENSOR),
    },
)

SCAN_FAILED = Code("scan_failed", "scan failed")
UNKNOWN_TAG = Code("unknown_tag", "unknown tag")

MOCK_READ_S = 0.2
NOON_S = 12 * 3600.0


def mock_reading(arguments: Mapping[str, Any], _: Parameters) -> Mapping[str, Any]:
    """Return a plausible reading that differs from tag to tag and is the same every time."""
    tag_id = str(arguments["tag_id"])
    phase = sum(tag_id.encode()) % 16 / 16.0
    values = {
        "temperature": 21.0 + 4.0 * math.sin(2.0 * math.pi * phase),
        "humidity": 55.0 + 15.0 * math.cos(2.0 * math.pi * phase),
    }
    sensors = [{"name": name, "value": round(value, 3)} for name, value in values.items()]
    reading = {"tag_id": tag_id, "stamp": 0.0, "sim_time_of_day_seconds": NOON_S, "readings": sensors}
    return {"reading": reading}


PLUGIN = Plugin(
    name="bridge",
    doc="Sensor readings at the tags of the greenhouse.",
    operations={
        "read_tag": Operation(
            doc="Read all sensors at one tag once.",
            arguments={"tag_id": Argument(TEXT, "decimal id of the tag")},
            result={"reading": READING},
            codes=(SCAN_FAILED, UNKNOWN_TAG),
            on_hold=OnHold.FINISH,
            mock=Mock(after=MOCK_READ_S, result=mock_reading),
        ),
    },
    types={"reading": READING, "sensor": SENSOR},
    parameters={
        "bridge_service_name": Parameter(
            TEXT, "/greenhouse_bridge/get_tag_reading", "service that reads a tag (GetTagReading)"
        ),
    },
    client="lupin_bridge.client:BridgeClient",
    nodes={"greenhouse_bridge": "lupin_bridge.node:main"},
)
