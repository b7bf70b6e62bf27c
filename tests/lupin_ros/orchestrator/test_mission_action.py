"""The action RunMission over real ROS 2: a program starts, follows and aborts a mission."""

from __future__ import annotations

import json
import re
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
from action_msgs.msg import GoalStatus

from lupin_engine_msgs.action import RunMission
from lupin_engine_msgs.srv import Command
from lupin_ros.adapter.node import Goal, GoalCallbacks
from lupin_ros.orchestrator.mission_action import MOST_GOALS
from lupin_ros.service.names import COMMAND_SERVICE, RUN_ACTION
from tests.lupin_ros.world import Operator, World

pytestmark = pytest.mark.timeout(180)

PAGE = Path(__file__).parents[3] / "docs" / "operating.md"
SUCCEEDED, CANCELED, ABORTED = (
    GoalStatus.STATUS_SUCCEEDED,
    GoalStatus.STATUS_CANCELED,
    GoalStatus.STATUS_ABORTED,
)


class Program:
    """A program that runs missions; it works with the operator's node."""

    def __init__(self, operator: Operator) -> None:
        self._operator = operator
        self._client = operator.ros.action(RunMission, RUN_ACTION)
        self.feedback: list[RunMission.Feedback] = []
        self.ends: list[tuple[int, RunMission.Result]] = []
        self.refused: list[bool] = []
        self.rejected: list[bool] = []
        operator.until(self._client.ready, RUN_ACTION)

    def send(self, *tags: str, mission: str = "InspectionMission", **fields: Any) -> Goal:
        """Send a goal."""
        given = {"request": json.dumps({"tag_sequence": tags}), "by": "planner", **fields}
        reports = GoalCallbacks(
            feedback=self.feedback.append,
            ended=lambda status, result: self.ends.append((status, result)),
            refused=lambda: self.refused.append(True),
            rejected=lambda: self.rejected.append(True),
        )
        return self._client.send(RunMission.Goal(mission=mission, **given), reports)

    def ended(self) -> tuple[int, str, str]:
        """Wait for the next end; return status, code and message."""
        self._operator.until(lambda: self.ends, "the end of a goal")
        status, self.result = self.ends.pop(0)
        return status, self.result.code, self.result.message

    def drive(self, *tags: str) -> Goal:
        """Send a goal whose first drive does not end by itself; return it when the robot drives."""
        self._operator.hit(1, "stall")
        goal = self.send(*tags)
        self._operator.in_state("INSPECTING", "NAVIGATING")
        self._operator.struck()
        return goal

    def run(self, *tags: str, **fields: Any) -> tuple[int, str, str]:
        """Send a goal and wait for its end."""
        self.send(*tags, **fields)
        return self.ended()


@pytest.fixture
def program(world: World, operator: Operator) -> Program:
    """A robot that is ready, and a program."""
    world.start_all()
    operator.in_state("READY")
    return Program(operator)


@pytest.mark.core
def test_the_program_of_the_page_runs_a_mission(world: World, operator: Operator, tmp_path: Path) -> None:
    """A plain client of rclpy, as the page has it, in at most 40 lines."""
    world.start_all()
    operator.in_state("READY")
    [text] = [
        each
        for each in re.findall(r"```python\n(.*?)```", PAGE.read_text(), re.DOTALL)
        if "RunMission" in each
    ]
    assert len(text.splitlines()) <= 40
    file = tmp_path / "planner.py"
    file.write_text(text)
    with world.log("planner").open("wb") as output:
        planner = subprocess.Popen([sys.executable, str(file)], stdout=output, stderr=subprocess.STDOUT)
        operator.until(lambda: planner.poll() is not None, "the end of the program")
    said = world.log("planner").read_text().splitlines()
    assert planner.returncode == 0, said
    assert said[-3:] == [f"{SUCCEEDED}  DONE: 2 OK", "1 OK ", "5 OK "]
    assert any(line.startswith("INSPECTING NAVIGATING 1") for line in said)


def test_feedback_and_result_tell_of_every_target(program: Program, operator: Operator) -> None:
    """The counts grow, the second target is skipped by a person; the reason stands in the result."""
    program.drive("1", "5")
    operator.ask("skip_current")
    assert program.ended() == (SUCCEEDED, "", "DONE: 1 OK, 1 SKIPPED")
    told = [(each.target, each.outcome, each.good, each.code) for each in program.result.outcomes]
    assert told == [("1", "SKIPPED", False, "skipped_by_operator"), ("5", "OK", True, "")]
    last = program.feedback[-1]
    assert (last.state, last.total, last.mission_id) == ("DONE", 2, program.result.mission_id)
    assert {each.outcome: each.count for each in last.counts if each.count} == {"OK": 1, "SKIPPED": 1}
    states = [each.state for each in program.feedback]
    assert list(dict.fromkeys(states)) == ["PREPARE", "INSPECTING", "RETURNING", "DONE"]


