"""Begins missions: the one in the slot, and those that are embedded in a state."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from lupin_engine.chart.model import State, UsedMission
from lupin_engine.errors import reason
from lupin_engine.machine.actions import ExecutableContent
from lupin_engine.machine.event import Event, Trigger
from lupin_engine.machine.requests import read_given
from lupin_engine.machine.scope import CONTEXT, ITINERARY, REQUEST, EvaluationScope
from lupin_engine.machine.step import Macrostep
from lupin_engine.plugin.types import fitted


class MissionStart:
    """Begins the missions of one machine: their requests, variables and targets."""

    __slots__ = ("_content", "_scope", "_walks")

    def __init__(self, scope: EvaluationScope, content: ExecutableContent, walks: Iterable[State]) -> None:
        """Make it for one machine; `walks` are the states whose targets follow from the request alone."""
        self._scope = scope
        self._content = content
        self._walks = walks

    def begin_context(self, step: Macrostep) -> None:
        """Set variables without a value to their default.

        Where a default raises, the step reports that as an error, and the variable stays unset.
        """
        scope, context = self._scope, self._scope.memory.context
        for name, variable in scope.chart.context.items():
            try:
                if name not in context:
                    context[name] = fitted(variable.default.evaluate(scope.see("", step)), variable.type)
            except Exception as problem:
                step.fail("", f"{variable.place}: context {name}: {reason(problem)}")

    def begin(self, event: Event, values: dict[str, Any], step: Macrostep) -> None:
        """Begin the mission that an accepted request starts; `values` are its fields, checked before."""
        memory = self._scope.memory
        memory.begin_mission(self._scope.chart)
        memory.mission = str(event.data["mission_type"])
        memory.mission_id = str(event.data.get("mission_id", ""))
        memory.started_at = step.now
        memory.request.update(values)
        self.begin_context(step)
        for walker in self._walks:
            if walker.mission == memory.mission:
                self._register_targets(walker, step)
        self._scope.mark_dirty(CONTEXT | REQUEST | ITINERARY)

    def begin_used(self, state: State, use: UsedMission, trigger: Trigger, step: Macrostep) -> None:
        """Begin an embedded mission: its request, its variables, missions inside, its `entry`.

        A request that fails is reported and marks the step as `failed_use`; `entry` runs all the same.
        """
        scope, memory = self._scope, self._scope.memory
        memory.given[state.name] = {}
        try:
            memory.given[state.name] = read_given(
                scope.world, state.name, use, scope.see(state.name, step, trigger)
            )
        except ValueError as problem:
            step.fail(state.name, str(problem))
            step.failed_use = state.name
        for name in memory.begin_part(state):
            scope.timers.disarm("budget", name)
        self.begin_context(step)
        scope.mark_dirty(CONTEXT | REQUEST)
        self._content.run(use.entry, state.name, trigger, step)

    def _register_targets(self, state: State, step: Macrostep) -> None:
        """Register the targets of a state, possibly in an embedded mission, that follow from the request.

        Where that fails nothing is registered: entering the state reports it.
        """
        scope, given = self._scope, self._scope.memory.given
        for name in reversed(scope.chart.lineage[state.name]):
            use = scope.chart.states[name].use
            if use is not None and name not in given:
                try:
                    given[name] = read_given(scope.world, name, use, scope.see(name, step))
                except ValueError:
                    return  # entering the state tells
        self._content.itineraries.register(state)
