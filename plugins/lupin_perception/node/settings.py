"""The parameters of the aggregator, their checks, and the rules made of them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from lupin_engine.errors import LupinError, Problems, nearest
from lupin_engine.plugin import (
    ANGLE,
    BOOL,
    COUNT,
    DURATION,
    LENGTH,
    NUMBER,
    ROS_NAME,
    TEXT,
    Parameter,
    list_of,
    number_in,
)
from lupin_greenhouse import SILENCE_S, layout
from lupin_perception.boxes import BoxView
from lupin_perception.flowers import Rules

_CLASSES = ["tulip_red", "tulip_white", "tulip_pink", "bug"]

TOPICS = {
    "tag_detections_topic": Parameter(ROS_NAME, "/camera/tag_detections_json", "tags in each frame (JSON)"),
    "yolo_detections_topic": Parameter(ROS_NAME, "/yolo/detections", "flowers in each frame (JSON)"),
    "mission_state_topic": Parameter(ROS_NAME, "/mission/state", "state of the mission (MissionState)"),
    "box_geometry_topic": Parameter(
        ROS_NAME, "/perception/box_geometry_json", "planter boxes by the layout (JSON), told or taken"
    ),
    "joint_states_topic": Parameter(ROS_NAME, "/joint_states", "joints of the arm (JointState)"),
    "discovered_tags_topic": Parameter(
        ROS_NAME, "/perception/discovered_tags", "tags that were seen (DiscoveredTags)"
    ),
    "observations_topic": Parameter(
        ROS_NAME, "/floranova/observations", "what was found at tags (Observation)"
    ),
    "confirm_service": Parameter(ROS_NAME, "/perception/confirm_tag", "confirms a tag (ConfirmTag)"),
    "reading_service": Parameter(
        ROS_NAME, "/greenhouse_bridge/get_tag_reading", "reads the sensors at a tag (GetTagReading)"
    ),
    "memory_file": Parameter(
        TEXT, "", "what outlives this process (JSON); empty: in the user's state; none: nothing is kept"
    ),
}
TAGS = {
    "base_frame": Parameter(TEXT, "base_link", "frame of the robot: where a pest at no tag is reported"),
    "tf_frame_prefix": Parameter(TEXT, "tag_", "a tag's frame is this and its id"),
    "min_sightings": Parameter(COUNT, 3, "views of a tag that make a discovery", minimum=1),
    "max_tag_distance_m": Parameter(LENGTH, 2.5, "farthest view that counts; 0: any", minimum=0.0),
    "freshness_s": Parameter(DURATION, 5.0, "how long ago a confirmed tag may have been seen"),
    "tag_in_sight_s": Parameter(DURATION, 1.0, "how long a tag counts as in sight after its last frame"),
    "publish_rate_hz": Parameter(
        number_in("Hz"), 2.0, "messages about the tags in a second", minimum=0.2, maximum=100.0
    ),
    "mission_freshness_s": Parameter(
        DURATION, SILENCE_S, "without a word of the mission for so long none is under way", minimum=0.5
    ),
}
FLOWERS = {
    "flower_class_names": Parameter(list_of(TEXT), _CLASSES, "classes of the detector, by their number"),
    "anomaly_class_name": Parameter(TEXT, "bug", "the class that is a pest, not a species"),
    "yolo_min_confidence": Parameter(NUMBER, 0.35, "least confidence that counts", 0.0, 1.0),
    "detection_image_width": Parameter(
        number_in("px"), 640.0, "width of the image that flowers are seen in", minimum=1.0
    ),
    "pan_joint_name": Parameter(TEXT, "shoulder_pan_joint", "joint that turns the camera to the side"),
    "pan_half_span": Parameter(ANGLE, 0.5, "pan at which the camera's middle sees a box's edge", 0.0, 3.14),
    "camera_half_fov": Parameter(ANGLE, 0.5, "half of what the camera sees across", 0.01, 1.57),
    "attribute_when_idle": Parameter(
        BOOL, True, "without a mission, credit flowers to the nearest tag in sight"
    ),
    "detection_delay_s": Parameter(
        DURATION, 0.1, "how late detections come: for so long those of the last target are left out", 0.0
    ),
    "anomaly_frames": Parameter(COUNT, 3, "frames in a row that make a report of a pest at no tag", 1),
    "anomaly_spacing_m": Parameter(
        LENGTH, 1.0, "nearer to an earlier report a pest at no tag is not reported again", minimum=0.0
    ),
}
BOXES = {
    "box_width": Parameter(LENGTH, 0.80, "width of a planter box along the aisle", 0.01, 10.0),
    "box_depth": Parameter(LENGTH, 0.40, "depth of a planter box", 0.01, 10.0),
    "tag_lateral_offset": Parameter(LENGTH, 0.0, "middle of the box, to the right of its tag", -10.0, 10.0),
    "lateral_columns": Parameter(COUNT, 7, "columns across a box, of at most one bloom each", 1, 99),
    "flower_base_depth_frac": Parameter(NUMBER, 0.5, "share of the depth that blooms are drawn at", 0.0, 1.0),
    "flower_depth_jitter_frac": Parameter(
        NUMBER, 0.18, "share of the depth that drawn blooms scatter by, to either side; cosmetic", 0.0, 0.5
    ),
    "flower_box_gate": Parameter(BOOL, True, "leave out detections beside a box that the layout knows"),
    "flower_box_gate_margin_m": Parameter(LENGTH, 0.10, "how far beside the box still counts", 0.0, 10.0),
}
LAYOUT = {
    "register_layout": Parameter(
        BOOL, True, "lay the known layout over the map and tell its boxes; false: take those that others tell"
    ),
    "tag_locations_file": Parameter(TEXT, "", "layout of the greenhouse, JSON; empty: the bundled one"),
    "box_height": Parameter(LENGTH, 0.30, "height of a planter box, told with it", 0.0, 10.0),
    "layout_max_error_m": Parameter(
        LENGTH, 0.15, "farthest that a tag may be from where the layout has it", minimum=0.001
    ),
    "layout_min_spread_m": Parameter(
        LENGTH, 0.40, "tags nearer to their middle do not tell how the layout is turned", minimum=0.001
    ),
}
IDLE = {
    "passive_climate": Parameter(BOOL, True, "without a mission, read the tags that are known"),
    "refresh_period_s": Parameter(DURATION, 0.0, "read each so often; 0: once", minimum=0.0),
    "tick_period_s": Parameter(DURATION, 0.5, "time between two looks for tags to read", minimum=0.05),
    "source_name": Parameter(TEXT, "passive_observer", "source of the readings without a mission"),
}
PARAMETERS: Mapping[str, Parameter] = {**TOPICS, **TAGS, **FLOWERS, **BOXES, **LAYOUT, **IDLE}


def check(values: Mapping[str, Any]) -> None:
    """Check that parameters fit each other, and that the layout can be used.

    Raises:
        LupinError: all errors.
    """
    problems = Problems()
    with problems.collecting():
        if values["register_layout"]:
            layout.load(values["tag_locations_file"])
    with problems.collecting():
        fusion_rules(values)
    problems.raise_any()


def fusion_rules(values: Mapping[str, Any]) -> Rules:
    """Return the rules of fusion.

    Raises:
        LupinError: the pest is not among the detector's classes.
    """
    anomaly, classes = values["anomaly_class_name"], values["flower_class_names"]
    if anomaly not in classes:
        hint = nearest(anomaly, classes)
        raise LupinError(f"parameter 'anomaly_class_name': no {anomaly!r} in flower_class_names; {hint}")
    return Rules(
        view=BoxView(values["pan_half_span"], values["camera_half_fov"]),
        columns=values["lateral_columns"],
        anomaly=anomaly,
        min_confidence=values["yolo_min_confidence"],
        gated=values["flower_box_gate"],
        margin=values["flower_box_gate_margin_m"],
    )
