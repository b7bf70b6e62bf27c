"""Scenarios: a simulation and its expected result, in a file of its own.

`load_scenario` reads a file and looks up every name in it (all mistakes at once, each with its place);
`Scenario.run` simulates it; `Scenario.failures` compares. A failure shows the expected and the actual value,
and the steps around.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from lupin_engine.chart.findings import Findings
from lupin_engine.chart.model import Chart, TemporalProperty
from lupin_engine.chart.source import Map, parse, read
from lupin_engine.chart.validation import validate
from lupin_engine.errors import ChartError, Diagnostic, LupinError, UsageError
from lupin_engine.machine.scope import World
from lupin_engine.missions.folders import (
    MISSIONS,
    default_missions_folder,
    find_mission,
    is_missions_folder,
    lifecycle_of,
)
from lupin_engine.missions.load import load_chart
from lupin_engine.plugin.registry import Catalog
from lupin_engine.properties.authored import properties_of
from lupin_engine.properties.built_in import STANDSTILL, Monitor, WatchPlans
from lupin_engine.runtime.history import History
from lupin_engine.runtime.setup import make_world
from lupin_engine.sim import SUFFIX
from lupin_engine.sim.expectations import Comparison
from lupin_engine.sim.failure import ScenarioFailure
from lupin_engine.sim.scenario_file import ScenarioNode
from lupin_engine.sim.scenario_reader import ScenarioNames, ScriptReader, check_names
from lupin_engine.sim.simulation import Run, Script, Simulation, Standstill


class Missions:
    """A cache of charts and worlds, for many scenarios.

    Args:
        catalog: of the plugins.
        prepare: transforms a chart before it is used.
    """

    def __init__(self, catalog: Catalog, prepare: Callable[[Chart], Chart] = lambda chart: chart) -> None:
        self.catalog = catalog
        self._prepare = prepare
        self._charts: dict[Path, Chart] = {}
        self._files: dict[tuple[str, Path], Path] = {}
        self._worlds: dict[tuple[Chart, str], World] = {}

    def file(self, name: str, scenario: Path) -> Path:
        """Find the mission that a scenario names, by name or by file; UsageError when there is none."""
        key = (name, scenario.parent)
        if key not in self._files:
            beside = scenario.parent / name
            self._files[key] = beside if beside.is_file() else find_mission(name, _folders(scenario))
        return self._files[key]

    def chart(self, mission: Path) -> Chart:
        """Return the chart of a mission file with its lifecycle; ChartError with all that is wrong."""
        if mission not in self._charts:
            self._charts[mission] = self._prepare(load_chart(lifecycle_of(mission), [mission], self.catalog))
        return self._charts[mission]

    def world(self, chart: Chart, parameters: Mapping[str, Any]) -> World:
        """Return the world of a chart under these settings; errors as for `make_world`."""
        key = (chart, repr(sorted(parameters.items())))
        if key not in self._worlds:
            self._worlds[key] = make_world(chart, parameters)
        return self._worlds[key]


@dataclass(frozen=True)
class Scenario:
    """A scenario whose names have all been found; `mission` is the mission's file.

    `warnings` are its probable mistakes.
    """

    file: Path
    promise: str
    mission: Path
    chart: Chart
    script: Script
    parameters: Mapping[str, Any]
    node: ScenarioNode
    missions: Missions
    properties: Mapping[str, TemporalProperty] = field(default_factory=dict)
    warnings: tuple[Diagnostic, ...] = ()

    @property
    def name(self) -> str:
        """The name of its file, without the ending."""
        return self.file.name.removesuffix(SUFFIX)

    @property
    def is_random(self) -> bool:
        """Whether another seed can make another run: the servers draw, or the chart's retries jitter."""
        invokes = (state.invoke for state in self.chart.states.values())
        jitters = any(invoke and invoke.retry and invoke.retry.jitter for invoke in invokes)
        return jitters or self.script.is_random

    def run(self, shift: int = 0) -> Run:
        """Simulate it, its seed shifted; a standstill violates a property, other errors as for `simulate`."""
        script = replace(self.script, seed=self.script.seed + shift) if shift else self.script
        world = self.missions.world(self.chart, self.parameters)
        simulation = Simulation(self.chart, script, self.parameters, world)
        monitor = Monitor(WatchPlans(properties_of(self.chart, self.properties)))
        simulation.listener = lambda step: monitor.take(step, simulation.machine.scope)
        try:
            run = simulation.run()
            monitor.end(run.watched_until)
        except Standstill as problem:
            history = History(simulation.steps[: problem.shown])
            run = replace(simulation.result(cut_off=False), history=history)
            monitor.breaches = {STANDSTILL: (history.steps[-1], str(problem))}
        return replace(run, violated=tuple((step, name, text) for name, text, step in monitor.found))

    def failures(self, run: Run) -> list[ScenarioFailure]:
        """Return every expectation that `run` does not meet, in the order of the file's words."""
        return list(Comparison(self.node, run).failures())

    def dated(self, run: Run) -> list[Diagnostic]:
        """Return a warning for each expectation that `run` meets as an older engine meant it."""
        comparison = Comparison(self.node, run)
        for _ in comparison.failures():
            pass
        return comparison.dated


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


def load_scenario(file: str | Path, catalog: Catalog, missions: Missions | None = None) -> Scenario:
    """Read a scenario and the mission that it is about.

    Args:
        missions: shared by scenarios of the same missions.

    Raises:
        ChartError: with everything that is wrong with the scenario, or with its mission.
        UsageError: the mission does not exist.
    """
    findings = Findings()
    return _load(read(Path(file), findings), Path(file), missions or Missions(catalog), findings)


def load_scenario_text(text: str, file: Path, missions: Missions) -> Scenario:
    """As `load_scenario`, of a text that could stand in `file`."""
    findings = Findings()
    return _load(parse(text, str(file), findings), file, missions, findings)


def _load(raw: Map | None, path: Path, missions: Missions, findings: Findings) -> Scenario:
    node = validate(raw, ScenarioNode, findings) if isinstance(raw, Map) else None
    if node is None:
        raise ChartError(findings.all)
    mission = missions.file(node.mission, path)
    chart = missions.chart(mission)
    misshapen, named = bool(findings.errors), Findings()
    words = ScenarioNames(chart, named)
    properties = words.read_properties(node)
    check_names(node, words)
    reader = ScriptReader(node, words)
    script, parameters = reader.script(), reader.parameters()
    # What has the wrong shape was left out: that it is not there is no second mistake.
    findings.extend(found for found in named.all if not misshapen or found.rule != "wrong-shape")
    if findings.errors:
        raise ChartError(findings.errors)
    return Scenario(
        path, node.scenario, mission, chart, script, parameters, node, missions, properties, findings.all
    )


def mission_name(mission: Path, file: Path, missions: Missions) -> str:
    """Return a mission's name in a scenario: its own where that is found, else the path to its file."""
    with suppress(LupinError):
        if missions.file(mission.stem, file).resolve() == mission.resolve():
            return mission.stem
    return Path(os.path.relpath(mission.resolve(), file.resolve().parent)).as_posix()


def _folders(scenario: Path) -> list[Path]:
    """Return the folders to search for missions: around the scenario, nearest first, else the shipped."""
    around = [folder for parent in scenario.absolute().parents for folder in (parent, parent / MISSIONS)]
    near = [folder for folder in around if is_missions_folder(folder)]
    return near or [default_missions_folder()]
