"""Publishes the simulated detectors' frames: the input of the perception aggregator."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence

from geometry_msgs.msg import Quaternion, Transform, TransformStamped, Vector3
from std_msgs.msg import String

from lupin_ros.adapter import Qos, RosNode
from lupin_sim.camera import Plate, facing
from lupin_sim.detector import HEIGHT_M, flower_entries, readable, tag_entries, tag_in_robot
from lupin_sim.floor import Point
from lupin_sim.robot import FloorPose

BASE, CAMERA = "base_link", "camera_link"


class Detections:
    """Publishes tags and flowers in view, and the tags' transforms.

    `send` publishes transforms together with the robot's, with one stamp: a tag is placed by the pose from
    which it was seen.
    """

    def __init__(self, ros: RosNode, send: Callable[[Sequence[TransformStamped]], None]) -> None:
        self._send = send
        self._tags = ros.publisher(String, "/camera/tag_detections_json", Qos.DETECTION)
        self._flowers = ros.publisher(String, "/yolo/detections", Qos.DETECTION)

    def publish(self, pose: FloorPose, seen: Sequence[Plate], pests: Sequence[Point]) -> None:
        """Publish one frame of each camera, taken from `pose`."""
        plates = readable(seen)
        tags = [_transform(CAMERA, f"tag_{p.id}", tag_in_robot(pose, p), 0.0) for p in plates]
        camera = _transform(BASE, CAMERA, None, HEIGHT_M)
        self._send([camera, *tags])
        self._tags.publish(String(data=json.dumps(tag_entries(pose, plates))))
        self._flowers.publish(String(data=json.dumps(flower_entries(pose, plates, pests))))


def _transform(parent: str, child: str, plate: FloorPose | None, height: float) -> TransformStamped:
    """Return the transform to a plate, whose +Z is its normal; without one straight up by `height`."""
    place, turn = Vector3(z=height), Quaternion(w=1.0)
    if plate is not None:
        place.x, place.y = plate.x, plate.y
        turn.x, turn.y, turn.z, turn.w = facing(plate.yaw)
    message = TransformStamped(child_frame_id=child)
    message.header.frame_id = parent
    message.transform = Transform(translation=place, rotation=turn)
    return message
