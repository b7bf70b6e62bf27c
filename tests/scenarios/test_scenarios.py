"""Every scenario file holds; together they go everywhere."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from lupin_engine.chart.model import Kind
from lupin_engine.sim.scenario import chart_loader, load_scenario, scenario_files
from lupin_engine.sim.simulation import Run
from tests import shipped

HERE = Path(__file__).parent
CHARTS = chart_loader(shipped.catalog())


def name_of(file: Path) -> str:
    """Return a scenario's name: that of its file without the ending."""
    return file.name.partition(".")[0]


@pytest.mark.parametrize("file", scenario_files([HERE]), ids=name_of)
def test_scenario(file: Path) -> None:
    """What the file promises comes true."""
    scenario = load_scenario(file, shipped.catalog(), CHARTS)
    failures = scenario.failures(scenario.run())
    assert not failures, "\n".join(map(str, failures))


def runs(mission: str) -> Iterator[Run]:
    """Run every scenario of a mission."""
    for file in scenario_files([HERE / mission]):
        yield load_scenario(file, shipped.catalog(), CHARTS).run()


@pytest.mark.parametrize("mission", ["inspection"])
def test_every_state_is_reached(mission: str) -> None:
    """The scenarios of a mission enter all of its states."""
    found = list(runs(mission))
    entered = {name for run in found for step in run.steps for name in step.entered}
    states = {state.name for state in found[0].chart.states.values() if state.kind is not Kind.HISTORY}
    assert states - entered == set()


@pytest.mark.parametrize("mission", ["inspection"])
def test_every_transition_is_taken(mission: str) -> None:
    """The scenarios of a mission take all of its transitions, or are refused by them."""
    found = list(runs(mission))
    taken = {rule for run in found for step in run.steps for rule in step.taken}
    refused = {step.refusal.code for run in found for step in run.steps if step.refusal}
    rules = [rule for state in found[0].chart.states.values() for rule in state.transitions]
    missed = {rule.id for rule in rules if rule.id not in taken and rule.refuse not in refused}
    assert missed == set()
