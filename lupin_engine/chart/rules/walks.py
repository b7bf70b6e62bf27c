"""Warnings: an itinerary restarted by accident, or left, also by FAULT, without an outcome of each target."""

from __future__ import annotations

from collections.abc import Iterator

from lupin_engine.chart.expressions.evaluation import Constant
from lupin_engine.chart.findings import warning
from lupin_engine.chart.model import Chart, Kind, State, Transition, every_call
from lupin_engine.chart.rules.index import Index, guard_of, local
from lupin_engine.chart.semantics import FAULT
from lupin_engine.chart.strictness import stricter
from lupin_engine.errors import Diagnostic


def begins_anew(index: Index) -> Iterator[Diagnostic]:
    """Find transitions that leave an itinerary's state and enter it again, so that the itinerary restarts.

    These are transitions of the state itself into a state inside, and of states inside that advance to it.
    """
    for walker in _walkers(index):
        for transition in walker.transitions:
            if transition.event != "done" and _leaves_to_return(index, walker, transition):
                hint = f"add 'internal: true' to go on, or name {local(walker.name)!r} to begin anew"
                yield _begun(walker, transition, hint)
        for transition in (each for state in _inside(index, walker) for each in state.transitions):
            if transition.target == walker.name and _calls(transition, "itinerary.advance"):
                yield _begun(walker, transition, "name the state inside to go on with")


def _leaves_to_return(index: Index, walker: State, transition: Transition) -> bool:
    target = transition.target
    if target is None or target == walker.name or not index.inside(target, walker.name):
        return False
    kept = transition.internal or index.chart.states[target].kind is Kind.HISTORY
    return walker.kind is Kind.COMPOUND and not kept


def _begun(walker: State, transition: Transition, hint: str) -> Diagnostic:
    name = local(walker.name)
    problem = f"this leaves {name!r} and enters it again, so that its itinerary begins anew"
    return warning(transition.place, "begins-anew", transition.id, problem, hint)


def untold_rest(index: Index) -> Iterator[Diagnostic]:
    """Find a way out of an itinerary that leaves targets open for which no outcome is published."""
    for walker in _walkers(index):
        if not _publishes_all(walker) or _closed_elsewhere(index, walker) or _returns(index, walker):
            continue
        budgets = [t for state in _inside(index, walker) for t in state.transitions if t.event == "budget"]
        for transition in (*walker.transitions, *budgets):
            if transition.event == "done" or not _ends(index, walker, transition):
                continue
            problem = f"the targets of {local(walker.name)!r} that are open then are told of by nobody"
            hint = "add 'itinerary.close_rest: {status: ...}' to its 'do'"
            yield warning(transition.place, "untold-rest", transition.id, problem, hint)


def silent_fault(index: Index) -> Iterator[Diagnostic]:
    """Find a FAULT that publishes no outcome of the targets that a failed mission leaves."""
    fault = index.chart.states.get(FAULT)
    walks = (walker.itinerary for walker in _walkers(index) if walker.mission)
    if fault is None or closes_in_fault(index.chart) or all(walk.leaves_open for walk in walks if walk):
        return
    problem = "a mission that fails leaves its targets without an outcome"
    hint = "add 'itinerary.close_rest: {status: ..., code: ...}' to its 'entry'"
    yield stricter("silent-fault", fault.place, FAULT, problem, hint)


def closes_in_fault(chart: Chart) -> bool:
    """Say whether FAULT publishes an outcome of each target that a failed mission leaves."""
    return any(call.name == "itinerary.close_rest" for call in every_call(chart.states[FAULT].on_entry))


def _publishes_all(walker: State) -> bool:
    """Say whether an itinerary is to publish each of its targets once; an endless one is not."""
    walk = walker.itinerary
    if walk is None or walk.leaves_open or not walker.mission:
        return False
    return walk.sweeps is None or (isinstance(walk.sweeps, Constant) and walk.sweeps.value == 1)


def _ends(index: Index, walker: State, transition: Transition) -> bool:
    """Say whether a transition leaves an itinerary for another state of the mission, whatever was visited."""
    target = transition.target
    if target is None or index.inside(target, walker.name):
        return False
    if index.chart.states[target].mission != walker.mission:
        return False  # the lifecycle tells
    return "itinerary." not in guard_of(transition).source and not _calls(transition, "itinerary.close_rest")


def _closed_elsewhere(index: Index, walker: State) -> bool:
    """Say whether the mission closes the open visits when the itinerary is left, or after it."""
    if any(call.name == "itinerary.close_rest" for call in every_call(walker.on_exit)):
        return True
    walkers = {each.name for each in _walkers(index)}
    around = (
        call.action
        for call in index.calls
        if call.state.mission == walker.mission and walkers.isdisjoint(index.lineage[call.state.name])
    )
    return any(call.name == "itinerary.close_rest" for call in every_call(around))


def _returns(index: Index, walker: State) -> bool:
    """Say whether the mission returns into an itinerary that was left, by a history around it."""
    pasts = (state for state in index.states if state.kind is Kind.HISTORY and state.mission)
    around = [past.name for past in pasts if (past.parent or "") in index.lineage[walker.name]]
    return any(
        not index.inside(t.source, walker.name) for past in around for t in index.ways_to.get(past, ())
    )


def _walkers(index: Index) -> Iterator[State]:
    return (state for state in index.states if state.itinerary is not None)


def _inside(index: Index, walker: State) -> Iterator[State]:
    return (s for s in index.states if s is not walker and index.inside(s.name, walker.name))


def _calls(transition: Transition, action: str) -> bool:
    return any(call.name == action for call in every_call(transition.actions))
