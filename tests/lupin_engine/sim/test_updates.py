"""Simulated servers that take a new goal in place of the one they work on."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from lupin_engine.chart.model import Chart
from lupin_engine.machine.event import Cancel, Start
from lupin_engine.missions.folders import default_missions_folder
from lupin_engine.missions.load import load_chart
from lupin_engine.replay.why import Inquiry, LivedStep
from lupin_engine.sim.narration import narrate
from lupin_engine.sim.scripted import MockOutcome, Rule
from lupin_engine.sim.simulation import (
    Ask,
    End,
    Happening,
    Leave,
    Restart,
    Run,
    Script,
    SetValue,
    simulate,
)
from tests import shipped

MISSION = """\
mission: Chase
summary: Drive to where somebody is.
inputs: {them: {value: robot.pose}}
codes: {slow: {label: it took too long}}
initial: CHASING
states:
  CHASING:
    invoke:
      do: nav.go_to
      with: {pose: "${ input.them if known(input.them) else param.dock_pose }"}
      timeout: {after: 30 s, code: slow}
      update: 1 s
    on: {operator.skip_current: done}
    on_done: done
    on_error: {target: done, code: slow}
  done: {type: final}
"""
#: Where they are, second by second.
THERE = [{"x": float(n), "y": 4.0, "yaw": 0.0} for n in range(5)]
WALKS = [Happening(SetValue("robot.pose", place), 0.9 + n, "CHASING") for n, place in enumerate(THERE)]


@pytest.fixture(scope="module")
def chase(tmp_path_factory: pytest.TempPathFactory) -> Chart:
    """The mission in the shipped lifecycle."""
    file: Path = tmp_path_factory.mktemp("chase") / "chase.yaml"
    file.write_text(MISSION, encoding="utf-8")
    return load_chart(default_missions_folder() / "lifecycle.yaml", [file], shipped.catalog())


def chased(chart: Chart, *more: Happening, **outcome: Any) -> Run:
    """Simulate it, with somebody who walks for five seconds."""
    rules = (Rule("nav.go_to", (MockOutcome(**outcome),)),)
    return simulate(chart, Script("Chase", rules=rules, happenings=(*WALKS, *more)))


def goals(run: Run) -> dict[str, list[str]]:
    """Return the goals of the chase, each with what the machine has said to it and heard of it."""
    found: dict[str, list[str]] = {}
    for step in run.steps:
        name = step.event.data.get("attempt") if isinstance(step.event.data, Mapping) else None
        if name in found:
            found[name].append(step.event.name.removeprefix("attempt."))
        for command in step.commands:
            if isinstance(command, Start) and command.operation == "nav.go_to":
                found[command.attempt] = []
            if isinstance(command, Cancel) and command.attempt in found:
                found[command.attempt].append("cancel")
    return found


def test_a_mocked_server_ends_the_old_goal_and_works_as_long_as_it_would_have(chase: Chart) -> None:
    """However often it is updated: its script goes on, and nothing is cancelled."""
    run = chased(chase, after=8.0)
    assert list(goals(run).values()) == [["accepted", "cancelled"]] * 5 + [["accepted", "done"]]
    (drive,) = [one for one in run.history.attempts.values() if one.operation == "nav.go_to"]
    assert (len(drive.updated), drive.outcome, drive.arguments["pose"]) == (5, "done", THERE[4])
    assert drive.ended == pytest.approx(drive.started + 8.0)
    assert run.violated == ()
    said = [text for line in narrate(run.chart, run.history) for text, _ in line.commanded]
    assert said.count("update nav.go_to(pose: {x 2, y 4, yaw 0})") == 1


def test_why_says_how_often_it_was_updated_until_then(chase: Chart) -> None:
    run = chased(chase, after=8.0)
    lived = [LivedStep(step, step.time) for step in run.steps]
    answer = Inquiry(chase, lived).moment(3.7)
    assert answer.text == "in CHASING for 3.7 s; under way: nav.go_to for 3.7 s (updated 3 times)"


def test_a_failure_by_hand_is_one_of_the_newest_goal(chase: Chart) -> None:
    run = chased(chase, Happening(End("nav.go_to", "nav_status_6"), 2.5, "CHASING"), after=8.0)
    assert list(goals(run).values())[-1] == ["accepted", "failed"]
    assert run.view.code == "slow"


#: What stops it, between the update after 2 s and its acceptance after 3.5 s.
STOPS = {
    "pause": Happening(Ask("operator.pause"), 2.5, "CHASING"),
    "leave": Happening(Ask("operator.skip_current"), 2.5, "CHASING"),
    "abort": Happening(Ask("operator.abort"), 2.5, "CHASING"),
    "estop": Happening(SetValue("robot.estop", True), 2.5, "CHASING"),
    "restart": Happening(Restart(0.5), 2.5, "CHASING"),
}


@pytest.mark.parametrize("stop", STOPS)
def test_what_stops_it_in_between_stops_both_goals(chase: Chart, stop: str) -> None:
    """The server works on the old one, and would take the new one later."""
    run = chased(chase, STOPS[stop], after=60.0, accepted_after=1.5)
    old, new, *_ = goals(run).values()
    assert old == ["accepted", "cancel", "cancelled"]
    assert new[0] == "cancel"
    assert run.violated == ()


def test_the_time_limit_stops_both_goals(chase: Chart) -> None:
    """The server is gone after it has taken one."""
    run = chased(chase, Happening(Leave("nav.go_to"), 2.5, "CHASING"), after=60.0)
    *_, old, new = goals(run).values()
    assert (old, new) == (["accepted", "cancel"], ["cancel"])
    assert (run.view.code, run.violated) == ("slow", ())
