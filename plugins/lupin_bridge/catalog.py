"""The catalog of the greenhouse bridge: its operation, types and parameters."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from lupin_engine.plugin import (
    BOOL,
    DURATION,
    INTEGER,
    NUMBER,
    ROS_NAME,
    TEXT,
    Access,
    Argument,
    Code,
    Mock,
    OnHold,
    Operation,
    Parameter,
    Parameters,
    Plugin,
    Type,
    list_of,
    named_values,
    number_in,
    one_of,
)
from lupin_greenhouse import MEASURED, SENSOR

#: What the sensors at one tag measured in one poll; `stamp` is seconds of the bridge's clock.
READING = Type(
    "record",
    "reading",
    fields={
        "tag_id": TEXT,
        "stamp": number_in("s"),
        "sim_time_of_day_seconds": number_in("s"),
        "readings": named_values(SENSOR, MEASURED),
    },
)

SCAN_FAILED = Code(
    "scan_failed", "scan failed", advice="Look at the bridge: its answer is in the observation."
)
UNKNOWN_TAG = Code("unknown_tag", "unknown tag", advice="Name a tag that the greenhouse has.")

MOCK_READ_S = 0.2
NOON_S = 12 * 3600.0


def mock_reading(arguments: Mapping[str, Any], _: Parameters) -> Mapping[str, Any]:
    """Return a plausible reading, a fixed one for each tag."""
    tag_id = str(arguments["tag_id"])
    phase = sum(tag_id.encode()) % 16 / 16.0
    values = {
        "temperature": 21.0 + 4.0 * math.sin(2.0 * math.pi * phase),
        "humidity": 55.0 + 15.0 * math.cos(2.0 * math.pi * phase),
    }
    sensors = [{"name": name, "value": round(value, 3)} for name, value in values.items()]
    reading = {"tag_id": tag_id, "stamp": 0.0, "sim_time_of_day_seconds": NOON_S, "readings": sensors}
    return {"reading": reading}


def reading_of(values: Mapping[str, float]) -> Mapping[str, Any]:
    """Return a reading with these values."""
    sensors = [{"name": name, "value": value} for name, value in values.items()]
    return {"reading": {"tag_id": "1", "stamp": 0.0, "sim_time_of_day_seconds": NOON_S, "readings": sensors}}


#: A frost, a heat, and a tag at which nothing was measured.
READINGS = (
    reading_of({"temperature": -2.0, "humidity": 90.0}),
    reading_of({"temperature": 38.0, "humidity": 20.0}),
    reading_of({}),
)

#: Where readings come from.
BACKENDS = ("simulator", "recorded", "mqtt")
#: The ways to replay a recording.
RECORDING_CLOCKS = ("time_of_day", "since_start")

#: Of the node `greenhouse_bridge`. What a backend has no use for is left alone by it.
NODE_PARAMETERS: Mapping[str, Parameter] = {
    "backend": Parameter(one_of(*BACKENDS), "simulator", "where readings come from"),
    "tag_file": Parameter(
        TEXT, "", "layout of the greenhouse, JSON; empty: the simulator's own, or whatever tags there are"
    ),
    "tag_locations_file": Parameter(
        TEXT, "", "the layout under the name that the other nodes know it by; read where tag_file is empty"
    ),
    "max_age": Parameter(
        DURATION, 900.0, "older values of a recording or a sensor are not served", minimum=0.1
    ),
    "debug_time_of_day": Parameter(
        NUMBER,
        -1.0,
        "hours; from 0 on the time of day of simulator or recording stands still there",
        minimum=-1.0,
        maximum=24.0,
    ),
    "speedup_factor": Parameter(
        NUMBER,
        0.0,
        "above 0: seconds of the simulator, or of a recording since its start, in a second",
        minimum=0.0,
    ),
    "sim_config_file": Parameter(TEXT, "", "simulator: climate, YAML; empty: its own"),
    "debug_seed": Parameter(
        INTEGER,
        -1,
        "simulator: from 0 on the noise is repeatable and the time of day stands still",
        minimum=-1,
    ),
    "recording_file": Parameter(TEXT, "", "recorded: the readings, CSV"),
    "recording_clock": Parameter(
        one_of(*RECORDING_CLOCKS),
        "time_of_day",
        "recorded: replay by time_of_day, or since_start of the bridge",
    ),
    "mqtt_host": Parameter(TEXT, "localhost", "mqtt: the broker's name or address"),
    "mqtt_port": Parameter(
        INTEGER, 0, "mqtt: the broker's port; 0: 1883, or 8883 with TLS", minimum=0, maximum=65535
    ),
    "mqtt_topic": Parameter(TEXT, "greenhouse/{tag}/{sensor}", "mqtt: the topics of the sensors"),
    "mqtt_units": Parameter(
        list_of(TEXT), [], "mqtt: the unit of sensors whose messages name none, such as soil_moisture=%"
    ),
    "mqtt_tls": Parameter(BOOL, False, "mqtt: encrypt, and check that the broker is the right one"),
    "mqtt_ca_file": Parameter(TEXT, "", "mqtt: who signs the broker's certificate; empty: the system's"),
    "mqtt_certificate_file": Parameter(TEXT, "", "mqtt: our certificate, where the broker wants one"),
    "mqtt_key_file": Parameter(TEXT, "", "mqtt: the key of our certificate"),
    "mqtt_credentials_file": Parameter(
        TEXT,
        "",
        "mqtt: user and password, one a line; empty: LUPIN_MQTT_USER and LUPIN_MQTT_PASSWORD",
    ),
}

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
            classes=READINGS,
        ),
    },
    types={"reading": READING, "sensor": SENSOR},
    parameters={
        "bridge_service_name": Parameter(
            ROS_NAME, "/greenhouse_bridge/get_tag_reading", "service that reads a tag (GetTagReading)"
        ),
    },
    client="lupin_bridge.client:BridgeClient",
    serves=("/greenhouse_bridge/get_tag_reading",),
    access=Access(operator=("/greenhouse_bridge/get_tag_reading",)),
    nodes={"greenhouse_bridge": "lupin_bridge.node:main"},
    composable=("greenhouse_bridge",),
)
