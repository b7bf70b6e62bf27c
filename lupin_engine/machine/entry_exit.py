"""Entering and leaving a state: what begins with it, what ends with it, and what a final state completes."""

from __future__ import annotations

from collections.abc import Container, Mapping
from typing import Any

from lupin_engine.chart.model import Kind, State
from lupin_engine.errors import reason
from lupin_engine.machine.actions import ExecutableContent
from lupin_engine.machine.event import NOTHING, InternalEvent, Trigger
from lupin_engine.machine.mission_start import MissionStart
from lupin_engine.machine.operations import Operations
from lupin_engine.machine.requests import Questions
from lupin_engine.machine.scope import Arguments, EvaluationScope
from lupin_engine.machine.state_timers import StateTimers
from lupin_engine.machine.step import Macrostep, fields_text


class EntryExit:
    """Enters and leaves the states of one machine, one at a time; a microstep says which, in which order."""

    __slots__ = ("_content", "_missions", "_operations", "_questions", "_scope", "_timers")

    def __init__(
        self,
        scope: EvaluationScope,
        content: ExecutableContent,
        operations: Operations,
        questions: Questions,
        missions: MissionStart,
        timers: StateTimers,
    ) -> None:
        self._scope = scope
        self._content = content
        self._operations = operations
        self._questions = questions
        self._missions = missions
        self._timers = timers

    def exit(self, state: State, trigger: Trigger, exited: Container[str], step: Macrostep) -> None:
        """Leave a state, together with all that is `exited`."""
        if state.use is not None:
            self._content.run(state.use.exit, state.name, trigger, step)
        if state.exit:
            self._content.run(state.exit, state.name, trigger, step)
        if state.invoke is not None or state.for_each is not None:
            self._operations.end(state, step)
        if state.timers or state.budget is not None:
            self._timers.disarm(state, exited, step)
        if state.ask is not None:
            self._questions.close(state.name, step)

    def enter(self, state: State, trigger: Trigger, comes_back: bool, step: Macrostep) -> None:
        """Enter a state; one that `comes_back` is restored from history."""
        if state.itinerary is not None:
            self._content.itineraries.begin(state, trigger, step, comes_back)
        if state.entry and not (comes_back and self._is_mission(state)):
            self._content.run(state.entry, state.name, trigger, step)
        if state.use is not None and not comes_back:
            self._missions.begin_used(state, state.use, trigger, step)
        if state.invoke is not None:
            self._operations.enter(state.name, trigger.event)
        if state.timers or state.budget is not None:
            self._timers.arm(state, trigger, step)
        if state.ask is not None:
            self._questions.ask(state.name, state.ask, trigger, step)
        if state.kind is Kind.FINAL:
            self._completed(state, self._result(state, trigger, step), step)

    def _is_mission(self, state: State) -> bool:
        """Say whether a state wraps a mission, which begins once however often history brings it back."""
        return state.parent is not None and self._scope.chart.states[state.parent].slot

    def _result(self, final: State, trigger: Trigger, step: Macrostep) -> Mapping[str, Any]:
        """Return the done data of a final state; if an expression fails, none, and the step has the error."""
        if not final.result:
            return NOTHING
        try:
            found = Arguments(final.result, {}).evaluate(self._scope.see(final.name, step, trigger))
        except Exception as problem:
            step.fail(final.name, f"{final.place}: result: {reason(problem)}")
            return NOTHING
        step.note(f"{final.local_name} gives {fields_text(found)}")
        return found

    def _completed(self, final: State, result: Mapping[str, Any], step: Macrostep) -> None:
        """Raise `done` for the state that a final state ends, and for the parallel ones that end with it."""
        states = self._scope.chart.states
        parent = states[final.parent or ""]
        if parent.parent is not None and self._is_mission(parent):
            parent = states[parent.parent]  # a mission's end is the slot's end
        step.queue.append(InternalEvent("done", parent.name, Trigger(result)))
        while parent.parent is not None:
            parent = states[parent.parent]
            if parent.kind is not Kind.PARALLEL or not self._is_final(parent.name):
                break
            step.queue.append(InternalEvent("done", parent.name))

    def _is_final(self, region: str) -> bool:
        """Say whether a region of a parallel state has come to its end (SCXML: isInFinalState)."""
        states, configuration = self._scope.chart.states, self._scope.memory.configuration
        state = states[region]
        if state.kind is Kind.HISTORY:
            return True
        if state.kind is Kind.PARALLEL:
            return all(map(self._is_final, state.children))
        return any(states[child].kind is Kind.FINAL and child in configuration for child in state.children)
