"""The photo round of the examples with its camera as a process: a person answers, or nobody."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from std_srvs.srv import Trigger

from tests.lupin_ros.world import Operator, World

pytestmark = pytest.mark.timeout(180)

PHOTO_ROUND = Path(__file__).parents[4] / "examples" / "photo_round"

Begin = Callable[[float], None]


@pytest.fixture
def begin(world: World, operator: Operator, tmp_path: Path) -> Begin:
    """Start everything in the dark, with so much time for an answer, and the mission at one tag."""

    def start(patience: float) -> None:
        camera = [sys.executable, str(PHOTO_ROUND / "camera.py"), "--ros-args"]
        world.run("camera", [*camera, "-p", f"folder:={tmp_path}", "-p", "light:=10.0"])
        world.start_all(missions_path=PHOTO_ROUND / "missions", photo_answer_s=patience)
        operator.in_state("READY")
        answer = operator.start("1", mission="PhotoMission")
        assert answer.accepted, answer.error_message

    return start


def test_a_person_answers(begin: Begin, operator: Operator, tmp_path: Path) -> None:
    """With the lamp: the photo is as bright as lamp and greenhouse together."""
    begin(120.0)
    operator.in_state("ROUND", "ASKING")
    answer = operator.call(Trigger, "/mission_orchestrator/answer/with_lamp", Trigger.Request())
    assert answer.success, answer.message
    operator.until_done(published=1)
    assert [o.status for o in operator.observations] == [0]
    assert (tmp_path / "photo1.pgm").read_bytes()[-1] == 110


def test_nobody_answers(begin: Begin, operator: Operator, tmp_path: Path) -> None:
    """The default counts: the tag is left out, and it is told why."""
    begin(1.0)
    operator.until_done(published=1)
    assert "ROUND/ASKING" in operator.seen()
    assert [(o.status, o.status_detail) for o in operator.observations] == [(3, "10 lx")]
    assert operator.state.last_error == "nobody_answered: for 1 s"
    assert list(tmp_path.glob("*.pgm")) == []
