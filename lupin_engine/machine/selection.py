"""The selection of transitions (SCXML): those that an internal event causes, and those that need no event."""

from __future__ import annotations

from collections.abc import Sequence

from lupin_engine.chart.model import Transition
from lupin_engine.chart.semantics import EXECUTION_ERROR, FAULT
from lupin_engine.machine.event import InternalEvent
from lupin_engine.machine.holds import passes
from lupin_engine.machine.requests import consider
from lupin_engine.machine.scope import EvaluationScope, Watch
from lupin_engine.machine.step import Considered, Macrostep
from lupin_engine.machine.structure import FAULT_RULE, Configuration, LevelRules


class Selection:
    """Selects the transitions of one machine; for each active leaf at most one."""

    __slots__ = ("_scope", "watch")

    def __init__(self, scope: EvaluationScope) -> None:
        self._scope = scope
        #: Caches that none without an event is enabled.
        self.watch = Watch()
        scope.watches.append(self.watch)

    def without_event(self, levels: LevelRules, step: Macrostep) -> list[Transition]:
        """Return the eventless transitions and the ones on a level of an input that can be taken now."""
        if not self.watch.is_due(levels.reads, step.now):
            return []
        scope, memory, inputs = self._scope, self._scope.memory, self._scope.inputs
        held = memory.held
        inputs.now = step.now
        scope.doubtful = False
        ready = (
            [
                rule
                for rule in offered
                if (not rule.event or inputs.holds(rule.event)) and (not held or passes(rule, memory))
            ]
            for offered in levels.offered
        )
        chosen = scope.enabled(ready, step, step.bound)
        if chosen:
            self.watch.invalidate()
        else:
            self.watch.cache_false(levels.reads, scope, step.now)
        return chosen

    def caused_by(self, internal: InternalEvent, active: Configuration, step: Macrostep) -> list[Transition]:
        """Return the transitions that an internal event causes."""
        rules = self._scope.enabled(self.offered(internal, active), step, internal.trigger)
        if internal.name == EXECUTION_ERROR and FAULT in self._scope.memory.configuration:
            # An error within FAULT does not lead there again, or a failing entry action would never end.
            return [rule for rule in rules if rule.id != FAULT_RULE]
        return rules

    def offered(self, internal: InternalEvent, active: Configuration) -> Sequence[Sequence[Transition]]:
        """Return the transitions that listen to an internal event: of its state, or for each leaf."""
        if internal.state is None:
            return active.candidates(internal.name)
        if internal.state in self._scope.memory.configuration:
            return active.rules_of(internal.state, internal.name)
        return ()

    def why_none(
        self, internal: InternalEvent, active: Configuration, step: Macrostep
    ) -> tuple[Considered, ...]:
        """Return why each of those that listen to an internal event could not be taken."""
        rules = {rule.id: rule for offered in self.offered(internal, active) for rule in offered}
        return tuple(consider(self._scope, rule, step, internal.trigger) for rule in rules.values())
