"""What the simulated robot makes of its surroundings: the map that grows as it drives, and the tags it sees.

Without an aggregator the tags that were found are told on its topic. For one that is there, parameter
`detector` has the cameras tell what they see, frame by frame.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from geometry_msgs.msg import Pose as PoseMessage
from geometry_msgs.msg import Quaternion, TransformStamped
from nav_msgs.msg import OccupancyGrid

from lupin_engine.middleware.node import Qos, RosNode
from lupin_engine.plugin.contract import Parameter
from lupin_engine.plugin.types import ANGLE, BOOL, COUNT, LENGTH
from lupin_msgs.msg import DiscoveredTag, DiscoveredTags, MissionState
from lupin_sim.camera import Camera, Plate, facing
from lupin_sim.layout import Layout
from lupin_sim.lidar import ORIGIN_X, ORIGIN_Y, RESOLUTION, GrowingMap, Lidar
from lupin_sim.node.detections import Detections
from lupin_sim.robot import Pose
from lupin_sim.sightings import Sightings

#: Seconds between two messages about the tags, and the least between two maps.
TELL_S = 0.5

PARAMETERS = {
    "lidar_range": Parameter(LENGTH, 1.5, "how far the robot sees walls and tables", minimum=0.1),
    "tag_range": Parameter(LENGTH, 1.0, "how far the camera reads tags", minimum=0.1),
    "tag_field_of_view": Parameter(
        ANGLE, 1.05, "angle that the camera sees, left and right together", minimum=0.01, maximum=6.28
    ),
    "min_sightings": Parameter(COUNT, 3, "views of a tag that make a discovery", minimum=1),
    "feed_tags": Parameter(
        BOOL, True, "whether to publish /perception/discovered_tags; false where the aggregator does"
    ),
    "detector": Parameter(
        BOOL, False, "publish what the cameras detect in each frame, for the aggregator, instead of feed_tags"
    ),
}


class Senses:
    """Looks around from wherever the robot is, and tells everybody."""

    def __init__(
        self,
        ros: RosNode,
        layout: Layout,
        values: Mapping[str, Any],
        send: Callable[[Sequence[TransformStamped]], None],
    ) -> None:
        """`send` publishes transforms of what is sensed together with the robot's own."""
        self._ros = ros
        self._map = GrowingMap(Lidar(layout, values["lidar_range"]))
        self._camera = Camera(layout, values["tag_range"], values["tag_field_of_view"])
        self._sightings = Sightings(values["min_sightings"], ros.stamp())
        self._mapped_from: tuple[float, float] | None = None
        self._maps = ros.publisher(OccupancyGrid, "/map", Qos.LATCHED)
        self._tags = None
        self._detections = Detections(ros, send) if values["detector"] else None
        if values["feed_tags"] and self._detections is None:
            self._tags = ros.publisher(DiscoveredTags, "/perception/discovered_tags", Qos.LATCHED)
        ros.subscribe(MissionState, "/mission/state", Qos.LATCHED, self._on_mission)
        ros.timer(TELL_S, self._tell)

    def look(self, pose: Pose) -> None:
        """Look around from `pose`."""
        if self._mapped_from != (pose.x, pose.y):  # turning shows the lidar nothing new
            self._mapped_from = pose.x, pose.y
            self._map.reveal(pose.x, pose.y)
        seen = self._camera.sees(pose)
        self._sightings.add(seen, self._ros.stamp())
        if self._detections is not None:
            self._detections.tell(pose, seen)

    def tell_map(self) -> None:
        """Publish the map if there is anything new in it."""
        if self._map.changed:
            self._maps.publish(self._grid())

    def _tell(self) -> None:
        self.tell_map()
        self._tell_tags()

    def _tell_tags(self) -> None:
        if self._tags is not None:
            message = DiscoveredTags(tags=[_tag(*found) for found in self._sightings.discovered])
            message.header.frame_id = "map"
            message.header.stamp = self._sightings.since
            self._tags.publish(message)

    def _on_mission(self, message: MissionState) -> None:
        began = self._sightings.follow(message.mission_id, message.lifecycle_state, self._ros.stamp())
        if began:
            # The map too: one who searches a greenhouse that is known already finds nothing to search.
            self._map.forget()
            self._mapped_from = None
            self._tell_tags()

    def _grid(self) -> OccupancyGrid:
        cells = self._map.take()
        message = OccupancyGrid()
        message.header.frame_id = "map"
        message.header.stamp = message.info.map_load_time = self._ros.stamp()
        message.info.resolution = RESOLUTION
        message.info.height, message.info.width = cells.shape
        message.info.origin.position.x, message.info.origin.position.y = ORIGIN_X, ORIGIN_Y
        message.data.frombytes(cells.tobytes())
        return message


def _tag(plate: Plate, sightings: int) -> DiscoveredTag:
    pose = PoseMessage()
    pose.position.x, pose.position.y = plate.x, plate.y
    x, y, z, w = facing(plate.yaw)
    pose.orientation = Quaternion(x=x, y=y, z=z, w=w)
    return DiscoveredTag(tag_id=plate.id, pose_in_map=pose, sightings=min(sightings, 2**32 - 1))
