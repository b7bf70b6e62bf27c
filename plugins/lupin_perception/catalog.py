"""The catalog of perception: operations, values, parameters. Loads without ROS."""

from __future__ import annotations

from lupin_engine.plugin import (
    BOOL,
    COUNT,
    DURATION,
    LENGTH,
    NUMBER,
    ROS_NAME,
    TEXT,
    Access,
    Argument,
    Code,
    LiveValue,
    Mock,
    OnHold,
    Operation,
    Parameter,
    Plugin,
    Type,
    list_of,
)

#: A tag that was seen: its id and position in metres in frame `map`, the rotation of its plate (+Z is the
#: plate's normal; x, y, z, w as in ROS), the dominant flower with its confidence (0 to 1), whether a pest was
#: seen there, and how many confident detections were fused into this.
DISCOVERED_TAG = Type(
    "record",
    "discovered_tag",
    fields={
        "id": TEXT,
        "x": LENGTH,
        "y": LENGTH,
        "facing": Type("record", "quaternion", fields=dict.fromkeys("xyzw", NUMBER)),
        "species": TEXT,
        "species_confidence": NUMBER,
        "anomaly": BOOL,
        "sightings": COUNT,
    },
)

PLUGIN = Plugin(
    name="perception",
    doc="What the cameras know about the tags.",
    operations={
        "confirm_tag": Operation(
            doc="Look whether the robot stands in front of the expected tag; only the detection decides.",
            arguments={
                "tag_id": Argument(TEXT, "id of the tag that should be in sight"),
                "within": Argument(
                    DURATION, "how long it may take until the tag is seen; without it one look", optional=True
                ),
            },
            result={"confidence": NUMBER},
            codes=(
                Code(
                    "visual_confirm_missed",
                    "tag not seen",
                    advice="Look whether the tag is dirty, or its place in the layout is wrong.",
                ),
                Code(
                    "confirm_failed",
                    "visual confirmation failed",
                    advice="Look at the cameras, and at who serves confirm_tag.",
                ),
            ),
            on_hold=OnHold.FINISH,
            mock=Mock(after=0.2, result={"confidence": 1.0}),
            classes=({"confidence": 0.5}, {"confidence": 0.0}),
        ),
    },
    values={
        "tags.discovered": LiveValue("all tags that were seen so far", list_of(DISCOVERED_TAG)),
    },
    types={"discovered_tag": DISCOVERED_TAG},
    parameters={
        "discovered_tags_topic": Parameter(
            ROS_NAME, "/perception/discovered_tags", "topic of the tags that were seen (DiscoveredTags)"
        ),
        "visual_confirmation_service": Parameter(
            ROS_NAME, "/perception/confirm_tag", "service that confirms a tag (ConfirmTag)"
        ),
    },
    client="lupin_perception.client:PerceptionClient",
    serves=("/perception/confirm_tag",),
    publishes=("/perception/discovered_tags", "/perception/box_geometry_json"),
    access=Access(
        viewer=(
            "/perception/discovered_tags",
            "/perception/box_geometry_json",
            "/camera/tag_detections_json",
            "/yolo/detections",
        ),
        engineer=("/perception/confirm_tag",),
    ),
    nodes={"perception_aggregator": "lupin_perception.node:main"},
    composable=("perception_aggregator",),
)
