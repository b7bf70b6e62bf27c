"""Servers that are killed while the node waits for them: real processes, and no good-bye."""

from __future__ import annotations

import signal
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from nav2_msgs.action import NavigateToPose
from std_msgs.msg import String

from lupin_ros.adapter.node import Qos
from tests.lupin_ros.system.wire.peer import HOLD, SPARE, TOLD
from tests.lupin_ros.system.wire.wire import OK, SCAN_FAILED, UNREACHABLE, Wire

pytestmark = pytest.mark.timeout(120)

PEER = Path(__file__).with_name("peer.py")


class Mortal(Wire):
    """A wire whose other ends are processes."""

    def __init__(self, folder: Path, **parameters: Any) -> None:
        super().__init__(folder, **parameters)
        self.told: list[str] = []
        self.ros.subscribe(String, TOLD, Qos.BACKLOG, lambda message: self.told.append(message.data))
        self._hold = self.ros.publisher(String, HOLD, Qos.EVENT)

    def live(self, role: str) -> None:
        """Start a base or a bridge and wait until it is there."""
        self.told.clear()
        self.world.run(role, [sys.executable, str(PEER), role])
        self.until_told(f"{role} up")

    def die(self, role: str) -> None:
        """End one without a word."""
        self.world.processes[role].send_signal(signal.SIGKILL)
        self.world.processes[role].wait(10.0)

    def replace(self, role: str) -> None:
        """End one without a word, and have another in its place before anybody has given up."""
        self.world.run(SPARE, [sys.executable, str(PEER), role, SPARE])
        self.until_told(f"{role} waits")
        self.die(role)
        self.told.clear()
        self.world.processes[role] = self.world.processes.pop(SPARE)
        self._until_answered(SPARE, f"{role} up")

    def until_told(self, what: str) -> None:
        """Wait until a peer has told something since it was started or told to hold."""
        self.until(lambda: what in self.told, what)

    def hold(self, role: str) -> None:
        """Let a peer hold the next request."""
        self.told.clear()
        self._until_answered(role, f"{role} holds")

    def _until_answered(self, word: str, answer: str) -> None:
        def answered() -> bool:
            self._hold.publish(String(data=word))  # again and again: it may not be matched yet
            return answer in self.told

        self.until(answered, answer)

    def until_accepted(self, *tags: str) -> str:
        """Start as soon as that is accepted; return the mission's id."""
        answers: list[Any] = []

        def starts() -> bool:
            answers.append(self.operator.start(*tags))
            return bool(answers[-1].accepted)

        self.until(starts, "an accepted start")
        self.wanted[answers[-1].mission_id] = list(tags)
        return str(answers[-1].mission_id)

    def until_refused(self) -> None:
        """Wait until a start is refused because something is missing."""
        refusal = "start refused: dependencies not ready"
        self.until(lambda: self.operator.start("x").error_message == refusal, "a refused start")


@pytest.fixture(scope="module")
def running(ros_domain: int, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Mortal]:
    """One node for all tests here: each leaves it with its mission ended and both peers alive."""
    given = {"scan_timeout_s": 3.0, "localization_timeout_s": 1.0}
    wire = Mortal(tmp_path_factory.mktemp("wire"), **given)
    wire.live("base")
    wire.live("bridge")
    wire.start_node()
    yield wire
    wire.close()


def test_a_base_that_dies_on_the_way_and_comes_back_is_sent_there_again(wire: Mortal) -> None:
    """The new one knows nothing of the goal, which counts as a failed try."""
    wire.hold("base")
    mission = wire.start("1", "2")
    wire.until_told("base drives")
    wire.replace("base")
    wire.until_done(mission)
    assert wire.outcomes(mission) == [("1", OK), ("2", OK)]
    wire.until(lambda: wire.told.count("base drives") == 3, "both tags and home")


def test_a_base_that_comes_back_while_the_node_is_held_gets_no_goal_before_the_resume(wire: Mortal) -> None:
    """Its predecessor took the goal and the cancel with it."""
    wire.hold("base")
    mission = wire.start("1")
    wire.until_told("base drives")
    wire.die("base")
    wire.estop(True)
    wire.until_held()
    wire.estop(False)
    wire.live("base")
    wire.until_quiet()
    assert "base drives" not in wire.told
    assert wire.operator.ask("resume").success
    wire.until_done(mission)
    assert wire.outcomes(mission) == [("1", OK)]
    wire.until(lambda: wire.told.count("base drives") == 2, "the tag and home")


def test_a_bridge_that_dies_in_a_call_costs_the_reading(wire: Mortal) -> None:
    """Its answer will never come; while it is away no mission is started, and when it is back one is."""
    wire.hold("bridge")
    mission = wire.start("1")
    wire.until_told("bridge reads 1")
    wire.die("bridge")
    wire.until_done(mission)
    assert wire.outcomes(mission) == [("1", SCAN_FAILED)]
    assert wire.details(mission) == ["scan_timeout"]
    wire.until_refused()
    wire.live("bridge")
    again = wire.until_accepted("2")
    wire.until_done(again)
    assert wire.outcomes(again) == [("2", OK)]


def test_a_base_that_stays_dead_ends_the_mission(wire: Mortal) -> None:
    """Neither the tag nor the dock can be reached, and that is said; when it is back, so are the missions."""
    wire.hold("base")
    mission = wire.start("1")
    wire.until_told("base drives")
    wire.die("base")
    wire.until_done(mission)
    assert wire.outcomes(mission) == [("1", UNREACHABLE)]
    assert wire.operator.state.last_error.startswith("nav_unavailable: action server navigate_to_pose is")
    wire.until_refused()
    wire.live("base")
    again = wire.until_accepted("2")
    wire.until_done(again)
    assert wire.outcomes(again) == [("2", OK)]


def test_a_reset_waits_for_a_base_that_is_gone(wire: Mortal) -> None:
    """War story A11: it led to READY, where missions could be started without anybody who drives."""
    wire.localize(variance=9.0)
    wire.start("1")
    wire.operator.in_state("FAULT")
    wire.die("base")
    navigation = wire.ros.action(NavigateToPose, "/navigate_to_pose")
    wire.until(lambda: not navigation.ready(), "the base is gone")
    since = len(wire.operator.states)
    assert wire.operator.ask("reset").success
    wire.operator.in_state("BOOT")
    refusal = "start refused: the robot is still starting up"
    wire.until(lambda: wire.operator.start("1").error_message == refusal, "the start is refused")
    wire.until_quiet()
    assert {state.lifecycle_state for state in wire.operator.states[since:]} <= {"FAULT", "BOOT"}
    wire.live("base")
    wire.operator.in_state("READY")
