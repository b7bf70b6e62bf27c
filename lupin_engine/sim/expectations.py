"""Compares a simulation with a scenario's expectations; a failure shows the steps around it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import zip_longest
from typing import Any

from lupin_engine.chart.model import Chart
from lupin_engine.chart.strictness import is_dated, stricter
from lupin_engine.errors import Diagnostic
from lupin_engine.machine.event import Act, Cancel, Command, Start
from lupin_engine.machine.memory import Visit
from lupin_engine.machine.step import Step, View
from lupin_engine.plugin.mocks import contains
from lupin_engine.plugin.profile import START, Publish
from lupin_engine.plugin.types import converted
from lupin_engine.properties.built_in import INVARIANTS
from lupin_engine.runtime.history import AttemptHistory
from lupin_engine.sim.entry_order import ROUNDING, OrderComparison, seconds
from lupin_engine.sim.failure import FailureMaker, ScenarioFailure
from lupin_engine.sim.narration import shorten
from lupin_engine.sim.scenario_file import (
    END,
    OPEN,
    CountNode,
    ExpectNode,
    MomentNode,
    RefusedNode,
    ScenarioNode,
    VisitNode,
)
from lupin_engine.sim.simulation import End, Happening, MomentView, Run, is_named

#: A difference at a moment: the key and its index, what was expected, what there was, the states concerned.
Difference = tuple[str, int | None, Any, Any, Sequence[str]]


class Comparison:
    """Compares a run with the expectations of a scenario."""

    def __init__(self, scenario: ScenarioNode, run: Run) -> None:
        self._scenario = scenario
        self._expect: ExpectNode = scenario.expect
        self._run = run
        self._chart: Chart = run.chart
        self._maker = FailureMaker(run)
        #: What holds as an older engine meant it, after `failures`.
        self.dated: list[Diagnostic] = []

    def failures(self) -> Iterator[ScenarioFailure]:
        """Yield the differences; after any, the unused mocks too, because one may explain a difference."""
        found = list(self._differences())
        yield from found
        if found:
            yield from self._unspent()

    def _differences(self) -> Iterator[ScenarioFailure]:
        expect, run = self._expect, self._run
        looks_at_all = expect.only is None
        yield from self._moments()
        yield from self._same("lifecycle", expect.lifecycle, run.history.lifecycles)
        yield from OrderComparison(expect, run, self._maker).failures()
        yield from self._visits("visits", expect.visits, run.visits, run.visits_of_sweep)
        published = [publish for _, publish in run.history.published]
        yield from self._visits("published", expect.published, published, _without_early(run))
        yield from self._statuses()
        yield from self._refused() if looks_at_all else ()
        yield from self._appeared("holds", expect.holds, run.history.holds)
        if looks_at_all or INVARIANTS in (expect.only or ()):
            yield from self._appeared("broken", expect.broken, run.history.broken)
        yield from self._violated()
        yield from self._same("final", expect.final, run.view.lifecycle)
        yield from self._same("paused", expect.paused, run.view.paused)
        yield from self._same("last_error", expect.last_error, _error(run.view, expect.last_error))
        yield from self._counts("counts", expect.counts, _begins)
        yield from self._counts("updates", expect.updates, _updates)
        yield from self._counts("cancels", expect.cancels, _cancels)
        yield from self._dropped()
        yield from self._notes()
        yield from self._lasted()
        if looks_at_all:
            yield from self._unfired()
            yield from self._idle()

    def _same(self, word: str, expected: Any, actual: Any) -> Iterator[ScenarioFailure]:
        if expected is not None and expected != actual:
            place, last = self._expect.at(word), self._run.view.configuration[-1:]
            if word == "final":
                actual = f"{actual}{self._maker.until}"
            yield self._maker.failure(place, word, expected, actual, concerned=last)

    # -- at a moment ------------------------------------------------------------------------------------

    def _moments(self) -> Iterator[ScenarioFailure]:
        run = self._run
        for number, when in enumerate(self._scenario.when):
            if when.expect is not None:
                end = MomentView(run.seconds, len(run.steps), run.view, run.context)
                for seen in (end,) if when.at_ == END else run.views.get(number, ()):
                    yield from self._moment(when.expect, seen)

    def _moment(self, node: MomentNode, seen: MomentView) -> Iterator[ScenarioFailure]:
        around = self._run.steps[seen.steps - 1] if seen.steps else None
        for key, index, expected, actual, states in (*self._states(node, seen), *self._values(node, seen)):
            what = f"{key} at {seen.time:.1f} s"
            yield self._maker.failure(node.at(key, index), what, expected, actual, around, states)

    def _states(self, node: MomentNode, seen: MomentView) -> Iterator[Difference]:
        active = seen.view.configuration
        parents = {self._chart.states[name].parent for name in active}
        leaves = [name for name in active if name not in parents]
        for index, name in enumerate(node.state):
            if not any(is_named(one, name) for one in active):
                yield "state", index, name, leaves, self._maker.called(name)
        for index, name in enumerate(node.not_state):
            found = [one for one in active if is_named(one, name)]
            if found:
                yield "not_state", index, f"not {name}", leaves, found

    def _values(self, node: MomentNode, seen: MomentView) -> Iterator[Difference]:
        view = seen.view
        leaf = view.configuration[-1:]
        actual: Mapping[str, Any] = {
            "lifecycle": view.lifecycle,
            "phase": view.phase,
            "target": view.target,
            "paused": view.paused,
            "asked": [question.question for question in view.asking],
            "held": list(view.held),
            "last_error": _error(view, node.last_error),
            "running": sorted(attempt.operation for attempt in view.attempts),
        }
        for key, found in actual.items():
            given = getattr(node, key)
            expected = sorted(given) if key == "running" and given is not None else given
            if expected is not None and expected != found:
                yield key, None, expected, found, leaf
        for name, expected in node.variables.items():
            if not contains(seen.context.get(name), converted(expected, self._chart.context[name].type)):
                yield "variables", None, f"{name}: {expected}", f"{name}: {seen.context.get(name)}", leaf

    # -- outcomes ---------------------------------------------------------------------------------------

    def _visits(
        self,
        word: str,
        expected: Sequence[VisitNode] | None,
        visits: Sequence[Visit | Publish],
        once: Sequence[Visit | Publish],
    ) -> Iterator[ScenarioFailure]:
        """Compare visits; those that an older engine had `once` are a warning."""
        if expected is None:
            return
        pairs = _pairs(expected, visits)
        first = next((index for index, pair in enumerate(pairs) if not _is_met(*pair)), None)
        if first is None:
            return
        node, visit = pairs[first]
        place = self._expect.at(word, first if node is not None else None)
        actual = [_outcome_text(visit, node) for node, visit in pairs if visit is not None]
        if all(_is_met(*pair) for pair in _pairs(expected, once)) and is_dated("early-outcomes"):
            problem = "every target of a request has an outcome now, also before its visit"
            new = [one for one in rewritten(expected, visits) if isinstance(one, str)]
            hint = f"not expected: {', '.join(new)}"
            self.dated.append(
                stricter("early-outcomes", self._expect.at(word), f"expect.{word}", problem, hint)
            )
            return
        around = self._publication(word, first, visit)
        yield self._maker.failure(place, word, list(map(str, expected)), actual, around)

    def _publication(self, word: str, index: int, visit: Visit | Publish | None) -> Step | None:
        """Return the step of a publication: that of its number, or the last about a visit's target.

        None where there was no such publication.
        """
        found = self._run.history.published
        if word == "published":
            return found[index][0] if index < len(found) else None
        return next((step for step, c in reversed(found) if visit and c.target == visit.target), None)

    def _statuses(self) -> Iterator[ScenarioFailure]:
        for status, wanted in self._expect.statuses.items():
            count = sum(1 for _, publish in self._run.history.published if publish.status == status)
            if not _is_in(wanted, count):
                place = self._expect.value_at("statuses", status)
                actual = f"{count} of {len(self._run.history.published)}"
                yield self._maker.failure(place, f"statuses: {status}", wanted, actual)

    def _refused(self) -> Iterator[ScenarioFailure]:
        wanted, refused = self._expect.refused, self._run.history.refused
        for index, (node, step) in enumerate(zip_longest(wanted, refused)):
            if node is None or step is None or not _fits(node, step):
                expected = _wanted_refusal(node) if node else "no further refusal"
                actual = _refusal(step) if step else "no further refusal"
                place = self._expect.at("refused", index if node else None)
                yield self._maker.failure(place, "refused", expected, actual, step)

    def _appeared(
        self, word: str, expected: Sequence[str] | None, found: Sequence[tuple[Step, str]]
    ) -> Iterator[ScenarioFailure]:
        """Compare the holds that were engaged, or the invariants that were broken."""
        actual = [name for _, name in found]
        if expected is None or list(expected) == actual:
            return
        same = [one == other for one, other in zip(expected, actual, strict=False)]
        first = same.index(False) if False in same else len(same)
        place = self._expect.at(word, first if first < len(expected) else None)
        around = found[first][0] if first < len(found) else None
        known: Mapping[str, Any] = self._chart.holds if word == "holds" else self._chart.invariants
        what = "the hold" if word == "holds" else "the invariant"
        # A hold of the engine itself, such as the one after a restart, stands in no file.
        pieces = [
            (f"{what} {name}", known[name].place) for name in actual[first : first + 1] if name in known
        ]
        yield self._maker.failure(place, word, list(expected), actual, around, pieces)

    def _violated(self) -> Iterator[ScenarioFailure]:
        """Compare the violated properties; each failure has the reason of its violation."""
        expected, only = self._expect.violated, self._expect.only
        # An invariant has a word of its own: `broken`.
        violated = [one for one in self._run.violated if one[1] != INVARIANTS]
        violated = [one for one in violated if only is None or one[1] in only]
        if expected == [name for _, name, _ in violated]:
            return
        place = self._expect.at("violated")
        for step, name, text in violated:
            if name not in expected:
                known = self._chart.properties.get(name)
                pieces = [(f"the property {name}", known.place)] if known else []
                yield self._maker.failure(place, f"violated: {name}", "it holds", text, step, pieces)
        missing = [name for name in expected if name not in [name for _, name, _ in violated]]
        if missing:
            yield self._maker.failure(place, "violated", missing, "they hold")

    def _notes(self) -> Iterator[ScenarioFailure]:
        notes = [note for step in self._run.steps for note in step.notes] if self._expect.notes else []
        for index, wanted in enumerate(self._expect.notes):
            if not any(wanted in note for note in notes):
                yield self._maker.failure(self._expect.at("notes", index), "notes", wanted, notes)

    # -- how often, how long ----------------------------------------------------------------------------

    def _counts(
        self, key: str, counts: Mapping[str, CountNode], is_of: Callable[[Command, str], bool]
    ) -> Iterator[ScenarioFailure]:
        for name, expected in counts.items():
            steps = [step for step in self._run.steps for command in step.commands if is_of(command, name)]
            if not _is_in(expected, len(steps)):
                place, last = self._expect.value_at(key, name), steps[-1] if steps else None
                states = [s.name for s in self._chart.states.values() if s.invoke and s.invoke.name == name]
                yield self._maker.failure(place, f"{key}: {name}", expected, len(steps), last, states)

    def _dropped(self) -> Iterator[ScenarioFailure]:
        expected, dropped = self._expect.dropped, self._run.view.dropped
        if expected is not None and not _is_in(expected, dropped):
            yield self._maker.failure(self._expect.at("dropped"), "dropped", expected, dropped)

    def _lasted(self) -> Iterator[ScenarioFailure]:
        lasted = self._run.seconds
        for word, sign in (("within", 1.0), ("at_least", -1.0)):
            given = getattr(self._expect, word)
            limit = seconds(given)
            if limit is not None and sign * (lasted - limit) > ROUNDING:
                yield self._maker.failure(self._expect.at(word), word, given, f"{lasted:.1f} s")

    # -- what never happened ----------------------------------------------------------------------------

    def _unfired(self) -> Iterator[ScenarioFailure]:
        """A happening that never came to pass is a mistake of the scenario: it tested nothing."""
        for number in dict.fromkeys(happening.number for happening in self._run.unfired):
            happening = next(one for one in self._run.unfired if one.number == number)
            nth = f" {happening.nth} times" if happening.nth > 1 else ""
            name = happening.state or happening.operation or ""
            verb = "entered" if happening.state else "started"
            states = self._maker.called(name) if happening.state else []
            expected = f"{name} is {verb}{nth}, for something to happen then"
            actual = f"{verb} {self._beginnings(happening)} times"
            place = self._scenario.at("when", number)
            yield self._maker.failure(place, "when", expected, actual, concerned=states)

    def _beginnings(self, happening: Happening) -> int:
        """Return how often the entry or start took place that a happening waits for."""
        history = self._run.history
        entered = [(name, "") for _, name in history.entered]
        started = [("", attempt.operation) for attempt in history.attempts.values()]
        return sum(1 for begun in (*entered, *started) if happening.is_meant(*begun))

    def _idle(self) -> Iterator[ScenarioFailure]:
        """Yield a failure for each happening without effect: it tested nothing."""
        for time, happening in self._run.idle:
            operation = getattr(happening.effect, "operation", "")
            is_end = isinstance(happening.effect, End)
            expected = f"{operation} is under way" if is_end else f"the server of {operation} is gone"
            around = next((step for step in reversed(self._run.steps) if step.time <= time), None)
            place, actual = self._scenario.at("when", happening.number), f"not so at {time:.1f} s"
            yield self._maker.failure(place, "when", expected, actual, around)

    def _unspent(self) -> Iterator[ScenarioFailure]:
        """Yield mocks with unused outcomes; alone no failure: they may be of forbidden events."""
        for number, used in self._run.unspent.items():
            mock, attempts = self._scenario.mocks[number], self._attempts(self._scenario.mocks[number].do)
            count = f"{len(mock.then)} attempts" if mock.in_turn else "an attempt"
            first = attempts[0].arguments if attempts and not used else {}
            given = [name for name in mock.with_ if name in first]
            values = "".join(f"; {name} of the first: {shorten(first[name])}" for name in given)
            expected, actual = f"{count} of {mock.do} under this mock", f"{used} of {len(attempts)}{values}"
            yield ScenarioFailure(self._scenario.at("mocks", number), "mock not used up", expected, actual)

    def _attempts(self, operation: str) -> list[AttemptHistory]:
        return [one for one in self._run.history.attempts.values() if one.operation == operation]


def _error(view: View, wanted: str | None) -> str:
    """Return the code reported last; with its detail, as it is published, where one is expected."""
    return f"{view.code}: {view.detail}" if view.detail and ":" in (wanted or "") else view.code


def _is_in(wanted: CountNode, count: int) -> bool:
    return wanted.at_least <= count and (wanted.at_most is None or count <= wanted.at_most)


def _pairs(
    expected: Sequence[VisitNode], visits: Sequence[Visit | Publish]
) -> list[tuple[VisitNode | None, Visit | Publish | None]]:
    return list(zip_longest(expected, visits))


def _without_early(run: Run) -> list[Publish]:
    """Return the outcomes that were published from the first visit of each mission on."""
    walkers = {state.name for state in run.chart.states.values() if state.itinerary is not None}
    found: list[Publish] = []
    begun = False
    for step in run.steps:
        begun = (begun and not (step.event.name == START and step.taken)) or not walkers.isdisjoint(
            step.entered
        )
        found += [command for command in step.commands if begun and isinstance(command, Publish)]
    return found


def rewritten(expected: Sequence[VisitNode], visits: Sequence[Visit | Publish]) -> list[int | str]:
    """Return what a scenario would expect of visits: the number of what it expects already, or a new text."""
    found: list[int | str] = []
    kept = 0
    for visit in visits:
        stays = kept < len(expected) and _is_met(expected[kept], visit)
        found.append(kept if stays else _outcome_text(visit, None))
        kept += stays
    return found


def _is_met(node: VisitNode | None, visit: Visit | Publish | None) -> bool:
    return (
        node is not None
        and visit is not None
        and (node.target, node.status) == (visit.target, visit.status or OPEN)
        and node.code in (None, visit.code)
        and (node.detail or "") in visit.detail
        and (node.reading is None or contains(visit.reading or {}, node.reading))
    )


def _outcome_text(visit: Visit | Publish, node: VisitNode | None) -> str:
    """Return the outcome of a visit as text, with the parts that were expected."""
    parts = [visit.target, visit.status or OPEN]
    if node is None or node.code is not None or (visit.status or OPEN) != node.status:
        parts.append(visit.code)
    if node is not None and node.detail is not None:
        parts.append(repr(visit.detail))
    if node is not None and node.reading is not None:
        parts.append(f"with {visit.reading}")
    return " ".join(filter(None, parts))


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


def _begins(command: Command, name: str) -> bool:
    if isinstance(command, Start):
        return command.operation == name and not command.updates
    return isinstance(command, Act) and command.action == name


def _updates(command: Command, name: str) -> bool:
    return isinstance(command, Start) and command.operation == name and bool(command.updates)


def _cancels(command: Command, name: str) -> bool:
    return isinstance(command, Cancel) and command.operation == name
