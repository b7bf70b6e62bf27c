"""The same inputs give the same steps, always; a journal or a snapshot gives the machine back."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from lupin_engine.machine.machine import Machine
from lupin_engine.machine.snapshot import restore
from lupin_engine.machine.step import Step
from lupin_engine.runtime.record import step_record
from lupin_engine.runtime.setup import make_machine
from lupin_engine.sim.scenario import Missions, load_scenario, scenario_files
from tests import shipped

pytestmark = pytest.mark.slow

MISSIONS = Missions(shipped.catalog())
FILES = scenario_files([Path(__file__).parent / "scenarios"])


def records(steps: tuple[Step, ...]) -> list[str]:
    """Return steps as the lines of a journal."""
    return [json.dumps(step_record(step), sort_keys=True) for step in steps]


def replay(machine: Machine, steps: tuple[Step, ...]) -> tuple[list[Step], Machine]:
    """Feed a machine with what came in; between every two steps another one goes on from its snapshot."""
    found: list[Step | None] = [machine.start(steps[0].time, steps[0].event.data.get("ahead"))]
    for step in steps[1:]:
        machine = Machine(machine.world, restore(machine.chart, machine.snapshot()))
        if step.event.name.startswith("timer."):
            found.append(machine.advance(step.time))
        else:
            found.append(machine.handle(step.event, step.time))
    return [step for step in found if step is not None], machine


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.name.partition(".")[0])
def test_same_inputs_same_steps(file: Path) -> None:
    """A scenario run twice gives equal records, and its steps replayed give equal steps."""
    scenario = load_scenario(file, shipped.catalog(), MISSIONS)
    run = scenario.run()
    assert records(scenario.run().steps) == records(run.steps)
    if any(step.event.name in ("resumed", "restarted") for step in run.steps):
        return  # the journal's own tests live through what was before and after
    found, fresh = replay(make_machine(scenario.chart, scenario.parameters), run.steps)
    assert found == list(run.steps)
    assert fresh.view == run.view
