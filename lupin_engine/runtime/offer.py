"""What a machine's missions ask of whoever starts them: plain data, for displays and forms."""

from __future__ import annotations

from pathlib import PurePath
from typing import Any

from lupin_engine.chart.expressions.evaluation import Constant
from lupin_engine.chart.model import Field
from lupin_engine.machine.machine import Machine
from lupin_engine.plugin.types import Type


def offered(machine: Machine, now: float) -> list[dict[str, Any]]:
    """Return every mission with its file's name, its summary and the fields of its request, as JSON data.

    A field has a name, a type with its base unit, a default where it has one, and its smallest value. A
    default that is computed is told as it would be now, and as it is written (`computed`).
    """
    return [
        {
            "mission": mission.name,
            "file": PurePath(mission.file).stem,
            "summary": mission.summary,
            "request": [_field(field, machine, now) for field in mission.request.values()],
        }
        for mission in machine.chart.missions.values()
    ]


def _field(field: Field, machine: Machine, now: float) -> dict[str, Any]:
    told: dict[str, Any] = {"name": field.name, **_type(field.type), "required": field.default is None}
    if field.default is not None:
        told["default"] = _default(field, machine, now)
        if not isinstance(field.default, Constant):
            told["computed"] = field.default.source
    low = field.type.minimum if field.minimum is None else field.minimum
    if low is not None:
        told["minimum"] = low
    if field.not_empty is not None:
        told["may_be_empty"] = False
    return told


def _type(kind: Type) -> dict[str, Any]:
    inner = kind.item or kind
    told: dict[str, Any] = {"type": kind.name}
    if inner.unit:
        told["unit"] = inner.unit
    if inner.values:
        told["allowed"] = list(inner.values)
    return told


def _default(field: Field, machine: Machine, now: float) -> Any:
    """Return what a field is when nobody gives it; None when that cannot be said now."""
    assert field.default is not None
    try:
        return field.default.evaluate(machine.scope.at("", now))
    except Exception:  # an input that is not known yet, or whatever a plugin's function raises
        return None
    finally:
        machine.scope.forget()
