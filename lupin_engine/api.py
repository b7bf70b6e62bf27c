"""The public interface of `lupin_engine` for notebooks and runners: load, simulate and test missions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from lupin_engine.errors import UsageError, nearest, unknown_field
from lupin_engine.machine.machine import Machine
from lupin_engine.missions.load import LoadedMissions
from lupin_engine.missions.selection import load_missions
from lupin_engine.plugin.profile import START
from lupin_engine.plugin.registry import load_catalog
from lupin_engine.runtime.setup import make_machine
from lupin_engine.sim.scenario import scenario_files
from lupin_engine.sim.simulation import LIMIT, Run, Script
from lupin_engine.sim.simulation import simulate as run_script
from lupin_engine.sim.suite import ScenarioResult, Suite


def load(*missions: str | Path) -> LoadedMissions:
    """Load and check missions with their lifecycle, as `lupin check` does.

    Args:
        missions: names or files; without any, all missions of the folder `missions`, else the shipped ones.

    Raises:
        UsageError: there is no such mission, or they do not share a lifecycle.
        ChartError: with every error of every file.
    """
    return load_missions([str(name) for name in missions], load_catalog())


def machine_of(missions: LoadedMissions, parameters: Mapping[str, Any] | None = None) -> Machine:
    """Return a machine that is not started: events in, commands out; it has no clock and does nothing itself.

    Args:
        parameters: settings by name, in base units (seconds, metres, radians).

    Raises:
        UsageError: a parameter does not exist or has a wrong value.
    """
    return make_machine(missions.chart, parameters or {})


def simulate(
    missions: LoadedMissions,
    mission: str = "",
    request: Mapping[str, Any] | None = None,
    *,
    parameters: Mapping[str, Any] | None = None,
    limit: float = LIMIT,
) -> Run:
    """Run a mission in virtual time against the plugins' mocks, as `lupin simulate` does.

    Args:
        mission: the name of its file, without the ending, else its own; '' for the only one.
        request: the fields of the start: texts, numbers, lists and mappings of these.
        parameters: settings by name, in base units.
        limit: the longest time that is simulated, in seconds.

    Raises:
        UsageError: there is no such mission, field or parameter, a value is out of range, or the request is
            refused.
    """
    name = _name_of(mission, missions)
    fields, given = missions.chart.missions[name].request, dict(request or {})
    wrong = [unknown_field(field, fields) for field in given if field not in fields]
    if not limit > 0.0:
        wrong.append(f"limit is {limit!r}; it must be more than 0 s")
    if wrong:
        raise UsageError("\n".join(wrong))
    run = run_script(missions.chart, Script(name, given, limit=limit), parameters)
    refusal = next((step.refusal for step in run.steps if step.event.name == START), None)
    if refusal is not None:
        raise UsageError(refusal.text)
    return run


def _name_of(mission: str, missions: LoadedMissions) -> str:
    """Return the name of the mission with this file stem, else of this name; '' for the only one.

    Raises:
        UsageError: there is none, or '' of several; the text has the nearest.
    """
    names = missions.names
    if not mission and len(names) == 1:
        return names[0]
    files = {Path(missions.chart.missions[name].place.file).stem: name for name in names}
    if mission not in {*names, *files}:
        raise UsageError(f"which mission? {nearest(mission, [*names, *files])}")
    return files.get(mission, mission)


def test(*paths: str | Path, seeds: Sequence[int] = (0,)) -> list[ScenarioResult]:  # noqa: PT028
    """Run scenarios, as `lupin test` does.

    Args:
        paths: files and folders.
        seeds: each scenario with something random in it runs with one after the other, until one fails.

    Raises:
        UsageError: a path does not exist or has no scenario, or there are no seeds. A scenario that cannot be
            read has a result with its `problem`.
    """
    if not seeds:
        raise UsageError("without seeds no scenario runs; write at least one, such as seeds=(0,)")
    suite = Suite(load_catalog())
    return [suite.run(file, seeds) for file in scenario_files([Path(path) for path in paths])]


#: Of pytest: not a test, where it is imported into a module of tests.
test.__test__ = False  # type: ignore[attr-defined]
