"""Scenarios: a simulation and what must come of it, in a file of its own.

`load_scenario` reads a file and looks up every name in it (all mistakes at once, each with its place);
`Scenario.run` simulates it; `Scenario.failures` compares. A failure says what was expected, what came, and
what happened around it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
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
from lupin_engine.machine.event import OPERATOR_REQUESTS
from lupin_engine.plugin.contract import Operation
from lupin_engine.plugin.registry import Catalog
from lupin_engine.plugin.types import DURATION, convert
from lupin_engine.runtime.setup import check_value
from lupin_engine.sim.expectations import Comparison, Failure
from lupin_engine.sim.scenario_file import (
    EndNode,
    ExpectNode,
    MockNode,
    OutcomeNode,
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

#: What scenario files end in.
SUFFIX = ".scenario.yaml"

Charts = Callable[[Path], Chart]


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
        return list(Comparison(self.expect, run).failures())


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
    chart = (charts or chart_loader(catalog))(find_mission(node.mission, _folders(path)))
    scenario = _Reader(path, node, chart, catalog, findings).scenario()
    if findings.errors:
        raise ChartError(findings.errors)
    return scenario


def _folders(scenario: Path) -> list[Path]:
    """Return where a mission is looked for: around the scenario, nearest first, else the shipped ones."""
    around = [folder for parent in scenario.absolute().parents for folder in (parent, parent / "missions")]
    near = [folder for folder in around if (folder / LIFECYCLE).is_file()]
    return near or [default_missions_folder()]


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
        given = self._parameters()
        return Scenario(self._path, node.scenario, self._chart, self._catalog, script, given, node.expect)

    def _parameters(self) -> dict[str, Any]:
        found = {}
        declared = self._chart.parameters
        for name, value in self._node.parameters.items():
            place = self._node.value_at("parameters", name)
            if name not in declared:
                key = self._node.key_at("parameters", name)
                self._findings.unknown(key, "unknown-parameter", "parameters", "parameter", name, declared)
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
                place = mock.key_at("with", name)
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
            problem = f"an attempt ends once, not in {' and '.join(ends)}"
            self._findings.add(node.place, "wrong-shape", name, problem)
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
                key = node.key_at("done", field)
                self._findings.unknown(key, "unknown-argument", name, "field", field, operation.result)
                continue
            try:
                found[field] = convert(value, operation.result[field])
            except ValueError as problem:
                self._findings.add(place, "wrong-type", f"{name}.{field}", str(problem))
        return found

    # -- happenings -------------------------------------------------------------------------------------

    def _happenings(self, node: WhenNode) -> Iterator[Happening]:
        if (node.at_ is None) == (node.on is None):
            problem = "say either 'at' (a duration) or 'on' (a state)"
            self._findings.add(node.place, "wrong-shape", "when", problem)
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
            found.extend(self._tell(node, name, value))
        if node.fail is not None:
            found.append(self._end(node.fail, needs_code=True))
        if node.finish is not None:
            found.append(self._end(node.finish, needs_code=False))
        if not (node.request or node.value or node.fail or node.finish):
            hint = "say request, value, fail or finish"
            self._findings.add(node.place, "wrong-shape", "when", "nothing happens", hint)
        return found

    def _check_request(self, place: Place, name: str) -> None:
        allowed = (START, *(f"operator.{verb}" for verb in OPERATOR_REQUESTS))
        if name not in allowed:
            self._findings.unknown(place, "unknown-event", "when", "request", name, allowed)

    def _tell(self, node: WhenNode, name: str, value: Any) -> Iterator[Tell]:
        """Yield the change of a live value, which may be named as the plugin or as the chart names it."""
        known = {spec.value: spec.value for spec in self._chart.inputs.values()}
        known |= {spec.name: spec.value for spec in self._chart.inputs.values()}
        if name not in known:
            key = node.key_at("value", name)
            self._findings.unknown(key, "unknown-value", "when.value", "value", name, known)
            return
        try:
            yield Tell(known[name], convert(value, self._catalog.values[known[name]].type))
        except ValueError as problem:
            place = node.value_at("value", name)
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
                place = expect.key_at("counts", name)
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
