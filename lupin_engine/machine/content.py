"""Executable content: the actions of transitions, entries and exits, the built-in ones carried out here.

As in SCXML, an error in an action ends its block and becomes an internal error event (see `Turn.fail`); the
step goes on, so a configuration is never left half-way.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from lupin_engine.chart.model import ActionCall
from lupin_engine.machine.environment import Cause, World, environment, walk_of
from lupin_engine.machine.event import Act, Publish, Report
from lupin_engine.machine.memory import Memory, Visit, Walk
from lupin_engine.machine.turn import Signal, Turn


class Content:
    """Runs actions for one memory."""

    def __init__(self, world: World, memory: Memory) -> None:
        self._world = world
        self._memory = memory

    def run(self, actions: Iterable[ActionCall], state: str, cause: Cause, turn: Turn) -> None:
        """Carry out a block of actions written in `state`."""
        for call in actions:
            try:
                self._run(call, state, cause, turn)
            except Exception as problem:
                turn.fail(state, f"{call.place}: {call.name}: {problem}")
                return

    def _run(self, call: ActionCall, state: str, cause: Cause, turn: Turn) -> None:
        env = environment(self._world, self._memory, state, turn.now, cause)
        arguments = {name: value.evaluate(env) for name, value in call.arguments.items()}
        builtin = _BUILTINS.get(call.name)
        if builtin is not None:
            builtin(self, arguments, walk_of(self._world.chart, self._memory, state), turn)
        elif call.moves and self._memory.held:
            self._memory.waiting_actions.append((state, call.name, arguments))
        else:
            turn.commands.append(Act(call.name, arguments))

    def release_actions(self, turn: Turn) -> None:
        """Carry out what a hold kept waiting."""
        for _, name, arguments in self._memory.waiting_actions:
            turn.commands.append(Act(name, arguments))
        self._memory.waiting_actions.clear()

    def forget_actions(self, state: str) -> None:
        """Drop what waits for a release in a state that is left: it was meant for there."""
        waiting = self._memory.waiting_actions
        self._memory.waiting_actions = [action for action in waiting if action[0] != state]

    def set(self, arguments: Mapping[str, Any], _: Walk | None, __: Turn) -> None:
        """`set`: write context variables."""
        self._memory.context.update(arguments)

    def raise_event(self, arguments: Mapping[str, Any], _: Walk | None, turn: Turn) -> None:
        """`raise`: queue an internal event."""
        turn.signals.append(Signal(str(arguments["event"])))

    def advance(self, _: Mapping[str, Any], walk: Walk | None, turn: Turn) -> None:
        """`itinerary.advance`: go on to the next target; refused while the current visit is open."""
        visit = walk.visit if walk else None
        if walk is None or visit is None or not visit.closed:
            turn.notes.append("itinerary.advance refused: the current visit is open")
        else:
            walk.index += 1

    def close(self, arguments: Mapping[str, Any], walk: Walk | None, turn: Turn) -> None:
        """`itinerary.close`: give the current visit its outcome and publish it; refused the second time."""
        visit = walk.visit if walk else None
        if visit is None or visit.closed:
            turn.notes.append("itinerary.close refused: the current visit is closed already")
        else:
            self._close(visit, arguments, turn)

    def close_rest(self, arguments: Mapping[str, Any], walk: Walk | None, turn: Turn) -> None:
        """`itinerary.close_rest`: close every open visit of the itinerary, in order."""
        for visit in walk.visits if walk else ():
            if not visit.closed:
                self._close(visit, arguments, turn)

    def _close(self, visit: Visit, arguments: Mapping[str, Any], turn: Turn) -> None:
        visit.status = arguments["status"]
        visit.code = arguments.get("code", "")
        visit.detail = arguments.get("detail", "")
        visit.reading = arguments.get("reading")
        self._publish(visit, turn)

    def _publish(self, visit: Visit, turn: Turn) -> None:
        turn.commands.append(
            Publish(
                self._memory.mission,
                self._memory.mission_id,
                visit.target,
                visit.status,
                visit.code,
                visit.detail,
                visit.reading,
            )
        )

    def publish_reading(self, arguments: Mapping[str, Any], _: Walk | None, turn: Turn) -> None:
        """`publish.reading`: publish a reading that belongs to no visit."""
        self._publish(Visit(arguments["tag"], "OK", reading=arguments["reading"]), turn)

    def clear(self, _: Mapping[str, Any], __: Walk | None, ___: Turn) -> None:
        """`report.clear`: nothing is wrong any more; forget the code reported last."""
        self._memory.code = self._memory.detail = ""

    def summary(self, _: Mapping[str, Any], walk: Walk | None, turn: Turn) -> None:
        """`report.summary`: say what became of every target."""
        visits = tuple(dict(vars(visit)) for visit in walk.visits) if walk else ()
        turn.commands.append(Report(self._memory.mission, self._memory.mission_id, visits))


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
