"""A question to the operator over ROS: seen and answered from a terminal, or answered by its default."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest
from std_srvs.srv import Trigger

from tests.lupin_ros.world import Operator, World

pytestmark = pytest.mark.timeout(180)

LIFECYCLE = """\
lifecycle: small
profile: greenhouse
initial: BOOT
states:
  BOOT: {always: READY}
  READY: {on: {mission.start: MISSION}}
  MISSION: {slot: mission, on_done: DONE}
  DONE: {on: {mission.start: MISSION}}
  FAULT: {on: {operator.reset: READY}}
"""
MISSION = """\
mission: Ask
codes:
  nobody_there: {label: nobody has answered, severity: info}
params:
  patience: {type: duration, default: 60 s}
states:
  ASKING:
    phase: ASKING
    ask:
      question: Go on for ${ param.patience:min }?
      choices: {go_on: Go on, stay: {label: Stay here, severity: warn}}
      default: stay
      after: ${ param.patience }
    on:
      answer.go_on: WORKING
      answer.stay: {target: done, code: nobody_there, detail: "${ event.by }"}
  WORKING:
    after: {100 ms: done}
  done: {type: final}
initial: ASKING
"""


def folder(tmp_path: Path) -> str:
    """Write the missions, and return their folder."""
    missions = tmp_path / "missions"
    missions.mkdir()
    (missions / "lifecycle.yaml").write_text(LIFECYCLE, encoding="utf-8")
    (missions / "ask.yaml").write_text(MISSION, encoding="utf-8")
    return str(missions)


def lupin_answer(*words: str) -> tuple[int, str]:
    """Run `lupin answer`, and return its exit code and what it says."""
    command = [str(Path(sys.executable).with_name("lupin")), "answer", *words]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60.0, check=False)
    return done.returncode, done.stdout + done.stderr


def test_a_question_is_answered_from_a_terminal(world: World, operator: Operator, tmp_path: Path) -> None:
    """It says what can be answered and how much time is left; only an open choice is accepted."""
    world.start("mission_orchestrator", missions_path=folder(tmp_path))
    operator.in_state("READY")
    assert lupin_answer() == (1, "nothing is asked\n")
    assert operator.start(mission="Ask").accepted
    operator.in_state("ASKING", "ASKING")
    code, said = lupin_answer()
    lines = said.splitlines()
    assert (code, lines[:3]) == (0, ["Go on for 1 min?", "  go_on  Go on", "  stay   Stay here"])
    assert re.match(r"  else stay in 00:[0-5]\d", lines[3])
    assert lupin_answer("go_no") == (2, "lupin: 'go_no' is no choice; did you mean 'go_on'?\n")
    assert lupin_answer("go_on") == (0, "go_on accepted\n")
    operator.in_state("DONE")
    refused = operator.call(Trigger, "/mission_orchestrator/answer/go_on", Trigger.Request())
    assert (refused.success, refused.message) == (
        False,
        "the answer 'go_on' is refused: nothing is asked",
    )


@pytest.mark.core
def test_a_question_that_nobody_answers(world: World, operator: Operator, tmp_path: Path) -> None:
    """The default counts, and its code is published, although it is mere information."""
    world.start("mission_orchestrator", missions_path=folder(tmp_path), patience=1.0)
    operator.in_state("READY")
    assert operator.start(mission="Ask").accepted
    operator.in_state("DONE")
    assert operator.state.last_error == "nobody_there: default"


def test_a_refusal_names_the_value(world: World, operator: Operator, tmp_path: Path) -> None:
    """Of a start over the service and from a terminal, and of an answer; nothing has changed."""
    missions = folder(tmp_path)
    cookbook = Path(__file__).parents[3] / "docs" / "cookbook" / "meals.yaml"
    Path(missions, "meals.yaml").write_bytes(cookbook.read_bytes())
    world.start("mission_orchestrator", missions_path=missions)
    operator.in_state("READY")
    refused = operator.start("W1", "W9", mission="Meals")
    assert (refused.accepted, refused.error_message) == (False, "unknown ward: 'W9'")
    command = [str(Path(sys.executable).with_name("lupin")), "start", "Meals", "--request"]
    begun = subprocess.run(
        [*command, "tag_sequence=W9,W1"], capture_output=True, text=True, timeout=60.0, check=False
    )
    assert (begun.returncode, begun.stdout) == (1, "unknown ward: 'W9'\n"), begun.stderr
    assert operator.state.lifecycle_state == "READY"
    assert operator.start("W2", mission="Meals").accepted
    operator.in_state("ROUND")
    answer = operator.call(Trigger, "/mission_orchestrator/answer/last", Trigger.Request())
    assert (answer.success, answer.message) == (False, "last refused: this is the last ward: 'W2'")
