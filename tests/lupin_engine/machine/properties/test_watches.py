"""Levels are looked at when something that they read changes; the steps are those of looking always."""

from __future__ import annotations

from pathlib import Path

import pytest

from lupin_engine.machine.scope import CONFIGURATION, CONTEXT, HELD, ITINERARY, Reads, Watch, input_part
from lupin_engine.machine.step import Step
from lupin_engine.missions.folders import LIFECYCLE, default_missions_folder
from lupin_engine.missions.load import load_chart
from lupin_engine.plugin.registry import load_catalog
from lupin_engine.sim.scenario import Missions, load_scenario, scenario_files

SCENARIOS = scenario_files([Path(__file__).parents[3] / "scenarios"])


@pytest.fixture(scope="module")
def missions() -> Missions:
    """The shipped missions, loaded once."""
    return Missions(load_catalog())


def steps_of(file: Path, missions: Missions) -> list[Step]:
    return list(load_scenario(file, missions.catalog, missions).run().history.steps)


@pytest.mark.slow
def test_every_scenario_takes_the_steps_of_looking_always(
    missions: Missions, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nothing that a watch leaves out would have been true, or told."""
    watched = [steps_of(file, missions) for file in SCENARIOS]
    monkeypatch.setattr(Watch, "cache_false", lambda *_: None)
    for file, steps in zip(SCENARIOS, watched, strict=True):
        assert steps_of(file, missions) == steps, file


def test_what_conditions_read(missions: Missions) -> None:
    """Found in the checked code of the shipped missions' guards."""
    folder = default_missions_folder()
    chart = load_chart(folder / LIFECYCLE, [folder / "inspection.yaml"], missions.catalog)
    battery, missing = input_part(chart, "battery"), input_part(chart, "missing")
    found = {
        name: Reads(
            chart, [rule.guard for rule in chart.states[name].transitions if rule.guard and not rule.event]
        )
        for name in ("READY", "RETURNING.DRIVING_HOME", "MISSION.InspectionMission.INSPECTING.PUBLISHING")
    }
    assert [reads.parts for reads in found.values()] == [missing, battery | CONTEXT, ITINERARY | CONTEXT]
    assert all(reads.certain and reads.ageing == () for reads in found.values())
    pause = chart.holds["pause"].engage_guard
    assert pause is not None
    assert Reads(chart, [pause]).parts == CONFIGURATION
    assert Reads(chart, [], ["input.battery.low"]).parts == battery
    assert not battery & missing & HELD
