"""What a reader has at the end of a page with a mission, its bindings and its scenarios."""

from __future__ import annotations

import shutil
from pathlib import Path

from lupin_engine.missions.folders import default_missions_folder
from lupin_engine.plugin.registry import load_catalog
from lupin_engine.replay.coverage import Coverage, CoverageObserver, add_up
from lupin_engine.sim.scenario import Missions
from lupin_engine.sim.suite import Suite


def run_scenarios(page: Path, mission: str, folder: Path, count: int) -> Coverage:
    """Run the `count` scenarios in the files of a page, in `folder`; all of them hold."""
    missions = folder / "missions"
    shutil.copytree(page / "bindings", missions / "bindings")
    shutil.copy(page / f"{mission}.yaml", missions)
    shutil.copy(default_missions_folder() / "lifecycle.yaml", missions)
    files = [Path(shutil.copy(file, folder)) for file in sorted(page.glob("*.scenario.yaml"))]
    catalog = load_catalog()
    suite = Suite(catalog, CoverageObserver())
    results = [suite.run(file) for file in files]
    assert [str(result.failures) for result in results if result.failures] == []
    assert len(results) == count
    return add_up(results, Missions(catalog))


def assert_all_reached(coverage: Coverage, mission: str, kind: str, more_than: int) -> None:
    """Every state, transition or guard of a mission was reached, and there are more than so many of them."""
    (part,) = (part for part in coverage.parts if part.title == mission)
    (tally,) = (tally for tally in part.tallies() if tally.kind == kind)
    assert [piece.text for piece in tally.missing] == []
    assert tally.total > more_than
