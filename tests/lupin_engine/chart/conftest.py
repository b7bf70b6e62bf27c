"""A catalog of made-up plugins with the signatures that the shipped missions use."""

from __future__ import annotations

import pytest

from lupin_engine.plugin.contract import (
    Action,
    Argument,
    Code,
    EventKind,
    Function,
    LiveValue,
    OnHold,
    Operation,
    Parameter,
    Plugin,
    Reader,
)
from lupin_engine.plugin.registry import Catalog, build_catalog
from lupin_engine.plugin.types import BOOL, DURATION, LENGTH, NUMBER, POSE, TEXT, Type, list_of
from lupin_greenhouse.profile import PROFILE

TAG = Type("record", "tag", fields={"id": TEXT, "x": LENGTH, "y": LENGTH})
READING = Type("record", "reading")
POSE_ARGUMENT = Argument(POSE, "where to")
VARIANCE = Argument(NUMBER, "largest variance to set off with")
NAV_CODES = tuple(
    Code(name, name.replace("_", " "))
    for name in ("nav_rejected", "nav_status_5", "nav_status_6", "amcl_drift_var")
)

NAV = Plugin(
    name="nav",
    doc="Driving.",
    operations={
        "localize": Operation(
            "Wait until the pose is known.", arguments={"max_variance": VARIANCE}, updates=True
        ),
        "go_to": Operation(
            "Drive to a pose.",
            arguments={"pose": POSE_ARGUMENT, "max_variance": VARIANCE},
            codes=NAV_CODES,
            uses=("base",),
            on_hold=OnHold.CANCEL,
        ),
        "dock": Operation(
            "Drive home.",
            arguments={"pose": POSE_ARGUMENT},
            codes=NAV_CODES,
            uses=("base",),
            on_hold=OnHold.CANCEL,
        ),
        "measure": Operation("Drive along.", result={"m": LENGTH}, on_hold=OnHold.CANCEL, cut_short=True),
        "seek": Operation("Look for a place.", result={"place": POSE}, on_hold=OnHold.CANCEL),
    },
    functions={
        "approach": Function("Where to stand.", POSE, lambda _: dict, {"target": Argument(TAG, "tag")}),
        "home_pose": Function("Where the dock is.", POSE, lambda _: dict, {"pose": Argument(POSE, "pose")}),
    },
    values={"robot.pose": LiveValue("Where the robot is.", POSE, freshness=2.0)},
    events={
        "blocked": EventKind("Something stands in the way.", {"where": POSE, "seconds": DURATION}),
        "battery_silent": EventKind("Its charge is unknown.", {"source": TEXT}),
    },
    parameters={"dock_pose": Parameter(POSE, {"x": 0.0, "y": 0.0, "yaw": 0.0}, "where the dock is")},
)
BRIDGE = Plugin(
    name="bridge",
    doc="The greenhouse.",
    operations={
        "read_tag": Operation(
            "Read a tag.",
            arguments={"tag_id": Argument(TEXT, "tag")},
            result={"reading": READING},
            codes=(Code("bridge_error", "bridge error"),),
        )
    },
    functions={
        "tags.numeric_order": Function("All tags.", list_of(TAG), lambda _: list),
        "tags.named": Function(
            "Tags by name.", list_of(TAG), lambda _: list, {"names": Argument(list_of(TEXT), "ids")}
        ),
    },
    values={
        "robot.estop": LiveValue("E-stop.", BOOL),
        "robot.battery": LiveValue("Charge.", NUMBER, initial=1.0),
        "robot.battery_source": LiveValue("Who tells it.", TEXT, initial=""),
    },
    types={"tag": TAG},
    readers={"tag": Reader(Code("unknown_tag", "unknown tag"), lambda _: lambda value: value)},
    parameters={"tag_sequence": Parameter(list_of(TEXT), [], "tags to visit")},
)
PERCEPTION = Plugin(
    name="perception",
    doc="Looking.",
    operations={
        "confirm_tag": Operation(
            "Look for a tag.",
            arguments={
                "tag_id": Argument(TEXT, "tag"),
                "within": Argument(DURATION, "how long it looks", optional=True),
            },
            codes=(Code("not_visible", "tag not visible"),),
        )
    },
)
ARM = Plugin(
    name="arm",
    doc="The arm.",
    actions={"preset": Action("Move the arm.", {"name": Argument(TEXT, "preset")}, moves=True)},
    parameters={"arm_patrol_enabled": Parameter(BOOL, False, "whether missions move the arm")},
)


@pytest.fixture(scope="session")
def catalog() -> Catalog:
    """What nav, bridge, perception and arm offer, as far as the shipped missions use it."""
    return build_catalog([NAV, BRIDGE, PERCEPTION, ARM], [PROFILE])
