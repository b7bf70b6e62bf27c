"""A mission's request: read, completed with defaults and checked before anything changes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from lupin_engine.chart.expressions.evaluation import Environment
from lupin_engine.chart.model import Field
from lupin_engine.errors import nearest, reason, shortened
from lupin_engine.machine.environment import World
from lupin_engine.machine.reasons import Refusal
from lupin_engine.plugin.types import Type, convert

#: Wrong elements of a list that are told of.
MAX_PROBLEMS = 5

UNKNOWN_MISSION = "unknown_mission"
BAD_REQUEST = "bad_request"


def read_request(
    world: World, data: Mapping[str, Any], env: Environment
) -> tuple[dict[str, Any], Refusal | None]:
    """Return the mission's request values, or the first reason to refuse.

    Args:
        world: gives the missions and the readers of plugin types.
        data: the event's fields; `mission_type` names the mission, an empty or absent field means default.
        env: what defaults are evaluated in.
    """
    mission = world.chart.missions.get(data.get("mission_type", ""))
    if mission is None:
        name = data.get("mission_type", "")
        hint = nearest(shortened(name), world.chart.missions)
        return {}, Refusal(UNKNOWN_MISSION, f"unknown mission_type {shortened(name)!r}; {hint}")
    values: dict[str, Any] = {}
    for field in mission.request.values():
        value, refusal = _read_field(world, field, data.get(field.name), env)
        if refusal is not None:
            return {}, refusal
        values[field.name] = value
    return values, None


def _read_field(world: World, field: Field, given: Any, env: Environment) -> tuple[Any, Refusal | None]:
    try:
        value = (
            field.default.evaluate(env)
            if _absent(given) and field.default
            else _read(world, field.type, given)
        )
    except ValueError as problem:
        return None, Refusal(_code_of(world, field.type), str(problem))
    except Exception as problem:
        # A default that cannot be computed, or data of a shape no reader expects: nothing has changed yet.
        return None, Refusal(BAD_REQUEST, f"{field.place}: {field.name}: {reason(problem)}")
    if field.not_empty is not None and not value:
        return None, Refusal(field.not_empty, world.chart.codes[field.not_empty].label)
    if field.minimum is not None and value < field.minimum:
        return None, Refusal(BAD_REQUEST, f"{field.name} must be at least {field.minimum:g}, got {value!r}")
    return value, None


def _absent(given: Any) -> bool:
    """A request has no optional fields on the wire: empty and zero mean that nothing was given."""
    return given is None or given in ("", 0) or given == []


def _read(world: World, wanted: Type, given: Any) -> Any:
    if wanted.kind == "list" and wanted.item is not None and isinstance(given, list):
        return _read_list(world, wanted.item, given)
    if wanted.name in world.readers:
        return world.readers[wanted.name](given)
    return convert(given, wanted)


def _read_list(world: World, item: Type, given: list[Any]) -> list[Any]:
    """Read every element, so that all wrong ones are told at once."""
    values, problems = [], []
    for element in given:
        try:
            values.append(_read(world, item, element))
        except ValueError as problem:
            problems.append(str(problem))
    if problems:
        raise ValueError(_together(problems))
    return values


def _together(problems: list[str]) -> str:
    """Join problems; what is allowed ("...; what is allowed") is said once when it is the same for all."""
    left_out = f" and {len(problems) - MAX_PROBLEMS} more" if len(problems) > MAX_PROBLEMS else ""
    problems = problems[:MAX_PROBLEMS]
    told = [problem.partition("; ") for problem in problems]
    allowed = {tail for _, _, tail in told}
    if len(allowed) > 1:
        return "; ".join(problems) + left_out
    return "; ".join(filter(None, (", ".join(head for head, _, _ in told) + left_out, *allowed)))


def _code_of(world: World, wanted: Type) -> str:
    """Return the code that a wrong value of this type is refused with."""
    name = wanted.item.name if wanted.item is not None else wanted.name
    return f"unknown_{name}" if f"unknown_{name}" in world.chart.codes else BAD_REQUEST
