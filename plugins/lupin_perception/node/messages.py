"""Converts the aggregator's data to messages."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point, Point32, Polygon, PoseStamped, Quaternion
from geometry_msgs.msg import Pose as PoseMessage

from lupin_engine.plugin import filled_in
from lupin_greenhouse import Array, Pose
from lupin_msgs.msg import (
    AnomalyReport,
    DiscoveredTag,
    DiscoveredTags,
    FlowerObservation,
    FlowerPoint,
    Observation,
    TagReading,
)
from lupin_perception.anomalies import PEST_SEVERITY, Pest
from lupin_perception.boxes import PlanterBox
from lupin_perception.flowers import ColumnBloom, ScanSummary
from lupin_perception.registry import Known
from lupin_perception.sightings import MAP

#: Who these observations are from.
SOURCE = "perception_aggregator"
_MOST_SIGHTINGS = 2**32 - 1


def pose_message(pose: Pose) -> PoseMessage:
    """Return a pose as a message, never with a w of 0."""
    message = PoseMessage()
    message.position.x, message.position.y, message.position.z = pose.position.tolist()
    x, y, z, w = pose.rotation.tolist()
    message.orientation = Quaternion(x=x, y=y, z=z, w=filled_in(w))
    return message


def discovered_tags(tags: Iterable[Known], since: Time) -> DiscoveredTags:
    """Return all tags, as of the moment when they last changed."""
    message = DiscoveredTags(tags=[_discovered(known) for known in tags])
    message.header.frame_id, message.header.stamp = MAP, since
    return message


def _discovered(known: Known) -> DiscoveredTag:
    message = DiscoveredTag(tag_id=known.id, pose_in_map=pose_message(known.pose))
    message.sightings = min(known.sightings, _MOST_SIGHTINGS)
    if known.summary is not None:
        message.species = known.summary.species
        message.species_confidence = known.summary.confidence
        message.anomaly = known.summary.anomaly
    return message


def flower_observation(
    known: Known, summary: ScanSummary, box: PlanterBox | None, places: Array, mission_id: str, stamp: Time
) -> Observation:
    """Return the Observation of a tag's flowers; `places` are where its blooms are drawn, row by row."""
    message = _observation(Observation.KIND_FLOWER, mission_id, stamp)
    message.tag_pose_in_map = pose_message(known.pose)
    flower: FlowerObservation = message.flower
    flower.tag_id = known.id
    flower.pose = PoseStamped(header=message.header, pose=pose_message(known.pose))
    flower.species, flower.confidence = summary.species, summary.confidence
    flower.anomaly = summary.anomaly
    if box is not None:
        flower.flowers = _points(summary.blooms, places)
        flower.box_footprint = Polygon(points=[Point32(x=x, y=y) for x, y in box.footprint().tolist()])
    return message


def _points(blooms: Sequence[ColumnBloom], places: Array) -> list[FlowerPoint]:
    return [
        FlowerPoint(
            position=Point(x=x, y=y),
            species=bloom.species,
            confidence=bloom.confidence,
            anomaly=bloom.anomaly,
        )
        for bloom, (x, y) in zip(blooms, places.tolist(), strict=True)
    ]


def anomaly_observation(pest: Pest, robot: Pose, mission_id: str, stamp: Time) -> Observation:
    """Return the Observation of a pest that belongs to no tag, at the robot's pose."""
    message = _observation(Observation.KIND_ANOMALY, mission_id, stamp)
    message.tag_pose_in_map.orientation.w = 0.0  # there is no tag
    report: AnomalyReport = message.anomaly
    report.pose = PoseStamped(header=message.header, pose=pose_message(robot))
    report.description, report.severity = pest.description, PEST_SEVERITY
    return message


def reading_observation(known: Known, reading: TagReading, source: str, stamp: Time) -> Observation:
    """Return the Observation of a reading outside of a mission."""
    message = _observation(Observation.KIND_TAG_READING, "", stamp, source)
    message.tag_pose_in_map = pose_message(known.pose)
    message.tag_reading = reading
    return message


def _observation(kind: int, mission_id: str, stamp: Time, source: str = SOURCE) -> Observation:
    message = Observation(mission_id=mission_id, source=source, kind=kind, status=Observation.STATUS_OK)
    message.header.frame_id, message.header.stamp = MAP, stamp
    return message
