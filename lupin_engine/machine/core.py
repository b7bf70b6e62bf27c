"""What the parts of one machine share: the chart, its memory, what expressions see, the deadlines."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from lupin_engine.chart.expressions.evaluation import Environment, Expression, UnknownInput
from lupin_engine.chart.model import Chart, Transition
from lupin_engine.errors import Severity, reason
from lupin_engine.machine.environment import NO_CAUSE, Cause, Surroundings, World
from lupin_engine.machine.memory import Memory
from lupin_engine.machine.structure import FAULT
from lupin_engine.machine.timers import Timers
from lupin_engine.machine.turn import Turn


class Core:
    """The common ground of a machine's parts."""

    __slots__ = ("chart", "env", "memory", "timers", "world")

    def __init__(self, world: World, memory: Memory) -> None:
        self.world = world
        self.chart: Chart = world.chart
        self.memory = memory
        self.timers = Timers(memory)
        self.env = Surroundings(world, memory)

    def see(self, state: str, turn: Turn, cause: Cause = NO_CAUSE) -> Environment:
        """Return what an expression written in `state` sees now; good until the next call."""
        return self.env.at(state, turn.now, cause)

    def check(self, guard: Expression, state: str, turn: Turn, cause: Cause = NO_CAUSE) -> bool:
        """Evaluate a condition; with an unknown input it is false, any other failure is an error as well."""
        try:
            return bool(guard.evaluate(self.see(state, turn, cause)))
        except UnknownInput as unknown:
            turn.note(f"{guard.place}: {guard.source}: {unknown}")
        except Exception as problem:
            turn.fail_once(state, f"{guard.place}: {guard.source}: {reason(problem)}")
        return False

    def fitting(self, name: str, value: Any) -> Any:
        """Return what is to be written to a variable; its kind was checked at load, its range is here.

        Raises:
            ValueError: the variable's type has a minimum, and the value is below.
        """
        variable = self.chart.context.get(name)
        least = variable.type.minimum if variable else None
        if variable is not None and least is not None and value < least:
            raise ValueError(f"{name} is a {variable.type} of at least {least:g}, got {value!r}")
        return value

    def report(self, code: str, detail: str) -> None:
        """Remember a code for `last_error`; what is mere information does not replace a warning.

        In FAULT nothing less severe than its reason does: an emergency stop there must not hide what failed.
        """
        declared = self.chart.codes.get(code)
        shown = self.chart.codes.get(self.memory.code) if FAULT in self.memory.configuration else None
        least = shown.severity if shown else Severity.WARN
        if declared is None or declared.severity >= least:
            self.memory.code, self.memory.detail = code, detail


def passes(rule: Transition, held: Iterable[str]) -> bool:
    """Say whether holds let a transition through."""
    return all(hold in rule.during or hold in rule.releases for hold in held)
