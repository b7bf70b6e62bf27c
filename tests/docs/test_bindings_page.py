"""The page on bindings: its scenarios reach everything that the mission with the spray cart says."""

from __future__ import annotations

from pathlib import Path

import pytest

from lupin_engine.replay.coverage import GUARDS, STATES, TRANSITIONS, Coverage
from tests.docs.reader import assert_all_reached, run_scenarios

SPRAYER = Path(__file__).parents[2] / "docs" / "sprayer"


@pytest.fixture(scope="module")
def reached(tmp_path_factory: pytest.TempPathFactory) -> Coverage:
    """Run the scenarios of the page, in a folder as the reader has it at the end."""
    return run_scenarios(SPRAYER, "spray", tmp_path_factory.mktemp("reader"), 3)


@pytest.mark.parametrize("kind", [STATES, TRANSITIONS, GUARDS])
def test_the_scenarios_reach_everything(kind: str, reached: Coverage) -> None:
    """Every state, transition and guard of the mission."""
    assert_all_reached(reached, "spray", kind, more_than=0)
