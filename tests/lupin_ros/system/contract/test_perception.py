"""The plugin `perception` keeps the contract, whether missions insist on it or not."""

from __future__ import annotations

from typing import Any, ClassVar

import pytest
from geometry_msgs.msg import Pose, Quaternion

from lupin_harness.cases import CatalogContract, DriverContract
from lupin_msgs.msg import DiscoveredTag, DiscoveredTags
from lupin_msgs.srv import ConfirmTag
from lupin_ros.adapter.node import Qos, RosNode

pytestmark = pytest.mark.timeout(120)


class TestCatalog(CatalogContract):
    """Without ROS."""

    plugin = "perception"


class TestDriver(DriverContract):
    """Over ROS 2, with cameras that see every tag, and have seen one; the mission does without them."""

    plugin = "perception"
    arguments: ClassVar = {"confirm_tag": {"tag_id": "3"}}
    nodes = ()
    waits = False

    @staticmethod
    def offer(ros: RosNode) -> None:
        """See tags."""

        def answer(request: Any, response: Any) -> Any:
            response.detected, response.detection_confidence = True, 0.9
            return response

        ros.serve(ConfirmTag, "/perception/confirm_tag", answer)
        seen = DiscoveredTag(tag_id="3", pose_in_map=Pose(orientation=Quaternion(w=1.0)), sightings=4)
        ros.publisher(DiscoveredTags, "/perception/discovered_tags", Qos.LATCHED).publish(
            DiscoveredTags(tags=[seen])
        )


class TestInsistingDriver(TestDriver):
    """The same for missions that insist on it: then the driver waits for the cameras."""

    parameters: ClassVar = {"require_visual_confirmation": True}
    waits = True
