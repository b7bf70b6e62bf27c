"""Every shipped mission has scenarios that reach all of it; pytest itself runs them, by our plugin.

A mission's scenarios are those in the folder of its name. The states and transitions of the lifecycle are
shared: the scenarios of any mission may reach them.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

import pytest

from lupin_engine.missions.folders import default_missions_folder, mission_files
from lupin_engine.replay.coverage import (
    GUARDS,
    OUTCOMES,
    STATES,
    TRANSITIONS,
    Coverage,
    CoverageObserver,
    FileCoverage,
    add_up,
)
from lupin_engine.sim.scenario import scenario_files
from lupin_engine.sim.suite import Suite
from tests import shipped

HERE = Path(__file__).parent
MISSIONS = [file.stem for file in mission_files(default_missions_folder())]


@cache
def coverage() -> Coverage:
    """Run every scenario of every mission."""
    suite = Suite(shipped.catalog(), CoverageObserver())
    return add_up([suite.run(file) for file in scenario_files([HERE])], suite.missions)


def part(name: str) -> FileCoverage:
    """What was reached of a mission, or of the lifecycle."""
    found = [part for part in coverage().parts if part.title == name]
    assert found, f"no scenario is about {name}"
    return found[0]


def test_there_are_missions() -> None:
    """What follows is about something."""
    assert MISSIONS


@pytest.mark.slow
@pytest.mark.parametrize("mission", MISSIONS)
def test_a_mission_has_scenarios(mission: str) -> None:
    """They stand in a folder of its name, and are about it."""
    assert scenario_files([HERE / mission])
    reached = {path.stem for path in coverage().charts}
    assert mission in reached


def check(name: str, kind: str) -> None:
    """Name what was not reached."""
    (tally,) = [tally for tally in part(name).tallies() if tally.kind == kind]
    missing = [f"{piece.place}: {piece.text}" for piece in tally.missing]
    assert not missing, "\n".join(missing)


@pytest.mark.slow
@pytest.mark.parametrize("kind", [STATES, TRANSITIONS])
@pytest.mark.parametrize("name", [*MISSIONS, "lifecycle"])
def test_every_state_and_transition_is_reached(name: str, kind: str) -> None:
    """Every state is entered and every transition taken, those that refuse included."""
    check(name, kind)


@pytest.mark.parametrize("kind", [OUTCOMES, GUARDS])
@pytest.mark.parametrize("name", [*MISSIONS, "lifecycle"])
def test_every_end_and_branch_is_reached(name: str, kind: str) -> None:
    """Every operation ends in every way that it can, and every guard is true once and false once."""
    check(name, kind)
