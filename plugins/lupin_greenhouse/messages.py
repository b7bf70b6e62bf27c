"""Translates between the engine's data and `lupin_msgs`: requests, MissionState, Observation. Needs no ROS.

The profile names these functions; orchestrator, pages and CLI call them. Counters are clamped at uint16.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from lupin_engine.errors import Severity
from lupin_engine.plugin import (
    Fields,
    Progress,
    Projection,
    Publish,
    Rating,
    Remark,
    Situation,
    StartAnswer,
    StartRequest,
    TargetOutcome,
    TargetResult,
    filled_in,
    last,
    pose_fields,
    time_fields,
)
from lupin_greenhouse.mission import STAGES

#: The counters of MissionState are uint16; a robot that monitors for weeks stays at the highest.
HIGHEST_COUNT = 2**16 - 1

#: How a visit ends, in the order of the values of `Observation.status`.
OUTCOMES = (
    TargetOutcome("OK", "completed", "visited", Rating.GOOD),
    TargetOutcome("UNREACHABLE", "unreachable", "unreachable"),
    TargetOutcome("SCAN_FAILED", "failed", "failed"),
    TargetOutcome("SKIPPED", "skipped", "skipped", Rating.LEFT_OUT),
)
#: Their names, each with its counter in MissionState.
STATUSES: Mapping[str, str] = {outcome.name: f"targets_{outcome.counter}" for outcome in OUTCOMES}
#: Values of `Observation.kind`; those of later builds are passed over.
TAG_READING, FLOWER, ANOMALY = 0, 1, 2

#: The published state in which `tags_discovered` counts.
EXPLORING = "EXPLORING"

#: Flags of MissionState.
FLAGS = ("estop_engaged", "paused", "battery_low")


# -- StartMission ---------------------------------------------------------------------------------------


def start_fields(asked: StartRequest) -> Fields:
    """Return the request of a start."""
    return {"mission_type": asked.mission, **asked.request}


def read_start(data: Fields) -> StartRequest:
    """Return the request in a message."""
    request = dict(data)
    return StartRequest(str(request.pop("mission_type")), request)


def answer_fields(answer: StartAnswer) -> Fields:
    """Return the response to a start."""
    return {
        "accepted": answer.accepted,
        "mission_id": answer.mission_id,
        "error_message": answer.reason,
    }


def read_answer(data: Fields) -> StartAnswer:
    """Return the answer in a message."""
    return StartAnswer(bool(data["accepted"]), str(data["mission_id"]), str(data["error_message"]))


# -- MissionState ---------------------------------------------------------------------------------------


def state_fields(now: Situation) -> Fields:
    """Return MissionState; without a mission its fields are empty."""
    if now.lifecycle in (*STAGES.starting, *STAGES.ready):
        none: dict[str, Any] = {"mission": "", "mission_id": "", "target": "", "started": None}
        now = replace(now, **none, total=0, counts={}, request={})
    battery = now.value("battery") or {}
    charge = battery.get("value")
    return {
        "header": {"stamp": now.stamp, "frame_id": "map"},
        "mission_id": now.mission_id,
        "mission_type": now.mission,
        "lifecycle_state": now.lifecycle,
        "mission_phase": now.phase,
        "current_target": now.target,
        **_counters(now),
        "last_error": f"{now.code}: {now.detail}" if now.detail else now.code,
        "last_event": now.label,
        "last_event_severity": int(now.severity),
        "estop_engaged": now.value("stopped") is True,
        "paused": now.paused,
        "battery_percentage": math.nan if charge is None else charge,
        "battery_low": bool(battery.get("low", False)),
        "started_at": now.started or time_fields(0.0),
    }


def _counters(now: Situation) -> Fields:
    goal = int(now.request.get("discovery_goal", 0))
    # They advance while the robot explores; those that turn up later are no finds of the search.
    discovered = len(now.value("discovered") or ()) if now.lifecycle == EXPLORING else now.value("found")
    discovered = _count(discovered or 0) if goal else 0
    search = {"discovery_goal": goal, "tags_discovered": discovered}
    if goal and not now.total:  # it searches: what it is to find is its list
        return {**search, "targets_total": goal, "targets_completed": discovered}
    counts = {counter: _count(now.counts.get(status, 0)) for status, counter in STATUSES.items()}
    return {**search, "targets_total": _count(now.total), **counts}


def _count(number: int) -> int:
    return min(number, HIGHEST_COUNT)


def read_state(data: Fields) -> Progress:
    """Return the progress in a MissionState; missing fields count as empty."""
    return Progress(
        mission=str(data.get("mission_type", "")),
        mission_id=str(data.get("mission_id", "")),
        lifecycle=str(data.get("lifecycle_state", "")),
        phase=str(data.get("mission_phase", "")),
        target=str(data.get("current_target", "")),
        total=int(data.get("targets_total", 0)),
        counts={status: int(data.get(counter, 0)) for status, counter in STATUSES.items()},
        goal=int(data.get("discovery_goal", 0)),
        found=int(data.get("tags_discovered", 0)),
        error=str(data.get("last_error", "")),
        event=str(data.get("last_event", "")),
        severity=Severity(data.get("last_event_severity", 0)),
        paused=bool(data.get("paused")),
        flags={flag: bool(data.get(flag)) for flag in FLAGS},
        gauges={"battery": float(data.get("battery_percentage", 0.0))},
    )


# -- Observation ----------------------------------------------------------------------------------------


def observation_fields(published: Publish, value: Callable[[str], Any], stamp: Fields) -> Fields:
    """Return the Observation of a closed visit, or of a reading on the way.

    All fields are there, also those of other kinds, because pages of a simulation get them as they are. Tag
    id and time are set whatever the outcome: consumers use them as key and label. A reading and a pose come
    only with OK. An unknown pose has `orientation.w` 0, which means "never observed".
    """
    fields: dict[str, Any] = {
        "header": {"stamp": stamp, "frame_id": "map"},
        "mission_id": published.mission_id,
        "source": published.source,
        "kind": TAG_READING,
        "status": list(STATUSES).index(published.status),
        "status_detail": "",
        "tag_reading": {
            "tag_id": published.target,
            "stamp": stamp,
            "sim_time_of_day_seconds": 0.0,
            "readings": [],
        },
        "flower": _NO_FLOWER,
        "anomaly": _NO_ANOMALY,
        "tag_pose_in_map": _whole_pose({}, {}),
    }
    if published.status != "OK":
        return {**fields, "status_detail": _reason(published)}
    fields["tag_reading"] = reading_fields(published.target, published.reading or {})
    place = place_of(published.target, value("places") or {}, value("robot"))
    if place is not None:
        fields["tag_pose_in_map"] = _whole_pose(place["position"], place["orientation"])
    return fields


def _reason(published: Publish) -> str:
    """Return why a visit failed: a drive's code and detail as in `last_error`; else the server's text."""
    if published.status == "UNREACHABLE" and published.code and published.detail:
        return f"{published.code}: {published.detail}"
    return published.detail or published.code


def _whole_pose(position: Fields, orientation: Fields) -> Fields:
    """Return a pose with all its numbers; a missing orientation is all zeros."""
    none = dict.fromkeys("xyz", 0.0)
    return {"position": {**none, **position}, "orientation": {**none, "w": 0.0, **orientation}}


#: What observations of a tag carry of other kinds.
_UNSEEN: Fields = {
    "header": {"stamp": time_fields(0.0), "frame_id": ""},
    "pose": _whole_pose({}, {"w": 1.0}),
}
_NO_ANOMALY: Fields = {"pose": _UNSEEN, "description": "", "severity": 0}
_NO_FLOWER: Fields = {
    "tag_id": "",
    "pose": _UNSEEN,
    "species": "",
    "confidence": 0.0,
    "anomaly": False,
    "flowers": [],
    "box_footprint": {"points": []},
}


def reading_fields(tag_id: str, reading: Mapping[str, Any]) -> Fields:
    """Return a TagReading, as the bridge published it."""
    return {
        "tag_id": tag_id,
        "stamp": time_fields(float(reading.get("stamp", 0.0))),
        "sim_time_of_day_seconds": float(reading.get("sim_time_of_day_seconds", 0.0)),
        "readings": [
            {"name": sensor["name"], "value": float(sensor["value"])}
            for sensor in reading.get("readings", ())
        ],
    }


def values_of(reading: Mapping[str, Any]) -> Mapping[str, float]:
    """Return a tag's measured values by sensor."""
    return {str(sensor["name"]): float(sensor["value"]) for sensor in reading.get("readings", ())}


