"""The inspection mission over real ROS 2: separate processes, real services, real readings."""

from __future__ import annotations

import signal
from pathlib import Path

import pytest
from action_msgs.msg import GoalStatus, GoalStatusArray

from lupin_msgs.msg import MissionState, Observation
from lupin_ros.adapter.node import Qos
from tests.lupin_ros.world import Operator, World

pytestmark = pytest.mark.timeout(180)

OK, UNREACHABLE, SCAN_FAILED, SKIPPED = range(4)
#: A tag at the other end of the greenhouse: on the way to it there is time to do something.
FAR = "21"


def outcomes(operator: Operator) -> list[tuple[str, int]]:
    return [(o.tag_reading.tag_id, o.status) for o in operator.observations]


def start_and_stall(operator: Operator, *tags: str) -> None:
    """Start an inspection whose first drive does not end by itself: what is done meanwhile is never late."""
    operator.hit(1, "stall")
    assert operator.start(*tags).accepted
    operator.in_state("INSPECTING", "NAVIGATING")
    operator.struck()


@pytest.mark.core
def test_three_tags_are_visited_read_and_published(world: World, operator: Operator) -> None:
    """The main job: states on the topic, observations for a late subscriber, nothing left running."""
    world.start_all()
    operator.in_state("READY")
    answer = operator.start("1", "5", "12")
    assert answer.accepted, answer.error_message
    assert answer.mission_id.startswith("lupin-")
    operator.until_done(published=3)

    seen = operator.seen()
    phases = ["NAVIGATING", "SCANNING", "PUBLISHING"]
    expected = ["READY", "PREPARE/LOCALIZING", *[f"INSPECTING/{p}" for p in phases * 3], "RETURNING", "DONE"]
    assert [state for state in seen if state != "BOOT"] == expected
    done = operator.state
    assert (done.targets_total, done.targets_completed, done.targets_failed) == (3, 3, 0)
    assert (done.last_error, done.mission_id) == ("", answer.mission_id)
    started = {(s.started_at.sec, s.started_at.nanosec) for s in operator.states if s.mission_id}
    assert len(started) == 1  # the same in every message, and of the clock of the stamps
    assert 0 <= done.header.stamp.sec - done.started_at.sec < 120

    log = world.log("mission_orchestrator").read_text(encoding="utf-8")
    counts = "total=3 completed=3 unreachable=0 failed=0 skipped=0"
    assert f"mission ended (mission_id={answer.mission_id!r} {counts})" in log
    tries = "tries={'nav.go_to': 1, 'bridge.read_tag': 1}"
    assert f"target (tag='1' status='OK' {tries} sensors=['temperature', 'co2'])" in log
    assert f"now='INSPECTING NAVIGATING' tag_id='5' mission_id={answer.mission_id!r})" in log
    assert "now='READY' tag_id='-' mission_id='-')" in log

    late = Operator("late")
    try:
        late.until(lambda: len(late.observations) == 3, "the backlog of observations")
        assert outcomes(late) == [("1", OK), ("5", OK), ("12", OK)]
        sensors = [[r.name for r in o.tag_reading.readings] for o in late.observations]
        assert sensors[0] == ["temperature", "co2"]
        assert all(o.mission_id == answer.mission_id for o in late.observations)
        assert all(o.tag_pose_in_map.orientation.w != 0.0 for o in late.observations)
        assert all(0 <= o.tag_reading.sim_time_of_day_seconds < 86400 for o in late.observations)
        late.until(lambda: late.states, "the latched state")
        assert late.state.lifecycle_state == "DONE"
    finally:
        late.ros.close()


@pytest.mark.core
def test_pause_stops_the_robot_and_resume_goes_on(world: World, operator: Operator) -> None:
    """A pause cancels the drive and refunds it; resume finishes with every tag read."""
    world.start_all()
    operator.in_state("READY")
    start_and_stall(operator, "1", "5")
    assert operator.ask("pause").success
    operator.until(lambda: operator.state.paused, "paused")
    again = operator.ask("pause")
    assert (again.success, again.message) == (False, "pause refused: paused by the operator")
    assert operator.observations == []
    assert operator.ask("resume").success
    operator.until_done(published=2)
    assert outcomes(operator) == [("1", OK), ("5", OK)]


