"""What was expected of a simulation against what came of it; a failure shows the story around it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from lupin_engine.errors import Place
from lupin_engine.machine.event import Act, Publish, Start
from lupin_engine.machine.memory import Visit
from lupin_engine.machine.step import Step
from lupin_engine.plugin.types import DURATION, convert
from lupin_engine.sim.scenario_file import ExpectNode, RefusedNode
from lupin_engine.sim.simulation import Run, is_named
from lupin_engine.sim.story import Line, tell

#: So that 26.1 s of sums of tenths is 26.1 s.
_ROUNDING = 1e-6
#: How many lines of the story are shown with a failure.
_SHOWN = 8


@dataclass(frozen=True)
class Failure:
    """One expectation that was not met; `story` is what happened around it."""

    place: Place
    what: str
    expected: str
    actual: str
    story: tuple[Line, ...] = ()

    def __str__(self) -> str:
        lines = [
            f"{self.place}: {self.what}",
            f"    expected: {self.expected}",
            f"    actual:   {self.actual}",
        ]
        return "\n".join([*lines, *(f"    | {line}" for line in self.story)])


class Comparison:
    """What was expected against what came."""

    def __init__(self, expect: ExpectNode, run: Run) -> None:
        self._expect = expect
        self._run = run
        self._entered = [(step, name) for step in run.steps for name in step.entered]

    def failures(self) -> Iterator[Failure]:
        """Yield what differs."""
        expect, run = self._expect, self._run
        yield from self._same("lifecycle", expect.lifecycle, list(run.lifecycles))
        yield from self._passes()
        yield from self._never()
        yield from self._visits("visits", expect.visits, run.visits)
        yield from self._visits("published", expect.published, [publish for _, publish in run.published])
        yield from self._refused()
        yield from self._same("final", expect.final, run.view.lifecycle)
        yield from self._same("paused", expect.paused, run.view.paused)
        yield from self._same("last_error", expect.last_error, run.view.code)
        yield from self._counts()
        yield from self._same("dropped", expect.dropped, run.view.dropped)
        yield from self._lasted()
        yield from self._unfired()

    def _same(self, word: str, expected: Any, actual: Any) -> Iterator[Failure]:
        if expected is not None and expected != actual:
            yield self._failure(self._expect.at(word), word, expected, actual)

    def _passes(self) -> Iterator[Failure]:
        reached, wanted = 0, self._expect.passes
        for _, name in self._entered:
            if reached < len(wanted) and is_named(name, wanted[reached]):
                reached += 1
        if reached < len(wanted):
            after = f" after {wanted[reached - 1]}" if reached else ""
            entered = list(dict.fromkeys(name.rpartition(".")[2] for _, name in self._entered if name))
            what = f"passes: {wanted[reached]} is not entered{after}"
            yield self._failure(self._expect.at("passes", reached), what, wanted, entered)

    def _never(self) -> Iterator[Failure]:
        for index, unwanted in enumerate(self._expect.never):
            for step, name in self._entered:
                if is_named(name, unwanted):
                    place = self._expect.at("never", index)
                    what, actual = f"never: {unwanted}", f"entered {name} at {step.time:.1f} s"
                    yield self._failure(place, what, f"{unwanted} is not entered", actual, step)
                    break

    def _visits(
        self, word: str, expected: list[str] | None, visits: Sequence[Visit | Publish]
    ) -> Iterator[Failure]:
        if expected is None:
            return
        actual = [f"{visit.target} {visit.status or 'open'} {visit.code}".rstrip() for visit in visits]
        shown = [
            text if _codes(wanted) else _without_code(text) for wanted, text in _paired(expected, actual)
        ]
        if expected != shown:
            first = next((i for i, pair in enumerate(_paired(expected, shown)) if pair[0] != pair[1]), 0)
            place = self._expect.at(word, first if first < len(expected) else None)
            yield self._failure(place, word, expected, actual, self._publication(first))

    def _publication(self, index: int) -> Step | None:
        steps = [step for step in self._run.steps for c in step.commands if isinstance(c, Publish)]
        return steps[index] if index < len(steps) else None

    def _refused(self) -> Iterator[Failure]:
        wanted, refused = self._expect.refused, self._run.refused
        for index in range(max(len(wanted), len(refused))):
            node = wanted[index] if index < len(wanted) else None
            step = refused[index] if index < len(refused) else None
            if node is None or step is None or not _fits(node, step):
                expected = _wanted_refusal(node) if node else "no further refusal"
                actual = _refusal(step) if step else "no further refusal"
                place = self._expect.at("refused", index if node else None)
                yield self._failure(place, "refused", expected, actual, step)

    def _counts(self) -> Iterator[Failure]:
        for name, expected in self._expect.counts.items():
            steps = [step for step in self._run.steps for command in step.commands if _is_of(command, name)]
            if len(steps) != expected:
                place = self._expect.value_at("counts", name)
                yield self._failure(
                    place, f"counts: {name}", expected, len(steps), steps[-1] if steps else None
                )

    def _lasted(self) -> Iterator[Failure]:
        seconds = self._run.seconds
        for word, sign in (("within", 1.0), ("at_least", -1.0)):
            given = getattr(self._expect, word)
            if given is not None and sign * (seconds - float(convert(given, DURATION))) > _ROUNDING:
                yield self._failure(self._expect.at(word), word, given, f"{seconds:.1f} s")

    def _unfired(self) -> Iterator[Failure]:
        """A happening that never came to pass is a mistake of the scenario: it tested nothing."""
        for happening in self._run.unfired:
            nth = f" {happening.nth} times" if happening.nth > 1 else ""
            expected = f"{happening.state} is entered{nth}, for something to happen then"
            entered = sum(1 for _, name in self._entered if is_named(name, happening.state or ""))
            yield self._failure(self._expect.place, "when", expected, f"entered {entered} times")

    def _failure(
        self, place: Place, what: str, expected: Any, actual: Any, around: Step | None = None
    ) -> Failure:
        return Failure(place, what, _text(expected), _text(actual), self._story(around))

    def _story(self, around: Step | None) -> tuple[Line, ...]:
        """Return the lines before and at a step; without one the last ones."""
        last = around.sequence if around is not None else len(self._run.steps)
        steps = [step for step in self._run.steps if step.sequence <= last]
        return tuple(tell(self._run.chart, steps))[-_SHOWN:]


def _text(value: Any) -> str:
    return (", ".join(map(str, value)) if isinstance(value, list) else str(value)) or "none"


def _codes(wanted: str | None) -> bool:
    return wanted is None or len(wanted.split()) > 2


def _without_code(text: str) -> str:
    return " ".join(text.split()[:2])


def _paired(expected: Sequence[str], actual: Sequence[str]) -> list[tuple[str | None, str]]:
    """Pair every actual text with the expected one in its place."""
    return [(expected[i] if i < len(expected) else None, text) for i, text in enumerate(actual)]


def _fits(node: RefusedNode, step: Step) -> bool:
    refusal = step.refusal
    if refusal is None or refusal.code != node.code:
        return False
    return node.request in (None, step.event.name) and (node.text or "") in refusal.text


def _wanted_refusal(node: RefusedNode) -> str:
    return " ".join(filter(None, (node.request, node.code, node.text and repr(node.text))))


def _refusal(step: Step) -> str:
    refusal = step.refusal
    return f"{step.event.name} {refusal.code} {refusal.text!r}" if refusal else step.event.name


def _is_of(command: Any, name: str) -> bool:
    if isinstance(command, Start):
        return command.operation == name
    return isinstance(command, Act) and command.action == name
