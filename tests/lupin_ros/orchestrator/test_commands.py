"""The command service over real ROS 2: whatever is asked for is done once, and the record says who asked."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

import pytest
from std_msgs.msg import String

from lupin_engine_msgs.srv import Command
from lupin_ros.adapter.node import Qos
from lupin_ros.service.names import COMMAND_SERVICE, STEPS_TOPIC
from tests.lupin_ros.world import Operator, World

pytestmark = pytest.mark.timeout(180)


class Desk(Operator):
    """An operator who commands, and reads the record."""

    def __init__(self) -> None:
        super().__init__("desk")
        self.steps: list[dict[str, Any]] = []
        self.ros.subscribe(String, STEPS_TOPIC, Qos.BACKLOG, lambda m: self.steps.append(json.loads(m.data)))

    def command(self, verb: str, mission: str = "", request: Any = None, **more: str) -> Command.Response:
        """Send a command with fields of a request."""
        text = "" if request is None else json.dumps(request)
        asked = Command.Request(verb=verb, mission=mission, request=text, **more)
        answer: Command.Response = self.call(Command, COMMAND_SERVICE, asked)
        return answer

    def record(self, number: int) -> dict[str, Any]:
        """Return the record of a step."""
        self.until(lambda: any(step["step"]["sequence"] == number for step in self.steps), f"step {number}")
        return next(step for step in self.steps if step["step"]["sequence"] == number)

    def begun(self) -> int:
        """Return how many missions were begun."""
        return len({state.mission_id for state in self.states if state.mission_id})


@pytest.fixture
def desk(world: World) -> Iterator[Desk]:
    """A robot that is ready, whose first drive does not end by itself."""
    world.start_all()
    desk = Desk()
    desk.in_state("READY")
    desk.hit(1, "stall")
    yield desk
    desk.ros.close()


@pytest.mark.core
def test_a_mission_from_start_to_end_by_commands(desk: Desk) -> None:
    """Each answer names the step; the same id is answered from memory; what is refused changes nothing."""
    wrong = desk.command("start", "InspectionMission", {"tags": ["1"]}, command_id="0", by="ann@desk")
    assert (wrong.accepted, wrong.code, wrong.step) == (False, "bad_request", 0)
    assert wrong.message == "start refused: unknown field 'tags'; allowed: 'tag_sequence'"
    wrong = desk.command("start", "InspectionMission", {"tag_sequence": ["1", "77"]})
    assert (wrong.code, wrong.message.startswith("unknown tag '77'")) == ("unknown_tag", True)
    wrong = desk.command("start", "InspectionMission", {"tag_sequence": []})
    assert (wrong.code, wrong.message) == ("no_tags", "no tags to visit")
    wrong = desk.command("start", "InspectionMision")
    assert wrong.message == "unknown mission 'InspectionMision'; did you mean 'InspectionMission'?"
    assert desk.state.lifecycle_state == "READY"

    given = ("start", "InspectionMission", {"tag_sequence": ["1", "5"]})
    begun = desk.command(*given, command_id="1", by="ann@desk")
    assert (begun.accepted, begun.code, begun.repeated) == (True, "", False)
    assert begun.message == f"InspectionMission {begun.mission_id} started"
    desk.in_state("INSPECTING", "NAVIGATING")
    again = desk.command(*given, command_id="1", by="ann@desk")
    assert (again.repeated, again.mission_id, again.step) == (True, begun.mission_id, begun.step)
    record = desk.record(begun.step)
    assert record["command"] == {"by": "ann@desk", "command_id": "1"}
    assert (record["step"]["event"], record["step"]["data"]["tag_sequence"]) == ("mission.start", ["1", "5"])

    paused = desk.command("pause", by="bob@bench", command_id="2")
    assert (paused.accepted, paused.message) == (True, "pause accepted")
    desk.until(lambda: desk.state.paused, "paused")
    mixed = desk.command("abort", by="bob@bench", command_id="2")
    assert (mixed.accepted, mixed.code) == (False, "command_id_in_use")
    refused = desk.command("start", "InspectionMission", by="bob@bench")
    assert (refused.accepted, refused.message) == (False, "start refused: a mission is already running")
    assert desk.record(refused.step)["command"] == {"by": "bob@bench"}
    assert desk.command("resume").message == "resume accepted"
    desk.until(lambda: not desk.state.paused, "resumed")
    assert desk.command("skip_current").message == "skip_current accepted"
    assert desk.command("abort").accepted
    desk.in_state("DONE")
    assert desk.begun() == 1
    # The services of others leave no trace of who called.
    resumed = [step for step in desk.steps if step["step"]["event"] == "operator.resume"]
    assert "command" not in resumed[-1]
