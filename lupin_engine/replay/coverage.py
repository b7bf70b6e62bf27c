"""Test coverage of scenarios: states, transitions, ends of operations, and branches of guards.

States, transitions and ends are read off the steps. A step does not have the results of its guards, so a run
to be counted uses a copy of the chart with instrumented guards (`CoverageObserver.prepare`).

A mission must cover its own states; the lifecycle's are shared, and one mission that reaches them is enough.
Around missions of one's own the shipped lifecycle is left out: the shipped missions have covered it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

from lupin_engine.chart.expressions.condition import Condition
from lupin_engine.chart.expressions.evaluation import Environment
from lupin_engine.chart.model import Chart, Invoke, Kind, State, Transition
from lupin_engine.errors import Place, near
from lupin_engine.machine.step import Step
from lupin_engine.missions.folders import is_shipped
from lupin_engine.replay.observed import guards_of_hold, observed
from lupin_engine.runtime.history import DONE, FAILED, AttemptHistory
from lupin_engine.sim.narration import short_name
from lupin_engine.sim.scenario import Missions
from lupin_engine.sim.simulation import Run
from lupin_engine.sim.suite import Counts, ScenarioResult

#: The kinds of items, in the order of reports.
STATES, TRANSITIONS, OUTCOMES, GUARDS = KINDS = ("states", "transitions", "outcomes", "guard branches")
#: A kind that is counted with them, and that no tally has.
HOLDS = "holds"
#: How the end of an operation is called that its timeout brings about.
TIMEOUT = "timeout"

#: A item that can be reached: its kind, whose it is, and which of several.
Key = tuple[str, str, str]


@dataclass(frozen=True)
class CoverageItem:
    """An item to cover; `mission` is the mission it belongs to, '' for the lifecycle."""

    key: Key
    place: Place
    text: str
    mission: str

    @property
    def kind(self) -> str:
        """Its kind."""
        return self.key[0]


# -- what there is ---------------------------------------------------------------------------------------


def items(chart: Chart) -> list[CoverageItem]:
    """Return all items of a chart, in the order of the file."""
    found = [item for state in chart.states.values() for item in _items(chart, state)]
    for hold in chart.holds.values():
        for name, word, guard in guards_of_hold(hold):
            found += _branches(guard, name, f"hold {hold.name}: {word}", "")
    return found


def _items(chart: Chart, state: State) -> Iterator[CoverageItem]:
    if state.name and state.kind is not Kind.HISTORY:
        yield CoverageItem(
            (STATES, state.name, ""), state.place, short_name(chart, state.name), state.mission
        )
    for rule in state.transitions:
        text = _rule_text(chart, rule)
        yield CoverageItem((TRANSITIONS, rule.id, ""), rule.place, text, state.mission)
        yield from _branches(rule.guard, rule.id, text, state.mission)
    for rule in state.resume_at:
        yield from _branches(rule.guard, rule.id, _rule_text(chart, rule), state.mission)
    for invoke in _invokes(state):
        yield from _ends(chart, state, invoke)
    if state.for_each is not None:
        name = short_name(chart, state.name)
        yield from _branches(state.for_each.when, f"{state.name}.for_each", f"{name}: when", state.mission)


def _invokes(state: State) -> Iterator[Invoke]:
    if state.invoke is not None:
        yield state.invoke
    if state.for_each is not None:
        yield state.for_each.invoke


def _ends(chart: Chart, state: State, invoke: Invoke) -> Iterator[CoverageItem]:
    """Yield the ways in which an operation can end."""
    words = [DONE, *dict.fromkeys(code.name for code in invoke.operation.codes)]
    ends = [(word, word) for word in words]
    if invoke.timeout is not None:
        ends.append((TIMEOUT, f"{invoke.timeout_code or TIMEOUT} (timeout)"))
    for word, missions in ends:
        key = (OUTCOMES, state.name, f"{invoke.name} {word}")
        text = f"{short_name(chart, state.name)}: {invoke.name} {missions}"
        yield CoverageItem(key, invoke.place, text, state.mission)


def _branches(guard: Condition, name: str, text: str, mission: str) -> Iterator[CoverageItem]:
    for value in ("true", "false") if guard else ():
        shown = f"{text}: {guard.source} is {value}"
        yield CoverageItem((GUARDS, name, value), guard.place, shown, mission)


def _rule_text(chart: Chart, rule: Transition) -> str:
    """Return the short text of a transition."""
    if rule.refuse is not None:
        leads = f"refused: {rule.refuse}"
    else:
        leads = f"-> {short_name(chart, rule.target)}" if rule.target is not None else "-> actions"
    return f"{short_name(chart, rule.source)}: {rule.event or 'always'} {leads}"


# -- guards that count -----------------------------------------------------------------------------------


class CoverageObserver:
    """Counts the items that runs reach, and the results of their charts' guards."""

    def __init__(self) -> None:
        self._seen: Counts = Counter()

    def prepare(self, chart: Chart) -> Chart:
        """Return a copy of a chart with instrumented guards."""
        return observed(chart, self._counter)

    def count(self, run: Run) -> Counts:
        """Return the counts of a run, with the guards evaluated since the last one.

        A step that explains why nothing was taken has evaluated guards once more, which is subtracted.
        """
        found = self._seen
        for step in run.steps:
            for one in step.why:
                key = (GUARDS, one.transition, "true" if one.holds else "false")
                if one.guard and key in found:
                    found[key] -= 1
        self._seen = Counter()
        return reached(run) + found

    def _counter(self, name: str, guard: Condition) -> Callable[[Environment], Any]:
        evaluate, true, false = guard.evaluate, (GUARDS, name, "true"), (GUARDS, name, "false")

        def counting(env: Environment) -> Any:
            try:
                value = evaluate(env)
            except Exception:
                self._seen[false] += 1  # as the machine takes it
                raise
            self._seen[true if value else false] += 1
            return value

        return counting