#: Places of tags that are remembered; the aggregator knows no more at a time.
MOST_PLACES = 400
#: Metres from the robot that reads a tag to the tag: one that was seen before and is farther away now is on
#: another map. A robot stands 1.5 m from its tag at most.
NEAR_M = 2.0


def remember_places(before: Any, _: str, reported: Any) -> Mapping[str, Any]:
    """Return the poses of tags by id: those just `reported`, and up to `MOST_PLACES` earlier ones.

    The aggregator clears its tags when a mission begins, so they are kept here.
    """
    seen = {tag["id"]: tag for tag in reported}
    known = {**before["before"], **before["seen"]} if before else {}
    older = {name: tag for name, tag in known.items() if name not in seen}
    return {"seen": seen, "before": dict(list(older.items())[-MOST_PLACES:])}


#: What the messages say of live values. They do not depend on the inputs that missions happen to declare.
PROJECTIONS: Mapping[str, Projection] = {
    "stopped": last("robot.estop"),
    "robot": last("robot.pose"),
    "places": Projection(("tags.discovered",), remember_places),
}


def place_of(
    target: str, places: Mapping[str, Mapping[str, Any]], robot: Mapping[str, float] | None
) -> Fields | None:
    """Return the pose of a target as seen now, or earlier within `NEAR_M` of the robot; else the robot's own.

    None where nothing is known.
    """
    seen, before = (places.get(when, {}).get(target) for when in ("seen", "before"))
    if seen is None and before is not None and robot is not None:
        away = math.hypot(before["x"] - robot["x"], before["y"] - robot["y"])
        seen = before if away <= NEAR_M else None
    if seen is not None:
        return plate_pose(seen)
    return None if robot is None else floor_pose(robot)


