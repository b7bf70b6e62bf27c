"""The same inputs give the same steps, always; a journal or a snapshot gives the machine back."""

from __future__ import annotations

import json
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import pytest

from lupin_engine.machine.machine import Machine
from lupin_engine.machine.step import Step
from lupin_engine.runtime.record import step_record
from lupin_engine.runtime.setup import make_machine
from lupin_engine.sim.scenario import Missions, load_scenario, scenario_files
from lupin_engine.sim.simulation import Happening, Restart, simulate
from tests import shipped

MISSIONS = Missions(shipped.catalog())
FILES = scenario_files([Path(__file__).parent / "scenarios"])


def records(steps: tuple[Step, ...]) -> list[str]:
    """Return steps as the lines of a journal."""
    return [json.dumps(step_record(step), sort_keys=True) for step in steps]


def replay(machine: Machine, steps: tuple[Step, ...]) -> list[Step]:
    """Feed a fresh machine with what the journal says that came in."""
    found: list[Step | None] = [machine.start(steps[0].time, steps[0].event.data.get("ahead"))]
    for step in steps[1:]:
        if step.event.name.startswith("timer."):
            found.append(machine.advance(step.time))
        else:
            found.append(machine.handle(step.event, step.time))
    return [step for step in found if step is not None]


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.name.partition(".")[0])
def test_same_inputs_same_steps(file: Path) -> None:
    """A scenario run twice gives equal records, crashes or not, and its steps replayed give equal steps.

    The second machine is made anew from its snapshot at every step, and between every two.
    """
    scenario = load_scenario(file, shipped.catalog(), MISSIONS)
    run = scenario.run()
    times = sorted({step.time for step in run.steps})
    between = [(first + second) / 2 for first, second in pairwise(times)]
    crashes = tuple(Happening(Restart(), time) for time in (*times, *between))
    script = replace(scenario.script, happenings=(*scenario.script.happenings, *crashes))
    assert records(simulate(scenario.chart, script, scenario.parameters).steps) == records(run.steps)
    fresh = make_machine(scenario.chart, scenario.parameters)
    assert replay(fresh, run.steps) == list(run.steps)
    assert fresh.view == run.view
