"""What an expression sees when it is evaluated: parameters, request, inputs, event, target, context."""

from __future__ import annotations

from collections import ChainMap
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

from lupin_engine.chart.expressions.evaluation import Environment, UnknownInput
from lupin_engine.chart.model import Chart
from lupin_engine.machine.event import NOTHING
from lupin_engine.machine.memory import Memory, Walk


@dataclass(frozen=True)
class World:
    """What never changes while a machine lives: chart, checked parameters, bound functions and readers.

    `seed` is what the jitter of retries is drawn from.
    """

    chart: Chart
    parameters: Mapping[str, Any]
    functions: Mapping[str, Callable[..., Any]] = field(default_factory=dict)
    readers: Mapping[str, Callable[[Any], Any]] = field(default_factory=dict)
    seed: int = 0


@dataclass(frozen=True, slots=True)
class Cause:
    """Why something is evaluated: the event's data, the error of an attempt, a `for_each`'s element."""

    event: Mapping[str, Any] = field(default_factory=lambda: NOTHING)
    error: Mapping[str, str] = field(default_factory=lambda: NOTHING)
    item: Any = None


NO_CAUSE = Cause()


class Inputs(Mapping[str, Any]):
    """The live values at the moment `now`; reading one that is not known raises `UnknownInput`."""

    __slots__ = ("_chart", "_memory", "now")

    def __init__(self, chart: Chart, memory: Memory) -> None:
        self._chart = chart
        self._memory = memory
        self.now = 0.0

    def __getitem__(self, name: str) -> Any:
        if not self.known(name):
            raise UnknownInput(name)
        value = self._memory.inputs[name].value
        levels = self._chart.inputs[name].levels
        if not levels:
            return value
        known = self._memory.levels
        return {"value": value, **{v.name: known.get(f"input.{name}.{v.name}", False) for v in levels}}

    def __iter__(self) -> Iterator[str]:
        return iter(self._chart.inputs)

    def __len__(self) -> int:
        return len(self._chart.inputs)

    def known(self, name: str) -> bool:
        """Say whether the input was reported, and not too long ago."""
        found = self._memory.inputs.get(name)
        if found is None:
            return False
        freshness = self._chart.inputs[name].freshness
        return freshness is None or self.now < found.stamp + freshness

    def holds(self, event: str) -> bool:
        """Say whether the level that an `input.NAME` or `input.NAME.LEVEL` event stands for is true."""
        name, _, level = event.removeprefix("input.").partition(".")
        if not self.known(name):
            return False
        return self._memory.levels.get(event, False) if level else self._memory.inputs[name].value is True


class Surroundings(dict[str, Any]):
    """What every expression of one machine sees; one object for the machine's whole life.

    Making a mapping for each evaluation would cost more than most evaluations. What few expressions ask for
    is looked up only when it is read: the itinerary depends on the state that the expression is written in.
    """

    __slots__ = ("_cause", "_memory", "_state", "_world", "inputs")

    def __init__(self, world: World, memory: Memory) -> None:
        self._world = world
        self._memory = memory
        self._state = ""
        self._cause = NO_CAUSE
        self.inputs = Inputs(world.chart, memory)
        super().__init__()
        self["event"] = NOTHING
        self["param"] = world.parameters
        self["input"] = self.inputs
        self["context"] = memory.context
        self["request"] = memory.request

    def at(self, state: str, now: float, cause: Cause = NO_CAUSE) -> Environment:
        """Return what an expression written in `state` sees now; good until the next call."""
        self._state = state
        self.inputs.now = now
        self._cause = cause
        self["event"] = cause.event
        return self

    def forget(self) -> None:
        """Let go of what the last step was about."""
        self._cause = NO_CAUSE
        self["event"] = NOTHING

    def __missing__(self, root: str) -> Any:
        found = _ASKED_SELDOM.get(root)
        if found is None:
            raise KeyError(root)
        return found(self)

    def with_target(self, target: Any) -> Environment:
        """Return what an expression sees for which `target` is the target."""
        return ChainMap({"target": target}, self)

    def walk(self) -> Walk | None:
        """Return the itinerary that the state works on in which the expression is written."""
        return walk_of(self._world.chart, self._memory, self._state)

    def in_state(self, names: Iterable[str]) -> bool:
        """Say whether one of the states is active."""
        return any(name in self._memory.configuration for name in names)


#: Roots of the environment that are worked out when they are read.
_ASKED_SELDOM: Mapping[str, Callable[[Surroundings], Any]] = MappingProxyType(
    {
        "error": lambda env: env._cause.error,
        "item": lambda env: env._cause.item,
        "target": lambda env: getattr(env.walk(), "item", None),
        "itinerary": lambda env: _itinerary(env.walk()),
        "known": lambda env: env.inputs.known,
        "held": lambda env: env._memory.held.__contains__,
        "in_state": lambda env: env.in_state,
        "functions": lambda env: env._world.functions,
    }
)


def walk_of(chart: Chart, memory: Memory, state: str) -> Walk | None:
    """Return the itinerary that `state` works on: its own or its ancestors', else the mission's last one."""
    if not memory.walks:
        return None
    for name in (state, *chart.ancestors(state)):
        if name in memory.walks:
            return memory.walks[name]
    return memory.walk


def _itinerary(walk: Walk | None) -> Mapping[str, Any]:
    if walk is None:
        return {"open": False, "remaining": 0, "total": 0, "closed": 0, "sweep": 0}
    visit = walk.visit
    return {
        "open": visit is not None and not visit.closed,
        "remaining": walk.remaining,
        "total": len(walk.items),
        "closed": sum(1 for visit in walk.visits if visit.closed),
        "sweep": walk.sweep,
    }
