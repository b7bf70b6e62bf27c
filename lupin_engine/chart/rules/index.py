"""The composed chart with what several rules ask of it, each answered once.

Rules get this and nothing else. It is made in one pass over the states; what few charts have (parallel
states, itineraries, inputs that may be unknown) is looked for only when a rule asks.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

from lupin_engine.chart.compose import Composed
from lupin_engine.chart.guards import TRUE, Condition, Every, condition_of, constant, fact, inputs_read
from lupin_engine.chart.model import (
    ActionCall,
    Constant,
    Expression,
    Invoke,
    Kind,
    State,
    Transition,
    Value,
)
from lupin_engine.errors import Diagnostic, Place

#: Beginnings of events that no wildcard listens to: they come from the engine and are meant for one state.
_OWN = ("done", "error", "after.", "budget", "input.")
#: The top-level state that an error leads to when nobody handles it.
FAULT = "FAULT"


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


@dataclass(frozen=True)
class Work:
    """An operation that a state runs."""

    state: State
    invoke: Invoke
    place: Place


class Index:
    """What the rules look at."""

    def __init__(self, composed: Composed, mistaken: Iterable[Place] = (), whole: bool = False) -> None:
        """Look through a chart.

        Args:
            composed: the chart, perhaps with holes.
            mistaken: where errors were found before.
            whole: whether all missions of the lifecycle are loaded.
        """
        self.composed = composed
        self.mistaken = {(place.file, place.line) for place in mistaken}
        self.whole = whole
        self.chart = composed.chart
        self.states = tuple(composed.chart.states.values())
        #: Every state's own name and its ancestors', innermost first.
        self.lineage: dict[str, tuple[str, ...]] = {}
        #: States with more than one transition.
        self.crowded: list[State] = []
        #: States that hold others and have transitions.
        self.outer: list[State] = []
        #: States that say what follows when something in them has ended.
        self.answering: list[State] = []
        self.parallel: list[State] = []
        self.guarded: list[Transition] = []
        #: Transitions that no event but a level causes.
        self.eventless: list[Transition] = []
        self.works: list[Work] = []
        for state in self.states:
            self._enter(state)

    def _enter(self, state: State) -> None:
        parent = state.parent
        self.lineage[state.name] = (state.name,) if parent is None else (state.name, *self.lineage[parent])
        if state.kind is Kind.PARALLEL:
            self.parallel.append(state)
        if state.invoke is not None:
            self.works.append(Work(state, state.invoke, state.invoke.place))
        if state.for_each is not None:
            self.works.append(Work(state, state.for_each.invoke, state.for_each.place))
        if not state.transitions:
            return
        if len(state.transitions) > 1:
            self.crowded.append(state)
        if state.children:
            self.outer.append(state)
        answers = False
        for transition in state.transitions:
            if transition.guard is not None:
                self.guarded.append(transition)
            event = transition.event
            if event == "" or event.startswith("input."):
                self.eventless.append(transition)
            answers = answers or event in ("done", "error")
        if answers:
            self.answering.append(state)

    # -- the tree ------------------------------------------------------------------------------------------

    def inside(self, name: str, ancestor: str) -> bool:
        """Tell whether a state is the other one or stands in it."""
        return ancestor in self.lineage[name]

    def regions(self, state: State) -> list[State]:
        """Return the children of a state that are no history."""
        children = (self.chart.states[name] for name in state.children)
        return [child for child in children if child.kind is not Kind.HISTORY]

    def begun(self, state: State) -> list[str]:
        """Return the children that are entered with a state when nothing else is said."""
        if state.slot or state.kind is Kind.PARALLEL:
            return [child.name for child in self.regions(state)]
        return [state.initial] if state.initial is not None else []

    def entered(self, name: str) -> Iterator[str]:
        """Yield a state and all that is entered with it when nothing else is said; history: its parent."""
        state = self.chart.states[name]
        if state.kind is Kind.HISTORY:
            yield from self.entered(state.parent or "")
            return
        yield name
        for child in self.begun(state):
            yield from self.entered(child)

    def domain(self, transition: Transition, target: str) -> str:
        """Return the innermost compound state that holds source and target and is itself not left."""
        states, lineage = self.chart.states, self.lineage[target]
        source = states[transition.source]
        if transition.internal and source.kind is Kind.COMPOUND and source.name in lineage[1:]:
            return source.name
        above = (name for name in self.lineage[source.name][1:] if name in lineage[1:])
        return next((name for name in above if states[name].kind is Kind.COMPOUND), "")

    @cached_property
    def slot(self) -> State | None:
        """The state that the missions stand in."""
        return next((state for state in self.states if state.slot), None)

    @cached_property
    def region_of(self) -> dict[str, tuple[tuple[str, str], ...]]:
        """For every state below a parallel one: each parallel state around it, with the region it is in."""
        found: dict[str, tuple[tuple[str, str], ...]] = {}
        if not self.parallel:
            return found
        parallel = {state.name for state in self.parallel}
        for state in self.states:
            outer = found.get(state.parent or "", ())
            if state.parent in parallel and state.kind is not Kind.HISTORY:
                outer = ((state.parent, state.name), *outer)
            if outer:
                found[state.name] = outer
        return found

    @cached_property
    def ways_to(self) -> dict[str, list[Transition]]:
        """For every target the transitions that lead to it."""
        found: dict[str, list[Transition]] = {}
        for state in self.states:
            for transition in state.transitions:
                if transition.target is not None:
                    found.setdefault(transition.target, []).append(transition)
        return found

    # -- conditions ----------------------------------------------------------------------------------------

    def understood(self, expression: Expression) -> bool:
        """Tell whether no mistake was found in the lines of an expression: one stands in for those."""
        return (expression.place.file, expression.place.line) not in self.mistaken

    @cached_property
    def unsure(self) -> frozenset[str]:
        """The inputs that may be unknown while a mission runs."""
        inputs = self.chart.inputs.values()
        return frozenset(i.name for i in inputs if i.initial is None or i.freshness is not None)

    def may_be_unknown(self, guard: Expression) -> bool:
        """Tell whether a guard may be false because an input is unknown, whatever it says."""
        if not self.unsure or "input." not in guard.source:
            return False
        return not self.unsure.isdisjoint(inputs_read(guard.source))

    # -- everything that is written ------------------------------------------------------------------------

    @cached_property
    def calls(self) -> list[Call]:
        """Every action of the chart."""
        return [found for state in self.states for found in _calls_of(state)]

    @cached_property
    def reads(self) -> list[Read]:
        """Every expression of the chart."""
        found: list[Read] = []
        for call in self.calls:
            for name, value in call.action.arguments.items():
                if not isinstance(value, Constant):
                    words = (*call.words, call.action.name, name)
                    found.append(Read(value, False, call.state.mission, words))
        for state in self.states:
            for transition in (*state.transitions, *state.resume_at):
                if transition.guard is not None:
                    found.append(Read(transition.guard, True, state.mission, (transition.id, "guard")))
            if state.timers or state.invoke or state.budget or state.for_each or state.itinerary:
                found += _reads_of_work(state)
        found += self._declared_reads()
        return found

    @cached_property
    def texts(self) -> Texts:
        """All expressions as text."""
        return Texts(self)

    def _declared_reads(self) -> Iterator[Read]:
        chart = self.chart
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


def _calls_of(state: State) -> Iterator[Call]:
    for call in state.entry:
        yield Call(call, state, (state.name, "entry"))
    for call in state.exit:
        yield Call(call, state, (state.name, "exit"))
    for transition in state.transitions:
        for call in transition.actions:
            yield Call(call, state, (transition.id, "do"))
    if state.for_each is not None:
        for call in state.for_each.on_done:
            yield Call(call, state, (state.name, "for_each.on_done.do"))
        for call in state.for_each.on_error:
            yield Call(call, state, (state.name, "for_each.on_error.do"))


def _reads_of_work(state: State) -> Iterator[Read]:
    """Yield what a state computes besides guards and the arguments of actions."""
    found: list[tuple[str, Value | None]] = [(timer.event, timer.after) for timer in state.timers]
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


class Texts:
    """All expressions of a chart as text, to find a name in; asked only when nothing quicker has found it."""

    def __init__(self, index: Index) -> None:
        found: dict[str, list[str]] = {}
        for read in index.reads:
            found.setdefault(read.mission, []).append(read.expression.source)
        for draft in index.composed.drafts.values():
            # What is handed to a part is built into the part's expressions and stands in none of them.
            if draft.node is not None and draft.node.with_:
                found.setdefault(draft.mission, []).extend(map(str, draft.node.with_.values()))
        self._by_mission = {mission: "\n".join(texts) for mission, texts in found.items()}

    def names(self, name: str, mission: str | None = None) -> bool:
        """Tell whether a name is read, by anyone or within one mission."""
        word = re.compile(rf"(?<![\w.'\"]){re.escape(name)}(?![\w'\"])")
        return any(name in text and word.search(text) for text in self._of(mission))

    def quotes(self, text: str) -> bool:
        """Tell whether a text is written out in an expression."""
        return any(f"'{text}'" in found or f'"{text}"' in found for found in self._of(None))

    def _of(self, mission: str | None) -> Iterable[str]:
        return self._by_mission.values() if mission is None else [self._by_mission.get(mission, "")]


def covers(pattern: str, event: str) -> bool:
    """Tell whether a pattern listens to everything that another one listens to."""
    if pattern == event:
        return True
    if pattern == "*":
        return bool(event) and not event.startswith(_OWN)
    return pattern.endswith(".*") and event.startswith(pattern[:-1])


def always_taken(transition: Transition) -> bool:
    """Tell whether a transition is taken whenever its event occurs, as far as its guard goes."""
    return transition.guard is None or constant(transition.guard.source) is True


def condition(transition: Transition) -> Condition:
    """Return when a transition is taken: its guard, and for a level that it is true."""
    guard = TRUE if transition.guard is None else condition_of(transition.guard.source)
    if transition.event.startswith("input."):
        return Every((fact(transition.event, True), guard))
    return guard


def line_of(place: Place, here: Place) -> str:
    """Return where something stands, for a finding that is told elsewhere."""
    name = place.file.rpartition("/")[2]
    return f"line {place.line}" if place.file == here.file else f"line {place.line} of {name}"


def local(name: str) -> str:
    """Return the last word of a state's name."""
    return name.rpartition(".")[2]


def told(event: str) -> str:
    """Return what an author calls an event of the engine's own."""
    if event.startswith("after."):
        return "after"
    return {"": "always", "done": "on_done", "error": "on_error"}.get(event, event)


Rule = Callable[[Index], Iterator[Diagnostic]]
