"""Where targets are and where the robot stands for them: as it is then sent there, with what came of it."""

from __future__ import annotations

from pathlib import Path

import pytest

from lupin_engine.machine.event import Start
from lupin_engine.machine.step import Step
from lupin_engine.runtime.places import TargetPlace, TargetPlaces
from lupin_engine.sim.scenario import load_scenario
from lupin_engine.sim.simulation import Simulation
from tests import shipped

SCENARIOS = Path(__file__).parents[2] / "scenarios"


@pytest.mark.parametrize(
    ("name", "outcomes"),
    [
        ("inspection/rough_day", {"OK", "SCAN_FAILED"}),
        ("inspection/every_end_of_a_drive", {"UNREACHABLE"}),
        ("exploration/rough_day", {"OK", "SCAN_FAILED"}),
    ],
)
def test_the_robot_is_sent_where_a_target_says(name: str, outcomes: set[str]) -> None:
    """In every step of a rough day; one target at most is the current one, and each gets an outcome."""
    file = SCENARIOS / f"{name}.scenario.yaml"
    scenario = load_scenario(file, shipped.catalog())
    simulation = Simulation(scenario.chart, scenario.script, scenario.parameters)
    places, seen, sent = TargetPlaces(), list[TargetPlace](), 0
    assert places.look(simulation.machine, 0.0) == []

    def look(step: Step) -> None:
        nonlocal sent
        seen[:] = places.look(simulation.machine, simulation.now)
        current = [place for place in seen if place.is_current]
        assert [place.id for place in current] == [simulation.machine.memory.target][: len(current)]
        for command in step.commands:
            if isinstance(command, Start) and command.operation == "nav.go_to" and current:
                pose = command.arguments["pose"]
                assert current[0].stand == (pose["x"], pose["y"], pose["yaw"])
                sent += 1

    simulation.listener = look
    simulation.run()
    assert sent >= len(seen) >= 3
    assert outcomes <= {place.status for place in seen} <= set(scenario.chart.profile.statuses)
