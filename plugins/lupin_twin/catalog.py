"""The catalog of the digital twin: its node, and the state of every tag as a live value."""

from __future__ import annotations

from lupin_engine.plugin import (
    BOOL,
    DURATION,
    NUMBER,
    ROS_NAME,
    TEXT,
    Access,
    LiveValue,
    Parameter,
    Plugin,
    Type,
    list_of,
    named_values,
)
from lupin_greenhouse import MEASURED, SENSOR

#: `age` is the time since the tag was observed; of one that never was, years.
TWIN_TAG = Type(
    "record",
    "twin_tag",
    fields={
        "id": TEXT,
        "age": DURATION,
        "species": TEXT,
        "species_confidence": NUMBER,
        "anomaly": BOOL,
        "readings": named_values(SENSOR, MEASURED),
    },
)

#: Seconds after which a published state, sent every second, is unknown.
FRESH_S = 10.0

PLUGIN = Plugin(
    name="twin",
    doc="The digital twin: the latest of every tag, kept through restarts, and sensor fields between them.",
    values={
        "twin.tags": LiveValue(
            "what the digital twin knows of each tag: its age, flowers and latest readings",
            list_of(TWIN_TAG),
            freshness=FRESH_S,
        )
    },
    types={"twin_tag": TWIN_TAG},
    parameters={
        "twin_state_topic": Parameter(ROS_NAME, "/twin/state", "topic of the digital twin (TwinState)"),
    },
    client="lupin_twin.client:TwinClient",
    nodes={"lupin_twin": "lupin_twin.node:main"},
    companions=("lupin_twin",),
    composable=("lupin_twin",),
    publishes=("/twin/state",),
    access=Access(viewer=("/twin/state", "/twin/get_field")),
    profile="greenhouse",
)
