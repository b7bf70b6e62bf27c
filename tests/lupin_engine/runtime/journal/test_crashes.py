"""An orchestrator that is gone after any step: no target lost, none twice, nothing moves by itself."""

from __future__ import annotations

import pytest

from lupin_engine.machine.event import Start
from lupin_engine.plugin.contract import OnHold
from lupin_engine.plugin.profile import Publish
from lupin_engine.sim.simulation import Ask, Happening, Restart, Run, Script, simulate
from tests import shipped

REQUEST = {"tag_sequence": ["1", "2"]}
MOMENTS = sorted(
    {
        round(step.time, 3)
        for step in simulate(shipped.mission("inspection"), Script("InspectionMission", REQUEST)).steps
    }
)


def crashed(at: float, away: float) -> Run:
    """Return a run whose orchestrator is gone from a moment on, and that somebody resumes 20 s after that."""
    happenings = (Happening(Restart(away), at), Happening(Ask("operator.resume"), at + away + 20.0))
    return simulate(
        shipped.mission("inspection"), Script("InspectionMission", REQUEST, happenings=happenings)
    )


@pytest.mark.parametrize("away", [0.0, 2.0, 1000.0])
@pytest.mark.parametrize("at", MOMENTS[1:-1])
def test_every_target_has_one_outcome_wherever_it_crashes(at: float, away: float) -> None:
    """And between the crash and the resume no operation begins that moves the robot."""
    run = crashed(at, away)
    told = [c.target for step in run.steps for c in step.commands if isinstance(c, Publish)]
    assert sorted(told) == ["1", "2"]
    operations = run.chart.catalog.operations
    held = [step for step in run.steps if at + away <= step.time < at + away + 20.0 and step.time > at]
    begun = [c.operation for step in held for c in step.commands if isinstance(c, Start)]
    assert [name for name in begun if operations[name].on_hold is OnHold.CANCEL] == []
