"""What a recorded step looks like, asked before it is used: files are cut off, and edited by hand."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

#: The parts of a step that have one type whatever the step is about; only the first two must be there.
_PARTS: Mapping[str, type] = MappingProxyType(
    {"event": str, "time": float, "data": dict, "entered": list, "commands": list, "configuration": list}
)
_NAMES = ("entered", "configuration")
#: Event -> what must be in its data.
_DATA: Mapping[str, Mapping[str, type]] = MappingProxyType(
    {
        "value": {"name": str, "value": object},
        "mission.start": {"mission_type": str},
        "attempt.failed": {"attempt": str, "code": str},
        "attempt.progress": {"attempt": str, "detail": str},
    }
)
#: Command -> what must be in it.
_COMMANDS: Mapping[str, Mapping[str, type]] = MappingProxyType(
    {
        "start": {"attempt": str, "operation": str, "arguments": dict},
        "cancel": {"attempt": str},
        "publish": {"target": str, "status": str},
    }
)
_REFUSAL: Mapping[str, type] = MappingProxyType({"code": str})
#: More seconds than any run has; beyond it, and where a number is none, times cannot be counted with.
_LATEST = 1e12


def misshapen(step: Mapping[str, Any]) -> str:
    """Return the name of the first part of a step that is not as steps are recorded; '' when all are."""
    for name, kind in _PARTS.items():
        if name in step and not _is(step[name], kind):
            return name
    checks = {
        **{part: all(isinstance(name, str) for name in step.get(part, ())) for part in _NAMES},
        "data": _is_data(step.get("data", {}), step["event"]),
        "commands": all(map(_is_command, step.get("commands", ()))),
        "refusal": "refusal" not in step or (_is(step["refusal"], dict) and _has(step["refusal"], _REFUSAL)),
    }
    return next((part for part, fits in checks.items() if not fits), "")


def _is_data(data: Mapping[str, Any], event: str) -> bool:
    return _has(data, _DATA.get(event, {})) and _is(data.get("result", {}), dict)


def _is_command(command: Any) -> bool:
    if not isinstance(command, Mapping) or not isinstance(command.get("command"), str):
        return False
    return _has(command, _COMMANDS.get(command["command"], {}))


def _has(whole: Mapping[str, Any], needed: Mapping[str, type]) -> bool:
    return all(name in whole and _is(whole[name], kind) for name, kind in needed.items())


def _is(value: Any, kind: type) -> bool:
    if kind is float:
        is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
        return is_number and -_LATEST < value < _LATEST
    return isinstance(value, kind)
