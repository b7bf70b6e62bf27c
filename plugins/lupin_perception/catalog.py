"""What perception offers a mission, as data: loads without ROS."""

from __future__ import annotations

from lupin_engine.plugin.contract import Argument, Code, Mock, OnHold, Operation, Parameter, Plugin
from lupin_engine.plugin.types import NUMBER, TEXT

PLUGIN = Plugin(
    name="perception",
    doc="What the cameras know about the tags.",
    operations={
        "confirm_tag": Operation(
            doc="Look whether the robot stands in front of the expected tag; only the detection decides.",
            arguments={"tag_id": Argument(TEXT, "id of the tag that should be in sight")},
            result={"confidence": NUMBER},
            codes=(
                Code("visual_confirm_missed", "tag not seen"),
                Code("confirm_failed", "visual confirmation failed"),
            ),
            on_hold=OnHold.FINISH,
            mock=Mock(after=0.2, result={"confidence": 1.0}),
        ),
    },
    parameters={
        "visual_confirmation_service": Parameter(
            TEXT, "/perception/confirm_tag", "service that confirms a tag (ConfirmTag)"
        ),
    },
    client="lupin_perception.client:PerceptionClient",
)
