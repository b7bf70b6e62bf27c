"""`lupin run` over real ROS 2: what it shows, how it ends, and that nothing is left."""

from __future__ import annotations

import os
import re
import shutil
import signal
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.lupin_ros.launch.processes import Lupin, until

pytestmark = pytest.mark.timeout(240)

Start = Callable[..., Lupin]

MISSIONS = Path(__file__).parents[3] / "missions"
#: The sensors that the greenhouse has at these tags.
SENSORS = {
    "1": {"temperature", "co2"},
    "5": {"temperature", "co2", "soil_moisture"},
    "12": {"temperature", "humidity", "co2"},
}
THREE = ("run", "inspection", "--tags", "1,5,12")
#: The second is at the other end of the greenhouse: on the way to it there is time to do something.
FAR = ("run", "inspection", "--tags", "1,21,12")


@pytest.mark.core
def test_three_tags_are_visited(lupin: Start) -> None:
    """The whole mission: states in order, a reading for every sensor of every tag, exit code 0."""
    run = lupin(*THREE, "--speed", "20", "--json")
    assert run.end() == 0, run.output

    phases = [(s["lifecycle_state"], s["mission_phase"]) for s in run.records("state")]
    seen = [phase for i, phase in enumerate(phases) if phase != phases[i - 1] or i == 0]
    leg = [("INSPECTING", "NAVIGATING"), ("INSPECTING", "SCANNING"), ("INSPECTING", "PUBLISHING")]
    assert seen == [("PREPARE", "LOCALIZING"), *(leg * 3), ("RETURNING", ""), ("DONE", "")]

    (result,) = run.records("result")
    assert (result["exit_code"], result["lifecycle"], result["total"]) == (0, "DONE", 3)
    assert result["counts"] == {"OK": 3, "UNREACHABLE": 0, "SCAN_FAILED": 0, "SKIPPED": 0}
    assert {r["tag"]: set(r["values"]) for r in result["readings"]} == SENSORS
    assert [r["status"] for r in result["readings"]] == ["OK", "OK", "OK"]
    assert run.processes() == {}


def test_the_output_for_people_ends_with_the_readings(lupin: Start) -> None:
    """Without a terminal: a line for every change, then the table, then one sentence."""
    run = lupin("run", "inspection", "--tags", "3,20", "--speed", "20")
    assert run.end() == 0, run.output
    assert "INSPECTING NAVIGATING  tag 3  0/2" in run.output
    assert run.errors == []
    *_, last = [line for line in run.lines if line]
    assert last.startswith("DONE: 2 visited of 2 targets in ")
    row = next(line for line in run.lines if line.strip().startswith("20"))
    assert row.split()[:4] == ["20", "OK", "·", "·"]  # tag 20 has no co2 and no light


RESTING = """\
mission: Resting
states:
  RESTING:
    after: {"${ request.rest }": done}
  done: {type: final}
request:
  rest: {type: duration, default: 1 h}
  tag_sequence: {type: list of tag, default: []}
initial: RESTING
"""


def test_a_field_that_the_start_message_lacks_is_commanded(lupin: Start, tmp_path: Path) -> None:
    """As `lupin start` does it, with the fields that have an option; else it would rest for an hour."""
    shutil.copytree(MISSIONS, tmp_path / "missions")
    file = tmp_path / "missions" / "resting.yaml"
    file.write_text(RESTING, encoding="utf-8")
    run = lupin("run", str(file), "--tags", "1,5", "--request", "rest=1500 ms", "--speed", "20", "--json")
    assert run.end() == 0, run.output
    (start,) = [one["step"] for one in run.records("step") if one["step"]["event"] == "mission.start"]
    given = {name: start["data"].get(name) for name in ("mission_type", "rest", "tag_sequence")}
    assert given == {"mission_type": "Resting", "rest": "1500 ms", "tag_sequence": ["1", "5"]}
    assert run.records("result")[0]["lifecycle"] == "DONE"


@pytest.mark.core
def test_an_interrupt_brings_the_robot_home_and_ends_everything_else(lupin: Start) -> None:
    """Ctrl-C: the mission is aborted, the rest counts as skipped, the robot drives home, exit code 130."""
    run = lupin(*FAR, "--speed", "2", "--json")
    run.until_line('"current_target": "21"')
    run.process.send_signal(signal.SIGINT)
    assert run.end() == 130, run.output
    (result,) = run.records("result")
    assert result["lifecycle"] == "DONE"
    assert [r["status"] for r in result["readings"]] == ["OK", "SKIPPED", "SKIPPED"]
    last = run.records("step")[-1]["step"]
    assert (last["event"], last["taken"]) == ("attempt.done", ["RETURNING.DRIVING_HOME.on_done.1"])
    assert run.processes() == {}


@pytest.mark.parametrize("signals", [(signal.SIGTERM,), (signal.SIGINT, signal.SIGINT)])
def test_without_time_to_come_home_the_robot_stops_where_it_is(
    lupin: Start, signals: tuple[signal.Signals, ...]
) -> None:
    """A service that is stopped, or Ctrl-C a second time: the goal is cancelled and its end awaited."""
    run = lupin(*FAR, "--speed", "2", "--json")
    run.until_line('"current_target": "21"')
    for number in signals:
        run.process.send_signal(number)
        run.until_line('"lifecycle_state": "RETURNING"')
    assert run.end() == 130, run.output
    (result,) = run.records("result")
    assert result["lifecycle"] == "DONE"
    assert [r["status"] for r in result["readings"]] == ["OK", "SKIPPED", "SKIPPED"]
    assert run.records("step")[-1]["step"]["event"] == "attempt.cancelled", "the goal's end was not awaited"
    assert run.processes() == {}


