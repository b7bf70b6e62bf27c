"""The timers of states: armed on entry, disarmed on exit; a budget keeps the time that is left of it."""

from __future__ import annotations

from collections.abc import Container

from lupin_engine.chart.expressions.evaluation import Environment
from lupin_engine.chart.model import State, Timer
from lupin_engine.errors import reason
from lupin_engine.machine.event import InternalEvent, Trigger
from lupin_engine.machine.inputs import WallClock
from lupin_engine.machine.scope import EvaluationScope
from lupin_engine.machine.step import Macrostep
from lupin_engine.machine.timers import period, seconds


class StateTimers:
    """The timers that the states of one machine declare: `after`, `every`, `at` and `budget`."""

    __slots__ = ("_scope", "_wall")

    def __init__(self, scope: EvaluationScope, wall: WallClock) -> None:
        self._scope = scope
        self._wall = wall

    def arm(self, state: State, trigger: Trigger, step: Macrostep) -> None:
        """Start the timers of a state that is entered, but none whose time is an error: the step has that."""
        for timer in (*state.timers, *((state.budget,) if state.budget else ())):
            if timer.word != "at":
                self._arm(timer, "budget" if timer is state.budget else "after", state, trigger, step)
        self._wall.arm(state.name, step)

    def disarm(self, state: State, exited: Container[str], step: Macrostep) -> None:
        """Forget the timers of a state that is left, together with all that is `exited`."""
        if state.timers:
            self._scope.timers.disarm("after", state.name)
            self._wall.leave(state.name)
        if state.budget is not None:
            self._keep_budget(state, state.budget, exited, step)

    def stop_budgets(self) -> None:
        """Stop the budget timers of states that are not active."""
        memory = self._scope.memory
        for state in memory.budgets.keys() - set(memory.configuration):
            self._scope.timers.disarm("budget", state)

    def tick_again(self, state: str, event: str, due: float, step: Macrostep) -> None:
        """Schedule the next tick of an `every` from when this one was due; missed ticks are skipped.

        If its period is an error now, the step has that, and no tick follows.
        """
        for timer in self._scope.chart.states[state].timers:
            if timer.word == "every" and timer.event == event:
                try:
                    period = _delay(timer, self._scope.see(state, step))
                except Exception as problem:
                    step.fail(state, f"{timer.place}: every: {reason(problem)}")
                    return
                missed = (step.now - due) // period
                self._scope.timers.arm("after", state, due + missed * period, period, event)

    def _arm(self, timer: Timer, kind: str, state: State, trigger: Trigger, step: Macrostep) -> None:
        """Start a timer of a state, unless an earlier visit's is still running; an error is the step's."""
        timers, memory = self._scope.timers, self._scope.memory
        if timer.goes_on and timers.left(kind, state.name, step.now) is not None:
            return
        delay = memory.budgets.get(state.name) if kind == "budget" else None
        if delay is None:
            try:
                delay = _delay(timer, self._scope.see(state.name, step, trigger))
            except Exception as problem:
                step.fail(state.name, f"{timer.place}: {timer.word}: {reason(problem)}")
                return
        if kind == "budget":
            memory.budgets[state.name] = delay
        if timer.goes_on and delay <= 0.0:
            # Used up meanwhile: nothing is begun before that is dealt with.
            step.queue.append(InternalEvent(timer.event, state.name))
            return
        timers.arm(kind, state.name, step.now, delay, timer.event)

    def _keep_budget(self, state: State, budget: Timer, exited: Container[str], step: Macrostep) -> None:
        """Store the time that is left of a state's budget, unless it was entered before the mission began.

        A budget with `goes_on` keeps running while the mission is diverted.
        """
        timers, known = self._scope.timers, self._scope.memory.budgets
        mission = self._scope.chart.missions.get(state.mission)
        if budget.goes_on and mission and mission.state in exited:
            return
        if state.name in known:
            known[state.name] = timers.left("budget", state.name, step.now) or 0.0
        timers.disarm("budget", state.name)


def _delay(timer: Timer, env: Environment) -> float:
    """Return how long a timer takes; errors of its expression, ValueError: too long, or too often."""
    due = timer.due.evaluate(env)
    return period(due) if timer.word == "every" else seconds(due)
