"""From an expectation that was not met to a `Failure`: the pieces of chart and story that it is about."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from lupin_engine.errors import Place
from lupin_engine.machine.step import Step
from lupin_engine.sim.failure import Failure
from lupin_engine.sim.narration import tell
from lupin_engine.sim.simulation import Run, is_named

#: How many lines of the story are shown before and after the step that a failure is about.
AROUND = 5

#: A state that was entered, with the step that did it.
Entry = tuple[Step, str]


class Reporter:
    """Makes the failures of one run."""

    def __init__(self, run: Run) -> None:
        self._run = run
        self._chart = run.chart

    def failure(
        self,
        place: Place,
        what: str,
        expected: Any,
        actual: Any,
        around: Step | None = None,
        states: Sequence[str] = (),
        concerned: Sequence[tuple[str, Place]] = (),
    ) -> Failure:
        """Make a failure.

        Args:
            around: the step that it is about; None: the end of the run.
            states: full names of the states that it is about.
            concerned: further pieces of the chart.
        """
        story, marked = self._story(around)
        pieces = (*concerned, *self._pieces(around, states))
        return Failure(place, what, _text(expected), _text(actual), pieces, story, marked)

    def called(self, name: str) -> list[str]:
        """Return the full name of a state; of several with this name the first."""
        return [full for full in self._chart.states if full and is_named(full, name)][:1]

    def _pieces(self, around: Step | None, states: Sequence[str]) -> Iterator[tuple[str, Place]]:
        """Yield states, and the transition that a step took or that refused its request."""
        for name in states:
            yield f"the state {name}", self._chart.states[name].place
        if around is None:
            return
        rules = {rule.id: rule for state in self._chart.states.values() for rule in state.transitions}
        taken = [rules[name] for name in around.taken if name in rules]
        for rule in [rule for rule in taken if _leads_to(rule.target, states)][:1] or taken[:1]:
            yield f"taken at {around.time:.1f} s: {rule.id}", rule.place
        for one in around.why if around.refusal is not None else ():
            if one.holds and rules[one.transition].refuse is not None:
                yield f"refused at {around.time:.1f} s: {one.transition}", one.place
                break

    def _story(self, around: Step | None) -> tuple[tuple[str, ...], int | None]:
        """Return the lines around a step and which of them is the step's; without one the last lines."""
        history = self._run.history
        lines = [str(line) for line in tell(self._chart, history)]
        if around is None:
            return tuple(lines[-2 * AROUND :]), None
        until = list(tell(self._chart, history, end=around.sequence))
        at = max(0, len(until) - 1)
        first = max(0, at - AROUND)
        return tuple(lines[first : at + AROUND + 1]), at - first


def _leads_to(target: str | None, states: Sequence[str]) -> bool:
    """Say whether a target is one of the states, or holds one, or lies in one."""
    return target is not None and any(
        f"{name}.".startswith(f"{target}.") or f"{target}.".startswith(f"{name}.") for name in states
    )


def _text(value: Any) -> str:
    return (", ".join(map(str, value)) if isinstance(value, (list, tuple)) else str(value)) or "none"