@pytest.mark.core
def test_abort_closes_the_rest_and_comes_home(world: World, operator: Operator) -> None:
    """After an abort every tag has exactly one outcome."""
    world.start_all(speed=4.0)
    operator.in_state("READY")
    assert operator.start("1", FAR, "12").accepted
    operator.until(lambda: operator.observations, "the first reading")
    assert operator.ask("abort").success
    operator.until_done(published=3)
    assert outcomes(operator) == [("1", OK), (FAR, SKIPPED), ("12", SKIPPED)]
    assert operator.state.targets_skipped == 2
    assert operator.state.last_event == "mission aborted"


def test_skip_goes_on_with_the_next_tag(world: World, operator: Operator) -> None:
    """A skipped tag is published as skipped, with its reason."""
    world.start_all()
    operator.in_state("READY")
    start_and_stall(operator, "1", "5")
    assert operator.ask("skip_current").success
    operator.until_done(published=2)
    assert outcomes(operator) == [("1", SKIPPED), ("5", OK)]
    assert operator.observations[0].status_detail == "skipped_by_operator"


def test_two_missions_have_ids_of_their_own(world: World, operator: Operator) -> None:
    """In one process; what is published names the mission that it belongs to."""
    world.start_all(mission_id_prefix="bay2")
    operator.in_state("READY")
    first = operator.start("1")
    assert first.mission_id.startswith("bay2-")
    operator.in_state("DONE")
    second = operator.start("5")
    assert second.accepted
    assert second.mission_id != first.mission_id
    operator.until(lambda: operator.state.mission_id == second.mission_id, "the second mission")
    operator.until_done(published=2)
    told = [(o.mission_id, o.tag_reading.tag_id) for o in operator.observations]
    assert told == [(first.mission_id, "1"), (second.mission_id, "5")]


def test_unknown_mission_unknown_tag_and_second_start_are_refused(world: World, operator: Operator) -> None:
    """Each refusal names what is wrong and what is allowed, and changes nothing."""
    world.start_all()
    operator.in_state("READY")
    unknown = operator.start("1", mission="InspektionMission")
    assert not unknown.accepted
    assert unknown.error_message == ("unknown mission 'InspektionMission'; did you mean 'InspectionMission'?")
    strange = operator.start("1", "99", "x")
    assert not strange.accepted
    assert "unknown tag '99'" in strange.error_message
    assert "unknown tag 'x'" in strange.error_message
    assert operator.ask("abort").success is False
    assert operator.state.lifecycle_state == "READY"
    start_and_stall(operator, "1")
    second = operator.start("5")
    assert (second.accepted, second.error_message) == (False, "start refused: a mission is already running")
    operator.set_parameter("lupin_sim", "fault", "none")
    operator.until_done(published=1)
    assert outcomes(operator) == [("1", OK)]


def test_no_start_while_e_stopped_or_low_on_battery(world: World, operator: Operator) -> None:
    """An engaged e-stop and a low battery refuse the start; when they are over it is accepted."""
    world.start_all()
    operator.in_state("READY")
    operator.set_parameter("lupin_sim", "estop", True)
    operator.until(lambda: operator.state.estop_engaged, "e-stop seen")
    assert operator.start("1").error_message == "start refused: e-stop engaged"
    operator.set_parameter("lupin_sim", "estop", False)
    operator.until(lambda: not operator.state.estop_engaged, "e-stop released")
    operator.set_parameter("lupin_sim", "battery", 0.1)
    operator.until(lambda: operator.state.battery_low, "battery low seen")
    assert operator.start("1").error_message == "start refused: battery low"
    operator.set_parameter("lupin_sim", "battery", 0.9)
    operator.until(lambda: not operator.state.battery_low, "battery recovered")
    assert operator.start("1").accepted
    operator.in_state("DONE")


