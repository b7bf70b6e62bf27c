"""The orchestrator's journal: what entered, on disk; what is told when that cannot be."""

from __future__ import annotations

import shlex
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from diagnostic_msgs.msg import DiagnosticArray

from lupin_engine.missions.folders import lifecycle_in
from lupin_engine.missions.load import load_chart
from lupin_engine.runtime.journal.journal import CHARTS, journal_files
from lupin_engine.runtime.journal.records import JournalFile, read_journal
from lupin_engine.runtime.journal.replay import replay
from lupin_engine.runtime.setup import make_world
from lupin_ros.adapter.node import Qos
from lupin_ros.orchestrator.journal_gate import WHAT_TO_DO
from tests import shipped
from tests.lupin_ros.orchestrator.test_resume import kill, outcomes, start_again
from tests.lupin_ros.world import Operator, World

pytestmark = pytest.mark.timeout(180)

ROOT = Path(__file__).parents[3]


def missions_in(folder: Path) -> list[JournalFile]:
    """Return the files about missions, the oldest first."""
    found = [read_journal(file) for file in journal_files(folder)]
    return [file for file in found if file.head.mission_id]


def test_a_mission_is_replayed_from_what_is_kept_of_it(
    world: World, operator: Operator, own_state: Path
) -> None:
    """Its chart, its parameters and its inputs: from the folder alone, to the published end."""
    world.start_all()
    operator.in_state("READY")
    mission_id = operator.start("1", "5").mission_id
    operator.in_state("INSPECTING", "NAVIGATING")
    assert operator.ask("pause").success
    assert operator.ask("resume").success
    operator.until_done(published=2)
    operator.until(lambda: len(journal_files(own_state)) == 3, "the file after the mission")

    (found,) = missions_in(own_state)
    head, folder = found.head, own_state / CHARTS / found.head.chart
    assert (head.mission, head.mission_id, found.problem) == ("InspectionMission", mission_id, "")
    chart = load_chart(lifecycle_in(folder), [folder / file for file in head.files], shipped.catalog())
    machine, codes = None, []
    for each in replay(found, make_world(chart, head.parameters)):
        machine = each.machine
        codes += [code.code for code in each.step.codes] if each.step else []
    assert machine is not None
    assert (machine.view.lifecycle, machine.view.counts["OK"], machine.view.mission_id) == (
        "DONE",
        2,
        mission_id,
    )
    assert "paused_by_operator" in codes
    told = [record.data[0] for record in found.records if record.kind == "outcome"]
    marked = [record.data[0] for record in found.records if record.kind == "published"]
    assert told == marked == [1, 2]
    (end,) = [record.data[0] for record in found.records if record.kind == "end"]
    assert (end["state"], end["completed"], end["total"]) == ("DONE", 2, 2)


def test_a_flood_of_starts_does_not_fill_the_disk(world: World, operator: Operator, own_state: Path) -> None:
    """As fast as they go, 15 kB each: some are kept whole, the rest counted; nor does the log grow."""
    world.start_all()
    operator.in_state("READY")
    flood = [sys.executable, "-m", "tests.faults.flood", "3"]
    done = subprocess.run(flood, cwd=ROOT, capture_output=True, text=True, check=True)
    sent, answered = (int(word) for word in done.stdout.split() if word.isdigit())
    end(world)
    records = [record for file in journal_files(own_state) for record in read_journal(file).records]
    written = [record for record in records if record.kind == "event" and record.data[0] == "mission.start"]
    counted = [record.data for record in records if record.kind == "refused"]
    assert answered > 50
    assert {data[:2] for data in counted} == {("mission.start", "unknown_mission")}
    # The last ones may be on their way when it ends.
    assert answered <= len(written) + sum(data[2] for data in counted) <= sent
    assert len(written) <= 8
    assert sum(file.stat().st_size for file in journal_files(own_state)) < 300_000
    logs = own_state.parents[1] / "log" / own_state.name
    assert sum(file.stat().st_size for file in logs.iterdir()) < 300_000