def test_a_mission_that_nobody_watches_any_more_is_aborted_in_order(lupin: Start) -> None:
    """A pipe whose reader has left, as a terminal that was closed: what cannot be told keeps from nothing."""
    run = lupin(*THREE, "--speed", "4", read_until="NAVIGATING")
    assert run.end() == 130, run.output
    assert run.errors == []
    assert run.processes() == {}
    log = (run.log_dir / "mission_orchestrator.log").read_text()
    assert "request (request='operator.abort' answer='accepted')" in log


@pytest.mark.core
def test_being_killed_leaves_no_process(lupin: Start) -> None:
    """`kill -9`: the nodes notice by themselves."""
    run = lupin(*THREE)
    run.until_line("NAVIGATING")
    run.process.kill()
    run.end()
    until(lambda: not run.processes(), "the nodes ended after their supervisor was killed")


def test_a_bridge_that_stays_dead_fails_its_scan_and_nothing_else(lupin: Start) -> None:
    """The mission has a declared error for that; the run tells which process died and how."""
    once = ("--set", "scan_timeout_s=3 s", "--no-respawn", "--separate")
    run = lupin("run", "inspection", "--tags", "1,21", "--speed", "2", *once)
    run.until_line("NAVIGATING  tag 21")
    os.kill(run.pid_of("greenhouse_bridge"), signal.SIGKILL)
    assert run.end() == 1, run.output
    assert any("greenhouse_bridge was killed by SIGKILL; its log is" in line for line in run.errors)
    assert "DONE: 1 visited, 1 failed of 2 targets" in run.lines[-1]


def test_a_run_whose_orchestrator_died_waits_for_somebody_who_resumes(lupin: Start) -> None:
    """The last lines of its log are told; the next one is held; where nobody comes the run ends: code 2."""
    run = lupin(*THREE, "--patience", "3")
    run.until_line("NAVIGATING  tag 1")
    os.kill(run.pid_of("mission_orchestrator"), signal.SIGKILL)
    assert run.end() == 2, run.output
    assert "mission_orchestrator was killed by SIGKILL" in run.errors[0]
    assert any(line.startswith("  | ") for line in run.errors)
    assert re.search(r"will be held: look where the robot is, then `lupin resume`$", run.output, re.MULTILINE)
    assert re.search(
        r"waits for an operator \(restarted: .*; nobody came within 3 s$", run.output, re.MULTILINE
    )
    assert "DONE: 3 skipped of 3 targets" in run.output


def test_an_absent_action_server_is_named(lupin: Start) -> None:
    """Nobody drives: BOOT gives up after its time, and says what it waited for."""
    run = lupin("run", "inspection", "--no-sim", "--set", "dependency_timeout_s=2 s")
    assert run.end() == 2, run.output
    (told,) = run.errors
    begin = "lupin: the orchestrator is in FAULT: dependency_timeout: "
    assert told.startswith(begin)
    # On a busy machine the bridge may not be there yet either.
    waited, _, advice = told.removeprefix(begin).partition("; ")
    assert "action server navigate_to_pose" in waited.split(", ")
    assert advice == "mend it, then `lupin up`, and beside it `lupin reset`"


def test_an_engaged_emergency_stop_refuses_the_start(lupin: Start) -> None:
    """Nothing starts while the e-stop is engaged; the service's reason reaches the terminal."""
    run = lupin("run", "inspection", "--tags", "1", "--sim", "estop=true")
    assert run.end() == 2, run.output
    assert run.errors == ["lupin: InspectionMission was not started: start refused: e-stop engaged"]


def test_nodes_that_run_are_used_and_left_alone(lupin: Start) -> None:
    """`lupin up` serves; a run joins, a second run is refused, an option for somebody else's node too."""
    up = lupin("up", "inspection", "--speed", "3")
    up.until_line("Ctrl-C stops everything")
    serving = set(up.processes())

    first = lupin("run", "inspection")  # all tags: it takes a minute
    first.until_line("NAVIGATING  tag 1")
    (joined,) = [line for line in first.lines if line.startswith("using what is there: ")]
    there = set(joined.removeprefix("using what is there: ").split(", "))
    wanted = {"lupin_sim", "greenhouse_bridge", "perception_aggregator", "lupin_twin", "mission_orchestrator"}
    assert wanted <= there

    second = lupin("run", "inspection", "--tags", "3")
    assert second.end() == 2, second.output
    assert second.errors == [
        "lupin: InspectionMission was not started: start refused: a mission is already running"
    ]
    third = lupin("run", "inspection", "--set", "nav_timeout_s=5 s")
    assert third.end() == 2, third.output
    assert third.errors == [
        "lupin: --set is for mission_orchestrator, which runs already; stop it or choose another --domain"
    ]

    first.process.send_signal(signal.SIGTERM)
    assert first.end() == 130, first.output
    assert first.processes() == {}
    assert set(up.processes()) == serving
    up.until_line("DONE")
    up.process.send_signal(signal.SIGINT)
    assert up.end() == 0, up.output
    assert up.processes() == {}
