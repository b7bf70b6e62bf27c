"""Messages as plain data, in the form in which they arrive."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from lupin_engine.machine.step import CodeEvent

MISSION_ID = "lupin-1"


def state(**fields: Any) -> tuple[str, dict[str, Any]]:
    """A MissionState of a mission in its middle, with changes."""
    data = {
        "mission_id": MISSION_ID,
        "mission_type": "InspectionMission",
        "lifecycle_state": "INSPECTING",
        "mission_phase": "NAVIGATING",
        "current_target": "5",
        "targets_total": 3,
        "targets_completed": 1,
        "targets_failed": 0,
        "targets_unreachable": 0,
        "targets_skipped": 0,
        "last_error": "",
        "last_event": "",
        "last_event_severity": 0,
        "battery_percentage": 0.83,
        "battery_low": False,
        "paused": False,
        "estop_engaged": False,
    }
    return "state", {**data, **fields}


def observation(
    tag: str,
    values: dict[str, float] | None = None,
    status: int = 0,
    detail: str = "",
    mission_id: str = MISSION_ID,
) -> tuple[str, dict[str, Any]]:
    """An Observation."""
    readings = [{"name": name, "value": value} for name, value in (values or {}).items()]
    return "observation", {
        "mission_id": mission_id,
        "status": status,
        "status_detail": detail,
        "tag_reading": {"tag_id": tag, "readings": readings},
    }


def flowers(tag: str, species: str, blooms: int = 1, anomaly: bool = False) -> tuple[str, dict[str, Any]]:
    """An Observation of flowers."""
    flower = {"tag_id": tag, "species": species, "confidence": 0.9 if species else 0.0, "anomaly": anomaly}
    flower["flowers"] = [{}] * blooms
    return "observation", {"mission_id": MISSION_ID, "kind": 1, "status": 0, "flower": flower}


def anomaly(description: str, kind: int = 2) -> tuple[str, dict[str, Any]]:
    """An Observation of an anomaly at no tag."""
    pose = {"pose": {"position": {"x": 1.0, "y": 2.5}}}
    report = {"description": description, "pose": pose, "severity": 1}
    return "observation", {"mission_id": MISSION_ID, "kind": kind, "status": 0, "anomaly": report}


def step(
    attempts: Sequence[tuple[str, int, float | None]],
    configuration: Sequence[str] = (),
    time: float = 0.0,
    mission_id: str = MISSION_ID,
    event: str = "x",
    attempt: str = "",
    commands: Sequence[dict[str, Any]] = (),
    codes: Sequence[CodeEvent] = (),
    asking: Sequence[dict[str, Any]] = (),
) -> tuple[str, dict[str, Any]]:
    """A step with its view; `attempts` are operation, tries, deadline."""
    shown = [
        {"state": "S", "operation": o, "tries": n, "phase": "accepted", "detail": "", "deadline": d}
        for o, n, d in attempts
    ]
    view = {"mission_id": mission_id, "configuration": list(configuration), "attempts": shown}
    view["asking"] = list(asking)
    record = {"time": time, "event": event, "data": {"attempt": attempt}, "commands": list(commands)}
    record["codes"] = [asdict(code) for code in codes]
    return "step", {"time": time, "step": record, "view": view}
