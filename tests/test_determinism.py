"""The same inputs give the same steps, always; a journal replayed gives the machine back."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from lupin_engine.machine.machine import Machine
from lupin_engine.machine.step import Step
from lupin_engine.runtime.record import step_record
from lupin_engine.runtime.setup import make_machine
from lupin_engine.sim.scenario import load_scenario, scenario_files
from tests import shipped

FILES = scenario_files([Path(__file__).parent / "scenarios"])


def records(steps: tuple[Step, ...]) -> list[str]:
    """Return steps as the lines of a journal."""
    return [json.dumps(step_record(step), sort_keys=True) for step in steps]


def replay(machine: Machine, steps: tuple[Step, ...]) -> list[Step]:
    """Feed a fresh machine with what the journal says that came in."""
    found: list[Step | None] = [machine.start(steps[0].time)]
    for step in steps[1:]:
        if step.event.name.startswith("timer."):
            found.append(machine.advance(step.time))
        else:
            found.append(machine.handle(step.event, step.time))
    return [step for step in found if step is not None]


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.name.partition(".")[0])
def test_same_inputs_same_steps(file: Path) -> None:
    """A scenario run twice gives equal records, and its steps replayed give equal steps."""
    scenario = load_scenario(file, shipped.catalog())
    run = scenario.run()
    assert records(run.steps) == records(scenario.run().steps)
    fresh = make_machine(scenario.chart, scenario.parameters)
    assert replay(fresh, run.steps) == list(run.steps)
    assert fresh.view == run.view
