"""From the machine's plain data to `lupin_msgs`; pure functions, tested without a node."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point, Pose, Quaternion

from lupin_engine.errors import Severity
from lupin_engine.machine.event import Publish
from lupin_engine.machine.step import View
from lupin_engine.plugin.contract import Code
from lupin_engine.plugin.wire import filled_in, pose_fields, time_fields
from lupin_msgs.msg import MissionState, Observation, SensorReading, TagReading

#: The counters of MissionState are uint16; a robot that monitors for weeks stays at the highest.
HIGHEST_COUNT = 2**16 - 1

_STATUS = {
    "OK": Observation.STATUS_OK,
    "UNREACHABLE": Observation.STATUS_UNREACHABLE,
    "SCAN_FAILED": Observation.STATUS_SCAN_FAILED,
    "SKIPPED": Observation.STATUS_SKIPPED,
}


@dataclass(frozen=True)
class Inputs:
    """The live values that `MissionState` publishes beside the view; None is unknown."""

    estop: bool | None
    battery: float | None
    battery_low: bool
    discovered: int = 0


def to_time(seconds: float) -> Time:
    """Return seconds since the epoch of the node's clock as a stamp."""
    return Time(**time_fields(seconds))


def mission_state(
    view: View,
    inputs: Inputs,
    codes: Mapping[str, Code],
    request: Mapping[str, Any],
    stamp: Time,
    started: Time | None,
) -> MissionState:
    """Return the published state. An empty mission leaves the mission's fields empty.

    `codes` are the declared ones, `request` is what the mission was started with. `started` is when it was
    accepted, of the same clock as `stamp`; the view's own time is the loop's and means nothing to others.
    """
    message = MissionState()
    message.header.stamp = stamp
    message.header.frame_id = "map"
    message.mission_id = view.mission_id
    message.mission_type = view.mission
    message.lifecycle_state = view.lifecycle
    message.mission_phase = view.phase
    message.current_target = view.target
    _fill_counters(message, view, int(request.get("discovery_goal", 0)), inputs.discovered)
    message.last_error = f"{view.code}: {view.detail}" if view.detail else view.code
    message.last_event, message.last_event_severity = classify(view.code, codes)
    message.estop_engaged = inputs.estop is True
    message.paused = view.paused
    message.battery_percentage = math.nan if inputs.battery is None else inputs.battery
    message.battery_low = inputs.battery_low
    if started is not None:
        message.started_at = started
    return message


def _fill_counters(message: MissionState, view: View, goal: int, discovered: int) -> None:
    message.discovery_goal = goal
    message.tags_discovered = _count(discovered) if goal else 0
    if goal and not view.total:  # it searches: what it is to find is its list
        message.targets_total, message.targets_completed = goal, message.tags_discovered
        return
    message.targets_total = _count(view.total)
    message.targets_completed = _count(view.completed)
    message.targets_failed = _count(view.failed)
    message.targets_unreachable = _count(view.unreachable)
    message.targets_skipped = _count(view.skipped)


def _count(number: int) -> int:
    return min(number, HIGHEST_COUNT)


def classify(code: str, codes: Mapping[str, Code]) -> tuple[str, int]:
    """Return (label, severity) of a code as it is declared; an undeclared one is its own label, a warning."""
    if not code:
        return "", int(Severity.INFO)
    declared = codes.get(code)
    return (declared.label, int(declared.severity)) if declared else (code, int(Severity.WARN))


def observation(published: Publish, pose: Pose | None, stamp: Time) -> Observation:
    """Return the observation of one closed visit, or of a reading on the way.

    Args:
        published: the visit's outcome. Its target's id is carried whatever the outcome, because consumers
            key on it; a reading only with OK.
        pose: where the target is, in frame map; None when nobody knows. Used with OK only; without it
            `orientation.w` stays 0, which means "never observed".
        stamp: the time of publication.
    """
    message = Observation()
    message.header.stamp = stamp
    message.header.frame_id = "map"
    message.mission_id = published.mission_id
    message.source = published.source
    message.kind = Observation.KIND_TAG_READING
    message.status = _STATUS[published.status]
    message.tag_reading.tag_id = published.target
    message.tag_pose_in_map.orientation.w = 0.0
    if published.status == "OK":
        message.tag_reading = tag_reading(published.target, published.reading or {})
        if pose is not None:
            message.tag_pose_in_map = pose
    else:
        message.status_detail = published.detail or published.code
    return message


def summary(visit: Mapping[str, Any]) -> dict[str, Any]:
    """Return what the log says of a target in the end: its outcome, its tries, what was read or why not."""
    told = {"tag": visit["target"], "status": visit["status"] or "open", "tries": dict(visit["tries"])}
    if visit["status"] == "OK":
        read = (visit["reading"] or {}).get("readings", ())
        return {**told, "sensors": [sensor["name"] for sensor in read]}
    return {**told, "reason": visit["detail"] or visit["code"] or "?"}


def place_of(
    target: str, discovered: Iterable[Mapping[str, Any]], robot: Mapping[str, float] | None
) -> Pose | None:
    """Return where a target is: its own pose where it was seen, else that of the robot in front of it."""
    for seen in discovered:
        if seen.get("id") == target:
            return plate_pose(seen)
    return None if robot is None else to_pose(robot)


def plate_pose(seen: Mapping[str, Any]) -> Pose:
    """Return the pose of a tag that was seen; an orientation that nobody filled in becomes the identity."""
    message = Pose()
    message.position.x, message.position.y = float(seen["x"]), float(seen["y"])
    facing = {axis: float(value) for axis, value in seen.get("facing", {}).items()}
    if any(facing.values()):
        message.orientation = Quaternion(**facing)
        message.orientation.w = filled_in(message.orientation.w)
    return message


def to_pose(pose: Mapping[str, float]) -> Pose:
    """Return a pose on the floor; its quaternion's w is never exactly 0."""
    fields = pose_fields(pose)
    message = Pose(position=Point(**fields["position"]), orientation=Quaternion(**fields["orientation"]))
    message.orientation.w = filled_in(message.orientation.w)
    return message


def tag_reading(tag_id: str, reading: Mapping[str, Any]) -> TagReading:
    """Return a reading as the bridge gave it."""
    message = TagReading(tag_id=tag_id)
    message.stamp = to_time(float(reading.get("stamp", 0.0)))
    message.sim_time_of_day_seconds = float(reading.get("sim_time_of_day_seconds", 0.0))
    message.readings = [
        SensorReading(name=sensor["name"], value=float(sensor["value"]))
        for sensor in reading.get("readings", ())
    ]
    return message
