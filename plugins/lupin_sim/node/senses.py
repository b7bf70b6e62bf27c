"""The simulated robot's senses: the map revealed as it drives, and its cameras' detections.

Cameras report what they see frame by frame, as the real ones do; placing and discovering tags is the
aggregator's work.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import OccupancyGrid

from lupin_engine.errors import LupinError
from lupin_engine.plugin import ANGLE, BOOL, LENGTH, NUMBER, Parameter, list_of
from lupin_ros.adapter import Qos, RosNode
from lupin_sim.camera import Camera
from lupin_sim.floor import Point
from lupin_sim.layout import Floorplan
from lupin_sim.lidar import ORIGIN_X, ORIGIN_Y, RESOLUTION, GrowingMap, Lidar
from lupin_sim.node.detections import Detections
from lupin_sim.robot import FloorPose

#: The least seconds between two maps, and the most: not everybody hears what is latched.
PUBLISH_S, REPUBLISH_S = 0.5, 5.0

PARAMETERS = {
    "lidar_range": Parameter(LENGTH, 1.5, "how far the robot sees walls and tables", minimum=0.1),
    "tag_range": Parameter(LENGTH, 1.0, "how far the cameras make out tags and pests", minimum=0.1),
    "tag_field_of_view": Parameter(
        ANGLE, 1.05, "angle that the camera sees, left and right together", minimum=0.01, maximum=6.28
    ),
    "detector": Parameter(
        BOOL, True, "whether the cameras tell what they detect; false where other detectors do"
    ),
    "pests": Parameter(
        list_of(NUMBER), [], "places of pests that sit at no tag, in metres: x1, y1, x2, y2, ..."
    ),
}


class Senses:
    """Looks around from the robot's pose, and publishes the results."""

    def __init__(
        self,
        ros: RosNode,
        layout: Floorplan,
        values: Mapping[str, Any],
        send: Callable[[Sequence[TransformStamped]], None],
    ) -> None:
        """`send` publishes sensed transforms together with the robot's own."""
        self._ros = ros
        self._send = send
        self._map = GrowingMap(Lidar(layout, values["lidar_range"]))
        self._camera = Camera(
            layout, values["tag_range"], values["tag_field_of_view"], places(values["pests"])
        )
        self._mapped_from: tuple[float, float] | None = None
        self._mission_id = ""
        self._published = ros.elapsed()
        self._maps = ros.publisher(OccupancyGrid, "/map", Qos.LATCHED)
        self._detections = Detections(ros, send) if values["detector"] else None
        ros.timer(PUBLISH_S, self.publish_map)

    def look(self, pose: FloorPose) -> None:
        """Look around from `pose`; publish that pose and the detections."""
        if self._mapped_from != (pose.x, pose.y):  # turning shows the lidar nothing new
            self._mapped_from = pose.x, pose.y
            self._map.reveal(pose.x, pose.y)
        if self._detections is None:
            self._send([])
        else:
            self._detections.publish(pose, self._camera.sees(pose), self._camera.pests(pose))

    def publish_map(self) -> None:
        """Publish the map if it has changed, or if the last message is old."""
        now = self._ros.elapsed()
        if self._map.changed or now - self._published >= REPUBLISH_S:
            self._published = now
            self._maps.publish(self._grid())

    def hear_mission(self, mission_id: str) -> None:
        """Clear the map when a mission begins: in a known greenhouse there is nothing to explore."""
        if mission_id not in ("", self._mission_id):
            self._mission_id = mission_id
            self._map.forget()
            self._mapped_from = None

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


def places(numbers: Sequence[float]) -> list[Point]:
    """Return numbers as places, two each.

    Raises:
        LupinError: the count is odd.
    """
    if len(numbers) % 2:
        raise LupinError(f"parameter 'pests': expected x and y of each place, got {len(numbers)} numbers")
    return list(zip(numbers[::2], numbers[1::2], strict=True))
