"""Runs many scenarios: each mission is loaded once, with one seed or with many."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Protocol

from lupin_engine.chart.model import Chart
from lupin_engine.errors import Diagnostic, LupinError
from lupin_engine.plugin.registry import Catalog
from lupin_engine.sim import SUFFIX
from lupin_engine.sim.failure import ScenarioFailure
from lupin_engine.sim.scenario import Missions, Scenario, load_scenario
from lupin_engine.sim.simulation import Run

#: How often something was reached, by its kind, its name and which of several.
Counts = Counter[tuple[str, str, str]]


class RunObserver(Protocol):
    """Counts the elements that runs reach."""

    def prepare(self, chart: Chart) -> Chart:
        """Return the chart that the runs use in place of `chart`."""

    def count(self, run: Run) -> Counts:
        """Return the counts of a run, as soon as it is over."""


@dataclass(frozen=True)
class ScenarioResult:
    """How a scenario went.

    `problem` says why it could not be run at all. `runs` is how many seeds were tried, `seed` the one that
    the failures are of; None where chance plays no part. `seconds` is the virtual time of the last run,
    `took` the real time of all. `warnings` are the probable mistakes of the scenario. `mission` and
    `counts` are there when an observer counts.
    """

    file: Path
    promise: str = ""
    problem: str = ""
    failures: tuple[ScenarioFailure, ...] = ()
    seed: int | None = None
    runs: int = 0
    seconds: float = 0.0
    took: float = 0.0
    mission: Path | None = None
    counts: Counts = field(default_factory=Counts)
    warnings: tuple[Diagnostic, ...] = ()

    @property
    def name(self) -> str:
        """The name of its file, without the ending."""
        return self.file.name.removesuffix(SUFFIX)

    @property
    def holds(self) -> bool:
        """Whether everything that was promised came true."""
        return not self.failures and not self.problem


class Suite:
    """Runs scenarios one after the other.

    Args:
        catalog: of the plugins.
        observer: gets every run.
    """

    def __init__(self, catalog: Catalog, observer: RunObserver | None = None) -> None:
        self._observer = observer
        self.missions = Missions(catalog, observer.prepare) if observer else Missions(catalog)

    def run(self, file: Path, seeds: Sequence[int] = (0,)) -> ScenarioResult:
        """Run a scenario with each seed until one fails; without anything random the first seed will do."""
        begun = time.perf_counter()
        try:
            scenario = load_scenario(file, self.missions.catalog, self.missions)
            result = self._tried(scenario, seeds)
        except LupinError as problem:
            result = ScenarioResult(file, problem=str(problem))
        return replace(result, took=time.perf_counter() - begun)

    def _tried(self, scenario: Scenario, seeds: Sequence[int]) -> ScenarioResult:
        is_random = scenario.is_random
        counts: Counts = Counts()
        runs, seconds, failures, last, run = 0, 0.0, [], None, None
        for seed in seeds if is_random else seeds[:1]:
            run = scenario.run(seed)
            runs, seconds, last = runs + 1, run.seconds, seed
            if self._observer is not None:
                counts.update(self._observer.count(run))
            failures = scenario.failures(run)
            if failures:
                break
        return ScenarioResult(
            scenario.file,
            scenario.promise,
            failures=tuple(failures),
            seed=last if is_random else None,
            runs=runs,
            seconds=seconds,
            mission=scenario.mission,
            counts=counts,
            warnings=(*scenario.warnings, *(scenario.dated(run) if run is not None else ())),
        )