@pytest.mark.parametrize("parameter", ["may_repeat_outcomes:=true", "journal_required:=false"])
def test_a_full_disk_is_reported_and_the_mission_goes_on_where_outcomes_may_be_repeated(
    world: World, operator: Operator, parameter: str
) -> None:
    """Files may not grow beyond a limit; that a code says, and the robot finds its way all the same."""
    world.start("greenhouse_bridge")
    world.start("lupin_sim", speed=10.0)
    limited(world, operator, "-p", parameter)
    health: list[str] = []
    operator.ros.subscribe(
        DiagnosticArray,
        "/diagnostics",
        Qos.EVENT,
        lambda told: health.extend(s.message for s in told.status if s.name == "/mission_orchestrator"),
    )
    operator.in_state("READY")
    assert operator.start("1", "5", "12").accepted
    operator.until_done(published=3)
    codes = {state.last_error.partition(":")[0] for state in operator.states}
    assert "journal_failed" in codes
    said = "the journal cannot be written: File too large: "
    operator.until(lambda: any(said in message for message in health), "that it is told on /diagnostics")
    assert "the journal cannot be written (problem='File too large'" in log_of(world)
    old = "journal_required (problem='false is written may_repeat_outcomes:=true now')"
    assert (old in log_of(world)) == parameter.startswith("journal_required")


@pytest.mark.parametrize(("way", "end"), [("abort", "DONE"), ("dock", "RETURNING")])
def test_a_full_disk_holds_the_mission_and_the_way_home_is_open(
    world: World, operator: Operator, own_state: Path, way: str, end: str
) -> None:
    """Nothing moves; what stops or ends the mission is taken, and the robot comes home."""
    world.start("greenhouse_bridge")
    world.start("lupin_sim", speed=10.0)
    limited(world, operator)
    operator.in_state("READY")
    operator.until(lambda: operator.start("1", "5", "12", "21").accepted, "the journal works for a moment")
    operator.until(lambda: operator.state.paused, "the mission is held")
    assert operator.state.last_error == f"journal_failed: File too large: {own_state}"
    answer = operator.ask("resume")
    why = f"the journal cannot be written: File too large: {own_state}; {WHAT_TO_DO}"
    assert (answer.success, answer.message) == (False, f"resume refused: {why}")
    assert operator.ask("pause").success
    assert operator.ask(way).success
    operator.in_state("RETURNING")
    operator.in_state(end)
    operator.until(lambda: operator.state.paused == (way == "dock"), "it waits in the dock, or is done")


@pytest.mark.core
def test_a_full_disk_and_a_kill_repeat_no_outcome(world: World, operator: Operator) -> None:
    """What was not flushed was not published: the next orchestrator publishes each target once.

    The disk is full in the middle of the mission: one that is coming home already is not held.
    """
    tags = ("1", "5", "12", "3", "7", "20", "9", "14")
    world.start("greenhouse_bridge")
    world.start("lupin_sim", speed=10.0)
    limited(world, operator)
    operator.in_state("READY")
    assert operator.start(*tags).accepted
    operator.until(lambda: "journal_failed" in operator.state.last_error, "the disk is full")
    until = operator.ros.now() + 5.0
    operator.until(lambda: operator.ros.now() > until, "what it does on a full disk")
    kill(world)
    start_again(world, operator)
    operator.resume()
    operator.until_done(published=len(tags))
    assert outcomes(operator) == {(tag, 0): 1 for tag in tags}


def end(world: World) -> None:
    """Have the orchestrator end as it does every day."""
    process = world.processes["mission_orchestrator"]
    process.send_signal(signal.SIGINT)
    assert process.wait(30.0) == 0


def limited(world: World, operator: Operator, *parameters: str) -> None:
    """Start an orchestrator whose files may have 10 kB, after one without a limit, which keeps the chart."""
    world.start("mission_orchestrator")
    operator.in_state("READY")
    end(world)
    operator.states.clear()
    lupin = shlex.quote(str(Path(sys.executable).with_name("lupin")))
    given = " ".join(["--ros-args", "-p", "estop_timeout_s:=10.0", *parameters])
    command = f"ulimit -f 10; exec {lupin} node mission_orchestrator {given} > /dev/null 2> >(cat >&2)"
    world.run("mission_orchestrator", ["bash", "-c", command])


def log_of(world: World) -> str:
    """Return what the orchestrator has written for people."""
    return world.log("mission_orchestrator").read_text(encoding="utf-8")
