"""War stories of an inspection, on the running orchestrator; docs/war-stories.md links here."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Iterator
from itertools import pairwise
from typing import Any

import pytest
from action_msgs.msg import GoalStatus

from lupin_engine.machine.operations import CANCEL_DEADLINE
from lupin_greenhouse.layout import BUNDLED
from lupin_msgs.msg import MissionState
from tests.lupin_ros.system.wire.wire import (
    AT_ONCE,
    OK,
    SKIPPED,
    UNREACHABLE,
    Drive,
    Wire,
    answer_reading,
    leave_open,
    running_node,
)

pytestmark = pytest.mark.timeout(120)

#: Further attempts to dock on a low battery, and the pause before each, in seconds.
RETRIES, BACKOFF = 1, 1.0
#: A variance that nobody sets off with, in m².
DRIFTED = 9.0


@pytest.fixture(scope="module")
def running(ros_domain: int, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Wire]:
    """One node for all tests here, with an arm: each leaves it with its mission ended."""
    given = {"dock_retry_max": RETRIES, "arm_patrol_enabled": True}
    with running_node(tmp_path_factory.mktemp("wire"), **given) as wire:
        wire.offer_arm()
        yield wire


# --- what tests here do again and again -------------------------------------------------------------------


def refusal(wire: Wire, request: str) -> str:
    """Ask for what must be refused; return the reason."""
    answer = wire.operator.ask(request)
    assert not answer.success
    return str(answer.message)


def release(wire: Wire) -> None:
    """Let the e-stop go, which moves nothing."""
    wire.estop(False)
    wire.until(lambda: not wire.operator.state.estop_engaged, "released")
    assert wire.operator.state.paused


def lifecycles(wire: Wire, mission: str) -> list[str]:
    """Return the states that a mission was in, each change once."""
    told = [state.lifecycle_state for state in wire.operator.states if state.mission_id == mission]
    return told[:1] + [after for before, after in pairwise(told) if before != after]


# --- before the robot drives ------------------------------------------------------------------------------


def test_an_abort_while_localizing_is_no_fault(wire: Wire) -> None:
    """Story 1: it ended in FAULT, for good."""
    wire.localize(variance=DRIFTED)
    mission = wire.start("1", "2")
    wire.operator.in_state("PREPARE", "LOCALIZING")
    wire.ask("abort")
    wire.until_done(mission)
    assert lifecycles(wire, mission) == ["PREPARE", "RETURNING", "DONE"]
    assert wire.outcomes(mission) == [("1", SKIPPED), ("2", SKIPPED)]


def test_a_battery_that_runs_low_while_localizing_docks_and_begins_there_again(wire: Wire) -> None:
    """Story 7: flags were set, nothing was fired, and the run stood still."""
    wire.localize(variance=DRIFTED)
    mission = wire.start("1")
    wire.operator.in_state("PREPARE", "LOCALIZING")
    wire.battery(0.1)
    wire.until_docked()
    wire.localize()
    wire.charge()
    wire.ask("resume")
    wire.until_done(mission)
    assert lifecycles(wire, mission)[:3] == ["PREPARE", "RETURNING", "PREPARE"]
    assert wire.outcomes(mission) == [("1", OK)]


def test_at_rest_a_stop_and_a_low_battery_refuse_the_start_and_leave_nothing_behind(wire: Wire) -> None:
    """Stories A6 and A20: a start was kept until the release; a low battery paused for ever."""
    wire.estop(True)
    wire.until(lambda: wire.operator.state.estop_engaged, "stopped")
    assert wire.operator.start("1").error_message == "start refused: e-stop engaged"
    wire.estop(False)
    wire.until(lambda: not wire.operator.state.estop_engaged, "released")
    wire.until_quiet()
    assert wire.drives == []
    wire.ask("resume")  # a stop asks for a person also at rest
    wire.battery(0.1)
    wire.until(lambda: wire.operator.state.battery_low, "low")
    assert wire.operator.start("1").error_message == "start refused: battery low"
    wire.until_quiet()
    assert not wire.operator.state.paused
    wire.charge()
    wire.until_done(wire.start("1"))


def test_the_pose_of_a_localizer_that_is_gone_starts_nothing_and_a_reset_looks_again(wire: Wire) -> None:
    """Stories 65 and A19: a sample of somebody dead counted; and what lay in FAULT could not get out."""
    wire.configure(localization_timeout_s=0.5)
    wire.lose_localizer()
    mission = wire.start("1")
    wire.operator.in_state("FAULT")
    assert wire.operator.state.last_error.startswith("localization_failed")
    assert wire.drives == []
    wire.localize()
    wire.ask("reset")
    wire.operator.in_state("READY")
    wire.until_done(wire.start("2"))
    wire.until(lambda: wire.outcomes(mission) == [("1", SKIPPED)], "the outcome of the first mission")


def test_a_reset_does_not_make_a_low_battery_full(wire: Wire) -> None:
    """Story A10: only edges were told, and the reset had cleared the flag."""
    wire.configure(localization_timeout_s=0.5)
    wire.localize(variance=DRIFTED)
    wire.start("1")
    wire.operator.in_state("FAULT")
    wire.battery(0.1)
    wire.until(lambda: wire.operator.state.battery_low, "low")
    wire.ask("reset")
    wire.operator.in_state("READY")
    assert wire.operator.start("1").error_message == "start refused: battery low"
    wire.until_quiet()
    assert wire.drives == []


def test_an_arm_is_folded_before_every_drive_to_a_tag(wire: Wire) -> None:
    """Story 46: the robot drove with its arm up, and the shoulder got hot."""
    settle = 0.3
    wire.configure(arm_travel_settle_s=settle)
    wire.until_done(wire.start("1", "2"))
    asked = [(name, at) for name, at in wire.arm.presets if at >= wire.begun]
    assert [name for name, _ in asked] == ["home", "inspect", "home", "inspect"]
    folded = [at for name, at in asked if name == "home"]
    for at, drive in zip(folded, wire.drives, strict=False):
        assert drive.arrived - at >= 0.5 * settle, "the arm had no time to fold"


def test_an_abort_while_the_arm_folds_leaves_no_drive_behind(wire: Wire) -> None:
    """Story 14: the timer that waited for the arm sent the robot to its tag after all."""
    settle = 0.6
    wire.configure(arm_travel_settle_s=settle)
    wire.base.plan.append(Drive.accept)
    mission = wire.start("1")
    wire.operator.in_state("INSPECTING", "NAVIGATING")
    wire.ask("abort")
    home = wire.until_driving()
    wire.until_later(settle + 0.2)
    assert (wire.drives, home.cancels) == ([home], [])
    home.arrive()
    wire.until_done(mission)
    assert wire.outcomes(mission) == [("1", SKIPPED)]


# --- where it drives --------------------------------------------------------------------------------------


def test_no_goal_lies_in_a_table(wire: Wire) -> None:
    """Story 19: the goal for tag 26 lay in the table across the aisle."""
    layout = json.loads(BUNDLED.read_text(encoding="utf-8"))
    mission = wire.start(*layout["tags"])
    wire.until_done(mission)
    goals = dict(zip(layout["tags"], (drive.place for drive in wire.drives), strict=False))
    tables = layout["tables"].values()
    inside = [
        tag
        for tag, (x, y) in goals.items()
        if any(t["x0"] <= x <= t["x1"] and t["y0"] <= y <= t["y1"] for t in tables)
    ]
    assert (len(goals), inside) == (29, [])


def test_without_a_dock_home_is_where_each_mission_began(wire: Wire) -> None:
    """Story 21: it was the origin of the map, or the first place for ever."""
    for place in ((2.0, 1.0), (0.5, 7.0)):
        wire.localize(*place)
        wire.until_quiet()
        wire.until_done(wire.start("1"))
        assert wire.drives[-1].place == pytest.approx(place)


def test_an_uncertain_pose_reaches_no_tag(wire: Wire) -> None:
    """Story 24: an inspection has a limit; tests/lupin_ros/system/wire/test_search.py has what has none."""
    wire.base.plan.append(Drive.accept)
    mission = wire.start("1", "2")
    drive = wire.until_driving()
    wire.localize(variance=0.5)
    wire.until_quiet()
    drive.arrive()
    wire.until_done(mission)
    assert wire.outcomes(mission) == [("1", OK), ("2", UNREACHABLE)]
    assert wire.details(mission)[1].startswith("amcl_drift_var")
    assert len(wire.drives) == 2


def test_a_server_that_rejects_is_asked_again_after_a_while(wire: Wire) -> None:
    """Story A23: all attempts were used up within milliseconds."""
    wire.base.plan.append(Drive.reject)
    mission = wire.start("1")
    wire.until_done(mission)
    first, second, _ = (drive.arrived for drive in wire.drives)
    assert second - first >= BACKOFF
    assert wire.outcomes(mission) == [("1", OK)]


# --- at a tag ---------------------------------------------------------------------------------------------


def test_a_pause_stops_the_dwell_and_what_was_read_cannot_be_skipped(wire: Wire) -> None:
    """Stories 11 and A13: the robot drove on in the pause; a skip made SKIPPED of an OK."""
    dwell = 0.8
    wire.configure(flower_scan_dwell_s=dwell)
    mission = wire.start("1")
    wire.until(lambda: wire.outcomes(mission), "the reading")
    assert refusal(wire, "skip_current").endswith("this target has its result already")
    wire.ask("pause")
    wire.until_held()
    wire.until_later(dwell + 0.2)
    assert len(wire.drives) == 1
    assert wire.operator.state.mission_phase == "SCANNING"
    wire.ask("resume")
    wire.until_done(mission)
    assert wire.outcomes(mission) == [("1", OK)]


def test_a_dock_between_two_tags_publishes_none_twice(wire: Wire) -> None:
    """Stories 27 and A24: a dock there closed the last tag again, and a skip overwrote its result."""
    wire.base.plan.append(Drive.accept)
    mission = wire.start("1", "2")
    wire.until_driving()
    wire.ask("pause", "skip_current")
    wire.until(lambda: wire.operator.state.mission_phase == "PUBLISHING", "between the tags")
    assert refusal(wire, "skip_current").endswith("this target has its result already")
    wire.ask("dock")
    wire.until_docked()
    assert refusal(wire, "skip_current") == (
        "skip_current is not possible in RETURNING; it is possible in INSPECTING or MONITORING"
    )
    wire.ask("resume")
    wire.until_done(mission)
    assert wire.outcomes(mission) == [("1", SKIPPED), ("2", OK)]
    assert len(wire.drives) == 4, "a tag, the dock, the next tag, home"


def test_a_dock_while_reading_leaves_nothing_that_stops_the_mission_later(wire: Wire) -> None:
    """Story A1: a flag outlived the drive home, and the mission stood still in PUBLISHING."""
    wire.bridge.plan.append(leave_open)
    mission = wire.start("1", "2")
    wire.until(lambda: wire.bridge.calls, "the question for a reading")
    wire.ask("dock")
    wire.until_docked()
    answer_reading(wire.bridge.calls[0])
    wire.ask("resume")
    wire.until_done(mission)
    assert wire.outcomes(mission) == [("1", OK), ("2", OK)]
    assert len(wire.drives) == 5, "a tag, the dock, both tags, home"


def arrive_first(wire: Wire, drive: Drive) -> None:
    drive.arrive()
    wire.until(lambda: wire.bridge.calls, "the question for a reading: two topics keep no order")
    wire.battery(0.1)


def run_low_first(wire: Wire, drive: Drive) -> None:
    wire.battery(0.1)
    drive.arrive()


@pytest.mark.parametrize("at_once", [arrive_first, run_low_first])
def test_an_arrival_and_a_low_battery_at_once_lose_nothing(
    wire: Wire, at_once: Callable[[Wire, Drive], None]
) -> None:
    """Story A35: the order of a queue decided whether the robot went to charge."""
    wire.base.plan.append(Drive.accept)
    wire.bridge.plan.extend([leave_open] * 2)
    mission = wire.start("1")
    drive = wire.until_driving()
    wire.until(lambda: drive.asked, "the question for the result")
    at_once(wire, drive)
    wire.until_docked()
    wire.bridge.plan.clear()
    wire.charge()
    wire.ask("resume")
    wire.until_done(mission)
    assert wire.outcomes(mission) == [("1", OK)]
    assert len(wire.drives) == 4, "the tag, the dock, the tag, home"


# --- on the way home --------------------------------------------------------------------------------------


def test_a_skip_of_the_last_tag_drives_home_at_once(wire: Wire) -> None:
    """Story A2: the drive home waited for a flag that this end did not set."""
    wire.base.plan.append(Drive.accept)
    mission = wire.start("1")
    wire.until_driving()
    asked = time.monotonic()
    wire.ask("skip_current")
    wire.until_done(mission)
    assert wire.drives[1].arrived - asked < AT_ONCE
    assert wire.outcomes(mission) == [("1", SKIPPED)]


def test_an_abort_whose_cancel_is_lost_comes_home_all_the_same(wire: Wire) -> None:
    """Story 3: the robot stood in RETURNING, waiting for an answer that was lost."""
    wire.base.plan.append(Drive.accept)
    wire.base.on_cancel = leave_open
    mission = wire.start("1")
    wire.until_driving()
    asked = time.monotonic()
    wire.ask("abort")
    wire.until_done(mission)
    assert CANCEL_DEADLINE <= wire.drives[1].arrived - asked < CANCEL_DEADLINE + AT_ONCE


def give_up(drive: Drive) -> None:
    """End the goal as aborted, whatever was asked for."""
    drive.end(GoalStatus.STATUS_ABORTED)


@pytest.mark.parametrize("stops", [Drive.stop, give_up])
def test_a_second_abort_ends_the_mission_where_the_robot_is(
    wire: Wire, stops: Callable[[Drive], Any]
) -> None:
    """Stories 10 and A34: it was ignored; later, the goal that it had ended was sent again."""
    wire.base.plan.extend([Drive.accept, Drive.accept])
    wire.base.on_cancel = stops
    mission = wire.start("1", "2")
    wire.until_driving()
    wire.ask("abort")
    home = wire.until_driving(2)
    wire.ask("abort")
    wire.until_done(mission)
    wire.until(lambda: home.ended, "the robot stopped")
    wire.until_quiet()
    assert len(wire.drives) == 2
    assert wire.operator.state.lifecycle_state == "DONE"
    assert wire.outcomes(mission) == [("1", SKIPPED), ("2", SKIPPED)]


@pytest.mark.parametrize("divert", ["abort", "dock", "battery"])
def test_who_is_paused_is_sent_home_without_a_resume(wire: Wire, divert: str) -> None:
    """Stories A7 and A36: the robot said that it returned, and waited for a resume; or ran dry."""
    wire.base.plan.append(Drive.accept)
    mission = wire.start("1")
    wire.until_driving()
    wire.ask("pause")
    wire.until_held()
    if divert == "battery":
        wire.battery(0.1)
    else:
        wire.ask(divert)
    wire.until(lambda: len(wire.drives) == 2, "the drive home")
    if divert != "abort":
        wire.until_docked()
        wire.charge()
        wire.ask("resume")
    wire.until_done(mission)
    assert wire.outcomes(mission) == [("1", SKIPPED if divert == "abort" else OK)]


def test_nothing_pauses_a_drive_to_the_charger(wire: Wire) -> None:
    """Story 6: the pause was accepted, the resume refused, and the robot ran dry."""
    wire.base.plan.extend([Drive.accept, Drive.accept])
    mission = wire.start("1")
    wire.until_driving()
    wire.battery(0.1)
    home = wire.until_driving(2)
    assert refusal(wire, "pause") == "pause refused: returning because the battery is low"
    wire.until_quiet()
    assert (home.drives, home.cancels) == (True, [])
    home.arrive()
    wire.until_docked()
    wire.charge()
    wire.ask("resume")
    wire.until_done(mission)
    assert wire.outcomes(mission) == [("1", OK)]


def cancel_by_itself(drive: Drive) -> None:
    """Take the goal and end it as cancelled, which nobody has asked for."""
    drive.accept()
    drive.end(GoalStatus.STATUS_CANCELED)


@pytest.mark.parametrize("fails", [Drive.reject, cancel_by_itself])
def test_a_dock_that_fails_on_a_low_battery_keeps_the_run(wire: Wire, fails: Callable[[Drive], Any]) -> None:
    """Stories 5, A5 and A15: the run was over; or the goal was sent again without end."""
    wire.base.plan.extend([Drive.accept, *[fails] * (1 + RETRIES)])
    mission = wire.start("1")
    wire.until_driving()
    wire.battery(0.1)
    wire.until_docked()
    wire.until_quiet()
    assert wire.operator.state.last_error.startswith("dock_unreachable")
    assert len(wire.drives) == 1 + 1 + RETRIES
    wire.charge()
    wire.ask("resume")
    wire.until_done(mission)
    assert wire.outcomes(mission) == [("1", OK)]


def test_a_battery_that_recovers_before_the_dock_fails_keeps_the_run(wire: Wire) -> None:
    """Story A38: the battery was asked again when the dock had failed, and the run was over."""
    wire.base.plan.extend([Drive.accept, Drive.accept, Drive.reject])
    mission = wire.start("1")
    wire.until_driving()
    wire.battery(0.1)
    home = wire.until_driving(2)
    wire.charge()
    home.end(GoalStatus.STATUS_ABORTED)
    wire.until_docked()
    wire.ask("resume")
    wire.until_done(mission)
    assert wire.outcomes(mission) == [("1", OK)]


def test_a_dock_on_request_that_fails_keeps_the_run(wire: Wire) -> None:
    """Story A39: the run was over, although it was to go on."""
    wire.base.plan.extend([Drive.accept, Drive.reject])
    mission = wire.start("1")
    wire.until_driving()
    wire.ask("dock")
    wire.until_docked()
    assert wire.operator.state.last_error.startswith("dock_unreachable")
    wire.ask("resume")
    wire.until_done(mission)
    assert wire.outcomes(mission) == [("1", OK)]


def test_a_stop_on_the_way_home_sends_nothing_before_the_resume(wire: Wire) -> None:
    """Story A5: the cancelled goal was sent again while the robot was stopped."""
    wire.base.plan.extend([Drive.arrive_at_once, Drive.accept, Drive.accept])
    mission = wire.start("1")
    home = wire.until_driving(2)
    wire.ask("pause")
    wire.until(lambda: home.ended, "the robot stopped")
    wire.until_quiet()
    assert len(wire.drives) == 2
    wire.ask("resume")
    again = wire.until_driving(3)
    wire.estop(True)
    wire.until(lambda: again.ended, "the robot stopped")
    assert refusal(wire, "resume") == "resume refused: e-stop engaged"
    release(wire)
    wire.until_quiet()
    assert len(wire.drives) == 3
    wire.ask("resume")
    wire.until_done(mission)
    assert len(wire.drives) == 4


def test_a_resume_on_the_way_to_the_dock_leads_to_the_dock(wire: Wire) -> None:
    """Story A8: it led back into the mission."""
    wire.base.plan.extend([Drive.accept, Drive.accept, Drive.accept])
    mission = wire.start("1")
    wire.until_driving()
    wire.ask("dock")
    wire.until_driving(2)
    wire.estop(True)
    wire.until_held()
    release(wire)
    wire.ask("resume")
    again = wire.until_driving(3)
    assert (wire.operator.state.lifecycle_state, again.place) == ("RETURNING", wire.drives[1].place)
    again.arrive()
    wire.until_docked()
    wire.ask("resume")
    wire.until_done(mission)
    assert wire.outcomes(mission) == [("1", OK)]


# --- what is told -----------------------------------------------------------------------------------------


def test_what_is_mere_information_is_no_error_and_a_warning_is_one(wire: Wire) -> None:
    """Story 17: every notice was a red error."""

    def told() -> tuple[str, int, str]:
        state = wire.operator.state
        return state.last_event, state.last_event_severity, state.last_error

    wire.base.plan.append(Drive.accept)
    mission = wire.start("1", "2")
    wire.until_driving()
    wire.ask("pause", "skip_current")
    wire.until(lambda: wire.outcomes(mission), "the skip")
    wire.until_quiet()
    assert told() == ("", MissionState.SEVERITY_INFO, "")
    wire.estop(True)
    wire.until(lambda: wire.operator.state.estop_engaged, "stopped")
    assert told() == ("e-stop engaged", MissionState.SEVERITY_WARN, "estop_engaged")
    release(wire)
    wire.ask("resume")
    wire.until_done(mission)


def test_the_state_is_told_without_a_mission_too(wire: Wire) -> None:
    """Stories 47 and 48: what lights and panels show is neither old nor missing."""
    told = len(wire.operator.states)
    begun = time.monotonic()
    wire.until(lambda: len(wire.operator.states) >= told + 5, "five more states")
    assert time.monotonic() - begun < 5 * 0.2 + AT_ONCE
    stamps = [s.header.stamp.sec + 1e-9 * s.header.stamp.nanosec for s in wire.operator.states[-5:]]
    assert stamps == sorted(set(stamps))
    assert math.isclose(stamps[-1], wire.ros.now(), abs_tol=AT_ONCE)
