"""The clocks of orchestrator and client are an hour apart: a mission is run, and what is late stays late."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from std_srvs.srv import Trigger

from lupin_engine.runtime.client_clocks import APART_S, STALE_AFTER_S
from lupin_engine_msgs.srv import Command
from lupin_ros.service.names import ANSWER_SERVICE, COMMAND_SERVICE
from tests.lupin_ros.orchestrator.test_answers import folder
from tests.lupin_ros.world import Operator, World

pytestmark = pytest.mark.timeout(180)

OLD = "refused: the request is {} s old, or the clocks of the two computers disagree"
STALE = re.compile(OLD.format(r"3[56]\d\d\.\d"))

#: What Python runs first in each process that is started.
CLOCK = """\
import os, time

true_ns = time.time_ns

def time_ns():
    while os.path.exists({hang!r}):
        time.sleep(0.05)
    return true_ns() + (3_600_000_000_000 if os.path.exists({flag!r}) else 0)

time.time_ns = time_ns
"""


@pytest.fixture
def hang(tmp_path: Path) -> Path:
    """A file: while it is there, the processes that the test starts hang when they look at the clock."""
    return tmp_path / "hang"


@pytest.fixture
def set_ahead(tmp_path: Path, hang: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[], None]:
    """Set the clock of the processes that the test starts an hour ahead, from when it is called."""
    flag, site = tmp_path / "ahead", tmp_path / "site"
    site.mkdir()
    text = CLOCK.format(flag=str(flag), hang=str(hang))
    (site / "sitecustomize.py").write_text(text, encoding="utf-8")
    monkeypatch.setenv("PYTHONPATH", str(site))
    return flag.touch


def test_a_mission_is_run_and_ended(world: World, operator: Operator, set_ahead: Callable[[], None]) -> None:
    """Who was heard before is known; who was not is refused once, unless it stops something."""
    world.start_all()
    operator.in_state("READY")
    operator.hit(1, "stall")
    assert operator.start("1", "5").accepted
    operator.in_state("INSPECTING", "NAVIGATING")
    set_ahead()
    stranger = {"verb": "skip", "by": "ann@laptop"}
    late = operator.call(Command, COMMAND_SERVICE, Command.Request(**stranger))
    assert (late.code, bool(STALE.fullmatch(late.message))) == ("stale", True)
    assert operator.ask("skip_current").message == "skip_current accepted"
    assert operator.ask("pause").message == "pause accepted"
    operator.until(lambda: operator.state.paused, "paused")
    assert operator.ask("resume").message == "resume accepted"
    operator.until(lambda: not operator.state.paused, "resumed")
    assert operator.ask("dock").message == "dock accepted"
    operator.in_state("RETURNING")
    again = operator.call(Command, COMMAND_SERVICE, Command.Request(verb="dock", by="bob@laptop"))
    assert again.code == "already_returning"
    assert operator.ask("abort").message == "abort accepted"
    operator.in_state("DONE")


def test_a_client_whose_clock_is_an_hour_behind_starts_and_resumes(
    world: World, operator: Operator, set_ahead: Callable[[], None]
) -> None:
    """By `lupin`, which asks again by itself, and by the plain services, where a person presses again."""
    set_ahead()
    world.start_all(speed=2.0)
    operator.in_state("READY")
    begun = lupin("start", "inspection", "--tags", "1,5")
    assert (begun.returncode, "InspectionMission" in begun.stdout) == (0, True), begun.stdout + begun.stderr
    operator.in_state("INSPECTING", "NAVIGATING")
    assert lupin("pause").returncode == 0
    operator.until(lambda: operator.state.paused, "paused")
    assert STALE.fullmatch(operator.ask("resume").message)
    pressed_again(operator, lambda: operator.ask("resume").message == "resume accepted")
    operator.until_done(published=2)


def test_what_comes_late_does_not_move_a_robot_that_stands(
    world: World, operator: Operator, set_ahead: Callable[[], None], hang: Path
) -> None:
    """The orchestrator takes nothing for some seconds; the clocks are an hour apart as well."""
    set_ahead()
    world.start_all(speed=2.0)
    operator.in_state("READY")
    assert not operator.start("1", "5").accepted
    pressed_again(operator, lambda: operator.start("1", "5").accepted)
    operator.in_state("INSPECTING", "NAVIGATING")
    assert operator.ask("pause").success
    operator.until(lambda: operator.state.paused, "paused")
    answers = late_answers(hang, operator, ["resume", "abort", "dock", "pause"])
    ages = [float(answer.split()[4]) for answer in answers[:3]]
    assert answers == [*(OLD.format(age) for age in ages), "pause refused: paused by the operator"]
    assert all(STALE_AFTER_S < age < 60.0 for age in ages), ages
    assert (operator.state.paused, operator.state.lifecycle_state) == (True, "INSPECTING")
    assert operator.ask("resume").message == "resume accepted"
    operator.in_state("INSPECTING", "NAVIGATING")
    assert late_answers(hang, operator, ["abort"]) == ["abort accepted"]
    operator.in_state("DONE")


def pressed_again(operator: Operator, press: Callable[[], bool]) -> None:
    """Press after some seconds, twice more where two requests were under way for different times."""
    for _ in range(3):
        later = operator.ros.elapsed() + APART_S
        operator.until(lambda later=later: operator.ros.elapsed() > later, "a moment")
        if press():
            return
    raise AssertionError("not accepted")


def lupin(*arguments: str) -> subprocess.CompletedProcess[str]:
    """Run a verb of the command line."""
    command = [str(Path(sys.executable).with_name("lupin")), *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=60.0, check=False)


def late_answers(hang: Path, operator: Operator, names: list[str]) -> list[str]:
    """Send requests one second apart to an orchestrator that hangs, and let it go on 6 s after the last."""
    answers: dict[str, Any] = {}
    callers = {name: operator.ros.service(Trigger, f"/mission/{name}") for name in names}
    operator.until(lambda: all(caller.ready() for caller in callers.values()), "the services")
    hang.touch()
    for name, caller in callers.items():
        later = operator.ros.elapsed() + 1.0
        operator.until(lambda later=later: operator.ros.elapsed() > later, "a second")
        caller.call(Trigger.Request(), 60.0, partial(answers.__setitem__, name))
    later = operator.ros.elapsed() + STALE_AFTER_S + 1.0
    operator.until(lambda: operator.ros.elapsed() > later, "it is late")
    hang.unlink()
    operator.until(lambda: len(answers) == len(names), "the answers")
    return [answers[name].message for name in names]


def test_a_question_is_answered(
    world: World, operator: Operator, set_ahead: Callable[[], None], tmp_path: Path
) -> None:
    """By the answer's own service and by the command service."""
    world.start("mission_orchestrator", missions_path=folder(tmp_path))
    operator.in_state("READY")
    assert operator.start(mission="Ask").accepted
    operator.in_state("ASKING", "ASKING")
    set_ahead()
    answer = Command.Request(verb="answer", request='{"choice": "go_on"}')
    assert operator.call(Command, COMMAND_SERVICE, answer).message == "go_on accepted"
    operator.in_state("DONE")
    late = operator.call(Trigger, ANSWER_SERVICE.format("stay"), Trigger.Request())
    assert late.message == "the answer 'stay' is refused: nothing is asked"
