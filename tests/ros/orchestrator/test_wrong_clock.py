"""The orchestrator's wall clock is set an hour ahead while a mission runs: what stops it still works."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pytest
from std_srvs.srv import Trigger

from lupin_engine.ros.names import ANSWER_SERVICE, COMMAND_SERVICE
from lupin_engine_msgs.srv import Command
from tests.ros.orchestrator.test_answers import folder
from tests.ros.world import Operator, World

pytestmark = pytest.mark.timeout(180)

STALE = re.compile(r"refused: the request is 360\d\.\d s old, or the clocks of the two computers disagree")

#: What Python runs first in each process that is started.
CLOCK = """\
import os, time

true_ns = time.time_ns
time.time_ns = lambda: true_ns() + (3_600_000_000_000 if os.path.exists({flag!r}) else 0)
"""


@pytest.fixture
def set_ahead(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[], None]:
    """Set the clock of the processes that the test starts an hour ahead, from when it is called."""
    flag, site = tmp_path / "ahead", tmp_path / "site"
    site.mkdir()
    (site / "sitecustomize.py").write_text(CLOCK.format(flag=str(flag)), encoding="utf-8")
    monkeypatch.setenv("PYTHONPATH", str(site))
    return flag.touch


def test_a_mission_is_stopped_and_ended(
    world: World, operator: Operator, set_ahead: Callable[[], None]
) -> None:
    """Pause, dock and abort are carried out; what would let the robot go on is refused, with the reason."""
    world.start_all()
    operator.in_state("READY")
    operator.hit(1, "stall")
    assert operator.start("1", "5").accepted
    operator.in_state("INSPECTING", "NAVIGATING")
    set_ahead()
    for name in ("skip_current", "resume", "reset"):
        assert STALE.fullmatch(operator.ask(name).message), name
    assert STALE.fullmatch(operator.start("1").error_message)
    assert operator.ask("pause").message == "pause accepted"
    operator.until(lambda: operator.state.paused, "paused")
    assert STALE.fullmatch(operator.ask("resume").message)
    assert operator.ask("dock").message == "dock accepted"
    operator.in_state("RETURNING")
    again = operator.call(Command, COMMAND_SERVICE, Command.Request(verb="dock"))
    assert again.code == "already_returning"
    late = operator.call(Command, COMMAND_SERVICE, Command.Request(verb="resume"))
    assert (late.code, bool(STALE.fullmatch(late.message))) == ("stale", True)
    assert operator.ask("abort").message == "abort accepted"
    operator.in_state("DONE")


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
