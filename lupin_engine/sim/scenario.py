"""Scenarios: a simulation and what must come of it, in a file of its own.

`load_scenario` reads a file and looks up every name in it (all mistakes at once, each with its place);
`Scenario.run` simulates it; `Scenario.failures` compares. A failure says what was expected, what came, and
what happened around it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lupin_engine.chart.documents import validate
from lupin_engine.chart.findings import Findings
from lupin_engine.chart.load import (
    LIFECYCLE,
    default_missions_folder,
    find_mission,
    lifecycle_of,
    load_chart,
)
from lupin_engine.chart.model import Chart
from lupin_engine.chart.source import Map, read
from lupin_engine.errors import ChartError, Place, UsageError
from lupin_engine.machine.event import OPERATOR_REQUESTS, Act, Publish, Start
from lupin_engine.machine.memory import Visit
from lupin_engine.machine.step import Step
from lupin_engine.plugin.contract import Operation
from lupin_engine.plugin.registry import Catalog
from lupin_engine.plugin.types import DURATION, convert
from lupin_engine.runtime.setup import check_value
from lupin_engine.sim.scenario_file import (
    EndNode,
    ExpectNode,
    MockNode,
    OutcomeNode,
    RefusedNode,
    ScenarioNode,
    WhenNode,
)
from lupin_engine.sim.scripted import OnCancel, Outcome, Rule
from lupin_engine.sim.simulation import (
    LIMIT,
    START,
    Ask,
    End,
    Happening,
    Run,
    Script,
    Tell,
    is_named,
    simulate,
)
from lupin_engine.sim.story import Line, tell

#: What scenario files end in.
SUFFIX = ".scenario.yaml"
#: How many lines of the story are shown with a failure.
_SHOWN = 8

Charts = Callable[[Path], Chart]


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


@dataclass(frozen=True)
class Scenario:
    """A scenario whose names have all been found."""

    file: Path
    promise: str
    chart: Chart
    catalog: Catalog
    script: Script
    parameters: Mapping[str, Any]
    expect: ExpectNode

    def run(self) -> Run:
        """Simulate it; errors as for `simulate`."""
        return simulate(self.chart, self.catalog, self.script, self.parameters)

    def failures(self, run: Run) -> list[Failure]:
        """Return every expectation that `run` does not meet, in the order of the file's words."""
        return list(_Comparison(self.expect, run).failures())


def is_scenario(name: str) -> bool:
    """Say whether a path is meant as a scenario file."""
    return name.endswith(SUFFIX)


def scenario_files(paths: Iterable[Path]) -> list[Path]:
    """Return the scenario files that are named or lie below the named folders, sorted within each.

    Raises:
        UsageError: a path does not exist, is no scenario, or holds none.
    """
    found: dict[Path, None] = {}
    for path in paths:
        files = sorted(path.rglob(f"*{SUFFIX}")) if path.is_dir() else [path]
        if not files:
            raise UsageError(f"no scenario in {str(path)!r}; their names end in {SUFFIX}")
        if not path.exists() or not is_scenario(files[0].name):
            raise UsageError(f"no scenario file {str(path)!r}; their names end in {SUFFIX}")
        found.update(dict.fromkeys(files))
    return list(found)


def chart_loader(catalog: Catalog) -> Charts:
    """Return a loader that loads each mission file once."""
    charts: dict[Path, Chart] = {}

    def load(mission: Path) -> Chart:
        if mission not in charts:
            beside = lifecycle_of(mission)
            lifecycle = beside if beside.is_file() else default_missions_folder() / LIFECYCLE
            charts[mission] = load_chart(lifecycle, [mission], catalog)
        return charts[mission]

    return load


def load_scenario(file: str | Path, catalog: Catalog, charts: Charts | None = None) -> Scenario:
    """Read a scenario and the mission that it is about.

    Args:
        charts: shared by scenarios of the same missions (see `chart_loader`).

    Raises:
        ChartError: with everything that is wrong with the scenario, or with its mission.
        UsageError: the mission does not exist.
    """
    path = Path(file)
    findings = Findings()
    raw = read(path, findings)
    node = validate(raw, ScenarioNode, findings) if isinstance(raw, Map) else None
    if node is None:
        raise ChartError(findings.all)
    local = Path("missions")
    folders = [path.parent, *([local] if local.is_dir() else []), default_missions_folder()]
    chart = (charts or chart_loader(catalog))(find_mission(node.mission, folders))
    scenario = _Reader(path, node, chart, catalog, findings).scenario()
    if findings.errors:
        raise ChartError(findings.errors)
    return scenario


