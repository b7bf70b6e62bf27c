"""Invariants: one that is false in a stable configuration is an error, once."""

from __future__ import annotations

from lupin_engine.chart.model import Invariant
from lupin_engine.chart.semantics import EXECUTION_ERROR
from lupin_engine.errors import reason
from lupin_engine.machine.event import InternalEvent, Trigger
from lupin_engine.machine.scope import EvaluationScope
from lupin_engine.machine.step import Macrostep
from lupin_engine.plugin.contract import INVARIANT_CODE


def watch_invariants(scope: EvaluationScope, step: Macrostep) -> None:
    """Raise the error event of each invariant that has become false, and report its code.

    It is raised again only after the invariant has held; one that cannot be evaluated counts as false.
    """
    broken = scope.memory.broken
    for invariant in scope.chart.invariants.values():
        breach = _breach(invariant, scope, step)
        if not breach and invariant.name in broken:
            broken.remove(invariant.name)
        elif breach and invariant.name not in broken:
            broken.append(invariant.name)
            step.broken += (invariant.name,)
            step.note(breach)
            scope.record_code(INVARIANT_CODE, breach, step)
            error = {"code": INVARIANT_CODE, "detail": breach}
            step.queue.append(InternalEvent(EXECUTION_ERROR, None, Trigger(event=error, error=error)))


def _breach(invariant: Invariant, scope: EvaluationScope, step: Macrostep) -> str:
    """Return how an invariant is broken, '' where it holds; one that cannot be evaluated is broken."""
    that, problem = invariant.that, ""
    try:
        if that.evaluate(scope.see("", step)):
            return ""
    except Exception as raised:
        problem = f": {reason(raised)}"
    return f"{invariant.place}: invariant {invariant.name} does not hold: {that.source}{problem}"
