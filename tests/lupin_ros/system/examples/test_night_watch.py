"""The night watch of the examples: with the twin that says what was read when, and by a clock of its own."""

from __future__ import annotations

import shutil
from datetime import datetime, timezone
from pathlib import Path

import pytest
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav2_msgs.action import NavigateToPose
from rosgraph_msgs.msg import Clock

from lupin_engine.missions.folders import default_missions_folder
from lupin_engine.runtime.clock import calendar_of
from lupin_msgs.msg import TwinState
from lupin_ros.adapter.node import Qos, ServedGoal
from tests.lupin_ros.helpers import to_time
from tests.lupin_ros.world import Operator, World

pytestmark = pytest.mark.timeout(180)

NIGHT_WATCH = Path(__file__).parents[4] / "examples" / "night_watch"


def read(twin: TwinState) -> set[str]:
    """The tags that have a reading."""
    return {tag.tag_id for tag in twin.tags if tag.readings}


def where_it_is_night() -> str:
    """A time zone in which it is one o'clock at night or a little later."""
    hour = datetime.now(timezone.utc).hour
    east = 1 - hour if hour < 14 else 25 - hour
    return f"Etc/GMT{-east:+d}"  # these count to the west


class Night:
    """A simulated clock, which begins half an hour before the watch; and a base that is there at once."""

    def __init__(self, operator: Operator) -> None:
        self.time = calendar_of("UTC").moment("2026-11-22 21:30")
        ros = operator.ros
        self._clock = ros.publisher(Clock, "/clock", Qos.EVENT)
        ros.serve_action(
            NavigateToPose, "navigate_to_pose", admit=lambda _: True, started=_arrive, cancelled=_stop
        )
        pose = PoseWithCovarianceStamped()
        pose.header.frame_id = "map"
        ros.publisher(PoseWithCovarianceStamped, "/amcl_pose", Qos.LATCHED).publish(pose)
        ros.steady_timer(0.02, self._tick)

    def _tick(self) -> None:
        self.time += 0.02
        self._clock.publish(Clock(clock=to_time(self.time)))


def _arrive(goal: ServedGoal) -> None:
    goal.succeed(NavigateToPose.Result())


def _stop(goal: ServedGoal) -> None:
    goal.cancel(NavigateToPose.Result())


def test_two_rounds_by_the_hour(world: World, operator: Operator, tmp_path: Path) -> None:
    """With simulated time, an hour is over when its clock says so."""
    missions = shutil.copytree(default_missions_folder(), tmp_path / "missions")
    shutil.copy(NIGHT_WATCH / "missions" / "night_watch.yaml", missions)
    night = Night(operator)
    world.start("greenhouse_bridge", use_sim_time=True)
    world.start("mission_orchestrator", use_sim_time=True, missions_path=missions)
    operator.in_state("READY")
    answer = operator.start("1", "5", mission="NightWatchMission")
    assert answer.accepted, answer.error_message
    operator.in_state("WATCHING", "WAITING")
    assert operator.observations == []
    night.time += 1800.0
    operator.until(lambda: len(operator.observations) == 2, "the round of ten o'clock")
    operator.in_state("WATCHING", "WAITING")
    night.time += 3600.0
    operator.until(lambda: len(operator.observations) == 4, "the round of eleven o'clock")
    operator.in_state("WATCHING", "WAITING")
    night.time += 7 * 3600.0
    operator.in_state("DONE")
    assert len(operator.observations) == 4


def test_the_oldest_reading_first(world: World, operator: Operator, tmp_path: Path) -> None:
    """An inspection reads two tags; the watch begins with the third, and goes on with the one read first."""
    missions = shutil.copytree(default_missions_folder(), tmp_path / "missions")
    shutil.copy(NIGHT_WATCH / "missions" / "night_watch.yaml", missions)
    world.start("lupin_twin", store_file=tmp_path / "twin.json")
    world.start_all(missions_path=missions, time_zone=where_it_is_night())
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
    operator.until(lambda: len(operator.observations) >= 5, "5 observations")
    told = [(o.tag_reading.tag_id, o.status) for o in operator.observations]
    assert told[2:5] == [("1", 0), ("12", 0), ("5", 0)]
    assert operator.ask("abort").success
    operator.in_state("DONE")
