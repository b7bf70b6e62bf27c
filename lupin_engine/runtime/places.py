"""Tells where the targets of a mission are, where the robot stands for them, and their outcomes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from lupin_engine.chart import Chart, Expression
from lupin_engine.machine import Machine, Phase, Traversal
from lupin_engine.plugin import POSE, OnHold, Operation

#: x, y and heading in metres and radians.
Stand = tuple[float, float, float]


@dataclass(frozen=True)
class TargetPlace:
    """A target with a place; without a `status` it has no outcome yet, `stand` may be unknown."""

    id: str
    x: float
    y: float
    stand: Stand | None
    status: str
    is_current: bool


class TargetPlaces:
    """The targets of one mission after the other.

    Where to stand is evaluated once for each, and corrected when the robot is sent there: it may depend on
    where the robot is.
    """

    def __init__(self) -> None:
        self._mission_id = ""
        self._stands: dict[tuple[str, str], Stand | None] = {}

    def look(self, machine: Machine, now: float) -> list[TargetPlace]:
        """Return the targets of all itineraries that are records with an `x` and a `y`, each once."""
        memory, found = machine.memory, dict[str, TargetPlace]()
        if memory.mission_id != self._mission_id:
            self._mission_id = memory.mission_id
            self._stands.clear()
        for traversal in memory.itineraries.values():
            for item, visit in zip(traversal.items, traversal.visits, strict=True):
                at, name = _place_of(item), visit.target
                if at is None or (name in found and not traversal.begun):
                    continue
                key = traversal.state, name
                is_current = name == memory.target and not visit.closed
                if sent := _sent(machine) if is_current else None:
                    self._stands[key] = sent
                elif key not in self._stands:
                    self._stands[key] = _stand(machine, traversal, item, now)
                earlier = traversal.earlier.get(name)
                status = visit.status or (earlier.status if earlier is not None else "")
                found[name] = TargetPlace(name, *at, self._stands[key], status, is_current)
        return list(found.values())


def _place_of(item: Any) -> tuple[float, float] | None:
    place = (item.get("x"), item.get("y")) if isinstance(item, Mapping) else (None, None)
    x, y = place
    return (float(x), float(y)) if isinstance(x, (int, float)) and isinstance(y, (int, float)) else None


def _stand(machine: Machine, traversal: Traversal, item: Any, now: float) -> Stand | None:
    """Evaluate where the robot is sent for a target; None where that is nowhere, or not known yet."""
    for state, pose in _poses(machine.chart, traversal.state):
        scope = machine.scope
        scope.at(state, now)
        try:
            return _stand_at(pose.evaluate(scope.with_target(item)))
        except Exception:  # nothing but a drawing needs it
            continue
    return None


def _sent(machine: Machine) -> Stand | None:
    """Return where the robot is on its way to; None where it is not."""
    for attempt in machine.memory.attempts.values():
        operation = machine.chart.catalog.operations.get(attempt.operation)
        if operation is not None and attempt.phase in (Phase.REQUESTED, Phase.ACCEPTED):
            for name in filter(attempt.arguments.__contains__, _moving(operation)):
                return _stand_at(attempt.arguments[name])
    return None


def _stand_at(pose: Mapping[str, Any]) -> Stand:
    return float(pose["x"]), float(pose["y"]), float(pose["yaw"])


def _moving(operation: Operation) -> Iterator[str]:
    """Yield the arguments of an operation that are poses to which it moves the robot."""
    if operation.on_hold is OnHold.CANCEL:
        yield from (name for name, argument in operation.arguments.items() if argument.type == POSE)


def _poses(chart: Chart, walker: str) -> Iterator[tuple[str, Expression]]:
    """Yield the poses to which states of an itinerary move the robot, with the names of these states."""
    for name, state in chart.states.items():
        if state.invoke is None or not name.startswith(f"{walker}."):
            continue
        given = state.invoke.arguments
        for argument in _moving(state.invoke.operation):
            if isinstance(value := given.get(argument), Expression):
                yield name, value
