"""The tutorial's mission: right at every step, and its scenarios reach everything that it says."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from lupin_engine.diagram.outline import outline
from lupin_engine.diagram.svg import svg
from lupin_engine.missions.folders import lifecycle_in
from lupin_engine.missions.load import load_files
from lupin_engine.plugin.registry import load_catalog
from lupin_engine.replay.coverage import GUARDS, STATES, TRANSITIONS, Coverage
from tests.docs.reader import assert_all_reached, run_scenarios

TUTORIAL = Path(__file__).parents[2] / "docs" / "tutorial"
STEPS = sorted(file for file in TUTORIAL.glob("*.yaml") if file.suffixes == [".yaml"])


@pytest.mark.parametrize("file", STEPS, ids=lambda file: file.stem)
def test_a_step_is_a_mission(file: Path) -> None:
    """With the binding beside it; drawn, it shows its states and the operations that it invokes."""
    loaded = load_files(lifecycle_in(file.parent), [file], load_catalog())
    text = file.read_text(encoding="utf-8")
    drawn = svg(outline(loaded.chart, focus="PatrolMission"))
    for name in re.findall(r"^ +([A-Z_]+):", text, re.MULTILINE):
        assert f">{name}<" in drawn
    assert ("photo_arm.move" in drawn) == ("photo_arm.move" in text)
    assert list(loaded.bindings) == (["photo_arm"] if "photo_arm.move" in text else [])


@pytest.fixture(scope="module")
def reached(tmp_path_factory: pytest.TempPathFactory) -> Coverage:
    """Run the scenarios of the page, in a folder as the reader has it at the end."""
    return run_scenarios(TUTORIAL, "patrol", tmp_path_factory.mktemp("reader"), 4)


@pytest.mark.parametrize("kind", [STATES, TRANSITIONS, GUARDS])
def test_the_scenarios_reach_everything(kind: str, reached: Coverage) -> None:
    """Every state, transition and guard of the patrol."""
    assert_all_reached(reached, "patrol", kind, more_than=5)
