"""Rules of war stories that are about the whole tree; docs/war-stories.md links here."""

from __future__ import annotations

from pathlib import Path

import pytest

from lupin_bridge.greenhouse import Greenhouse
from lupin_bridge.units import QUANTITIES as SERVED
from lupin_greenhouse.readings import SENSOR_UNITS
from lupin_twin.state import SENSORS
from lupin_twin.text import QUANTITIES as KEPT

ROOT = Path(__file__).parents[2]

simulator = pytest.importorskip("greenhouse_sim", reason="mdp-greenhouse is not installed here")


def test_nothing_of_ours_sends_velocities() -> None:
    """Story 74: a drive without a time limit goes on when its sender dies. Goals end; velocities do not.

    The profile names their topics to say who may drive by hand through the gateway; the simulated base obeys
    one for half a second.
    """
    shelves = ("lupin_engine", "lupin_ros", "workbench", "plugins")
    sources = [file for shelf in shelves for file in (ROOT / shelf).rglob("*.py")]
    assert len(sources) > 100
    guilty = [
        file.relative_to(ROOT).as_posix()
        for file in sources
        if any(word in file.read_text(encoding="utf-8") for word in ("Twist", "cmd_vel"))
    ]
    assert sorted(guilty) == ["plugins/lupin_greenhouse/profile.py", "plugins/lupin_sim/node/robot.py"]


def test_bridge_twin_and_profile_mean_the_same_by_a_number() -> None:
    """Story A33: moist was 30 to 60 for one and 0.2 to 0.8 for the other."""
    assert {sensor: SERVED[sensor].unit for sensor in SENSORS} == {
        sensor: KEPT[sensor].symbol for sensor in SENSORS
    }
    assert {sensor: unit or "1" for sensor, unit in SENSOR_UNITS.items()} == {
        sensor: SERVED[sensor].unit for sensor in SENSORS
    }
    assert set(SERVED) == set(KEPT) == set(SENSORS)


@pytest.mark.parametrize(("told", "seconds"), [(86_400.0 * 2.5, 43_200.0), (-3_600.0, 82_800.0)])
def test_a_time_of_day_lies_within_a_day_whatever_the_simulator_says(
    monkeypatch: pytest.MonkeyPatch, told: float, seconds: float
) -> None:
    """Story 59: it was off by factors of 24 and 2.5."""
    greenhouse = Greenhouse()
    data = {**greenhouse._simulator.get_sensor_data("1"), "timestamp": told}
    monkeypatch.setattr(greenhouse._simulator, "get_sensor_data", lambda tag_id: data)
    assert greenhouse.read("1").time_of_day == seconds
