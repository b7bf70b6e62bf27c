"""What the robot and its operators tell each other, as plain data.

The types are ones that every ROS 2 has, so that nothing needs to be built: an order is one line of text; a
state and an outcome are each a DiagnosticStatus, whose values are pairs of text.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from lupin_engine.errors import Severity
from lupin_engine.plugin.profile import (
    Fields,
    Progress,
    Publish,
    Situation,
    StartAnswer,
    StartRequest,
    TargetResult,
)

#: The outcomes of a shelf.
PICKED, MISSING, LEFT = "PICKED", "MISSING", "LEFT"


# -- an order: `FetchOrder A1 B2` -----------------------------------------------------------------------


def order_fields(asked: StartRequest) -> Fields:
    return {"load_namespace": " ".join([asked.mission, *asked.request.get("shelves", ())])}


def read_order(data: Fields) -> StartRequest:
    mission, *shelves = data["load_namespace"].split() or [""]
    return StartRequest(mission, {"shelves": shelves})


def answer_fields(answer: StartAnswer) -> Fields:
    return {"success": answer.accepted, "message": answer.mission_id if answer.accepted else answer.reason}


def read_answer(data: Fields) -> StartAnswer:
    accepted, text = data["success"], data["message"]
    return StartAnswer(accepted, text, "") if accepted else StartAnswer(accepted, "", text)


# -- the state ------------------------------------------------------------------------------------------


def state_fields(now: Situation) -> Fields:
    told = {
        "doing": now.lifecycle,
        "phase": now.phase,
        "shelf": now.target,
        "shelves": now.total,
        **{name: now.counts.get(name, 0) for name in (PICKED, MISSING, LEFT)},
        "halted": "yes" if now.paused else "no",
        "code": now.code,
    }
    return {
        "level": int(now.severity),
        "name": now.mission,
        "hardware_id": now.mission_id,
        "message": now.label,
        "values": _pairs(told),
    }


def read_state(data: Fields) -> Progress:
    told = _told(data)
    return Progress(
        mission=data["name"],
        mission_id=data["hardware_id"],
        lifecycle=told.get("doing", ""),
        phase=told.get("phase", ""),
        target=told.get("shelf", ""),
        total=int(told.get("shelves", 0)),
        counts={name: int(told.get(name, 0)) for name in (PICKED, MISSING, LEFT)},
        error=told.get("code", ""),
        event=data["message"],
        severity=Severity(data["level"]),
        paused=told.get("halted") == "yes",
        flags={"halted": told.get("halted") == "yes"},
    )


# -- the outcome of a shelf -----------------------------------------------------------------------------


def outcome_fields(told: Publish, value: Callable[[str], Any], stamp: Fields) -> Fields:
    return {
        "level": int(Severity.INFO if told.status == PICKED else Severity.WARN),
        "name": told.target,
        "hardware_id": told.mission_id,
        "message": told.status,
        "values": _pairs({"reason": told.detail or told.code, **gripped(told.reading or {})}),
    }


def read_outcome(data: Fields) -> TargetResult:
    told = _told(data)
    values = {name: float(text) for name, text in told.items() if name != "reason"}
    return TargetResult(data["name"], data["message"], told.get("reason", ""), values, data["hardware_id"])


def gripped(reading: Mapping[str, Any]) -> Mapping[str, float]:
    """Return what the gripper has measured of a parcel."""
    return {name: float(reading[name]) for name in ("width", "force") if name in reading}


def _pairs(told: Mapping[str, Any]) -> list[Fields]:
    return [{"key": name, "value": str(value)} for name, value in told.items()]


def _told(data: Fields) -> dict[str, str]:
    return {pair["key"]: pair["value"] for pair in data["values"]}
