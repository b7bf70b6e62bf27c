"""Itineraries: the lists that states walk, one target after the other, sweep after sweep."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from lupin_engine.chart.expressions.evaluation import UnknownInput
from lupin_engine.chart.model import Itinerary, State
from lupin_engine.errors import reason
from lupin_engine.machine.core import Core
from lupin_engine.machine.environment import Cause, walk_of
from lupin_engine.machine.event import Publish
from lupin_engine.machine.memory import Visit, Walk
from lupin_engine.machine.turn import Turn


class OpenVisit(Exception):
    """An itinerary was to go on although its current visit has no outcome."""


class Walks:
    """The itineraries of one machine."""

    __slots__ = ("_core",)

    def __init__(self, core: Core) -> None:
        self._core = core

    def begin(self, state: State, cause: Cause, turn: Turn, comes_back: bool) -> None:
        """Lay out the itinerary of a state that is entered; one brought back by history goes on with it."""
        rule, memory = state.itinerary, self._core.memory
        if rule is None:
            return
        if not (comes_back and state.name in memory.walks):
            walk = Walk(state.name, [], [], sweeps=self._sweeps(state, rule, cause, turn))
            walk.leaves_open = rule.leaves_open
            self._lay_out(walk, self._items(state, rule, cause, turn))
            memory.walks[state.name] = walk
            self._choose(walk, 0, turn)
        memory.current_walk = state.name

    def of(self, state: str) -> Walk | None:
        """Return the itinerary that `state` works on."""
        return walk_of(self._core.chart, self._core.memory, state)

    def advance(self, walk: Walk | None, turn: Turn) -> None:
        """Go on to the next target; refused when there is none.

        Raises:
            OpenVisit: the current visit has no outcome. Going on as if it had would walk to it for ever.
        """
        if walk is None or walk.visit is None:
            turn.note("itinerary.advance refused: there is no target to go on from")
        elif not walk.visit.closed:
            raise OpenVisit("the current visit is open: close it before going on")
        elif walk.index + 1 < len(walk.items) or walk.is_last_sweep:
            walk.index += 1
            self._choose(walk, walk.index, turn)
        else:
            self._sweep_again(walk, turn)

    def close(self, walk: Walk | None, outcome: Mapping[str, Any], turn: Turn) -> None:
        """Give the current visit its outcome and publish it; refused the second time."""
        visit = walk.visit if walk else None
        if walk is None or visit is None or visit.closed:
            turn.note("itinerary.close refused: the current visit is closed already")
        else:
            self._close(walk, visit, outcome, turn)

    def close_rest(self, walk: Walk | None, outcome: Mapping[str, Any], turn: Turn) -> None:
        """Close every open visit of an itinerary in order, unless it leaves them open."""
        if walk is None or walk.leaves_open:
            return
        for visit in walk.visits:
            if not visit.closed:
                self._close(walk, visit, outcome, turn)

    def publish(self, visit: Visit, turn: Turn, source: str = "") -> None:
        """Tell the world what became of a target; the mission is the source unless another one is named."""
        memory = self._core.memory
        told = (visit.target, visit.status, visit.code, visit.detail, visit.reading)
        turn.commands.append(Publish(source or memory.mission, memory.mission_id, *told))

    def _close(self, walk: Walk, visit: Visit, outcome: Mapping[str, Any], turn: Turn) -> None:
        visit.status = outcome["status"]
        visit.code = outcome.get("code", "")
        visit.detail = outcome.get("detail", "")
        visit.reading = outcome.get("reading")
        rule = self._core.chart.states[walk.state].itinerary
        self.publish(visit, turn, rule.source if rule else "")

    # -- laying out -------------------------------------------------------------------------------------

    def _lay_out(self, walk: Walk, items: list[Any]) -> None:
        walk.items = items
        walk.visits = [Visit(identity_of(item)) for item in items]
        walk.index = 0

    def _sweep_again(self, walk: Walk, turn: Turn) -> None:
        """Begin the next sweep with what the list is now; one that became empty stays as it was."""
        state = self._core.chart.states[walk.state]
        assert state.itinerary is not None, f"{walk.state} walks without an itinerary"
        for visit in walk.visits:
            walk.past[visit.status] = walk.past.get(visit.status, 0) + 1
        walk.sweep += 1
        self._lay_out(walk, self._items(state, state.itinerary, Cause(), turn) or walk.items)
        self._choose(walk, 0, turn)

    def _items(self, state: State, rule: Itinerary, cause: Cause, turn: Turn) -> list[Any]:
        try:
            return list(rule.items.evaluate(self._core.see(state.name, turn, cause)))
        except Exception as problem:
            turn.fail(state.name, f"{rule.place}: itinerary: {reason(problem)}")
            return []

    def _sweeps(self, state: State, rule: Itinerary, cause: Cause, turn: Turn) -> int:
        if rule.sweeps is None:
            return 1
        try:
            return int(rule.sweeps.evaluate(self._core.see(state.name, turn, cause)))
        except Exception as problem:
            turn.fail(state.name, f"{rule.place}: sweeps: {reason(problem)}")
            return 1

    def _choose(self, walk: Walk, index: int, turn: Turn) -> None:
        """Move the target that is next by the itinerary's order to `index`."""
        rule = self._core.chart.states[walk.state].itinerary
        if rule is None or rule.order is None or index >= len(walk.items):
            return
        try:
            ranks = [self._rank(rule, walk, item, turn) for item in walk.items[index:]]
        except UnknownInput as unknown:
            turn.note(f"{rule.order.place}: order: {unknown}; the list's own order counts")
            return
        except Exception as problem:
            turn.fail(walk.state, f"{rule.order.place}: order: {reason(problem)}")
            return
        best = index + ranks.index(min(ranks))
        walk.items.insert(index, walk.items.pop(best))
        walk.visits.insert(index, walk.visits.pop(best))

    def _rank(self, rule: Itinerary, walk: Walk, item: Any, turn: Turn) -> float:
        assert rule.order is not None
        self._core.see(walk.state, turn)
        return float(rule.order.evaluate(self._core.env.with_target(item)))


def identity_of(item: Any) -> str:
    """Return what an element is called in messages: its `id`, or itself."""
    return str(item["id"]) if isinstance(item, dict) and "id" in item else str(item)
