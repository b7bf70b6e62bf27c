"""The night watch of the examples, with the twin that says what was read when."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from lupin_engine.missions.folders import default_missions_folder
from lupin_engine.ros.adapter.node import Qos
from lupin_msgs.msg import TwinState
from tests.ros.world import Operator, World

pytestmark = pytest.mark.timeout(180)

NIGHT_WATCH = Path(__file__).parents[3] / "examples" / "night_watch"


def read(twin: TwinState) -> set[str]:
    """The tags that have a reading."""
    return {tag.tag_id for tag in twin.tags if tag.readings}


def test_the_oldest_reading_first(world: World, operator: Operator, tmp_path: Path) -> None:
    """An inspection reads two tags; the watch begins with the third, and goes on with the one read first."""
    missions = shutil.copytree(default_missions_folder(), tmp_path / "missions")
    shutil.copy(NIGHT_WATCH / "missions" / "night_watch.yaml", missions)
    world.start("lupin_twin", store_file=tmp_path / "twin.json")
    world.start_all(missions_path=missions)
    twin: list[TwinState] = []
    operator.ros.subscribe(TwinState, "/twin/state", Qos.LATCHED, twin.append)
    operator.in_state("READY")
    assert operator.start("12", "5").accepted
    operator.until_done(published=2)
    # Told more than once, a second apart: then the orchestrator has heard it as well.
    both = {"5", "12"}
    operator.until(lambda: [read(state) for state in twin].count(both) >= 3, "the twin has both readings")
    answer = operator.start("5", "12", "1", mission="NightWatchMission")
    assert answer.accepted, answer.error_message
    operator.in_state("WATCHING", "WAITING")
    operator.until(lambda: len(operator.observations) == 5, "5 observations")
    told = [(o.tag_reading.tag_id, o.status) for o in operator.observations]
    assert told[2:] == [("1", 0), ("12", 0), ("5", 0)]
    assert operator.ask("abort").success
    operator.in_state("DONE")