# -- what was reached ------------------------------------------------------------------------------------


def reached(run: Run) -> Counts:
    """Return how often a run reached states, transitions, ends of operations and holds."""
    found: Counts = Counter()
    for step in run.steps:
        found.update((STATES, name, "") for name in step.entered)
        found.update((TRANSITIONS, name, "") for name in step.taken)
        found.update((HOLDS, note.split(" ")[1], "") for note in step.notes if _engages(note))
        refusing = _refusing(step, _refusals(run.chart))
        if refusing:
            found[TRANSITIONS, refusing, ""] += 1
    for attempt in run.history.attempts.values():
        found.update(_ends_of(attempt, run))
    return found


def _engages(note: str) -> bool:
    return note.startswith("hold ") and note.endswith(" engaged")


@lru_cache(maxsize=32)
def _refusals(chart: Chart) -> Mapping[str, str]:
    """Return the transitions that refuse, each with its code."""
    rules = (rule for state in chart.states.values() for rule in state.transitions)
    return {rule.id: rule.refuse for rule in rules if rule.refuse is not None}


def _refusing(step: Step, refusals: Mapping[str, str]) -> str:
    """Return the transition that refused a request; '' when none did."""
    if step.refusal is None:
        return ""
    able = (one.transition for one in step.why if one.holds)
    return next((name for name in able if refusals.get(name) == step.refusal.code), "")


def _ends_of(attempt: AttemptHistory, run: Run) -> Iterator[Key]:
    """Yield the ends that an attempt came to, as long as a state waited for it."""
    if attempt.timed_out:
        yield OUTCOMES, attempt.state, f"{attempt.operation} {TIMEOUT}"
    if _is_done_by_hold(attempt, run):
        yield OUTCOMES, attempt.state, f"{attempt.operation} {DONE}"
    elif attempt.answer in (DONE, FAILED) and not attempt.late:
        word = DONE if attempt.answer == DONE else attempt.data["code"]
        yield OUTCOMES, attempt.state, f"{attempt.operation} {word}"


def _is_done_by_hold(attempt: AttemptHistory, run: Run) -> bool:
    """Return whether an attempt that a hold cut short counted as done, by `on_hold: continue`."""
    state = run.chart.states[attempt.state]
    goes_on = state.invoke is not None and state.invoke.on_hold == "continue"
    if attempt.cancelled is None or attempt.timed_out or not goes_on:
        return False
    ways = {rule.id for rule in state.transitions if rule.event == "done"}
    after = (step for step in run.steps if step.time >= (attempt.cancelled or 0.0))
    left = next((step for step in after if state.name in step.exited), None)
    return left is not None and not ways.isdisjoint(left.taken)


# -- the sum ---------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Tally:
    """The numbers of one kind: reached, total, and the missing items."""

    kind: str
    total: int
    missing: tuple[CoverageItem, ...]

    @property
    def taken(self) -> int:
        """The number of reached items."""
        return self.total - len(self.missing)


