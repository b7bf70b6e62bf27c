"""Executable content: the actions of transitions, entries and exits, the built-in ones carried out here.

As in SCXML, an error in an action ends its block and becomes an internal error event (see `Macrostep.fail`);
the step goes on, so a configuration is never left half-way.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from lupin_engine.chart.model import ActionCall
from lupin_engine.errors import reason
from lupin_engine.machine.event import Act, InternalEvent, Report, Trigger
from lupin_engine.machine.itineraries import Itineraries
from lupin_engine.machine.memory import Traversal, Visit
from lupin_engine.machine.scope import EvaluationScope, evaluated
from lupin_engine.machine.step import Macrostep
from lupin_engine.plugin.profile import Publication


class ExecutableContent:
    """Runs the actions of one machine."""

    __slots__ = ("_scope", "itineraries")

    def __init__(self, scope: EvaluationScope) -> None:
        self._scope = scope
        self.itineraries = Itineraries(scope)

    def run(self, actions: Iterable[ActionCall], state: str, trigger: Trigger, step: Macrostep) -> None:
        """Carry out a block of actions written in `state`."""
        for call in actions:
            try:
                self._run(call, state, trigger, step)
            except Exception as problem:
                step.fail(state, f"{call.place}: {call.name}: {reason(problem)}")
                return

    def _run(self, call: ActionCall, state: str, trigger: Trigger, step: Macrostep) -> None:
        env = self._scope.see(state, step, trigger)
        action = self._scope.chart.catalog.actions.get(call.name)
        arguments = evaluated(call.arguments, action.arguments if action else {}, env)
        builtin = _BUILTINS.get(call.name)
        publication = self._scope.chart.profile.publications.get(call.name)
        if builtin is not None:
            builtin(self, arguments, self.itineraries.of(state), step)
        elif publication is not None:
            self.publish(publication, arguments, step)
        elif call.moves and self._scope.memory.held:
            self._scope.memory.waiting_actions.append((state, call.name, arguments))
        else:
            step.commands.append(Act(call.name, arguments))

    def suspend(self, step: Macrostep) -> None:
        """A hold was engaged: actions are over at once, there is nothing to stop."""

    def resume(self, step: Macrostep) -> None:
        """The last hold was released: carry out what it kept waiting."""
        waiting = self._scope.memory.waiting_actions
        step.commands.extend(Act(name, arguments) for _, name, arguments in waiting)
        waiting.clear()

    def forget_actions(self, state: str) -> None:
        """Drop what waits for a release in a state that is left: it was meant for there."""
        waiting = self._scope.memory.waiting_actions
        waiting[:] = [action for action in waiting if action[0] != state]

    def set(self, arguments: Mapping[str, Any], _: Traversal | None, __: Macrostep) -> None:
        """`set`: write context variables."""
        fitting = {name: self._fitting(name, value) for name, value in arguments.items()}
        self._scope.memory.context.update(fitting)

    def _fitting(self, name: str, value: Any) -> Any:
        """Return what is to be written to a variable; its kind was checked at load, its range is here.

        Raises:
            ValueError: the variable's type has a minimum, and the value is below.
        """
        variable = self._scope.chart.context.get(name)
        least = variable.type.minimum if variable else None
        if variable is not None and least is not None and value < least:
            raise ValueError(f"{name} is a {variable.type} of at least {least:g}, got {value!r}")
        return value

    def raise_event(self, arguments: Mapping[str, Any], _: Traversal | None, step: Macrostep) -> None:
        """`raise`: queue an internal event."""
        step.queue.append(InternalEvent(str(arguments["event"])))

    def advance(self, _: Mapping[str, Any], traversal: Traversal | None, step: Macrostep) -> None:
        """`itinerary.advance`: go on to the next target."""
        self.itineraries.advance(traversal, step)

    def close(self, arguments: Mapping[str, Any], traversal: Traversal | None, step: Macrostep) -> None:
        """`itinerary.close`: give the current visit its outcome."""
        self.itineraries.close(traversal, arguments, step)

    def close_rest(self, arguments: Mapping[str, Any], traversal: Traversal | None, step: Macrostep) -> None:
        """`itinerary.close_rest`: give every open visit its outcome."""
        self.itineraries.close_rest(traversal, arguments, step)

    def publish(self, publication: Publication, arguments: Mapping[str, Any], step: Macrostep) -> None:
        """Publish what was read at a target outside of a visit: an action of the profile."""
        target, reading = arguments[publication.target[0]], arguments[publication.reading[0]]
        self.itineraries.publish(Visit(target, publication.outcome, reading=reading), step)

    def clear(self, _: Mapping[str, Any], __: Traversal | None, ___: Macrostep) -> None:
        """`report.clear`: nothing is wrong any more; forget the code reported last."""
        self._scope.memory.code = self._scope.memory.detail = ""

    def summary(self, _: Mapping[str, Any], traversal: Traversal | None, step: Macrostep) -> None:
        """`report.summary`: say what became of every target."""
        told = ("target", "status", "code", "detail", "reading", "tries")
        visits = (
            tuple({name: getattr(v, name) for name in told} for v in traversal.visits) if traversal else ()
        )
        step.commands.append(Report(self._scope.memory.mission, self._scope.memory.mission_id, visits))


_BUILTINS = {
    "set": ExecutableContent.set,
    "raise": ExecutableContent.raise_event,
    "itinerary.advance": ExecutableContent.advance,
    "itinerary.close": ExecutableContent.close,
    "itinerary.close_rest": ExecutableContent.close_rest,
    "report.clear": ExecutableContent.clear,
    "report.summary": ExecutableContent.summary,
}
