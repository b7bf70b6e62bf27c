"""The evaluation scope: the environment of expressions, and cached conditions with their dependencies.

Conditions that were evaluated as false are not evaluated again before one of their dependencies is marked
dirty or becomes stale (`Watch`). Dependencies are bits: `CONTEXT` and so on, and one for each input.
"""

from __future__ import annotations

import ast
import math
from collections import ChainMap
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from types import MappingProxyType
from typing import Any, Protocol

from lupin_engine.chart.expressions.condition import FREE
from lupin_engine.chart.expressions.evaluation import (
    Compiled,
    Environment,
    Expression,
    UnknownInput,
    UnknownValue,
    Value,
)
from lupin_engine.chart.model import Chart, Transition
from lupin_engine.errors import Severity, reason
from lupin_engine.machine.event import NO_TRIGGER, NOTHING, Trigger
from lupin_engine.machine.memory import Memory, Traversal
from lupin_engine.machine.step import CodeEvent, Macrostep
from lupin_engine.machine.timers import Timers
from lupin_engine.plugin.contract import Argument, classify
from lupin_engine.plugin.types import Notation, problems


class Calendar(Protocol):
    """Local dates and times of day in one time zone, for moments in POSIX time, to the millisecond.

    Dates and times of day are texts as `plugin.types` has them.
    """

    def shown(self, moment: float) -> tuple[str, str]:
        """Return date and time of day."""

    def next(self, time: str, after: float, without: Collection[str]) -> tuple[float, str]:
        """Return the first moment later than `after` at which clocks show `time`, and its date.

        Dates in `without` are skipped. A time that is left out on a date counts when the clock leaps over
        it, one that comes twice counts the first time.
        """

    def as_text(self, moment: float) -> str:
        """Return a moment as people write it, with the zone."""


@dataclass(frozen=True)
class World:
    """The constants of a machine: chart, checked parameters, bound functions and readers.

    `seed` seeds the jitter of retries. Without a `calendar` the time of day is unknown.
    """

    chart: Chart
    parameters: Mapping[str, Any]
    functions: Mapping[str, Callable[..., Any]] = field(default_factory=dict)
    readers: Mapping[str, Callable[[Any], Any]] = field(default_factory=dict)
    seed: int = 0
    calendar: Calendar | None = None


#: Parts of what expressions see, as bits; every input has one of its own after them.
CONTEXT, REQUEST, CONFIGURATION, HELD, ITINERARY, OPERATIONS = (1 << index for index in range(6))
_FIRST_INPUT = 6
_EVERYTHING = -1
_PARTS: Mapping[str, int] = MappingProxyType(
    {
        "context": CONTEXT,
        "request": REQUEST,
        "given": REQUEST,
        "in_state": CONFIGURATION,
        "held": HELD,
        "target": ITINERARY,
        "itinerary": ITINERARY,
        # Constant while conditions are watched, or a function of its arguments.
        **dict.fromkeys(("param", "functions", "event", "error", "item", "clock", "this_step"), 0),
    }
)


def input_part(chart: Chart, name: str) -> int:
    """Return the bit of an input."""
    return 1 << (_FIRST_INPUT + list(chart.inputs).index(name))


class Reads:
    """The dependencies of some conditions: `parts` as bits, and those inputs that become stale.

    Without `certain` they are not fully known, because a condition is no checked expression or reads the
    clock.
    """

    __slots__ = ("ageing", "certain", "parts")

    def __init__(self, chart: Chart, conditions: Iterable[Value], levels: Iterable[str] = ()) -> None:
        """Collect the dependencies of conditions and levels (`input.NAME` or `input.NAME.LEVEL`)."""
        found = {("input", level.split(".")[1]) for level in levels}
        self.certain = True
        for condition in conditions:
            if not isinstance(condition, Expression):
                continue
            if isinstance(condition.evaluate, Compiled):
                found.update(reads_of(condition.evaluate.code))
            else:
                self.certain = False
        names = {name for root, name in found if root in ("input", "known")}
        inputs = chart.inputs if "" in names else [name for name in chart.inputs if name in names]
        self.parts = 0
        for name in inputs:
            self.parts |= input_part(chart, name)
        for root, _ in found:
            self.parts |= _PARTS.get(root, 0 if root in ("input", "known") else _EVERYTHING)
        # The clock goes on by itself: what reads it is looked at in every step.
        self.certain = self.certain and not any(root == "clock" for root, _ in found)
        self.ageing = tuple(name for name in inputs if chart.inputs[name].freshness is not None)


@lru_cache(4096)
def reads_of(code: str) -> tuple[tuple[str, str], ...]:
    """Return the roots of the environment that checked code reads, each with the name below, if constant."""
    tree = ast.parse(code, mode="eval")
    roots = {
        id(node): str(node.slice.value)
        for node in ast.walk(tree)
        if isinstance(node, ast.Subscript)
        and isinstance(node.value, ast.Name)
        and node.value.id == "env"
        and isinstance(node.slice, ast.Constant)
    }
    below = dict.fromkeys(roots, "")
    for node in ast.walk(tree):
        if isinstance(node, ast.Subscript) and isinstance(node.slice, ast.Constant):
            if id(node.value) in roots:
                below[id(node.value)] = str(node.slice.value)
        elif isinstance(node, ast.Call) and id(node.func) in roots:
            first = node.args[0] if node.args else None
            below[id(node.func)] = str(first.value) if isinstance(first, ast.Constant) else ""
    return tuple((root, below[key]) for key, root in roots.items())


