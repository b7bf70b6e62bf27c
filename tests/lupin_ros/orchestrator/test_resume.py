"""An orchestrator that is killed, and the next one: held, nothing moves, nothing is lost or done twice."""

from __future__ import annotations

import json
import re
import signal
import time
from collections import Counter
from pathlib import Path

import pytest

from lupin_engine.runtime.journal.frames import MAGIC
from lupin_engine.runtime.journal.journal import journal_files
from lupin_engine.runtime.journal.records import read_journal
from lupin_engine_msgs.srv import Command
from lupin_ros.adapter.process import StoodStill
from lupin_ros.service.names import COMMAND_SERVICE
from tests.lupin_ros.world import Operator, World

pytestmark = pytest.mark.timeout(180)

NODE = "mission_orchestrator"
#: Seconds for which a node stands still until others have forgotten it, and what it says of that.
FORGOTTEN_S = 4.0
WHY = "others may forget a node after 2.25 s, so it ends, to be started again"


def kill(world: World, node: str = NODE) -> None:
    """Kill a node."""
    process = world.processes[node]
    process.send_signal(signal.SIGKILL)
    process.wait(10.0)


def start_again(world: World, operator: Operator, **parameters: object) -> None:
    """Start another one and wait until it is held."""
    operator.states.clear()
    world.start(NODE, **{"estop_timeout_s": 10.0, **parameters})
    operator.held()


def outcomes(operator: Operator) -> Counter[tuple[str, int]]:
    """Return the outcomes that came, each once however often the same message came."""
    found = {
        (o.mission_id, o.tag_reading.tag_id, o.status, o.header.stamp.nanosec) for o in operator.observations
    }
    return Counter((tag, status) for _, tag, status, _ in found)


@pytest.mark.core
def test_a_mission_goes_on_when_somebody_says_so(world: World, operator: Operator, own_state: Path) -> None:
    """The same target, the same mission, the drive of the old one is ended, and every outcome came once."""
    world.start_all(speed=2.0)
    operator.in_state("READY")
    mission_id = operator.start("1", "5", "12").mission_id
    operator.until(lambda: len(operator.observations) == 1, "the first outcome")
    operator.in_state("INSPECTING", "NAVIGATING")
    target = operator.state.current_target
    kill(world)
    start_again(world, operator)
    held = operator.state
    assert (held.lifecycle_state, held.current_target, held.mission_id) == ("INSPECTING", target, mission_id)
    assert (held.targets_completed, held.paused) == (1, True)
    assert held.last_error.startswith("restarted: nobody watched since 20")
    assert held.last_error.endswith(f"under way: INSPECTING NAVIGATING, at {target}: nav.go_to")
    operator.resume()
    operator.until_done(published=3)
    assert outcomes(operator) == {(tag, 0): 1 for tag in ("1", "5", "12")}
    found = [read_journal(file) for file in journal_files(own_state)]
    (mission,) = [file for file in found if file.head.mission_id]
    assert [record.kind for record in mission.records].count("resumed") == 1


def test_an_orchestrator_that_stood_still_begins_anew(world: World, operator: Operator) -> None:
    """Others have forgotten it, and a third node comes meanwhile: else some would never find it again."""
    world.start_all(speed=2.0)
    operator.in_state("READY")
    assert operator.start("1", "5").accepted
    operator.in_state("INSPECTING", "NAVIGATING")
    stopped = world.processes[NODE]
    stopped.send_signal(signal.SIGSTOP)
    world.start("lupin_twin")
    until = time.monotonic() + FORGOTTEN_S
    operator.until(lambda: time.monotonic() > until, "the standstill")
    stopped.send_signal(signal.SIGCONT)
    operator.until(lambda: stopped.poll() is not None, "its end")
    assert stopped.returncode == StoodStill.exit_code
    told = re.findall(rf"^lupin: {NODE} stood still for (\S+) s; {WHY}$", world.log(NODE).read_text(), re.M)
    assert len(told) == 1
    assert float(told[0]) >= FORGOTTEN_S
    start_again(world, operator)
    operator.resume()
    operator.until_done(published=2)
    assert outcomes(operator) == {("1", 0): 1, ("5", 0): 1}


@pytest.mark.core
def test_a_command_is_done_once_also_by_the_next_orchestrator(world: World, operator: Operator) -> None:
    """A start under way, and one whose mission is over, are answered and not carried out; skip likewise."""
    world.start_all(speed=20.0)
    operator.in_state("READY")
    start = Command.Request(verb="start", mission="InspectionMission", command_id="1", by="ann@desk")
    start.request = json.dumps({"tag_sequence": ["1", "5", "12"]})
    begun = operator.call(Command, COMMAND_SERVICE, start)
    assert begun.accepted
    operator.in_state("INSPECTING", "NAVIGATING")
    skip = Command.Request(verb="skip", command_id="2", by="ann@desk")
    skipped = operator.call(Command, COMMAND_SERVICE, skip)
    assert skipped.message == "skip accepted"
    kill(world)
    start_again(world, operator)
    again = operator.call(Command, COMMAND_SERVICE, skip)
    assert (again.accepted, again.repeated, again.step) == (True, True, skipped.step)
    other = operator.call(Command, COMMAND_SERVICE, Command.Request(verb="resume", command_id="2"))
    assert other.code == "command_id_in_use"
    operator.resume()
    operator.until_done(published=3)
    kill(world)
    operator.states.clear()
    world.start(NODE, estop_timeout_s=10.0)
    operator.in_state("READY")
    again = operator.call(Command, COMMAND_SERVICE, start)
    assert (again.accepted, again.repeated, again.mission_id) == (True, True, begun.mission_id)
    operator.ask("pause")
    assert {state.lifecycle_state for state in operator.states} <= {"BOOT", "READY"}
    assert sorted(outcomes(operator).items()) == [(("1", 3), 1), (("12", 0), 1), (("5", 0), 1)]


