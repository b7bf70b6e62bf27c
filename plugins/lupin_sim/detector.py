"""Simulates the frames of the two detectors: tags with their corners, and flowers.

Metres, radians, pixels. Both cameras look ahead from the robot's pose: one reads tags (with the intrinsics of
the real stack's simulated camera), the one on the gripper sees flowers. Plates are at camera height. The
blooms behind a tag follow from its id, so every run is the same.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from lupin_greenhouse import PLATE_M
from lupin_sim.camera import Plate
from lupin_sim.floor import Point
from lupin_sim.robot import FloorPose

#: Height of cameras and plates above the floor.
HEIGHT_M = 0.1
#: Focal length, and size and middle of the image, of the camera that reads tags.
FOCAL_PX = 554.25
IMAGE_PX = (640.0, 480.0)
CENTRE_PX = (320.5, 240.5)
#: Nearer things are drawn as if they were here.
NEAREST_M = 0.05
#: Half of what the camera on the gripper sees across.
HALF_FIELD = 0.5

#: Digits of the longest id that a tag can have: the largest families have some thousands of tags.
MOST_DIGITS = 9
#: Classes of the detector of flowers, by their number; the last one is a pest.
CLASSES = ("tulip_red", "tulip_white", "tulip_pink", "bug")
SPECIES = 3
PEST = 3
#: Every so many-th tag has a pest.
PEST_EVERY = 5
#: Inner size of a box, how far to either side of its tag blooms stand, and half their width in the image.
BOX_WIDTH_M, BOX_DEPTH_M = 0.8, 0.4
OUTERMOST = 0.6
BLOOM_PX = 20.0


@dataclass(frozen=True)
class SimulatedBloom:
    """A bloom in a box: its class, its confidence (0 to 1), and its place across, -1 to 1 from the left."""

    kind: int
    confidence: float
    fraction: float


#: A pest at no tag.
STRAY = SimulatedBloom(PEST, 0.8, 0.0)


def blooms_of(tag_id: str) -> tuple[SimulatedBloom, ...]:
    """Return the blooms behind a tag: two to four of one species, sometimes with a pest."""
    number = sum(tag_id.encode()) if not tag_id.isdecimal() else int(tag_id)
    count = 2 + number // SPECIES % 3
    step = 2.0 * OUTERMOST / (count - 1)
    blooms = [SimulatedBloom(number % SPECIES, 0.9 - 0.05 * i, step * i - OUTERMOST) for i in range(count)]
    if number % PEST_EVERY == 0:
        blooms.append(SimulatedBloom(PEST, 0.8, 0.0))
    return tuple(blooms)


def readable(plates: Iterable[Plate]) -> list[Plate]:
    """Return the plates that a detector can report: with an id of digits, at most `MOST_DIGITS`."""
    numbered = (plate for plate in plates if plate.id.isascii() and plate.id.isdecimal())
    return [plate for plate in numbered if len(plate.id) <= MOST_DIGITS]


def tag_in_robot(pose: FloorPose, plate: Plate) -> FloorPose:
    """Return the pose of a plate in the frame of a robot at `pose`."""
    forward, left = _ahead(pose, plate.x, plate.y)
    return FloorPose(forward, left, plate.yaw - pose.yaw)


def tag_entries(pose: FloorPose, plates: Iterable[Plate]) -> list[dict[str, Any]]:
    """Return a frame of the tag detector: id, corners clockwise from the upper left, and distance ahead.

    Plates must be `readable`: ValueError for another id.
    """
    return [_tag_entry(tag_in_robot(pose, plate), plate) for plate in plates]


def _tag_entry(seen: FloorPose, plate: Plate) -> dict[str, Any]:
    # To the right of whoever looks at the plate.
    across = (-math.sin(seen.yaw) * PLATE_M / 2, math.cos(seen.yaw) * PLATE_M / 2)
    corners = [
        _pixel(seen.x + side * across[0], seen.y + side * across[1], up * PLATE_M / 2)
        for side, up in ((-1, 1), (1, 1), (1, -1), (-1, -1))
    ]
    return {"id": int(plate.id), "corners": corners, "dist": max(seen.x, NEAREST_M)}


def _pixel(forward: float, left: float, up: float) -> list[float]:
    scale = FOCAL_PX / max(forward, NEAREST_M)
    u, v = CENTRE_PX[0] - scale * left, CENTRE_PX[1] - scale * up
    return [min(max(u, 0.0), IMAGE_PX[0]), min(max(v, 0.0), IMAGE_PX[1])]


def flower_entries(
    pose: FloorPose, plates: Sequence[Plate], pests: Sequence[Point] = ()
) -> list[dict[str, Any]]:
    """Return a frame of the flower detector: the visible blooms behind the nearest of these plates.

    Without plates, the visible pests.
    """
    if not plates:
        bearings = (_bearing_of(pose, *place) for place in pests)
        return [_flower_entry(STRAY, bearing) for bearing in bearings if abs(bearing) <= HALF_FIELD]
    plate = min(plates, key=lambda plate: math.dist((pose.x, pose.y), plate.face))
    views = ((bloom, _bearing(pose, plate, bloom)) for bloom in blooms_of(plate.id))
    return [_flower_entry(bloom, bearing) for bloom, bearing in views if abs(bearing) <= HALF_FIELD]


def _bearing(pose: FloorPose, plate: Plate, bloom: SimulatedBloom) -> float:
    """Return the angle to a bloom, to the right of the view's middle, in radians."""
    ahead = (math.cos(plate.yaw), math.sin(plate.yaw))
    along = bloom.fraction * BOX_WIDTH_M / 2
    x = plate.face[0] - along * ahead[1] - BOX_DEPTH_M / 2 * ahead[0]
    y = plate.face[1] + along * ahead[0] - BOX_DEPTH_M / 2 * ahead[1]
    return _bearing_of(pose, x, y)


def _bearing_of(pose: FloorPose, x: float, y: float) -> float:
    """Return the angle to a place, to the right of the view's middle, in radians."""
    forward, left = _ahead(pose, x, y)
    return -math.atan2(left, forward)


def _flower_entry(bloom: SimulatedBloom, bearing: float) -> dict[str, Any]:
    u, v = (1.0 + bearing / HALF_FIELD) * IMAGE_PX[0] / 2, IMAGE_PX[1] / 2
    return {
        "class": bloom.kind,
        "confidence": bloom.confidence,
        "bbox_xyxy": [u - BLOOM_PX, v - BLOOM_PX, u + BLOOM_PX, v + BLOOM_PX],
        "track_id": None,
        "class_name": CLASSES[bloom.kind],
    }


def _ahead(pose: FloorPose, x: float, y: float) -> tuple[float, float]:
    """Return a place in the robot's frame: how far ahead, and how far to the left."""
    dx, dy = x - pose.x, y - pose.y
    cosine, sine = math.cos(pose.yaw), math.sin(pose.yaw)
    return cosine * dx + sine * dy, cosine * dy - sine * dx
