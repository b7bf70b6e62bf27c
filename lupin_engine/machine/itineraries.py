"""Itineraries: iteration over lists of targets, in one or several passes (`sweeps`), with one visit for each.

Each visit is closed once, with an outcome that is published; advancing over an open visit is an error.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from lupin_engine.chart.expressions.evaluation import UnknownValue
from lupin_engine.chart.model import Itinerary, State
from lupin_engine.errors import reason, shortened
from lupin_engine.machine.event import Trigger
from lupin_engine.machine.memory import Traversal, Visit
from lupin_engine.machine.scope import ITINERARY, EvaluationScope, traversal_of
from lupin_engine.machine.step import Macrostep
from lupin_engine.plugin.profile import Publish


class OpenVisit(Exception):
    """`itinerary.advance` was called while the current visit had no outcome."""


class Itineraries:
    """The itineraries of one machine."""

    __slots__ = ("_scope",)

    def __init__(self, scope: EvaluationScope) -> None:
        self._scope = scope

    def begin(self, state: State, trigger: Trigger, step: Macrostep, comes_back: bool) -> None:
        """Build the itinerary of a state that is entered; one restored from history keeps its own."""
        rule, memory = state.itinerary, self._scope.memory
        if rule is None:
            return
        if not (comes_back and state.name in memory.itineraries):
            sweeps = self._sweeps(state, rule, trigger, step)
            traversal = Traversal(state.name, [], [], sweeps=sweeps, again=rule.again)
            traversal.leaves_open = rule.leaves_open
            self._lay_out(traversal, self._items(state, rule, trigger, step))
            before = memory.itineraries.get(state.name)
            if before is not None and before.begun:
                traversal.before, traversal.past = before.before + len(before.items), before.past
                traversal.earlier = before.earlier
                self._pass_on(before.visits, traversal)
            memory.itineraries[state.name] = traversal
            self._choose(traversal, 0, step)
        memory.current_itinerary = state.name
        self._scope.mark_dirty(ITINERARY)

    def register(self, state: State) -> None:
        """Register the targets of a mission that begins: each gets an outcome, however early it ends."""
        rule, memory = state.itinerary, self._scope.memory
        if rule is None:
            return
        traversal = Traversal(state.name, [], [], leaves_open=rule.leaves_open, begun=False)
        try:
            self._lay_out(traversal, list(rule.items.evaluate(self._scope)))
        except Exception:
            return  # entering the state tells
        memory.itineraries[state.name] = traversal
        memory.current_itinerary = memory.current_itinerary or state.name

    def of(self, state: str) -> Traversal | None:
        """Return the itinerary that `state` works on; None where the mission has entered none."""
        return traversal_of(self._scope.chart, self._scope.memory, state)

    def advance(self, traversal: Traversal | None, step: Macrostep) -> None:
        """Go on to the next target, or to the end; without a current one nothing changes but the notes.

        Raises:
            OpenVisit: the current visit has no outcome.
        """
        self._scope.mark_dirty(ITINERARY)
        if traversal is None or traversal.visit is None:
            step.note("itinerary.advance refused: there is no target to go on from")
        elif not traversal.visit.closed:
            raise OpenVisit("the current visit is open: close it before going on")
        elif traversal.index + 1 < len(traversal.items) or traversal.is_last_sweep:
            traversal.index += 1
            self._choose(traversal, traversal.index, step)
        else:
            self._sweep_again(traversal, step)

    def close(self, traversal: Traversal | None, outcome: Mapping[str, Any], step: Macrostep) -> None:
        """Give the current visit its outcome and publish it; one that is closed or missing is noted only."""
        visit = traversal.visit if traversal else None
        if traversal is None or visit is None or visit.closed:
            step.note("itinerary.close refused: the current visit is closed already")
        else:
            self._close(traversal, visit, outcome, step)

    def close_rest(self, state: str, outcome: Mapping[str, Any], step: Macrostep) -> None:
        """Close every open visit of the itineraries of a state, in order, unless they leave them open.

        Those are the one around it, else those inside it; for a state of the lifecycle all of the mission.
        """
        ahead = self._scope.memory.ahead
        for traversal in self._all_of(state):
            for visit in traversal.visits if not traversal.leaves_open else ():
                # A target of several itineraries that are not begun is told of once.
                if not visit.closed and (traversal.begun or any(visit is one for one in ahead)):
                    self._close(traversal, visit, outcome, step)

    def _all_of(self, state: str) -> list[Traversal]:
        chart, walks = self._scope.chart, self._scope.memory.itineraries
        around = [walks[name] for name in chart.lineage[state] if name in walks]
        inside = [walk for name, walk in walks.items() if state in chart.lineage[name]]
        if around or inside or not chart.states[state].mission:
            return around[:1] or inside or list(walks.values())
        last = self._scope.memory.traversal
        return [] if last is None else [last]

    def publish(self, visit: Visit, step: Macrostep, source: str = "") -> None:
        """Publish the outcome of a visit; the mission is the source unless another one is named."""
        memory = self._scope.memory
        fields = (visit.target, visit.status, visit.code, visit.detail, visit.reading)
        step.commands.append(Publish(source or memory.mission, memory.mission_id, *fields))

    def _close(self, traversal: Traversal, visit: Visit, outcome: Mapping[str, Any], step: Macrostep) -> None:
        self._scope.mark_dirty(ITINERARY)
        visit.status = outcome["status"]
        visit.code = outcome.get("code", "")
        visit.detail = outcome.get("detail", "")
        visit.reading = outcome.get("reading")
        rule = self._scope.chart.states[traversal.state].itinerary
        self.publish(visit, step, rule.source if rule else "")

    # -- laying out -------------------------------------------------------------------------------------

    def _lay_out(self, traversal: Traversal, items: list[Any]) -> None:
        traversal.items = items
        traversal.visits = [Visit(identity_of(item)) for item in items]
        traversal.index = 0

    def _sweep_again(self, traversal: Traversal, step: Macrostep) -> None:
        """Begin the next sweep: over what failed, or the list evaluated anew, which stays if it is empty."""
        state = self._scope.chart.states[traversal.state]
        assert state.itinerary is not None, f"{traversal.state} walks without an itinerary"
        failed = traversal.failed if traversal.precedes_failed else []
        self._pass_on(traversal.visits, traversal)
        traversal.sweep += 1
        if failed:
            traversal.before += len(traversal.items) - len(failed)  # they count in the mission's total
        items = failed or self._items(state, state.itinerary, Trigger(), step) or traversal.items
        self._lay_out(traversal, items)
        self._choose(traversal, 0, step)

    def _pass_on(self, visits: list[Visit], traversal: Traversal) -> None:
        """Count the visits of an earlier sweep or walk in the one that follows."""
        for visit in visits:
            if visit.closed:
                traversal.past[visit.status] = traversal.past.get(visit.status, 0) + 1
                traversal.earlier[visit.target] = visit

    def _items(self, state: State, rule: Itinerary, trigger: Trigger, step: Macrostep) -> list[Any]:
        try:
            items = list(rule.items.evaluate(self._scope.see(state.name, step, trigger)))
            for item in items:
                identity_of(item)  # one that has none is told here
            return items
        except Exception as problem:
            step.fail(state.name, f"{rule.place}: itinerary: {reason(problem)}")
            return []

    def _sweeps(self, state: State, rule: Itinerary, trigger: Trigger, step: Macrostep) -> int:
        sweeps = 1
        try:
            if rule.sweeps is not None:
                sweeps = int(rule.sweeps.evaluate(self._scope.see(state.name, step, trigger)))
        except Exception as problem:
            step.fail(state.name, f"{rule.place}: sweeps: {reason(problem)}")
        return sweeps + 1 if sweeps and rule.again else sweeps

    def _choose(self, traversal: Traversal, index: int, step: Macrostep) -> None:
        """Move the target that is next by the itinerary's order to `index`."""
        rule = self._scope.chart.states[traversal.state].itinerary
        if rule is None or rule.order is None or index >= len(traversal.items):
            return
        try:
            ranks = [self._rank(rule, traversal, item, step) for item in traversal.items[index:]]
        except UnknownValue as unknown:
            step.note(f"{rule.order.place}: order: {unknown}; the list's own order counts")
            return
        except Exception as problem:
            step.fail(traversal.state, f"{rule.order.place}: order: {reason(problem)}")
            return
        best = index + ranks.index(min(ranks))
        traversal.items.insert(index, traversal.items.pop(best))
        traversal.visits.insert(index, traversal.visits.pop(best))

    def _rank(self, rule: Itinerary, traversal: Traversal, item: Any, step: Macrostep) -> float:
        assert rule.order is not None
        self._scope.see(traversal.state, step)
        return float(rule.order.evaluate(self._scope.with_target(item)))


def identity_of(item: Any) -> str:
    """Return a target's name in messages: its `id`, or the target itself.

    Raises:
        ValueError: it has none; the checker lets that pass only where it does not know the type.
    """
    name = item.get("id") if isinstance(item, dict) else item
    if isinstance(name, bool) or not isinstance(name, (str, int)):
        raise ValueError(f"the target {shortened(repr(item))} has no 'id' to tell it by")
    return str(name)