@pytest.mark.core
def test_an_e_stop_stops_the_mission_until_somebody_resumes(world: World, operator: Operator) -> None:
    """Releasing the button is not enough: only resume goes on."""
    world.start_all()
    operator.in_state("READY")
    start_and_stall(operator, "1")
    operator.set_parameter("lupin_sim", "estop", True)
    operator.until(lambda: operator.state.estop_engaged and operator.state.paused, "held by the e-stop")
    assert operator.ask("resume").message == "resume refused: e-stop engaged"
    operator.set_parameter("lupin_sim", "estop", False)
    operator.until(lambda: not operator.state.estop_engaged, "button released")
    assert operator.state.paused
    assert operator.ask("resume").success
    operator.until_done(published=1)
    assert outcomes(operator) == [("1", OK)]


def test_without_a_robot_boot_ends_in_fault_naming_the_server(world: World, operator: Operator) -> None:
    """What is missing is named; when it is there, nobody has to reset."""
    world.start("greenhouse_bridge")
    world.start("mission_orchestrator", dependency_timeout_s=2.0)
    operator.in_state("FAULT")
    assert operator.state.last_event == "dependencies not ready"
    assert operator.state.last_event_severity == MissionState.SEVERITY_ERROR
    assert "navigate_to_pose" in operator.state.last_error
    assert operator.start("1").error_message == (
        "start refused: the orchestrator is in FAULT; reset it first"
    )
    world.start("lupin_sim", speed=10.0)
    operator.in_state("READY")
    assert operator.state.last_error == ""


def test_a_robot_that_goes_is_waited_for(world: World, operator: Operator) -> None:
    """READY means that a mission can begin; with the robot it comes back by itself."""
    world.start_all()
    operator.in_state("READY")
    world.processes["lupin_sim"].kill()
    world.processes["lupin_sim"].wait(10.0)
    operator.in_state("BOOT")
    assert operator.start("1").error_message == "start refused: the robot is still starting up"
    world.start("lupin_sim", speed=10.0)
    operator.in_state("READY")
    assert operator.start("1").accepted
    operator.until_done(published=1)
    assert outcomes(operator) == [("1", OK)]


def test_a_bridge_that_dies_costs_readings_not_the_mission(world: World, operator: Operator) -> None:
    """The tags after the death are published as failed, with a reason, and the robot comes home."""
    world.start_all(scan_timeout_s=3.0, speed=4.0)
    operator.in_state("READY")
    assert operator.start("1", FAR, "12").accepted
    operator.until(lambda: operator.observations, "the first reading")
    world.processes["greenhouse_bridge"].send_signal(signal.SIGKILL)
    operator.until_done(published=3)
    assert outcomes(operator) == [("1", OK), (FAR, SCAN_FAILED), ("12", SCAN_FAILED)]
    assert all(o.status_detail for o in operator.observations[1:])
    assert operator.state.last_event_severity == MissionState.SEVERITY_WARN


def test_goals_that_are_rejected_make_a_tag_unreachable(world: World, operator: Operator) -> None:
    """After the declared number of tries the tag is given up and the next one visited."""
    world.start_all()
    operator.in_state("READY")
    operator.hit(2, "reject")
    assert operator.start("1", "5").accepted
    operator.until_done(published=2)
    assert outcomes(operator) == [("1", UNREACHABLE), ("5", OK)]
    assert operator.observations[0].status == Observation.STATUS_UNREACHABLE


def test_a_drive_that_failed_is_told_by_its_code_wherever_it_is_told(
    world: World, operator: Operator
) -> None:
    """Who compares codes finds them in the observation as in the state, also where there is a detail."""
    world.start_all()
    operator.in_state("READY")
    operator.hit(2, "abort")
    assert operator.start("1").accepted
    operator.until_done(published=1)
    assert outcomes(operator) == [("1", UNREACHABLE)]
    assert operator.observations[0].status_detail == "nav_status_6: ABORTED: fault: abort"
    assert operator.state.last_error == "nav_status_6: ABORTED: fault: abort"


