"""Conversions to lupin_msgs: pure functions over plain data."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import pytest

pytest.importorskip("lupin_msgs.msg", reason="the interface packages are not built here")

from geometry_msgs.msg import Pose

from lupin_engine.errors import Severity
from lupin_engine.machine.step import View
from lupin_engine.plugin.contract import Code
from lupin_engine.plugin.profile import Fields, Publish
from lupin_engine.plugin.wire import SMALLEST_W
from lupin_greenhouse import messages as greenhouse
from lupin_greenhouse.profile import PROFILE
from lupin_msgs.msg import MissionState, Observation
from lupin_ros.service import messages

CODES = {
    "battery_low": Code("battery_low", "battery low", Severity.WARN),
    "localization_failed": Code("localization_failed", "localization failed", Severity.ERROR),
}
READING = {
    "tag_id": "5",
    "stamp": 12.25,
    "sim_time_of_day_seconds": 3600.0,
    "readings": [{"name": "temperature", "value": 21.5}, {"name": "co2", "value": 480.0}],
}
VIEW = View(
    configuration=("", "MISSION"),
    lifecycle="INSPECTING",
    phase="NAVIGATING",
    mission="InspectionMission",
    mission_id="lupin-1",
    started_at=3.0,
    target="5",
    total=4,
    counts={"OK": 1, "SCAN_FAILED": 1, "UNREACHABLE": 1, "SKIPPED": 0},
    code="localization_failed",
    detail="no pose",
    codes=1,
    asking=(),
    held=("pause",),
    paused=True,
    attempts=(),
    cancelling=(),
    dropped=0,
)


HERE = {"x": 1.0, "y": 2.0, "yaw": 0.0}
NOW = {"sec": 7, "nanosec": 0}


def published(status: str = "OK", **changes: object) -> Publish:
    return Publish("InspectionMission", "lupin-1", "5", status, **changes)  # type: ignore[arg-type]


def observation(told: Publish, **values: object) -> Observation:
    """The message that is sent, of the inputs that are known."""
    return messages.write(Observation(), greenhouse.observation_fields(told, values.get, NOW))


def to_pose(fields: Fields) -> Pose:
    return messages.write(Pose(), fields)


def test_an_ok_observation_carries_its_reading_and_pose() -> None:
    message = observation(published(reading=READING, detail="at the second look"), robot=HERE)
    assert (message.status, message.status_detail) == (Observation.STATUS_OK, "")
    assert message.tag_reading.tag_id == "5"
    assert [(r.name, r.value) for r in message.tag_reading.readings] == [
        ("temperature", 21.5),
        ("co2", 480.0),
    ]
    assert (message.tag_reading.stamp.sec, message.tag_reading.stamp.nanosec) == (12, 250_000_000)
    assert (message.tag_pose_in_map.position.x, message.tag_pose_in_map.orientation.w) == (1.0, 1.0)
    assert (message.header.frame_id, message.header.stamp.sec, message.source) == (
        "map",
        7,
        "InspectionMission",
    )


def paths(fields: object, where: str = "") -> set[str]:
    """Return all names of plain data, those inside of others as well."""
    if not isinstance(fields, dict):
        return set()
    found = {f"{where}{name}" for name in fields}
    return found.union(*(paths(value, f"{where}{name}.") for name, value in fields.items()))


def test_pages_of_a_simulation_get_every_field_as_on_the_wire() -> None:
    """They see what the profile makes, and no message that has defaults."""
    told = greenhouse.observation_fields(published("SKIPPED"), {}.get, NOW)
    empty = messages.read(Observation())
    assert paths(told) == paths(empty)
    assert {name: told[name] for name in ("flower", "anomaly")} == {
        name: empty[name] for name in ("flower", "anomaly")
    }
    now = messages.situation(VIEW, CODES, {}, {}.get, None, NOW)
    assert paths(greenhouse.state_fields(now)) == paths(messages.read(MissionState()))


def test_a_failed_observation_carries_its_tag_and_reason_but_no_reading_and_no_pose() -> None:
    failed = published("UNREACHABLE", code="nav_status_6", detail="aborted")
    message = observation(failed, robot=HERE)
    assert (message.status, message.status_detail) == (
        Observation.STATUS_UNREACHABLE,
        "nav_status_6: aborted",
    )
    assert (message.tag_reading.tag_id, list(message.tag_reading.readings)) == ("5", [])
    assert message.tag_reading.stamp.sec == NOW["sec"], "tables sort by it"
    assert message.tag_pose_in_map.orientation.w == 0.0


@pytest.mark.parametrize(
    ("status", "code", "detail", "told"),
    [
        ("UNREACHABLE", "nav_timeout", "", "nav_timeout"),
        ("UNREACHABLE", "", "too far", "too far"),
        ("SCAN_FAILED", "visual_confirm_missed", "tag '5' not discovered", "tag '5' not discovered"),
    ],
)
def test_of_a_drive_the_code_comes_first_and_a_scan_is_told_in_its_servers_words(
    status: str, code: str, detail: str, told: str
) -> None:
    assert observation(published(status, code=code, detail=detail)).status_detail == told


def test_a_code_is_the_reason_where_there_is_no_detail() -> None:
    message = observation(published("SKIPPED", code="skipped_by_operator"))
    assert message.status_detail == "skipped_by_operator"


def test_without_any_pose_w_stays_zero_which_means_never_observed() -> None:
    assert observation(published(reading=READING)).tag_pose_in_map.orientation.w == 0.0


@pytest.mark.parametrize("yaw", [math.pi, -math.pi, 3 * math.pi])
def test_a_true_half_turn_is_never_taken_for_never_observed(yaw: float) -> None:
    pose = to_pose(greenhouse.floor_pose({"x": 0.0, "y": 0.0, "yaw": yaw}))
    assert pose.orientation.w != 0.0
    assert math.hypot(pose.orientation.z, pose.orientation.w) == pytest.approx(1.0)


# --- where a target is

HALF = math.sqrt(0.5)
SEEN = {"id": "5", "x": 3.0, "y": 4.0, "facing": {"x": 0.0, "y": HALF, "z": 0.0, "w": HALF}}
ROBOT = {"x": 1.0, "y": 2.0, "yaw": 0.0}


@pytest.mark.parametrize(
    ("visit", "told"),
    [
        ({"status": "OK", "reading": {"readings": [{"name": "co2", "value": 1.0}]}}, {"sensors": ["co2"]}),
        ({"status": "OK"}, {"sensors": []}),
        ({"status": "UNREACHABLE", "code": "nav_timeout", "detail": "slow"}, {"reason": "slow"}),
        ({"status": "SKIPPED", "code": "mission_aborted"}, {"reason": "mission_aborted"}),
        ({"status": "SCAN_FAILED"}, {"reason": "?"}),
        ({}, {"status": "open", "reason": "?"}),
    ],
)
def test_the_summary_of_a_target_says_what_was_read_or_why_not(
    visit: dict[str, object], told: dict[str, object]
) -> None:
    nothing = {"target": "7", "status": "", "code": "", "detail": "", "reading": None}
    found = messages.visit_record({**nothing, "tries": {"nav.go_to": 2}, **visit}, PROFILE)
    assert found == {"tag": "7", "status": visit.get("status"), "tries": {"nav.go_to": 2}, **told}


def test_a_target_that_was_seen_is_where_it_was_seen_turned_as_its_plate() -> None:
    fields = greenhouse.place_of("5", {"seen": {"4": {**SEEN, "id": "4"}, "5": SEEN}}, ROBOT)
    assert fields is not None
    pose = to_pose(fields)
    assert (pose.position.x, pose.position.y) == (3.0, 4.0)
    q = pose.orientation
    assert (q.x, q.y, q.z, q.w) == (0.0, HALF, 0.0, HALF)


def test_a_place_is_remembered_unless_the_robot_that_reads_there_is_elsewhere() -> None:
    """The aggregator forgets its tags when a mission begins; on another map a place is somewhere else."""
    fold = greenhouse.PROJECTIONS["places"].fold
    known = fold(fold(None, "tags.discovered", [SEEN]), "tags.discovered", [{**SEEN, "id": "6"}])
    near = {"x": 3.5, "y": 4.0, "yaw": 0.0}
    assert greenhouse.place_of("5", known, near) == greenhouse.plate_pose(SEEN)
    far = {"x": 0.0, "y": 4.0, "yaw": 0.0}
    assert greenhouse.place_of("5", known, far) == greenhouse.floor_pose(far)
    assert greenhouse.place_of("6", known, far) == greenhouse.plate_pose(SEEN), "it is seen now"
    many = [{**SEEN, "id": str(number)} for number in range(greenhouse.MOST_PLACES + 5)]
    old = fold(fold(known, "tags.discovered", many), "tags.discovered", [])["before"]
    assert len(old) == greenhouse.MOST_PLACES


def test_one_that_was_not_is_where_the_robot_stands_before_it_if_anybody_knows() -> None:
    fields = greenhouse.place_of("6", {"seen": {"5": SEEN}}, ROBOT)
    assert fields is not None
    pose = to_pose(fields)
    assert (pose.position.x, pose.position.y) == (1.0, 2.0)
    assert greenhouse.place_of("6", {"seen": {"5": SEEN}}, None) is None


@pytest.mark.parametrize(
    ("facing", "w"),
    [
        ({"x": 0.0, "y": 0.0, "z": 0.0, "w": 0.0}, 1.0),  # nobody filled it in
        ({"x": 0.0, "y": 1.0, "z": 0.0, "w": 0.0}, SMALLEST_W),  # a true half turn
    ],
)
def test_a_place_that_is_known_never_looks_unpopulated(facing: dict[str, float], w: float) -> None:
    assert to_pose(greenhouse.plate_pose({**SEEN, "facing": facing})).orientation.w == w


# --- the state


def published_state(
    view: View, request: Mapping[str, int], started: Fields | None = None, **values: object
) -> MissionState:
    """The message that is sent, of the inputs that are known."""
    now = messages.situation(view, CODES, request, values.get, started, NOW)
    return messages.write(MissionState(), greenhouse.state_fields(now))


def state(view: View, discovered: int, goal: int, found: int = 0) -> MissionState:
    known = {"battery": {"value": 1.0, "low": False}, "stopped": False, "found": found}
    seen = [{"id": str(n)} for n in range(discovered)]
    return published_state(view, {"discovery_goal": goal}, discovered=seen, **known)


def counters(message: MissionState) -> tuple[int, ...]:
    return (
        message.targets_total,
        message.targets_completed,
        message.targets_failed,
        message.targets_unreachable,
        message.targets_skipped,
    )


SEARCHING = replace(
    VIEW, lifecycle="EXPLORING", mission="ExplorationMission", total=0, counts=dict.fromkeys(VIEW.counts, 0)
)
WATCHING = replace(VIEW, lifecycle="MONITORING", mission="ExplorationMission", total=5)


def test_a_search_counts_the_tags_that_it_found() -> None:
    message = state(SEARCHING, discovered=3, goal=5)
    assert (message.tags_discovered, message.discovery_goal) == (3, 5)
    assert counters(message) == (5, 3, 0, 0, 0)


def test_with_a_list_of_targets_its_visits_count_and_the_discovery_is_told_beside() -> None:
    """What turns up while the tags are watched is no find of the search."""
    message = state(replace(WATCHING, counts={**VIEW.counts, "OK": 2}), discovered=6, goal=5, found=5)
    assert (message.tags_discovered, message.discovery_goal) == (5, 5)
    assert counters(message) == (5, 2, 1, 1, 0)


def test_on_the_way_to_the_dock_a_search_keeps_its_finds_and_before_it_there_are_none() -> None:
    home = replace(SEARCHING, lifecycle="RETURNING")
    assert state(home, discovered=4, goal=5, found=3).tags_discovered == 3
    assert state(replace(SEARCHING, lifecycle="PREPARE"), discovered=1, goal=5).tags_discovered == 0


@pytest.mark.parametrize("lifecycle", ["BOOT", "READY"])
def test_where_no_mission_runs_or_has_ended_its_fields_are_empty(lifecycle: str) -> None:
    """After a reset: the robot is there again, and the mission that failed is not."""
    reset = replace(WATCHING, lifecycle=lifecycle, target="", code="", detail="", held=(), paused=False)
    message = published_state(reset, {"discovery_goal": 5}, {"sec": 5}, found=5, battery={"value": 0.5})
    empty = MissionState(lifecycle_state=lifecycle, mission_phase="NAVIGATING", battery_percentage=0.5)
    empty.header = message.header
    assert message == empty


def test_in_fault_and_in_the_end_the_mission_is_still_told() -> None:
    for lifecycle in ("FAULT", "DONE"):
        message = state(replace(WATCHING, lifecycle=lifecycle), discovered=6, goal=5, found=5)
        assert (message.mission_id, message.targets_total, message.tags_discovered) == ("lupin-1", 5, 5)


def test_without_a_goal_there_is_no_discovery() -> None:
    message = state(VIEW, discovered=6, goal=0)
    assert (message.tags_discovered, message.discovery_goal) == (0, 0)


def test_a_robot_that_monitors_for_weeks_stays_at_the_highest_count() -> None:
    message = state(replace(WATCHING, counts={"OK": 70_000}), discovered=70_000, goal=5, found=70_000)
    assert (message.targets_completed, message.tags_discovered) == (65_535, 65_535)


def test_the_state_has_label_severity_and_counts_of_the_view() -> None:
    battery = {"value": 0.5, "low": False}
    state = published_state(VIEW, {}, {"sec": 5, "nanosec": 0}, stopped=True, battery=battery)
    assert (state.lifecycle_state, state.mission_phase, state.current_target) == (
        "INSPECTING",
        "NAVIGATING",
        "5",
    )
    assert (state.targets_total, state.targets_completed, state.targets_failed) == (4, 1, 1)
    assert state.last_error == "localization_failed: no pose"
    assert (state.last_event, state.last_event_severity) == ("localization failed", 2)
    assert (state.estop_engaged, state.paused, state.battery_percentage) == (True, True, 0.5)
    assert (state.discovery_goal, state.tags_discovered) == (0, 0)
    assert state.started_at.sec == 5


def test_an_unknown_battery_is_not_a_number() -> None:
    state = published_state(VIEW, {})
    assert math.isnan(state.battery_percentage)
    assert state.estop_engaged is False
    assert state.started_at.sec == 0