class _Reader:
    """Turns the words of one file into a script, looking up every name."""

    def __init__(
        self, path: Path, node: ScenarioNode, chart: Chart, catalog: Catalog, findings: Findings
    ) -> None:
        self._path, self._node, self._chart = path, node, chart
        self._catalog, self._findings = catalog, findings

    def scenario(self) -> Scenario:
        """Return the scenario, as far as it can be understood."""
        node = self._node
        self._check_expectations(node.expect)
        limit = self._duration(node, "limit", node.limit)
        script = Script(
            mission=next(iter(self._chart.missions)),
            request=node.request,
            rules=tuple(rule for mock in node.mocks for rule in self._rules(mock)),
            happenings=tuple(h for when in node.when for h in self._happenings(when)),
            limit=LIMIT if limit is None else limit,
            starts=node.start == "ready",
        )
        return Scenario(
            self._path, node.scenario, self._chart, self._catalog, script, self._parameters(), node.expect
        )

    def _parameters(self) -> dict[str, Any]:
        found = {}
        declared = self._chart.parameters
        for name, value in self._node.parameters.items():
            place = self._node.value_at("parameters", name)
            if name not in declared:
                self._findings.unknown(place, "unknown-parameter", "parameters", "parameter", name, declared)
                continue
            try:
                found[name] = check_value(declared[name], value)
            except ValueError as problem:
                self._findings.add(place, "wrong-type", f"parameters.{name}", str(problem))
        return found

    # -- mocks ------------------------------------------------------------------------------------------

    def _rules(self, mock: MockNode) -> Iterator[Rule]:
        operation = self._operation(mock.at("do"), mock.do)
        if operation is None:
            return
        for name in mock.with_:
            if name not in operation.arguments:
                place = mock.value_at("with", name)
                self._findings.unknown(
                    place, "unknown-argument", mock.do, "argument", name, operation.arguments
                )
        outcomes = tuple(self._outcome(outcome, mock.do, operation) for outcome in mock.then)
        once = mock.in_turn
        yield Rule(mock.do, outcomes, mock.with_, mock.target, once)

    def _operation(self, place: Place, name: str) -> Operation | None:
        if name not in self._catalog.operations:
            self._findings.unknown(
                place, "unknown-operation", "", "operation", name, self._catalog.operations
            )
        return self._catalog.operations.get(name)

    def _outcome(self, node: OutcomeNode, name: str, operation: Operation) -> Outcome:
        ends = [word for word in ("done", "fail") if getattr(node, word) is not None] + ["never"] * node.never
        if len(ends) > 1:
            self._findings.add(
                node.place, "wrong-shape", name, f"an attempt ends once, not in {' and '.join(ends)}"
            )
        if node.fail is not None:
            self._check_code(node.at("fail"), node.fail, name, operation)
        accepted = (
            None if node.accepted == "never" else self._duration(node, "accepted", node.accepted) or 0.0
        )
        return Outcome(
            after=self._duration(node, "after", node.after),
            code=node.fail or "",
            detail=node.detail,
            result=self._result(node, name, operation),
            never=node.never,
            accepted_after=accepted,
            on_cancel=OnCancel(node.cancel),
            progress=node.progress,
        )

    def _check_code(self, place: Place, code: str, name: str, operation: Operation) -> None:
        codes = [known.name for known in operation.codes]
        if code not in codes:
            self._findings.unknown(place, "undeclared-code", name, "code", code, codes)

    def _result(self, node: OutcomeNode, name: str, operation: Operation) -> dict[str, Any]:
        found = {}
        for field, value in (node.done or {}).items():
            place = node.value_at("done", field)
            if field not in operation.result:
                self._findings.unknown(place, "unknown-argument", name, "field", field, operation.result)
                continue
            try:
                found[field] = convert(value, operation.result[field])
            except ValueError as problem:
                self._findings.add(place, "wrong-type", f"{name}.{field}", str(problem))
        return found

    # -- happenings -------------------------------------------------------------------------------------

    def _happenings(self, node: WhenNode) -> Iterator[Happening]:
        if (node.at_ is None) == (node.on is None):
            self._findings.add(
                node.place, "wrong-shape", "when", "say either `at` (a duration) or `on` (a state)"
            )
            return
        wait = (
            self._duration(node, "at", node.at_)
            if node.on is None
            else self._duration(node, "after", node.after)
        )
        if node.on is not None:
            self._check_state(node.at("on"), node.on)
        for effect in self._effects(node):
            yield Happening(effect, wait or 0.0, node.on, node.nth)

    def _effects(self, node: WhenNode) -> list[Ask | Tell | End]:
        found: list[Ask | Tell | End] = []
        if node.request is not None:
            self._check_request(node.at("request"), node.request.name)
            found.append(Ask(node.request.name, node.request.data))
        for name, value in (node.value or {}).items():
            found.extend(self._tell(node.value_at("value", name), name, value))
        if node.fail is not None:
            found.append(self._end(node.fail, needs_code=True))
        if node.finish is not None:
            found.append(self._end(node.finish, needs_code=False))
        if not found:
            self._findings.add(
                node.place, "wrong-shape", "when", "nothing happens", "say request, value, fail or finish"
            )
        return found

    def _check_request(self, place: Place, name: str) -> None:
        allowed = (START, *(f"operator.{verb}" for verb in OPERATOR_REQUESTS))
        if name not in allowed:
            self._findings.unknown(place, "unknown-event", "when", "request", name, allowed)

    def _tell(self, place: Place, name: str, value: Any) -> Iterator[Tell]:
        """Yield the change of a live value, which may be named as the plugin or as the chart names it."""
        known = {spec.value: spec.value for spec in self._chart.inputs.values()}
        known |= {spec.name: spec.value for spec in self._chart.inputs.values()}
        if name not in known:
            self._findings.unknown(place, "unknown-value", "when.value", "value", name, known)
            return
        try:
            yield Tell(known[name], convert(value, self._catalog.values[known[name]].type))
        except ValueError as problem:
            self._findings.add(place, "wrong-type", f"when.value.{name}", str(problem))

    def _end(self, node: EndNode, needs_code: bool) -> End:
        operation = self._operation(node.at("do"), node.do)
        if operation is not None and (needs_code or node.code):
            self._check_code(node.at("code"), node.code, node.do, operation)
        return End(node.do, node.code, node.detail)

    # -- names and durations ----------------------------------------------------------------------------

    def _check_expectations(self, expect: ExpectNode) -> None:
        for key in ("passes", "never"):
            for index, name in enumerate(getattr(expect, key)):
                self._check_state(expect.at(key, index), name)
        for key in ("within", "at_least"):
            self._duration(expect, key, getattr(expect, key))
        known = (*self._catalog.operations, *self._catalog.actions)
        for name in expect.counts:
            if name not in known:
                place = expect.value_at("counts", name)
                self._findings.unknown(
                    place, "unknown-operation", "expect.counts", "operation or action", name, known
                )

    def _check_state(self, place: Place, name: str) -> None:
        names = [state for state in self._chart.states if state]
        if not any(is_named(state, name) for state in names):
            local = {state.rpartition(".")[2] for state in names}
            self._findings.unknown(place, "unknown-state", "", "state", name, local)

    def _duration(self, node: Any, key: str, value: Any) -> float | None:
        if value is None:
            return None
        if isinstance(value, (int, float)) and value != 0:
            hint = f"write '{value} s'"
            self._findings.add(node.at(key), "no-unit", key, f"a duration needs a unit, got {value!r}", hint)
            return None
        try:
            return float(convert(value, DURATION))
        except ValueError as problem:
            self._findings.add(
                node.at(key), "wrong-type", key, f"{problem}", "write a duration such as '5 s'"
            )
            return None


class _Comparison:
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
        for word, misses in (
            ("within", lambda limit: seconds > limit),
            ("at_least", lambda limit: seconds < limit),
        ):
            given = getattr(self._expect, word)
            if given is not None and misses(float(convert(given, DURATION))):
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
    return ", ".join(map(str, value)) or "none" if isinstance(value, list) else str(value)


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
