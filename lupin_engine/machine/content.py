"""Executable content: the actions of transitions, entries and exits, the built-in ones carried out here.

As in SCXML, an error in an action ends its block and becomes an internal error event (see `Turn.fail`); the
step goes on, so a configuration is never left half-way.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from lupin_engine.chart.model import ActionCall
from lupin_engine.errors import reason
from lupin_engine.machine.arguments import evaluated
from lupin_engine.machine.core import Core
from lupin_engine.machine.environment import Cause
from lupin_engine.machine.event import Act, Report
from lupin_engine.machine.memory import Visit, Walk
from lupin_engine.machine.turn import Signal, Turn
from lupin_engine.machine.walks import Walks


class Content:
    """Runs the actions of one machine."""

    __slots__ = ("_core", "walks")

    def __init__(self, core: Core) -> None:
        self._core = core
        self.walks = Walks(core)

    def run(self, actions: Iterable[ActionCall], state: str, cause: Cause, turn: Turn) -> None:
        """Carry out a block of actions written in `state`."""
        for call in actions:
            try:
                self._run(call, state, cause, turn)
            except Exception as problem:
                turn.fail(state, f"{call.place}: {call.name}: {reason(problem)}")
                return

    def _run(self, call: ActionCall, state: str, cause: Cause, turn: Turn) -> None:
        env = self._core.see(state, turn, cause)
        action = self._core.chart.catalog.actions.get(call.name)
        arguments = evaluated(call.arguments, action.arguments if action else {}, env)
        builtin = _BUILTINS.get(call.name)
        if builtin is not None:
            builtin(self, arguments, self.walks.of(state), turn)
        elif call.moves and self._core.memory.held:
            self._core.memory.waiting_actions.append((state, call.name, arguments))
        else:
            turn.commands.append(Act(call.name, arguments))

    def release_actions(self, turn: Turn) -> None:
        """Carry out what a hold kept waiting."""
        waiting = self._core.memory.waiting_actions
        turn.commands.extend(Act(name, arguments) for _, name, arguments in waiting)
        waiting.clear()

    def forget_actions(self, state: str) -> None:
        """Drop what waits for a release in a state that is left: it was meant for there."""
        waiting = self._core.memory.waiting_actions
        waiting[:] = [action for action in waiting if action[0] != state]

    def set(self, arguments: Mapping[str, Any], _: Walk | None, __: Turn) -> None:
        """`set`: write context variables."""
        fitting = {name: self._core.fitting(name, value) for name, value in arguments.items()}
        self._core.memory.context.update(fitting)

    def raise_event(self, arguments: Mapping[str, Any], _: Walk | None, turn: Turn) -> None:
        """`raise`: queue an internal event."""
        turn.signals.append(Signal(str(arguments["event"])))

    def advance(self, _: Mapping[str, Any], walk: Walk | None, turn: Turn) -> None:
        """`itinerary.advance`: go on to the next target."""
        self.walks.advance(walk, turn)

    def close(self, arguments: Mapping[str, Any], walk: Walk | None, turn: Turn) -> None:
        """`itinerary.close`: give the current visit its outcome."""
        self.walks.close(walk, arguments, turn)

    def close_rest(self, arguments: Mapping[str, Any], walk: Walk | None, turn: Turn) -> None:
        """`itinerary.close_rest`: give every open visit its outcome."""
        self.walks.close_rest(walk, arguments, turn)

    def publish_reading(self, arguments: Mapping[str, Any], _: Walk | None, turn: Turn) -> None:
        """`publish.reading`: publish a reading that belongs to no visit."""
        self.walks.publish(Visit(arguments["tag"], "OK", reading=arguments["reading"]), turn)

    def clear(self, _: Mapping[str, Any], __: Walk | None, ___: Turn) -> None:
        """`report.clear`: nothing is wrong any more; forget the code reported last."""
        self._core.memory.code = self._core.memory.detail = ""

    def summary(self, _: Mapping[str, Any], walk: Walk | None, turn: Turn) -> None:
        """`report.summary`: say what became of every target."""
        told = ("target", "status", "code", "detail", "reading", "tries")
        visits = tuple({name: getattr(v, name) for name in told} for v in walk.visits) if walk else ()
        turn.commands.append(Report(self._core.memory.mission, self._core.memory.mission_id, visits))


_BUILTINS = {
    "set": Content.set,
    "raise": Content.raise_event,
    "itinerary.advance": Content.advance,
    "itinerary.close": Content.close,
    "itinerary.close_rest": Content.close_rest,
    "publish.reading": Content.publish_reading,
    "report.clear": Content.clear,
    "report.summary": Content.summary,
}
