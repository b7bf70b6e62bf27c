"""A budget that goes on while the lifecycle has the robot."""

from __future__ import annotations

from typing import Any

import pytest

from lupin_engine.machine.reload import successor
from tests.lupin_engine.machine.charts import PAUSE, Bench, chart


def working(**more: Any) -> Bench:
    """A mission with a minute for its work, that may leave the work, and be sent to the dock."""
    work = {
        "budget": {60.0: "OVER"},
        "states": {"B": {"invoke": "nav.go", "on_done": "B", "on_error": "B"}},
        "on": {"rest": "REST"},
        "mission": "M",
        **more,
    }
    mission = {
        "mission": "M",
        "states": {"WORK": work, "REST": {"on": {"work": "WORK"}, "mission": "M"}, "OVER": {"mission": "M"}},
        "on": {"operator.dock": "DOCK", "operator.abort": "READY"},
    }
    slot = {"slot": True, "states": {"M": mission, "history": {"kind": "history", "depth": 2}}}
    states = {
        "READY": {"on": {"mission.start": "MISSION"}},
        "MISSION": slot,
        "DOCK": {"on": {"operator.resume": "MISSION.history"}},
    }
    missions = {"M": {"state": "MISSION.M"}}
    bench = Bench(chart(states, initial="READY", missions=missions, holds={"pause": PAUSE}))
    bench.send("mission.start", mission_type="M")
    bench.wait(10.0)
    return bench


@pytest.mark.parametrize(("during", "left"), [({"during": "divert"}, 20.0), ({}, 50.0)])
def test_the_time_at_the_dock_counts_where_it_is_said(during: dict[str, Any], left: float) -> None:
    """Else the clock stands still meanwhile."""
    bench = working(**during)
    bench.send("operator.dock")
    bench.wait(30.0)
    bench.restart()
    bench.send("operator.resume")
    assert bench.leaves == ["MISSION.M.WORK.B"]
    assert (bench.wait_for_next(), bench.leaves) == (left, ["MISSION.M.OVER"])


def test_what_is_used_up_at_the_dock_is_told_on_coming_back() -> None:
    """Before anything is begun."""
    bench = working(during="divert")
    bench.send("operator.dock")
    bench.wait(300.0)
    assert bench.leaves == ["DOCK"]
    begun = len(bench.started)
    bench.send("operator.resume")
    assert (bench.leaves, len(bench.started)) == (["MISSION.M.OVER"], begun)


def test_other_states_of_the_mission_do_not_count() -> None:
    """It is the time of this state still."""
    bench = working(during="divert")
    bench.send("rest")
    bench.wait(100.0)
    bench.send("work")
    assert (bench.wait_for_next(), bench.leaves) == (50.0, ["MISSION.M.OVER"])


def test_another_start_has_its_whole_time() -> None:
    """What ran on from the mission before is forgotten."""
    bench = working(during="divert")
    bench.send("operator.dock")
    bench.machine.memory.configuration = ("", "READY")
    bench.restart()
    bench.send("mission.start", mission_type="M")
    bench.wait(59.0)
    assert bench.leaves == ["MISSION.M.WORK.B"]
    bench.wait(1.0)
    assert bench.leaves == ["MISSION.M.OVER"]


def test_the_end_of_the_mission_stops_the_clock() -> None:
    """Nothing is counted in READY."""
    bench = working(during="divert")
    bench.send("operator.abort")
    bench.wait(3.0)  # until the drive must have ended
    assert (bench.leaves, bench.machine.next_deadline) == (["READY"], None)


def test_missions_that_are_loaded_anew_forget_what_ran_on() -> None:
    """The next one has its whole time: the deadline of the one before does not count for it."""
    bench = working(during="divert")
    bench.send("operator.dock")
    bench.machine.memory.configuration = ("", "READY")
    bench.machine = successor(bench.machine, bench.machine.world)
    bench.machine.go_on(bench.now)
    bench.send("mission.start", mission_type="M")
    bench.wait(59.0)
    assert bench.leaves == ["MISSION.M.WORK.B"]
    bench.wait(1.0)
    assert bench.leaves == ["MISSION.M.OVER"]
