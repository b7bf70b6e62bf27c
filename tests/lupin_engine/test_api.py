"""The engine from Python: errors have the texts of the command, and no input is ignored."""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any

import pytest

from lupin_engine import ChartError, UsageError, load, simulate
from lupin_engine import test as run_scenarios

BOTH = ("inspection", "exploration")


@pytest.mark.parametrize(
    ("mission", "given", "text"),
    [
        ("inspection", {"request": {"tags": ["1"]}}, "unknown field 'tags'; allowed: 'tag_sequence'"),
        (
            "inspection",
            {"request": {"tag_sequence": ["99"]}},
            "unknown tag '99'; the layout has 29 tags: 1, ",
        ),
        ("inspection", {"limit": -1.0}, "limit is -1.0; it must be more than 0 s"),
        ("inspektion", {}, "which mission? did you mean 'inspection'?"),
        ("", {}, "which mission? allowed: 'ExplorationMission', 'InspectionMission', 'exploration', "),
        ("inspection", {"parameters": {"max_target": 1}}, "unknown parameter 'max_target'; did you mean "),
    ],
)
def test_what_is_wrong_is_an_error(mission: str, given: dict[str, Any], text: str) -> None:
    """A field that is not there, a refused request, a limit that is none."""
    with pytest.raises(UsageError) as caught:
        simulate(load(*BOTH), mission, **given)
    assert str(caught.value).startswith(text)


def test_a_mission_is_meant_by_its_file_too() -> None:
    """As on the command line. A run and missions are shown in one line."""
    both = load(*BOTH)
    run = simulate(both, "inspection", {"tag_sequence": ["1"]})
    assert repr(run) == "<Run to DONE in 6.7 s: 16 steps>"
    assert repr(both) == "<LoadedMissions InspectionMission, ExplorationMission>"


def test_an_error_of_a_chart_comes_back_from_another_process(tmp_path: Path) -> None:
    """One that does not unpickle hangs a pool of processes."""
    (tmp_path / "broken.yaml").write_text("mission: Broken\ninitial: A\nstates: {}\n", encoding="utf-8")
    with pytest.raises(ChartError) as caught:
        load(tmp_path / "broken.yaml")
    again = pickle.loads(pickle.dumps(caught.value))
    assert (str(again), again.diagnostics) == (str(caught.value), caught.value.diagnostics)


def test_scenarios_without_seeds_are_an_error(tmp_path: Path) -> None:
    """Otherwise they would hold without having run."""
    with pytest.raises(UsageError, match="without seeds no scenario runs"):
        run_scenarios(tmp_path, seeds=())
