"""The report of a failed expectation: expected and actual, the lines of both files, the steps around.

Without colours: `ScenarioFailure.lines` names the kind of each line.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lupin_engine.errors import Place
from lupin_engine.machine.step import Step
from lupin_engine.sim.narration import narrate
from lupin_engine.sim.simulation import Run, is_named

#: What a line of a failure is.
KINDS = ("head", "source", "caret", "expected", "actual", "chart", "story", "marked")
HEAD, SOURCE, CARET, EXPECTED, ACTUAL, CHART, STORY, MARKED = KINDS


#: How many lines of the story are shown before and after the step that a failure is about.
AROUND = 5


@dataclass(frozen=True)
class ScenarioFailure:
    """One expectation that was not met.

    Args:
        place: the expectation in the scenario.
        concerned: elements of the chart, each with a description.
        story: the steps around it, and `marked` the index of the step itself.
    """

    place: Place
    what: str
    expected: str
    actual: str
    concerned: tuple[tuple[str, Place], ...] = ()
    story: tuple[str, ...] = ()
    marked: int | None = None

    def __str__(self) -> str:
        return "\n".join(text for _, text in self.lines())

    def lines(self) -> Iterator[tuple[str, str]]:
        """Yield its lines, each with its kind."""
        yield from self.about()
        yield from self.story_lines()

    def about(self) -> Iterator[tuple[str, str]]:
        """Yield the difference, and the lines of both files."""
        yield HEAD, f"{self.place.shown}: {self.what}"
        yield EXPECTED, f"    expected: {self.expected}"
        yield ACTUAL, f"    actual:   {self.actual}"
        yield from excerpt(self.place)
        for what, place in self.concerned:
            yield CHART, f"  {place.shown}: {what}"
            yield from excerpt(place)

    def story_lines(self) -> Iterator[tuple[str, str]]:
        """Yield the steps around it."""
        for index, line in enumerate(self.story):
            marked = index == self.marked
            yield (MARKED if marked else STORY), f"    {'>' if marked else '|'} {line}"


def failure_lines(failures: Iterable[ScenarioFailure]) -> Iterator[tuple[str, str]]:
    """Yield the lines of several failures of one run; the same steps are shown once in a row."""
    before: ScenarioFailure | None = None
    for failure in failures:
        yield from failure.about()
        if before is None or (failure.story, failure.marked) != (before.story, before.marked):
            yield from failure.story_lines()
        before = failure


class FailureMaker:
    """Makes the failures of one run: with the pieces of chart and story that they are about."""

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
        concerned: Sequence[str | tuple[str, Place]] = (),
    ) -> ScenarioFailure:
        """Make a failure.

        Args:
            around: the step that it is about; None: the end of the run.
            concerned: full names of the states that it is about, and other pieces of the chart.
        """
        story, marked = self._story(around)
        states = [name for name in concerned if isinstance(name, str)]
        others = [piece for piece in concerned if not isinstance(piece, str)]
        pieces = (*others, *self._pieces(around, states))
        return ScenarioFailure(place, what, _text(expected), _text(actual), pieces, story, marked)

    @property
    def until(self) -> str:
        """The limit that ended the run, as text; '' where none did."""
        return f", when the run was stopped at {self._run.limit}" if self._run.cut_off else ""

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
        """Return the lines around a step, and the index of its own; without a step the last ones and None."""
        history = self._run.history
        lines = [str(line) for line in narrate(self._chart, history)]
        if around is None:
            return tuple(lines[-2 * AROUND :]), None
        until = list(narrate(self._chart, history, end=around.sequence))
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


def excerpt(place: Place) -> Iterator[tuple[str, str]]:
    """Yield the line of a place and a caret below it; nothing when the file cannot be read any more."""
    try:
        lines = Path(place.file).read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError):
        return
    if place.line <= len(lines):
        yield SOURCE, f"{place.line:>7} | {lines[place.line - 1]}"
        yield CARET, f"{'':>7} | {'':>{place.column - 1}}^"