@pytest.mark.core
def test_a_refused_goal_has_the_sentence_of_the_engine(program: Program, operator: Operator) -> None:
    """The same as the command gets, and nothing has changed."""
    assert program.run("1", mission="InspectionMision") == (
        ABORTED,
        "unknown_mission",
        "unknown mission 'InspectionMision'; did you mean 'InspectionMission'?",
    )
    text = "start refused: unknown field 'tags'; allowed: 'tag_sequence'"
    assert program.run(request='{"tags": ["1"]}') == (ABORTED, "bad_request", text)
    assert program.run(request="{")[:2] == (ABORTED, "bad_request")
    assert program.run("77")[:2] == (ABORTED, "unknown_tag")
    assert program.run(by="x" * 201)[2] == "refused: too long: by has 201 letters, at most 200"
    late = RunMission.Goal().stamp
    late.sec = int(time.time()) - 60
    status, code, message = program.run("1", stamp=late)
    assert (status, code) == (ABORTED, "stale")
    assert re.fullmatch(r"refused: the goal is 6\d\.\d s old, or the clocks .* disagree", message)
    assert operator.state.lifecycle_state == "READY"
    program.drive("1")
    refused = "start refused: a mission is already running"
    assert program.run("5") == (ABORTED, "mission_running", refused)
    assert operator.state.lifecycle_state == "INSPECTING"


def test_a_flood_of_goals_is_rejected(program: Program, operator: Operator, world: World) -> None:
    """Each goal that is taken is in every message about goals, for as long as its result is kept."""
    for _ in range(MOST_GOALS + 20):
        program.send("77")
    operator.until(lambda: len(program.ends) + len(program.rejected) == MOST_GOALS + 20, "all answers")
    assert len(program.rejected) == 20
    assert {result.code for _, result in program.ends} == {"unknown_tag"}
    assert f"goal rejected: {MOST_GOALS} came within 120 s" in world.log("mission_orchestrator").read_text()
    assert operator.start("1").accepted


def test_a_cancel_aborts_and_an_abort_of_others_is_told(program: Program, operator: Operator) -> None:
    """The goal ends when the robot is home; a mission that was begun by others has no goal."""
    goal = program.drive("1", "5")
    goal.cancel()
    assert program.ended() == (CANCELED, "mission_aborted", "mission aborted by planner")
    assert operator.state.lifecycle_state == "DONE"
    assert {each.code for each in program.result.outcomes} == {"mission_aborted"}

    program.drive("1")
    command = Command.Request(verb="abort", by="ann@desk")
    assert operator.call(Command, COMMAND_SERVICE, command).accepted
    assert program.ended() == (ABORTED, "mission_aborted", "mission aborted by ann@desk")

    program.feedback.clear()
    assert operator.start("1").accepted
    operator.in_state("DONE")
    assert (program.feedback, program.ends) == ([], [])


@pytest.mark.core
def test_a_goal_and_its_cancel_release_no_hold(program: Program, operator: Operator) -> None:
    """A stop, and one that was let go; a pause: a person resumes first."""
    operator.set_parameter("lupin_sim", "estop", True)
    operator.until(lambda: operator.state.estop_engaged, "the stop")
    assert program.run("1") == (ABORTED, "estop_engaged", "start refused: e-stop engaged")
    operator.set_parameter("lupin_sim", "estop", False)
    operator.until(lambda: not operator.state.estop_engaged, "the release")
    let_go = "start refused: e-stop engaged; only a person releases this hold: resume first"
    assert program.run("1") == (ABORTED, "estop_engaged", let_go)
    assert operator.state.lifecycle_state == "READY"
    assert operator.ask("resume").success

    goal = program.drive("1")
    assert operator.ask("pause").success
    operator.held()
    goal.cancel()
    operator.until(lambda: program.refused, "the refusal of the cancel")
    assert (operator.state.lifecycle_state, operator.state.paused) == ("INSPECTING", True)
    assert operator.ask("resume").success  # the client asks again, as ours do, and then it is taken
    assert program.ended() == (CANCELED, "mission_aborted", "mission aborted by planner")


def test_a_killed_orchestrator_loses_the_goal_and_holds_the_mission(
    program: Program, world: World, operator: Operator
) -> None:
    """A new goal is refused until a person has ended the mission; one that ends in order says so."""
    program.drive("1", "5")
    process = world.processes["mission_orchestrator"]
    process.send_signal(signal.SIGKILL)
    process.wait(10.0)
    operator.states.clear()
    process = world.start("mission_orchestrator", estop_timeout_s=10.0)
    operator.held()
    assert operator.state.last_error.startswith("restarted: ")
    assert program.ended() == (GoalStatus.STATUS_UNKNOWN, "", "")
    assert program.run("5")[:2] == (ABORTED, "mission_running")
    operator.resume()
    operator.in_state("DONE")

    program.drive("1")
    process.send_signal(signal.SIGINT)
    text = "mission_orchestrator ends: its mission is held until somebody resumes it"
    assert program.ended() == (ABORTED, "restarted", text)
