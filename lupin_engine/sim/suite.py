"""Many scenarios: each mission loaded once, in one process or in several, with one seed or with many."""

from __future__ import annotations

import multiprocessing
import os
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import closing
from dataclasses import dataclass, field, replace
from multiprocessing.context import BaseContext
from pathlib import Path
from typing import Protocol

from lupin_engine.chart.model import Chart
from lupin_engine.errors import LupinError
from lupin_engine.plugin.registry import Catalog, load_catalog
from lupin_engine.sim import SUFFIX
from lupin_engine.sim.failure import ScenarioFailure
from lupin_engine.sim.scenario import Missions, Scenario, load_scenario
from lupin_engine.sim.simulation import Run

#: From so many runs on it pays to begin further processes.
WORTH_SHARING = 400

#: How often something was reached, by its kind, its name and which of several.
Counts = Counter[tuple[str, str, str]]


class RunObserver(Protocol):
    """Counts what runs reach."""

    def prepare(self, chart: Chart) -> Chart:
        """Return the chart that the runs use in place of `chart`."""

    def count(self, run: Run) -> Counts:
        """Return what a run reached, as soon as it is over."""


#: Makes the observer of a suite; importable by name, because a worker process makes its own.
MakeObserver = Callable[[], RunObserver]


@dataclass(frozen=True)
class ScenarioResult:
    """How a scenario went.

    `problem` says why it could not be run at all. `runs` is how many seeds were tried, `seed` the one that
    the failures are of; None where chance plays no part. `seconds` is the virtual time of the last run,
    `took` the real time of all. `mission` and `counts` are there when an
    observer counts.
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

    @property
    def name(self) -> str:
        """What the scenario is called."""
        return self.file.name.removesuffix(SUFFIX)

    @property
    def holds(self) -> bool:
        """Whether everything that was promised came true."""
        return not self.failures and not self.problem


class Suite:
    """Runs scenarios one after the other.

    Args:
        catalog: what the plugins offer.
        observe: makes the observer of the runs.
    """

    def __init__(self, catalog: Catalog, observe: MakeObserver | None = None) -> None:
        self._observer = observe() if observe else None
        self.missions = Missions(catalog, self._observer.prepare) if self._observer else Missions(catalog)

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
        runs, seconds, failures, last = 0, 0.0, [], None
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
        )


class Crew:
    """Processes that run scenarios before anybody asks how they went, in the order of `files`.

    Close it in the end: what has not been begun then is dropped.
    """

    def __init__(
        self, files: Iterable[Path], seeds: Sequence[int], workers: int, observe: MakeObserver | None
    ) -> None:
        self._pool = ProcessPoolExecutor(workers, _context(), _begin, (observe,))
        self._coming = {file: self._pool.submit(_run, file, seeds) for file in files}

    def result(self, file: Path) -> ScenarioResult:
        """Wait until it is known how one of the scenarios went."""
        return self._coming[file].result()

    def close(self) -> None:
        """End the processes, each after the scenario that it is at."""
        self._pool.shutdown(cancel_futures=True)


def run_all(
    catalog: Catalog,
    files: Sequence[Path],
    seeds: Sequence[int] = (0,),
    jobs: int = 0,
    observe: MakeObserver | None = None,
) -> Iterator[ScenarioResult]:
    """Yield how each scenario went, in the order of `files`, as soon as it is known.

    Args:
        jobs: how many processes; 0: as many as it is worth.
    """
    workers = useful_workers(len(files), len(seeds), jobs)
    if workers <= 1:
        suite = Suite(catalog, observe)
        yield from (suite.run(file, seeds) for file in files)
        return
    with closing(Crew(files, seeds, workers, observe)) as crew:
        yield from map(crew.result, files)


def useful_workers(files: int, seeds: int, jobs: int = 0) -> int:
    """Return how many processes should run so many scenarios with so many seeds; `jobs` when it is not 0."""
    cores = len(os.sched_getaffinity(0)) if files * seeds >= WORTH_SHARING else 1
    return min(jobs or cores, files)


def _context() -> BaseContext:
    """Return how processes begin: as copies of this one, unless its threads could hold a lock meanwhile."""
    can_copy = "fork" in multiprocessing.get_all_start_methods() and threading.active_count() == 1
    return multiprocessing.get_context("fork" if can_copy else "spawn")


#: The suite of a worker process.
_suite: Suite | None = None


def _begin(observe: MakeObserver | None) -> None:
    global _suite
    _suite = Suite(load_catalog(), observe)


def _run(file: Path, seeds: Sequence[int]) -> ScenarioResult:
    assert _suite is not None, "a worker begins before it works"
    return _suite.run(file, seeds)