@pytest.mark.core
def test_a_low_battery_docks_waits_and_goes_on(world: World, operator: Operator) -> None:
    """The divert keeps the itinerary; resume is refused until the battery has recovered."""
    world.start_all(speed=4.0)
    operator.in_state("READY")
    assert operator.start("1", FAR).accepted
    operator.until(lambda: operator.observations, "the first reading")
    operator.set_parameter("lupin_sim", "battery", 0.1)
    operator.in_state("RETURNING")
    operator.until(lambda: operator.state.paused, "docked")
    assert operator.state.last_event == "battery low"
    assert operator.ask("resume").message == "resume refused: battery low"
    operator.set_parameter("lupin_sim", "battery", 0.9)
    operator.until(lambda: not operator.state.battery_low, "battery recovered")
    assert operator.ask("resume").success
    operator.until_done(published=2)
    assert outcomes(operator) == [("1", OK), (FAR, OK)]


@pytest.mark.core
@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        (
            {"nav_timeout_s": "soon"},
            "parameter 'nav_timeout_s': expected duration, got 'soon'; its units are 'ms', 's', 'min', 'h'",
        ),
        ({"missions": "[inspektion]"}, "did you mean 'inspection'?"),
    ],
)
def test_a_wrong_parameter_ends_the_node_with_a_message(
    world: World, parameters: dict[str, str], message: str
) -> None:
    """No traceback: the parameter, what was given, what is allowed."""
    process = world.start("mission_orchestrator", **parameters)
    assert process.wait(30.0) != 0
    output = world.log("mission_orchestrator").read_text()
    assert message in output
    assert "Traceback" not in output


@pytest.mark.core
def test_a_mission_file_with_errors_ends_the_node_with_all_of_them(world: World, tmp_path: Path) -> None:
    """Each finding has file, line and column."""
    missions = tmp_path / "missions"
    missions.mkdir()
    source = Path(__file__).parents[3] / "missions"
    (missions / "parts").mkdir()
    for name in ("lifecycle.yaml", "inspection.yaml", "parts/visit_targets.yaml"):
        text = (source / name).read_text()
        text = text.replace("on_done: INSPECTING", "on_done: INSPEKTING").replace(
            "phase: LOCAL", "fase: LOCAL"
        )
        (missions / name).write_text(text)
    process = world.start("mission_orchestrator", missions_path=str(missions))
    assert process.wait(30.0) != 0
    output = world.log("mission_orchestrator").read_text()
    found = [line.removeprefix(f"{missions}/") for line in output.splitlines()]
    assert found == [
        "inspection.yaml:25:9: error: states.PREPARE.states.LOCALIZING: unknown key 'fase'; "
        "did you mean 'phase'? [unknown-key]",
        "inspection.yaml:30:18: error: MISSION.InspectionMission.PREPARE.LOCALIZING.on_done: "
        "no state is called 'INSPEKTING' here; did you mean 'INSPECTING'? [unknown-state]",
    ]


@pytest.mark.core
def test_an_orchestrator_that_crashed_leaves_no_robot_driving(world: World, operator: Operator) -> None:
    """The next one cancels the goals that its predecessor left behind, and is held."""
    statuses: list[int] = []
    operator.ros.subscribe(
        GoalStatusArray,
        "/navigate_to_pose/_action/status",
        Qos.LATCHED,
        lambda message: statuses.extend(goal.status for goal in message.status_list[-1:]),
    )
    world.start_all()
    operator.in_state("READY")
    start_and_stall(operator, FAR)
    operator.until(lambda: GoalStatus.STATUS_EXECUTING in statuses, "the robot driving")
    world.processes["mission_orchestrator"].kill()
    world.processes["mission_orchestrator"].wait(10.0)
    assert statuses[-1] == GoalStatus.STATUS_EXECUTING
    operator.states.clear()
    world.start("mission_orchestrator")
    over = (
        GoalStatus.STATUS_CANCELED,
        GoalStatus.STATUS_ABORTED,
    )  # by the next one, or by the robot's watchdog
    operator.until(lambda: statuses[-1] in over, "the old goal has ended")
    operator.held()
    assert operator.state.last_error.startswith("restarted: ")