class Watch:
    """Caches that conditions are false, until a dependency changes or becomes stale.

    Conditions with other `Reads` than the cached ones are always due.
    """

    __slots__ = ("_reads", "dirty", "false_until")

    def __init__(self) -> None:
        #: What has changed since the conditions were found false.
        self.dirty = _EVERYTHING
        self._reads: Reads | None = None
        #: Until when none of the conditions can become true, if nothing changes.
        self.false_until = -math.inf

    def is_due(self, reads: Reads, now: float) -> bool:
        """Say whether the conditions must be evaluated now."""
        return reads is not self._reads or self.dirty & reads.parts != 0 or now >= self.false_until

    def invalidate(self) -> None:
        """Drop the cache: one of the conditions is true."""
        self._reads = None
        self.false_until = -math.inf

    def is_known_false(self, reads: Reads) -> bool:
        """Say whether these conditions are cached as false, and no dependency is dirty."""
        return reads is self._reads and not self.dirty & reads.parts

    def mark_false(self, reads: Reads) -> None:
        """Cache these conditions as false without evaluating them, as the model checker restores a state."""
        self._reads, self.dirty, self.false_until = reads, 0, math.inf

    def cache_false(self, reads: Reads, scope: EvaluationScope, now: float) -> None:
        """Cache that all conditions are false now, unless dependencies or evaluations were uncertain."""
        self._reads = reads if reads.certain and not scope.doubtful else None
        self.dirty = 0
        self.false_until = math.inf if self._reads is not None else -math.inf
        for name in reads.ageing:
            known = scope.memory.inputs.get(name)
            end = known.stamp + (scope.chart.inputs[name].freshness or 0.0) if known is not None else now
            if now < end < self.false_until:
                self.false_until = end


class LiveInputs(Mapping[str, Any]):
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


class EvaluationScope(dict[str, Any]):
    """The environment of all expressions of one machine; one object for the machine's whole life.

    A mapping for each evaluation would cost more than most evaluations. Rare roots are computed only when
    they are read: the itinerary depends on the state that the expression is written in.
    """

    __slots__ = (
        "_state",
        "_trigger",
        "chart",
        "doubtful",
        "false_until",
        "inputs",
        "level_reads",
        "memory",
        "timers",
        "watches",
        "world",
    )

    def __init__(self, world: World, memory: Memory) -> None:
        self.world = world
        self.chart: Chart = world.chart
        self.memory = memory
        self.timers = Timers(memory)
        #: Whoever must know what changes; see `Watch`.
        self.watches: list[Watch] = []
        #: Whether a condition could not be evaluated since this was last set to False.
        self.doubtful = False
        #: Until when no level and no eventless transition can become true, if nothing changes.
        self.false_until = -math.inf
        #: The parts that decide on those.
        self.level_reads = _EVERYTHING
        self._state = ""
        self._trigger = NO_TRIGGER
        self.inputs = LiveInputs(world.chart, memory)
        super().__init__()
        self["event"] = NOTHING
        self["param"] = world.parameters
        self["input"] = self.inputs
        self["context"] = memory.context
        self["request"] = memory.request
        self["given"] = memory.given
        self["functions"] = world.functions

    def at(self, state: str, now: float, trigger: Trigger = NO_TRIGGER) -> Environment:
        """Return the environment of an expression written in `state` at `now`; valid until the next call."""
        self._state = state
        self.inputs.now = now
        self._trigger = trigger
        self["event"] = trigger.event
        return self

    def clear_event(self) -> None:
        """Clear the event of the last step."""
        self._trigger = NO_TRIGGER
        self["event"] = NOTHING

    def see(self, state: str, step: Macrostep, trigger: Trigger = NO_TRIGGER) -> Environment:
        """Return the environment of an expression written in `state` in a step; valid until the next call."""
        return self.at(state, step.now, trigger)

    def enabled(
        self, candidates: Iterable[Iterable[Transition]], step: Macrostep, trigger: Trigger = NO_TRIGGER
    ) -> list[Transition]:
        """Return of each group of candidates the first one whose guard is true, if there is one."""
        chosen = []
        check = self.check
        for offered in candidates:
            for rule in offered:
                guard = rule.guard
                if guard is FREE or check(guard, rule.source, step, trigger):
                    chosen.append(rule)
                    break
        return chosen

    def check(self, guard: Expression, state: str, step: Macrostep, trigger: Trigger = NO_TRIGGER) -> bool:
        """Evaluate a condition; with an unknown input it is false, any other failure is an error as well."""
        try:
            return bool(guard.evaluate(self.at(state, step.now, trigger)))
        except UnknownValue as unknown:
            self.doubtful = True
            step.note(f"{guard.place}: {guard.source}: {unknown}")
        except Exception as problem:
            self.doubtful = True
            step.fail_once(state, f"{guard.place}: {guard.source}: {reason(problem)}")
        return False

    def mark_dirty(self, part: int) -> None:
        """Mark a dependency dirty in every watch."""
        if part & self.level_reads:
            self.false_until = -math.inf
        for watch in self.watches:
            watch.dirty |= part

    def record_code(
        self,
        code: str,
        detail: str,
        step: Macrostep,
        target: str | None = None,
        least: Severity = Severity.INFO,
    ) -> None:
        """Report a code, and remember it for `last_error` unless a worse one is remembered.

        Without a `target` it is about the current one. A code below `least` is reported only.
        """
        memory, found = self.memory, classify(code, self.chart.codes)
        about = memory.target if target is None else target
        step.codes.append(CodeEvent(code, found.label, found.severity, detail, about))
        memory.codes += 1
        if found.severity >= max(least, classify(memory.code, self.chart.codes).severity):
            memory.code, memory.detail = code, detail

    @property
    def wall(self) -> float | None:
        """The robot's clock at the time of the evaluation, in POSIX time, or None if it is unknown."""
        ahead = self.memory.wall
        return None if ahead is None or self.world.calendar is None else self.inputs.now + ahead

    def clock(self) -> Mapping[str, str]:
        """Return date and time of day of the robot's clock; UnknownValue where it is unknown."""
        wall = self.wall
        if wall is None or self.world.calendar is None:
            raise UnknownValue("clock is unknown: nobody has told the time")
        today, time = self.world.calendar.shown(wall)
        return {"today": today, "time": time}

    def __missing__(self, root: str) -> Any:
        found = _ASKED_SELDOM.get(root)
        if found is None:
            raise KeyError(root)
        return found(self)

    def with_target(self, target: Any) -> Environment:
        """Return the environment with another `target`."""
        return ChainMap({"target": target}, self)

    def traversal(self) -> Traversal | None:
        """Return the itinerary that the expression's state works on; None before the mission enters one."""
        return traversal_of(self.chart, self.memory, self._state)

    def in_state(self, names: Iterable[str]) -> bool:
        """Say whether one of the states is active."""
        return any(name in self.memory.configuration for name in names)