@dataclass
class FileCoverage:
    """A mission or a lifecycle: the items of its file, parts included, and their counts."""

    title: str
    file: str
    items: dict[Key, CoverageItem] = field(default_factory=dict)
    counts: Counts = field(default_factory=Counter)

    def tallies(self) -> list[Tally]:
        """Return the sum for each kind."""
        return [self._tally(kind) for kind in KINDS]

    def _tally(self, kind: str) -> Tally:
        mine = [item for item in self.items.values() if item.kind == kind]
        return Tally(kind, len(mine), tuple(item for item in mine if not self.counts[item.key]))


class Coverage:
    """The sum over many runs, by missions and lifecycles."""

    def __init__(self) -> None:
        self._parts: dict[str, FileCoverage] = {}
        self.charts: dict[Path, tuple[Chart, Counts]] = {}

    def add(self, mission: Path, chart: Chart, counts: Mapping[Key, int]) -> None:
        """Add the counts of one run of a mission."""
        own = _own_items(chart)
        if mission not in self.charts:
            self.charts[mission] = (chart, Counter())
            for item in own:
                self._part(chart, item.mission).items.setdefault(item.key, item)
        self.charts[mission][1].update(counts)
        for name in dict.fromkeys((*chart.missions, *(item.mission for item in own))):
            self._part(chart, name).counts.update(counts)

    def _part(self, chart: Chart, mission: str) -> FileCoverage:
        file = chart.missions[mission].file if mission else chart.states[""].place.file
        return self._parts.setdefault(file, FileCoverage(Path(file).stem, near(file)))

    @property
    def parts(self) -> list[FileCoverage]:
        """The missions, then the lifecycles."""
        lifecycles = {chart.states[""].place.file for chart, _ in self.charts.values()}
        return sorted(self._parts.values(), key=lambda part: part.file in map(near, lifecycles))

    @property
    def percent(self) -> float:
        """The share of reached items in percent; 0 without scenarios."""
        tallies = [tally for part in self.parts for tally in part.tallies()]
        total = sum(tally.total for tally in tallies)
        return 100.0 * sum(tally.taken for tally in tallies) / total if total else 0.0

    def record(self) -> dict[str, Any]:
        """Return the sum as JSON data."""
        return {
            "percent": round(self.percent, 1),
            "parts": [
                {"name": part.title, "file": part.file, **{t.kind: _tally_record(t) for t in part.tallies()}}
                for part in self.parts
            ],
        }


@lru_cache(maxsize=32)
def _own_items(chart: Chart) -> tuple[CoverageItem, ...]:
    """Return the items of a chart; those of a shipped lifecycle count around shipped missions only."""
    shipped = {file for file in chart.lifecycle_files if is_shipped(Path(file))}
    if any(is_shipped(Path(mission.file)) for mission in chart.missions.values()):
        shipped = set()
    return tuple(item for item in items(chart) if item.place.file not in shipped)


def add_up(results: Iterable[ScenarioResult], missions: Missions) -> Coverage:
    """Return the coverage of all scenarios together."""
    coverage = Coverage()
    for result in results:
        if result.mission is not None:
            coverage.add(result.mission, missions.chart(result.mission), result.counts)
    return coverage


def _tally_record(tally: Tally) -> dict[str, Any]:
    missing = [{"place": item.place.shown, "what": item.text} for item in tally.missing]
    return {"taken": tally.taken, "of": tally.total, "missing": missing}


# -- the sum as text ----------------------------------------------------------------------------------------

#: Width of a column of the table, in cells.
_WIDTH = 16


def coverage_lines(coverage: Coverage) -> Iterator[str]:
    """Yield a line for each mission and lifecycle, then every missing item."""
    if not coverage.parts:
        yield "nothing was reached: no scenario was run"
        return
    width = max(len(part.title) for part in coverage.parts)
    yield f"{'reached':{width}}" + "".join(f"{kind:>{_WIDTH}}" for kind in KINDS)
    for part in coverage.parts:
        yield f"{part.title:{width}}" + "".join(f"{_share(tally):>{_WIDTH}}" for tally in part.tallies())
    yield f"{coverage.percent:.1f} % of all"
    for part in coverage.parts:
        yield from _missing(part)


def _share(tally: Tally) -> str:
    return f"{tally.taken} of {tally.total}"


def _missing(part: FileCoverage) -> Iterator[str]:
    for tally in part.tallies():
        if tally.missing:
            yield ""
            yield f"{part.title}: {tally.kind} that were not reached"
        for item in tally.missing:
            yield f"  {item.place.shown}: {item.text}"
