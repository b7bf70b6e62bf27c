"""The missions of the examples over real nodes, whose orchestrator is killed in one state after the other.

That no step is without this is shown in virtual time (`tests/lupin_engine/sim/test_examples_restarted.py`).
"""

from __future__ import annotations

import shutil
import sys
from pathlib import Path
from typing import Any

import pytest

from lupin_engine.missions.folders import default_missions_folder
from tests.lupin_ros.system.examples.test_night_watch import where_it_is_night
from tests.lupin_ros.world import Operator, World

pytestmark = pytest.mark.timeout(240)

EXAMPLES = Path(__file__).parents[4] / "examples"
NODE = "mission_orchestrator"


class Restarts:
    """Kills the orchestrator, and resumes what the next one holds; `given` are their parameters."""

    def __init__(self, world: World, operator: Operator, **given: Any) -> None:
        self.world, self.operator = world, operator
        self.given = {"estop_timeout_s": 10.0, **given}

    def kill_in(self, *phases: str) -> None:
        """Kill the orchestrator once in each of these published phases, or states that have none."""
        for phase in phases:
            self.operator.until(lambda phase=phase: self._phase() == phase, phase)  # type: ignore[misc]
            self._kill()

    def _phase(self) -> str:
        states = self.operator.states
        return states[-1].mission_phase or states[-1].lifecycle_state if states else ""

    def _kill(self) -> None:
        process = self.world.processes[NODE]
        process.kill()
        process.wait(10.0)
        self.operator.states.clear()
        self.world.start(NODE, **self.given)
        self.operator.held()
        self.operator.resume()

    def told(self) -> list[tuple[str, int]]:
        """What became of each tag: the same message may come twice, and counts once."""
        found = {
            (o.tag_reading.tag_id, o.status, o.header.stamp.sec, o.header.stamp.nanosec)
            for o in self.operator.observations
        }
        return sorted((tag, status) for tag, status, *_ in found)


def start(operator: Operator, mission: str, *tags: str) -> None:
    """Start a mission when the robot is ready."""
    operator.in_state("READY")
    answer = operator.start(*tags, mission=mission)
    assert answer.accepted, answer.error_message


def test_a_photo_round(world: World, operator: Operator, tmp_path: Path) -> None:
    """Killed while it drives, and on its way home."""
    camera = [sys.executable, str(EXAMPLES / "photo_round" / "camera.py"), "--ros-args"]
    world.run("camera", [*camera, "-p", f"folder:={tmp_path}", "-p", "light:=200.0"])
    restarts = Restarts(world, operator, missions_path=EXAMPLES / "photo_round" / "missions")
    world.start_all(speed=4.0, **restarts.given)
    start(operator, "PhotoMission", "1", "5")
    restarts.kill_in("NAVIGATING", "RETURNING")
    operator.until_done(published=2)
    assert restarts.told() == [("1", 0), ("5", 0)]
    # One that was taken when nobody was left to hear of it is taken again.
    taken = {file.name for file in tmp_path.glob("*.pgm")}
    assert {"photo1.pgm", "photo2.pgm"} <= taken <= {"photo1.pgm", "photo2.pgm", "photo3.pgm"}


def test_a_night_watch(world: World, operator: Operator, tmp_path: Path) -> None:
    """Killed while it drives, and while it waits for the next hour."""
    missions = shutil.copytree(default_missions_folder(), tmp_path / "missions")
    shutil.copy(EXAMPLES / "night_watch" / "missions" / "night_watch.yaml", missions)
    restarts = Restarts(world, operator, missions_path=missions, time_zone=where_it_is_night())
    world.start_all(speed=4.0, **restarts.given)
    start(operator, "NightWatchMission", "1", "5")
    restarts.kill_in("NAVIGATING", "WAITING")
    assert operator.ask("abort").success
    operator.until_done(published=2)
    assert restarts.told() == [("1", 0), ("5", 0)]
