"""The page on bindings: its scenarios reach everything that the mission with the spray cart says."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from lupin_engine.chart.load import default_missions_folder
from lupin_engine.plugin.registry import load_catalog
from lupin_engine.sim.coverage import GUARD, STATE, TRANSITION, Coverage
from lupin_engine.sim.scenario import Missions
from lupin_engine.sim.suite import add_up, run_all

SPRAYER = Path(__file__).parents[2] / "docs" / "sprayer"


@pytest.fixture(scope="module")
def reached(tmp_path_factory: pytest.TempPathFactory) -> Coverage:
    """Run the scenarios of the page, in a folder as the reader has it at the end."""
    folder = tmp_path_factory.mktemp("reader")
    missions = folder / "missions"
    shutil.copytree(SPRAYER / "bindings", missions / "bindings")
    shutil.copy(SPRAYER / "spray.yaml", missions)
    shutil.copy(default_missions_folder() / "lifecycle.yaml", missions)
    files = [Path(shutil.copy(file, folder)) for file in sorted(SPRAYER.glob("*.scenario.yaml"))]
    catalog = load_catalog()
    results = list(run_all(catalog, files, jobs=1, counts=True))
    assert [str(result.failures) for result in results if result.failures] == []
    assert len(results) == 3
    return add_up(results, Missions(catalog))


@pytest.mark.parametrize("kind", [STATE, TRANSITION, GUARD])
def test_the_scenarios_reach_everything(kind: str, reached: Coverage) -> None:
    """Every state, transition and guard of the mission."""
    (spray,) = (part for part in reached.parts if part.title == "spray")
    (tally,) = (tally for tally in spray.tallies() if tally.kind == kind)
    assert [piece.text for piece in tally.missing] == []
    assert tally.total > 0
