"""The parameters of the aggregator and the twin that users know: names, defaults and least values.

The tables are those of the interface description. What it has and we do not, or otherwise, says why.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pytest

from lupin_engine.plugin.contract import Parameter
from lupin_perception.node import PARAMETERS as AGGREGATOR
from lupin_twin.node import PARAMETERS as TWIN

AGGREGATOR_TABLE: dict[str, Any] = {
    "tag_detections_topic": "/camera/tag_detections_json",
    "yolo_detections_topic": "/yolo/detections",
    "mission_state_topic": "/mission/state",
    "box_geometry_topic": "/perception/box_geometry_json",
    "discovered_tags_topic": "/perception/discovered_tags",
    "observations_topic": "/floranova/observations",
    "confirm_service": "/perception/confirm_tag",
    "joint_states_topic": "/joint_states",
    "tf_frame_prefix": "tag_",
    "min_sightings": 3,
    "max_tag_distance_m": 2.5,
    "freshness_s": 5.0,
    "yolo_min_confidence": 0.35,
    "flower_class_names": ["tulip_red", "tulip_white", "tulip_pink", "bug"],
    "anomaly_class_name": "bug",
    "publish_rate_hz": 2.0,
    "pan_joint_name": "shoulder_pan_joint",
    "detection_image_width": 640.0,
    "lateral_columns": 7,
    "box_width": 0.80,
    "box_depth": 0.40,
    "box_height": 0.30,
    "tag_lateral_offset": 0.0,
    "flower_base_depth_frac": 0.5,
    "flower_depth_jitter_frac": 0.18,
    "pan_half_span": 0.5,
    "camera_half_fov": 0.5,
    "flower_box_gate": True,
    "flower_box_gate_margin_m": 0.10,
    "attribute_when_idle": True,
    # of what were two nodes of their own
    "tag_locations_file": "",
    "refresh_period_s": 0.0,
    "tick_period_s": 0.5,
    "source_name": "passive_observer",
}
AGGREGATOR_LEFT_OUT = {
    "map_frame": "every pose of the interface is in frame map",
    "tag_mount_height": "blooms have z = 0, so no height is worked out",
    "yolo_window_s": "nothing has read it: a scan is a window of its own",
}
AGGREGATOR_OWN = {
    "reading_service",
    "memory_file",
    "base_frame",
    "tag_in_sight_s",
    "mission_freshness_s",
    "detection_delay_s",
    "anomaly_frames",
    "anomaly_spacing_m",
    "register_layout",
    "layout_max_error_m",
    "layout_min_spread_m",
    "passive_climate",
}

TWIN_TABLE: dict[str, Any] = {
    "observations_topic": "/floranova/observations",
    "state_topic": "/twin/state",
    "field_service_name": "/twin/get_field",
    "discovered_tags_topic": "/perception/discovered_tags",
    "box_geometry_topic": "/perception/box_geometry_json",
    "state_publish_rate_hz": 1.0,
    "frame_id": "map",
    "buffer_len": 32,
    "idw_power": 2.0,
    "idw_falloff_radius_m": 2.0,
    "max_distance_to_nearest_tag": 2.0,
}
TWIN_LEFT_OUT = {"idw_max_distance_m": "it is max_distance_to_nearest_tag, 2 m, and the falloff is as far"}
TWIN_OWN = {"map_topic", "store_file"}


@pytest.mark.parametrize(
    ("declared", "table", "left_out", "own"),
    [
        (AGGREGATOR, AGGREGATOR_TABLE, AGGREGATOR_LEFT_OUT, AGGREGATOR_OWN),
        (TWIN, TWIN_TABLE, TWIN_LEFT_OUT, TWIN_OWN),
    ],
    ids=["aggregator", "twin"],
)
def test_every_parameter_of_the_interface_is_there_with_its_default(
    declared: Mapping[str, Parameter], table: dict[str, Any], left_out: dict[str, str], own: set[str]
) -> None:
    assert {name: declared[name].default for name in table if name in declared} == table
    assert declared.keys() == table.keys() | own
    assert not declared.keys() & left_out.keys()


def test_rates_have_the_floors_of_the_interface() -> None:
    assert AGGREGATOR["publish_rate_hz"].minimum == 0.2
    assert TWIN["state_publish_rate_hz"].minimum == 0.1


def test_the_limits_of_confirming_and_discovering_have_their_units() -> None:
    """Metres, seconds and radians are told with each; the rates are per second."""
    units = {name: AGGREGATOR[name].type.unit for name in AGGREGATOR_TABLE if AGGREGATOR[name].type.unit}
    assert units == {
        "max_tag_distance_m": "m",
        "freshness_s": "s",
        "publish_rate_hz": "Hz",
        "detection_image_width": "px",
        "box_width": "m",
        "box_depth": "m",
        "box_height": "m",
        "tag_lateral_offset": "m",
        "pan_half_span": "rad",
        "camera_half_fov": "rad",
        "flower_box_gate_margin_m": "m",
        "refresh_period_s": "s",
        "tick_period_s": "s",
    }
