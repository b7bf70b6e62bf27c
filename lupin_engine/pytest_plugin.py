"""pytest collects `*.scenario.yaml` and runs each as a test.

A scenario is one item, so pytest's own options choose (`-k`), end (`-x`) and report them (`--junit-xml`).
pytest-xdist shares them between processes (`-n`). `--lupin-seed` is added to the seeds
of random scenarios, `--lupin-seeds` runs each with so many of them, and `--lupin-coverage` reports the states
and transitions that no scenario reached.

pytest loads this plugin in every run, also without scenarios, so the engine is imported with the first one.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from lupin_engine.sim import SUFFIX

if TYPE_CHECKING:
    from lupin_engine.sim.suite import Counts, RunObserver, ScenarioResult, Suite

#: What is kept between scenarios: the suite, and what was reached of each mission.
_SUITE: pytest.StashKey[Suite] = pytest.StashKey()
_REACHED: pytest.StashKey[dict[Path, Counts]] = pytest.StashKey()
#: What a worker of pytest-xdist tells the process that began it.
_OUTPUT = "lupin_reached"


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add our options."""
    group = parser.getgroup("lupin", "scenarios of missions")
    group.addoption("--lupin-seed", type=int, default=0, help="added to the seeds of random scenarios")
    group.addoption("--lupin-seeds", type=int, default=1, help="run random scenarios with so many seeds")
    group.addoption("--lupin-coverage", action="store_true", help="tell what no scenario reached")


def pytest_configure(config: pytest.Config) -> None:
    """Prepare the counts of coverage."""
    config.stash[_REACHED] = {}


def pytest_collect_file(file_path: Path, parent: pytest.Collector) -> pytest.Collector | None:
    """Collect a file with the name of a scenario; None for any other."""
    if not file_path.name.endswith(SUFFIX):
        return None
    found: pytest.Collector = ScenarioFile.from_parent(parent, path=file_path)
    return found


class ScenarioFile(pytest.File):
    """A file with one scenario."""

    def collect(self) -> Iterator[pytest.Item]:
        """Yield the scenario, which is read when it is run."""
        yield ScenarioItem.from_parent(self, name=self.path.name.removesuffix(SUFFIX))


class Unmet(Exception):
    """A scenario failed, or could not be run."""

    def __init__(self, result: ScenarioResult) -> None:
        super().__init__(result.file)
        self.result = result


class ScenarioItem(pytest.Item):
    """One scenario."""

    def runtest(self) -> None:
        """Run it with each seed; raises `Unmet` where it fails or cannot be run."""
        first = self.config.option.lupin_seed
        seeds = range(first, first + max(1, self.config.option.lupin_seeds))
        result = _suite(self.config).run(self.path, seeds)
        if result.mission is not None and self.config.option.lupin_coverage:
            _reach(self.config, result.mission, result.counts)
        if not result.holds:
            raise Unmet(result)

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], style: Any = None) -> Any:
        """Return the failure as `lupin test` prints it; any other exception is a defect, shown by pytest."""
        if not isinstance(excinfo.value, Unmet):
            return super().repr_failure(excinfo, style)
        from lupin_engine.sim.failure import failure_lines

        result = excinfo.value.result
        seed = f"with --lupin-seed {result.seed}:" if result.seed is not None and result.failures else ""
        lines = (line for _, line in failure_lines(result.failures))
        return "\n".join((*filter(None, (result.promise, seed, result.problem)), *lines))

    def reportinfo(self) -> tuple[Path, int, str]:
        """Return its file and its name."""
        return self.path, 0, self.name


def _suite(config: pytest.Config) -> Suite:
    """Return the suite of this process."""
    if _SUITE not in config.stash:
        from lupin_engine.plugin.registry import load_catalog
        from lupin_engine.sim.suite import Suite

        observer: RunObserver | None = None
        if config.option.lupin_coverage:
            from lupin_engine.replay.coverage import CoverageObserver

            observer = CoverageObserver()
        config.stash[_SUITE] = Suite(load_catalog(), observer)
    return config.stash[_SUITE]


# -- what was reached, also in the processes of pytest-xdist ---------------------------------------------


def _reach(config: pytest.Config, mission: Path, counts: Counts) -> None:
    config.stash[_REACHED].setdefault(mission, Counter()).update(counts)


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Send the coverage of a worker (pytest-xdist) to its controller."""
    output: dict[str, Any] | None = getattr(session.config, "workeroutput", None)
    if output is not None:
        reached = session.config.stash[_REACHED]
        told = [(str(mission), list(counts.items())) for mission, counts in reached.items()]
        output[_OUTPUT] = json.dumps(told)


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node: Any) -> None:
    """Add the coverage of a worker."""
    told: Sequence[Any] = json.loads(getattr(node, "workeroutput", {}).get(_OUTPUT, "[]"))
    for mission, counts in told:
        _reach(node.config, Path(mission), Counter({tuple(key): count for key, count in counts}))


def pytest_terminal_summary(terminalreporter: Any, config: pytest.Config) -> None:
    """Print the coverage."""
    reached = config.stash[_REACHED]
    if not reached or not config.option.lupin_coverage:
        return
    from lupin_engine.replay.coverage import Coverage, coverage_lines

    coverage, missions = Coverage(), _suite(config).missions
    for mission, counts in reached.items():
        coverage.add(mission, missions.chart(mission), counts)
    terminalreporter.section("missions")
    for line in coverage_lines(coverage):
        terminalreporter.write_line(line)