#: Roots of the environment that are worked out when they are read.
_ASKED_SELDOM: Mapping[str, Callable[[EvaluationScope], Any]] = MappingProxyType(
    {
        "error": lambda env: env._trigger.error,
        "item": lambda env: env._trigger.item,
        "target": lambda env: _target(env.traversal()),
        "itinerary": lambda env: _itinerary(env.traversal()),
        "clock": EvaluationScope.clock,
        "known": lambda env: env.inputs.known,
        "held": lambda env: env.memory.held.__contains__,
        "in_state": lambda env: env.in_state,
    }
)


def traversal_of(chart: Chart, memory: Memory, state: str) -> Traversal | None:
    """Return the itinerary that `state` works on: its own or its ancestors', else the mission's last one.

    None where the mission has entered no itinerary.
    """
    if not memory.itineraries:
        return None
    for name in chart.lineage[state]:
        if name in memory.itineraries:
            return memory.itineraries[name]
    return memory.traversal


def _target(traversal: Traversal | None) -> Any:
    if traversal is None or traversal.item is None:
        raise ValueError("there is no target here: the itinerary is empty, or at its end")
    return traversal.item


def _itinerary(traversal: Traversal | None) -> Mapping[str, Any]:
    if traversal is None:
        return {"open": False, "remaining": 0, "total": 0, "closed": 0, "sweep": 0}
    visit = traversal.visit
    return {
        "open": visit is not None and not visit.closed,
        "remaining": traversal.remaining,
        "total": len(traversal.items),
        "closed": sum(1 for visit in traversal.visits if visit.closed),
        "sweep": traversal.sweep,
    }


class Arguments:
    """The arguments of an invoke or an action.

    Kinds and units were checked at load, and so was the range of literals. The range of computed arguments is
    checked here, so that no plugin gets a value that its catalog excludes; mocks in a simulation do not
    check.
    """

    __slots__ = ("_checked", "_values")

    def __init__(self, values: Mapping[str, Value], declared: Mapping[str, Argument]) -> None:
        self._values = tuple((name, _plain(value)) for name, value in values.items())
        names = [name for name in declared if isinstance(values.get(name), Expression)]
        self._checked = tuple((name, declared[name].type) for name in names)

    def evaluate(self, env: Environment) -> dict[str, Any]:
        """Return the arguments as they are now.

        Raises:
            ValueError: one is outside its range, or not finite; the text begins with its name.
        """
        arguments = {name: evaluate(env) for name, evaluate in self._values}
        for name, wanted in self._checked:
            found = problems(arguments[name], wanted, Notation.DATA)
            if found:
                raise ValueError(found[0].at(name))
        return arguments


def _plain(value: Value) -> Callable[[Environment], Any]:
    return value.evaluate.compiled() if isinstance(value.evaluate, Compiled) else value.evaluate