def plate_pose(seen: Mapping[str, Any]) -> Fields:
    """Return the pose of a tag that was seen; an orientation of zeros becomes the identity."""
    facing = {axis: float(value) for axis, value in seen.get("facing", {}).items()}
    if any(facing.values()):
        facing["w"] = filled_in(facing.get("w", 1.0))
    else:
        facing = {"w": 1.0}
    return {"position": {"x": float(seen["x"]), "y": float(seen["y"])}, "orientation": facing}


def floor_pose(pose: Mapping[str, float]) -> Fields:
    """Return a pose on the floor; its quaternion's w is never exactly 0."""
    fields = pose_fields(pose)
    fields["orientation"]["w"] = filled_in(fields["orientation"]["w"])
    return fields


def read_observation(data: Fields) -> TargetResult | Remark | None:
    """Return an Observation as a result or a remark; None for an unknown kind."""
    kind, mission_id = int(data.get("kind", TAG_READING)), str(data.get("mission_id", ""))
    if kind == FLOWER:
        return Remark(*_flowers(data["flower"]), mission_id)
    if kind == ANOMALY:
        return Remark(*_anomaly(data["anomaly"]), mission_id)
    if kind != TAG_READING:
        return None
    status, reading = int(data.get("status", 0)), data.get("tag_reading", {})
    return TargetResult(
        target=str(reading.get("tag_id", "")),
        status=list(STATUSES)[status] if status < len(STATUSES) else f"status {status}",
        reason=str(data.get("status_detail", "")),
        values=values_of(reading),
        mission_id=mission_id,
    )


def _flowers(flower: Fields) -> tuple[Severity, str]:
    species, confidence = flower["species"] or "no species", float(flower["confidence"])
    text = f"tag {flower['tag_id']}: {species} ({confidence:.2f}), blooms: {len(flower['flowers'])}"
    return (Severity.WARN, f"{text}, anomaly") if flower["anomaly"] else (Severity.INFO, text)


def _anomaly(anomaly: Fields) -> tuple[Severity, str]:
    place = anomaly["pose"]["pose"]["position"]
    text = f"anomaly at x {place['x']:.2f} m, y {place['y']:.2f} m: {anomaly['description']}"
    return Severity.WARN, text