def test_who_was_away_gets_from_the_next_one_what_the_last_one_told(world: World, operator: Operator) -> None:
    """The backlog of a publisher dies with it: a twin that was down meanwhile would never hear of that."""
    world.start_all(speed=2.0)
    operator.in_state("READY")
    assert operator.start("1", "5").accepted
    operator.until(lambda: len(operator.observations) == 1, "the first outcome")
    kill(world)
    late = Operator("late")
    start_again(world, operator)
    late.until(lambda: late.observations, "what was told before")
    assert late.observations[0] == operator.observations[0]
    late.ros.close()


def test_what_was_missing_when_it_died_may_be_back(world: World, operator: Operator, own_state: Path) -> None:
    """Else no mission could be started any more after this one, for something that is there."""
    world.start_all(speed=1.0)
    operator.in_state("READY")
    assert operator.start("29").accepted
    operator.in_state("INSPECTING", "NAVIGATING")
    kill(world, "greenhouse_bridge")

    def is_told() -> bool:
        told = [record.data for record in read_journal(journal_files(own_state)[-1]).records]
        return any(data[:1] == ("plugins.missing",) for data in told)

    operator.until(is_told, "the bridge is missed")
    kill(world)
    world.start("greenhouse_bridge")
    start_again(world, operator)
    operator.resume()
    assert operator.ask("abort").success
    operator.in_state("DONE")
    operator.until(lambda: operator.start("1").accepted, "the next mission")


def test_other_missions_than_before_close_it(world: World, operator: Operator, tmp_path: Path) -> None:
    """The reason is told, and what becomes of each target that was left."""
    missions = copied_missions(tmp_path)
    world.start_all(speed=2.0, missions_path=str(missions))
    operator.in_state("READY")
    mission_id = operator.start("1", "5", "12").mission_id
    operator.until(lambda: len(operator.observations) == 1, "the first outcome")
    kill(world)
    file = missions / "inspection.yaml"
    file.write_text(file.read_text() + "\n# another one\n")
    operator.states.clear()
    world.start(NODE, estop_timeout_s=10.0, missions_path=str(missions))
    operator.until(
        lambda: operator.states and "mission_closed" in operator.state.last_error, "the mission is closed"
    )
    why = "the files of the missions are others than before"
    assert operator.state.last_error == f"mission_closed: InspectionMission {mission_id}: {why}; left out: 2"
    operator.until(lambda: len(outcomes(operator)) == 3, "what became of the others")
    assert outcomes(operator) == {("1", 0): 1, ("5", 3): 1, ("12", 3): 1}
    assert {o.status_detail for o in operator.observations if o.status} == {why}
    operator.in_state("READY")


def test_a_mission_that_cannot_be_read_any_more_is_told(
    world: World, operator: Operator, own_state: Path
) -> None:
    """The engine was exchanged meanwhile for one whose journal has another form."""
    world.start_all(speed=2.0)
    operator.in_state("READY")
    mission_id = operator.start("1", "5").mission_id
    operator.in_state("INSPECTING", "NAVIGATING")
    kill(world)
    for file in journal_files(own_state):
        file.write_bytes(file.read_bytes().replace(MAGIC, b"lupin journal 9\n"))
    newest = journal_files(own_state)[-1]
    operator.states.clear()
    world.start(NODE, estop_timeout_s=10.0)
    operator.until(
        lambda: operator.states and "mission_closed" in operator.state.last_error, "the mission is closed"
    )
    why = f"{newest} was written by another version of the engine; this one does not read it"
    assert operator.state.last_error == f"mission_closed: {mission_id}: {why}"
    operator.in_state("READY")


@pytest.mark.parametrize("policy", ["continue", "abort"])
def test_a_policy_decides_without_a_person(world: World, operator: Operator, policy: str) -> None:
    """One goes on by itself when everything is there; the other is closed, and the robot stands."""
    world.start_all(speed=2.0)
    operator.in_state("READY")
    assert operator.start("1", "5").accepted
    operator.in_state("INSPECTING", "NAVIGATING")
    kill(world)
    world.start(NODE, estop_timeout_s=10.0, resume_policy=policy)
    operator.until(lambda: len(outcomes(operator)) == 2, "every target has its outcome")
    if policy == "continue":
        operator.in_state("DONE")
        assert outcomes(operator) == {("1", 0): 1, ("5", 0): 1}
    else:
        operator.in_state("READY")
        assert outcomes(operator) == {("1", 3): 1, ("5", 3): 1}


def test_a_wrong_policy_ends_the_node_with_a_message(world: World) -> None:
    """What is allowed."""
    process = world.start(NODE, resume_policy="perhaps")
    assert process.wait(30.0) != 0
    said = world.log(NODE).read_text()
    assert "resume_policy: expected ask, continue, abort, got 'perhaps'" in said


def copied_missions(folder: Path) -> Path:
    """Return a folder with the inspection and its lifecycle."""
    missions = folder / "missions"
    (missions / "parts").mkdir(parents=True)
    source = Path(__file__).parents[3] / "missions"
    for name in ("lifecycle.yaml", "inspection.yaml", "parts/visit_targets.yaml"):
        (missions / name).write_text((source / name).read_text())
    return missions
