"""Executable content: runs the actions of transitions, entries and exits; built-in ones are carried out here.

As in SCXML, an error in an action ends its block and becomes an internal error event (see `Macrostep.fail`);
the step goes on, so a configuration is never left half-way. Actions of plugins become commands; one that
moves the robot during a hold waits for the release.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable, Mapping
from typing import Any

from lupin_engine.chart.model import ActionCall, Chart
from lupin_engine.errors import reason
from lupin_engine.machine.event import NOTHING, Act, InternalEvent, Report, Trigger
from lupin_engine.machine.itineraries import Itineraries
from lupin_engine.machine.memory import Visit
from lupin_engine.machine.scope import CONTEXT, Arguments, EvaluationScope
from lupin_engine.machine.step import Macrostep, fields_text
from lupin_engine.plugin.profile import Publication
from lupin_engine.plugin.types import fitted


class CompiledAction:
    """An action whose name is resolved and whose arguments are prepared, once for each chart."""

    __slots__ = ("arguments", "builtin", "call", "data", "publication")

    def __init__(self, call: ActionCall, chart: Chart) -> None:
        declared = chart.catalog.actions.get(call.name)
        self.call = call
        self.builtin = _BUILTINS.get(call.name)
        self.publication = chart.profile.publications.get(call.name)
        self.arguments = Arguments(call.arguments, declared.arguments if declared else {})
        self.data = Arguments(call.data, {}) if call.data else None


class ExecutableContent:
    """Runs the actions of one machine."""

    __slots__ = ("_compiled", "_scope", "itineraries")

    def __init__(self, scope: EvaluationScope, compiled: dict[int, CompiledAction]) -> None:
        """Make the runner of one machine's actions; `compiled` caches them by id of the call."""
        self._scope = scope
        self._compiled = compiled
        self.itineraries = Itineraries(scope)

    def run(self, actions: Iterable[ActionCall], state: str, trigger: Trigger, step: Macrostep) -> bool:
        """Carry out a block of actions written in `state`; say whether it came to its end."""
        compiled = self._compiled
        for call in actions:
            if call.name == "if":
                holds = self._scope.check(call.guard, state, step, trigger)
                if not self.run(call.then if holds else call.otherwise, state, trigger, step):
                    return False
                continue
            action = compiled.get(id(call))
            if action is None:
                # The chart keeps its calls as long as it lives, so that an id means one of them.
                action = compiled[id(call)] = CompiledAction(call, self._scope.chart)
            try:
                self.carry_out(action, state, trigger, step)
            except Exception as problem:
                step.fail(state, f"{call.place}: {call.name}: {reason(problem)}")
                return False
        return True

    def carry_out(self, action: CompiledAction, state: str, trigger: Trigger, step: Macrostep) -> None:
        """Carry out one action, which may raise whatever its arguments raise."""
        scope = self._scope
        arguments = action.arguments.evaluate(scope.at(state, step.now, trigger))
        if action.data is not None:
            arguments["data"] = action.data.evaluate(scope)
        if action.builtin is not None:
            action.builtin(self, arguments, state, step)
        elif action.publication is not None:
            self.publish(action.publication, arguments, step)
        elif action.call.moves and scope.memory.held:
            scope.memory.waiting_actions.append((state, action.call.name, arguments))
        else:
            step.commands.append(Act(action.call.name, arguments))

    def resume(self, step: Macrostep) -> None:
        """Send the actions that waited for the last hold's release."""
        waiting = self._scope.memory.waiting_actions
        step.commands.extend(Act(name, arguments) for _, name, arguments in waiting)
        waiting.clear()

    def forget_actions(self, left: Container[str]) -> None:
        """Drop the waiting actions of states that are left."""
        waiting = self._scope.memory.waiting_actions
        waiting[:] = [action for action in waiting if action[0] not in left]

    def set(self, arguments: Mapping[str, Any], _: str, __: Macrostep) -> None:
        """`set`: write context variables."""
        self._write(arguments)

    def add(self, arguments: Mapping[str, Any], _: str, __: Macrostep) -> None:
        """`add`: put something into lists and sets; where one is full that is an error, nothing is lost."""
        context = self._scope.memory.context
        self._write({name: [*context[name], value] for name, value in arguments.items()})

    def remove(self, arguments: Mapping[str, Any], _: str, __: Macrostep) -> None:
        """`remove`: take something out of lists and sets, wherever it stands there."""
        context = self._scope.memory.context
        self._write({n: [old for old in context[n] if old != value] for n, value in arguments.items()})

    def _write(self, values: Mapping[str, Any]) -> None:
        """Write variables, all or none.

        Raises:
            ValueError: a value does not fit its variable, of which the text has the name.
        """
        kept = {}
        for name, value in values.items():
            variable = self._scope.chart.context.get(name)
            try:
                kept[name] = fitted(value, variable.type) if variable is not None else value
            except ValueError as problem:
                raise ValueError(f"{name} is {problem}") from None
        self._scope.memory.context.update(kept)
        self._scope.mark_dirty(CONTEXT)

    def raise_event(self, arguments: Mapping[str, Any], _: str, step: Macrostep) -> None:
        """`raise`: queue an internal event."""
        name, data = str(arguments["event"]), arguments.get("data", NOTHING)
        if data:
            step.note(f"{name} carries {fields_text(data)}")
        step.queue.append(InternalEvent(name, None, Trigger(data)))

    def advance(self, _: Mapping[str, Any], state: str, step: Macrostep) -> None:
        """`itinerary.advance`: make the next target the current one."""
        self.itineraries.advance(self.itineraries.of(state), step)

    def close(self, arguments: Mapping[str, Any], state: str, step: Macrostep) -> None:
        """`itinerary.close`: give the current visit its outcome."""
        self.itineraries.close(self.itineraries.of(state), arguments, step)

    def close_rest(self, arguments: Mapping[str, Any], state: str, step: Macrostep) -> None:
        """`itinerary.close_rest`: give every open visit its outcome."""
        self.itineraries.close_rest(state, arguments, step)

    def publish(self, publication: Publication, arguments: Mapping[str, Any], step: Macrostep) -> None:
        """Publish a reading that belongs to no visit: an action of the profile."""
        target, reading = arguments[publication.target[0]], arguments[publication.reading[0]]
        self.itineraries.publish(Visit(target, publication.outcome, reading=reading), step)

    def clear(self, _: Mapping[str, Any], __: str, ___: Macrostep) -> None:
        """`report.clear`: nothing is wrong any more; forget the code reported last."""
        self._scope.memory.code = self._scope.memory.detail = ""

    def note(self, arguments: Mapping[str, Any], _: str, step: Macrostep) -> None:
        """`report.note`: say something in the log."""
        step.note(arguments["text"])

    def summary(self, _: Mapping[str, Any], __: str, step: Macrostep) -> None:
        """`report.summary`: publish the outcome of every target."""
        memory = self._scope.memory
        fields = ("target", "status", "code", "detail", "reading", "tries")
        visits = tuple([{name: getattr(visit, name) for name in fields} for visit in memory.outcomes])
        step.commands.append(Report(memory.mission, memory.mission_id, visits))


_Builtin = Callable[[ExecutableContent, Mapping[str, Any], str, Macrostep], None]
_BUILTINS: Mapping[str, _Builtin] = {
    "set": ExecutableContent.set,
    "add": ExecutableContent.add,
    "remove": ExecutableContent.remove,
    "raise": ExecutableContent.raise_event,
    "itinerary.advance": ExecutableContent.advance,
    "itinerary.close": ExecutableContent.close,
    "itinerary.close_rest": ExecutableContent.close_rest,
    "report.clear": ExecutableContent.clear,
    "report.note": ExecutableContent.note,
    "report.summary": ExecutableContent.summary,
}
