"""The mission of the cookbook that uses another one twice, over real ROS 2."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from lupin_engine.missions.folders import LIFECYCLE, default_missions_folder
from tests.lupin_ros.world import Operator, World

pytestmark = pytest.mark.timeout(180)

COOKBOOK = Path(__file__).parents[4] / "docs" / "cookbook"


def test_two_rounds_and_a_way_by_the_dock(world: World, operator: Operator, tmp_path: Path) -> None:
    """The counters are about both rounds, and a return from the dock tells nothing twice."""
    missions = shutil.copytree(COOKBOOK / "parts", tmp_path / "missions" / "parts").parent
    for name in ("rows.yaml", "evening.yaml"):
        shutil.copy(COOKBOOK / name, missions)
    shutil.copy(default_missions_folder() / LIFECYCLE, missions)
    world.start_all(missions_path=missions)
    operator.in_state("READY")
    assert operator.start("1", "5", mission="Evening").accepted
    operator.in_state("SECOND", "NAVIGATING")
    assert operator.state.targets_total == 4
    assert operator.state.targets_completed == 2
    assert operator.ask("dock").success
    operator.in_state("RETURNING")
    operator.until(lambda: operator.state.paused, "the robot is at the dock")
    assert operator.ask("resume").success
    operator.until_done(published=4)
    told = [(o.tag_reading.tag_id, o.status) for o in operator.observations]
    assert told == [("1", 0), ("5", 0), ("12", 0), ("16", 0)]
    assert (operator.state.mission_type, operator.state.targets_completed) == ("Evening", 4)
