"""All actions and expressions that stand in a chart, each with the path that it is told under."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from typing import NamedTuple

from lupin_engine.chart.expressions.evaluation import Constant, Expression, Value
from lupin_engine.chart.model import ActionCall, Chart, Invoke, State


class Read(NamedTuple):
    """An expression of the chart: whether it is a condition (else a value), and where it is told.

    There are many and most are in order, so the path is put together when it is asked for.
    """

    expression: Expression
    condition: bool
    mission: str
    words: tuple[str, ...]

    @property
    def path(self) -> str:
        """What the expression is for."""
        return ".".join(word for word in self.words if word)


class Call(NamedTuple):
    """An action of the chart, the state that it is written in and what its list is called."""

    action: ActionCall
    state: State
    words: tuple[str, ...]

    @property
    def path(self) -> str:
        """The list that the action stands in."""
        return ".".join(word for word in self.words if word)


def calls_of(chart: Chart) -> list[Call]:
    """Return every action of a chart."""
    found: list[Call] = []
    for state in chart.states.values():
        if state.entry or state.exit:
            found += [Call(call, state, (state.name, "entry")) for call in state.entry]
            found += [Call(call, state, (state.name, "exit")) for call in state.exit]
        for transition in state.transitions:
            if transition.actions:
                found += [Call(call, state, (transition.id, "do")) for call in transition.actions]
        if state.for_each is not None:
            each = state.for_each
            found += [Call(call, state, (state.name, "for_each.on_done.do")) for call in each.on_done]
            found += [Call(call, state, (state.name, "for_each.on_error.do")) for call in each.on_error]
    return found


def reads_of(chart: Chart, calls: Iterable[Call]) -> list[Read]:
    """Return every expression of a chart, whose actions are `calls`."""
    found: list[Read] = []
    for call in calls:
        for name, value in call.action.arguments.items():
            if not isinstance(value, Constant):
                words = (*call.words, call.action.name, name)
                found.append(Read(value, False, call.state.mission, words))
    states = chart.states.values()
    found += [
        Read(transition.guard, True, state.mission, (transition.id, "guard"))
        for state in states
        for transition in (state.transitions + state.resume_at)
        if transition.guard is not None
    ]
    found += [
        Read(timer.after, False, state.mission, (state.name, timer.event))
        for state in states
        for timer in state.timers
        if not isinstance(timer.after, Constant)
    ]
    for state in states:
        if state.invoke or state.budget or state.for_each or state.itinerary:
            found += _reads_of_work(state)
    found += _declared_reads(chart)
    return found


def _reads_of_work(state: State) -> Iterator[Read]:
    """Yield what a state computes besides guards, times and the arguments of actions."""
    found: list[tuple[str, Value | None]] = []
    if state.budget is not None:
        found.append(("budget.after", state.budget.after))
    if state.invoke is not None:
        found += _values_of_invoke("invoke", state.invoke)
    if state.for_each is not None:
        each = state.for_each
        found += [("for_each.in", each.items), ("for_each.key", each.key), ("for_each.limit", each.limit)]
        found += _values_of_invoke("for_each.invoke", each.invoke)
        if each.when is not None:
            yield Read(each.when, True, state.mission, (state.name, "for_each.when"))
    if state.itinerary is not None:
        walk = state.itinerary
        found += [("itinerary.items", walk.items), ("itinerary.order", walk.order)]
        found.append(("itinerary.sweeps", walk.sweeps))
    for word, value in found:
        if value is not None and not isinstance(value, Constant):
            yield Read(value, False, state.mission, (state.name, word))


def _values_of_invoke(path: str, invoke: Invoke) -> Iterator[tuple[str, Value | None]]:
    for name, value in invoke.arguments.items():
        if not isinstance(value, Constant):
            yield f"{path}.with.{name}", value
    yield f"{path}.timeout.after", invoke.timeout
    if invoke.retry is not None:
        retry = invoke.retry
        for name in ("attempts", "backoff", "factor", "jitter"):
            yield f"{path}.retry.{name}", getattr(retry, name)


def _read(value: Value | None, mission: str, words: tuple[str, ...]) -> Iterator[Read]:
    if value is not None and not isinstance(value, Constant):
        yield Read(value, False, mission, words)


def _declared_reads(chart: Chart) -> Iterator[Read]:
    """Yield the expressions that stand in no state."""
    for hold in chart.holds.values():
        for key, guard in (("engage_guard", hold.engage_guard), ("release_guard", hold.release_guard)):
            if guard is not None:
                yield Read(guard, True, "", ("holds", hold.name, key))
    for invariant in chart.invariants.values():
        yield Read(invariant.that, True, "", ("invariants", invariant.name))
    for found in chart.inputs.values():
        for level in found.levels:
            for key in ("below", "above", "hysteresis"):
                words = ("inputs", found.name, "levels", level.name, key)
                yield from _read(getattr(level, key), "", words)
    for variable in chart.context.values():
        yield from _read(variable.default, "", ("context", variable.name, "default"))
    for mission in chart.missions.values():
        for field in mission.request.values():
            yield from _read(field.default, mission.name, ("request", field.name, "default"))


class Texts:
    """All expressions of a chart as text, by mission; asked when nothing quicker has found a name."""

    def __init__(self, found: Iterable[tuple[str, str]]) -> None:
        by_mission: dict[str, list[str]] = {}
        for mission, text in found:
            by_mission.setdefault(mission, []).append(text)
        self._by_mission = {mission: "\n".join(texts) for mission, texts in by_mission.items()}

    def names(self, name: str, mission: str | None = None) -> bool:
        """Tell whether a name is read, by anyone or within one mission."""
        word = re.compile(rf"(?<![\w.'\"]){re.escape(name)}(?![\w'\"])")
        return any(name in text and word.search(text) for text in self._of(mission))

    def quotes(self, text: str) -> bool:
        """Tell whether a text is written out in an expression."""
        return any(f"'{text}'" in found or f'"{text}"' in found for found in self._of(None))

    def _of(self, mission: str | None) -> Iterable[str]:
        return self._by_mission.values() if mission is None else [self._by_mission.get(mission, "")]
