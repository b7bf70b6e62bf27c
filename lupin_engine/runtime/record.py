"""Steps and views as plain JSON data: what is logged, published beside the contract, and stored."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from lupin_engine.machine.event import Act, Cancel, Command, Publish, Report, Start
from lupin_engine.machine.step import Step
from lupin_engine.machine.view import View

_NAMES = {Start: "start", Cancel: "cancel", Act: "act", Publish: "publish", Report: "report"}


def step_record(step: Step) -> dict[str, Any]:
    """Return a step as JSON data; empty parts are left out."""
    record: dict[str, Any] = {
        "sequence": step.sequence,
        "time": step.time,
        "event": step.event.name,
        "data": dict(step.event.data),
        "taken": list(step.taken),
        "exited": list(step.exited),
        "entered": list(step.entered),
        "commands": [command_record(command) for command in step.commands],
        "configuration": list(step.configuration),
        "notes": list(step.notes),
        "why": [str(considered) for considered in step.why],
    }
    if step.accepted is not None:
        record["accepted"] = step.accepted
    if step.refusal is not None:
        record["refusal"] = asdict(step.refusal)
    return {name: value for name, value in record.items() if value not in ([], {})}


def command_record(command: Command) -> dict[str, Any]:
    """Return a command as JSON data, named by its kind."""
    return {"command": _NAMES[type(command)], **asdict(command)}


def view_record(view: View) -> dict[str, Any]:
    """Return a view as JSON data."""
    return asdict(view)
