"""What an expression sees when it is evaluated: parameters, request, inputs, event, target, context."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from lupin_engine.chart.model import Chart, Environment, UnknownInput
from lupin_engine.machine.memory import Memory, Walk


@dataclass(frozen=True)
class World:
    """What never changes while a machine lives: chart, checked parameters, bound functions and readers."""

    chart: Chart
    parameters: Mapping[str, Any]
    functions: Mapping[str, Callable[..., Any]] = field(default_factory=dict)
    readers: Mapping[str, Callable[[Any], Any]] = field(default_factory=dict)


@dataclass(frozen=True)
class Cause:
    """Why something is evaluated: the event's data, and the error when an attempt failed."""

    event: Mapping[str, Any] = field(default_factory=dict)
    error: Mapping[str, str] = field(default_factory=dict)


NO_CAUSE = Cause()


class Inputs(Mapping[str, Any]):
    """The live values at one moment; reading one that is not known raises `UnknownInput`."""

    def __init__(self, chart: Chart, memory: Memory, now: float) -> None:
        self._chart = chart
        self._memory = memory
        self._now = now

    def __getitem__(self, name: str) -> Any:
        if not self.known(name):
            raise UnknownInput(name)
        value = self._memory.inputs[name][0]
        levels = self._chart.inputs[name].levels
        if not levels:
            return value
        return {"value": value, **{level.name: self._level(name, level.name) for level in levels}}

    def __iter__(self) -> Iterator[str]:
        return iter(self._chart.inputs)

    def __len__(self) -> int:
        return len(self._chart.inputs)

    def known(self, name: str) -> bool:
        """Say whether the input was reported and is not older than its freshness."""
        if name not in self._memory.inputs:
            return False
        freshness = self._chart.inputs[name].freshness
        return freshness is None or self._now - self._memory.inputs[name][1] <= freshness

    def holds(self, event: str) -> bool:
        """Say whether the level that an `input.NAME` or `input.NAME.LEVEL` event stands for is true."""
        name, _, level = event.removeprefix("input.").partition(".")
        if not self.known(name):
            return False
        return self._level(name, level) if level else self._memory.inputs[name][0] is True

    def _level(self, name: str, level: str) -> bool:
        return self._memory.levels.get((name, level), False)


def environment(world: World, memory: Memory, state: str, now: float, cause: Cause) -> Environment:
    """Return what an expression written in `state` sees."""
    inputs = Inputs(world.chart, memory, now)
    walk = walk_of(world.chart, memory, state)
    return {
        "param": world.parameters,
        "request": memory.request,
        "input": inputs,
        "known": inputs.known,
        "event": cause.event,
        "error": cause.error,
        "context": memory.context,
        "target": walk.item if walk else None,
        "itinerary": _itinerary(walk),
        "held": memory.held.__contains__,
        "in_state": lambda names: any(name in memory.configuration for name in names),
        "functions": world.functions,
    }


def walk_of(chart: Chart, memory: Memory, state: str) -> Walk | None:
    """Return the itinerary that `state` works on: its own or its ancestors', else the mission's last one."""
    for name in (state, *chart.ancestors(state)):
        if name in memory.walks:
            return memory.walks[name]
    return memory.walk


def _itinerary(walk: Walk | None) -> Mapping[str, Any]:
    if walk is None:
        return {"open": False, "remaining": 0, "total": 0, "closed": 0}
    visit = walk.visit
    return {
        "open": visit is not None and not visit.closed,
        "remaining": walk.remaining,
        "total": len(walk.items),
        "closed": sum(1 for visit in walk.visits if visit.closed),
    }
