"""The composed chart with shared queries of the rules, each computed once.

It is made in one pass over the states; rare features (parallel states, itineraries, inputs that may be
unknown) are indexed only when a rule asks.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache, cached_property

from lupin_engine.chart.compose.compose import Composed
from lupin_engine.chart.expressions.condition import Condition, mistaken
from lupin_engine.chart.expressions.guards import Every, Formula, fact
from lupin_engine.chart.expressions.names import may_ask, unknowns_read
from lupin_engine.chart.model import ActionCall, Invoke, Kind, State, Transition
from lupin_engine.chart.records import Role, own, parts_of
from lupin_engine.chart.rules.written import (
    Read,
    Saying,
    Texts,
    WrittenAction,
    calls_of,
    reads_of,
    sayings_of,
)
from lupin_engine.chart.semantics import FAULT, TIMERS, Semantics, matches
from lupin_engine.errors import Diagnostic, Place

#: Beginnings of events that only the state they belong to hears.
OF_ONE_STATE = ("done", "error", "budget", *TIMERS)


@dataclass(frozen=True)
class Work:
    """An operation that a state runs."""

    state: State
    invoke: Invoke


class Index:
    """The input of the rules."""

    def __init__(self, composed: Composed) -> None:
        """Index a chart, perhaps one from which parts with errors were left out."""
        self.composed = composed
        self.chart = composed.chart
        self.states = tuple(composed.chart.states.values())
        self.semantics = Semantics(self.chart)
        self.lineage = self.semantics.lineage
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
        if state.kind is Kind.PARALLEL:
            self.parallel.append(state)
        if state.invoke is not None:
            self.works.append(Work(state, state.invoke))
        if state.for_each is not None:
            self.works.append(Work(state, state.for_each.invoke))
        if not state.transitions:
            return
        if len(state.transitions) > 1:
            self.crowded.append(state)
        if state.children:
            self.outer.append(state)
        answers = False
        for transition in state.transitions:
            guard = guard_of(transition)
            if guard and guard.understood:
                self.guarded.append(transition)
            event = transition.event
            if event == "" or event.startswith("input."):
                self.eventless.append(transition)
            answers = answers or event in ("done", "error")
        if answers:
            self.answering.append(state)

    # -- the tree ------------------------------------------------------------------------------------------

    def inside(self, name: str, ancestor: str) -> bool:
        """Say whether a state is `ancestor` or below it."""
        return ancestor in self.lineage[name]

    def regions(self, state: State) -> list[State]:
        """Return the children of a state that are no history."""
        return [self.chart.states[name] for name in self.semantics.regions(state.name)]

    def begun(self, state: State) -> list[str]:
        """Return the children that are entered with a state by default; [] where no initial one is known."""
        if state.slot or state.kind is Kind.PARALLEL:
            return [child.name for child in self.regions(state)]
        return [state.initial] if state.initial is not None else []

    def entered(self, name: str) -> Iterator[str]:
        """Yield a state and all that are entered with it by default."""
        yield name
        for child in self.begun(self.chart.states[name]):
            yield from self.entered(child)

    @cached_property
    def reached(self) -> set[str]:
        """The reachable states, from the root on, ignoring guards.

        A state that is entered through a child of it has not entered its initial one. An unhandled error
        leads to FAULT.
        """
        states = self.chart.states
        active: set[str] = set()
        begun: set[str] = set()
        waiting = ["", FAULT] if FAULT in states else [""]
        while waiting:
            entered = waiting.pop()
            if entered in begun:
                continue
            begun.add(entered)
            waiting += self.begun(states[entered])
            for name in self.lineage[entered]:
                if name in active:
                    break
                active.add(name)
                waiting += self._leads_to(states[name])
        return active

    def _leads_to(self, state: State) -> list[str]:
        """Return the states that are entered from a state, or together with it whatever its initial child."""
        ways = state.transitions + state.resume_at
        found = [transition.target for transition in ways if transition.target is not None]
        if state.kind is Kind.PARALLEL:
            found += [region.name for region in self.regions(state)]
        if state.kind is Kind.HISTORY:
            found += [name for name in (state.initial, state.parent) if name is not None]
        return found

    @cached_property
    def slot(self) -> State | None:
        """The state that the missions stand in; None in a chart without one."""
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

    @cached_property
    def groups(self) -> list[list[Transition]]:
        """The transitions of one state that may answer the same event, where there are several."""
        return [group for state in self.crowded for group in groups_of(state.transitions)]

    # -- conditions ----------------------------------------------------------------------------------------

    @cached_property
    def unsure(self) -> frozenset[str]:
        """The inputs that may be unknown while a mission runs."""
        inputs = self.chart.inputs.values()
        return frozenset(i.name for i in inputs if i.initial is None or i.freshness is not None)

    def is_sure(self, guard: Condition) -> bool:
        """Say whether a guard is false only by its condition, not by a mistake or an unknown input."""
        if not guard.understood:
            return False
        if not may_ask(guard.source):
            return True
        return not any(self.may_be_unknown(name) for name in unknowns_read(guard.source))

    def may_be_unknown(self, name: str) -> bool:
        """Say whether a read value (see `unknowns_read`) may be unknown."""
        return not name.startswith("input.") or name.removeprefix("input.") in self.unsure

    # -- everything that is written ------------------------------------------------------------------------

    @cached_property
    def sayings(self) -> list[Saying]:
        """All actions, expressions and codes of the chart."""
        return sayings_of(self.chart)

    @cached_property
    def calls(self) -> list[WrittenAction]:
        """Every action of the chart."""
        return calls_of(self.sayings)

    @cached_property
    def reads(self) -> list[Read]:
        """Every expression of the chart."""
        return reads_of(self.sayings)

    @cached_property
    def texts(self) -> Texts:
        """All expressions as text, to find names in."""
        # What is handed to a part is built into the part's expressions and stands in none of them.
        drafts = self.composed.drafts.values()
        handed = [
            (d.within or d.mission, str(v))
            for d in drafts
            if d.node is not None
            for v in d.node.with_.values()
        ]
        return Texts([*((read.mission, read.expression.source) for read in self.reads), *handed])


def guard_of(thing: Transition | ActionCall) -> Condition:
    """Return the guard of a transition or an `if`; where it has further conditions, one not `understood`."""
    kind: type = type(thing)
    if not _has_more(kind):
        return thing.guard
    said = own(thing, _CONDITIONS)
    if said in ([], [thing.guard]):
        return thing.guard
    return mistaken(f"? {', '.join(one.source for one in said)}", said[0].place)


_CONDITIONS = frozenset({Role.CONDITION})


@cache
def _has_more(kind: type) -> bool:
    return sum(part.role is Role.CONDITION for part in parts_of(kind)) > 1


def always_taken(transition: Transition) -> bool:
    """Say whether a transition is taken whenever its event occurs, as far as its guard goes."""
    return guard_of(transition).constant is True


def taken_when(transition: Transition) -> Formula:
    """Return when a transition is taken: its guard, and for a level that it is true."""
    when = guard_of(transition).formula
    return Every((fact(transition.event, True), when)) if transition.event.startswith("input.") else when


def groups_of(transitions: Sequence[Transition]) -> Iterator[list[Transition]]:
    """Yield groups of two or more that answer one event, in order; a wildcard is in each that it covers."""
    by_event: dict[str, list[Transition]] = {}
    for transition in transitions:
        by_event.setdefault(transition.event, []).append(transition)
    if len(by_event) == len(transitions) and not any(event.endswith("*") for event in by_event):
        return
    wild = [event for event in by_event if event.endswith("*")]
    if not wild:
        yield from (group for group in by_event.values() if len(group) > 1)
        return
    for event, group in by_event.items():
        wider = [pattern for pattern in wild if pattern != event and matches(pattern, event)]
        if wider:
            group = [t for t in transitions if t.event == event or t.event in wider]
        if len(group) > 1:
            yield group


def line_of(place: Place, here: Place) -> str:
    """Return a place as text, for a finding at another one."""
    name = place.file.rpartition("/")[2]
    if name == here.file.rpartition("/")[2]:
        name = place.file  # of two files with one name, the path tells them apart
    return f"line {place.line}" if place.file == here.file else f"line {place.line} of {name}"


def local(name: str) -> str:
    """Return the last word of a state's name."""
    return name.rpartition(".")[2]


def event_name(event: str) -> str:
    """Return the author's word for an event of the engine."""
    if event.startswith(TIMERS):
        return event.partition(".")[0]
    return {"": "always", "done": "on_done", "error": "on_error"}.get(event, event)


Rule = Callable[[Index], Iterator[Diagnostic]]
