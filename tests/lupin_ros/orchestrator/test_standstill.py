"""A mission that goes in circles without time ends in FAULT, and the orchestrator goes on answering."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.lupin_ros.orchestrator.test_answers import LIFECYCLE
from tests.lupin_ros.world import Operator, World

pytestmark = pytest.mark.timeout(120)

STILL = """\
mission: Still
initial: A
states:
  A: {after: {0 s: B}, on: {operator.skip_current: done}}
  B: {after: {0 s: A}}
  done: {type: final}
"""


def test_a_circle_without_time_is_told_as_a_fault(world: World, operator: Operator, tmp_path: Path) -> None:
    """`MissionState` has the code and what goes round; a reset is taken."""
    missions = tmp_path / "missions"
    missions.mkdir()
    (missions / "lifecycle.yaml").write_text(LIFECYCLE, encoding="utf-8")
    (missions / "still.yaml").write_text(STILL, encoding="utf-8")
    world.start("mission_orchestrator", missions_path=str(missions))
    operator.in_state("READY")
    assert operator.start(mission="Still").accepted
    operator.in_state("FAULT")
    assert operator.state.last_error == (
        "execution_error: time stands still: more than 10000 things happen at one moment; MISSION.Still.B,"
        " MISSION.Still.A are entered over and over, so let one of them take time"
    )
    assert operator.ask("reset").success
    operator.in_state("READY")
