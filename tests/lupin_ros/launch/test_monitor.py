"""A mission as its messages tell it."""

from __future__ import annotations

from typing import Any

import pytest

from lupin_engine.errors import Severity
from lupin_engine.machine.step import CodeEvent
from lupin_greenhouse.profile import PROFILE
from lupin_ros.launch.monitor import RunMonitor
from tests.lupin_ros.launch.messages import anomaly, flowers, observation, state, step

ID = "lupin-1"
START = {"command": "start", "attempt": "a1", "operation": "nav.go_to", "arguments": {}}
CANCEL = {"command": "cancel", "attempt": "a1", "operation": "nav.go_to"}


def told(*messages: tuple[str, dict[str, Any]]) -> RunMonitor:
    """A monitor that began at 100 s and got one message a second."""
    monitor = RunMonitor(PROFILE, ID, 100.0)
    for second, (kind, data) in enumerate(messages):
        monitor.take(kind, data, 100.0 + second)
    return monitor


def texts(monitor: RunMonitor) -> list[tuple[float, str]]:
    return [(h.elapsed, h.text) for h in monitor.happenings]


def test_the_past_of_other_missions_is_not_taken_in() -> None:
    """Latched topics bring it to everybody who joins."""
    monitor = RunMonitor(PROFILE, ID, 0.0)
    other = "lupin-0"
    assert not monitor.take("state", state(mission_id=other)[1], 1.0)
    assert not monitor.take("observation", observation("1", mission_id=other)[1], 1.0)
    assert not monitor.take("step", step([], mission_id=other)[1], 1.0)
    assert (monitor.lifecycle, monitor.results, monitor.view) == ("", {}, {})


@pytest.mark.parametrize(
    ("lifecycle", "completed", "verdict"),
    [("DONE", 3, 0), ("DONE", 2, 1), ("FAULT", 3, 2), ("INSPECTING", 3, 2)],
)
def test_the_verdict_is_the_exit_code(lifecycle: str, completed: int, verdict: int) -> None:
    """0 all visited, 1 some missed, 2 fault or not ended."""
    monitor = told(state(lifecycle_state=lifecycle, targets_total=3, targets_completed=completed))
    assert monitor.verdict == verdict
    assert monitor.ended == (lifecycle in ("DONE", "FAULT"))


def test_readings_and_failures_become_events() -> None:
    """A reading with its values; a failure with its reason, as a warning."""
    monitor = told(
        observation("1", {"temperature": 20.0, "co2": 400.25}),
        observation("5", status=2, detail="scan_timeout"),
    )
    assert texts(monitor) == [
        (0.0, "tag 1 OK: temperature 20, co2 400.2"),
        (1.0, "tag 5 SCAN_FAILED: scan_timeout"),
    ]
    assert [h.severity for h in monitor.happenings] == [Severity.INFO, Severity.WARN]
    assert monitor.results["5"].status == "SCAN_FAILED"


def test_flowers_and_anomalies_are_events_and_no_readings() -> None:
    """What the cameras find is told; targets are counted by their readings alone."""
    monitor = told(
        flowers("5", "tulip_red", blooms=3),
        flowers("6", "", anomaly=True),
        anomaly("bug seen"),
    )
    assert [(h.severity, h.text) for h in monitor.happenings] == [
        (Severity.INFO, "tag 5: tulip_red (0.90), blooms: 3"),
        (Severity.WARN, "tag 6: no species (0.00), blooms: 1, anomaly"),
        (Severity.WARN, "anomaly at x 1.00 m, y 2.50 m: bug seen"),
    ]
    assert (monitor.results, monitor.received) == ({}, 0)


def test_an_observation_of_a_later_build_is_passed_over() -> None:
    """A kind that is not known yet."""
    monitor = RunMonitor(PROFILE, ID, 0.0)
    assert not monitor.take(*anomaly("", kind=7), 1.0)
    assert monitor.happenings == []


def test_flags_and_errors_become_events_once() -> None:
    """Five messages a second repeat them. A code is told for each step that reports it."""
    paused = state(
        paused=True,
        estop_engaged=True,
        last_error="estop_engaged",
        last_event="e-stop engaged",
        last_event_severity=1,
    )
    engaged = CodeEvent("estop_engaged", "e-stop engaged", Severity.WARN, "", "")
    late = CodeEvent("late", "late", Severity.INFO, "5 s", "7")
    monitor = told(
        state(),
        paused,
        step([], codes=[engaged]),
        paused,
        state(last_error="estop_engaged"),
        step([], codes=[late, late]),
    )
    assert texts(monitor) == [
        (1.0, "paused"),
        (2.0, "e-stop engaged (estop_engaged)"),
        (4.0, "e-stop released"),
        (4.0, "resumed"),
        (5.0, "tag 7: late (late: 5 s)"),
        (5.0, "tag 7: late (late: 5 s)"),
    ]
    assert monitor.happenings[-1].severity is Severity.INFO


def test_time_runs_against_the_deadline_of_the_orchestrator() -> None:
    """Its clock has another origin; what counts is the distance."""
    monitor = told(step([("nav.go_to", 1, 5060.0)], time=5000.0))
    (running,) = monitor.running(112.0)
    assert (running.operation, running.since, running.limit) == ("nav.go_to", 12.0, 60.0)
    monitor.take("step", step([("nav.go_to", 2, 5090.0)], time=5030.0)[1], 130.0)
    (running,) = monitor.running(131.0)
    assert (running.tries, running.since, running.limit) == (2, 1.0, 60.0)
    monitor.take("step", step([("nav.go_to", 2, None)], time=5031.0)[1], 131.0)
    assert monitor.running(140.0)[0].limit is None


def test_a_goal_is_under_way_until_its_server_says_so() -> None:
    """Also when the mission itself has moved on: a cancel takes its time."""
    monitor = told(step([], commands=[START]))
    assert monitor.busy
    monitor.take("step", step([], commands=[CANCEL])[1], 101.0)
    assert monitor.busy
    monitor.take("step", step([], event="attempt.cancelled", attempt="a1")[1], 102.0)
    assert not monitor.busy


def searching(found: int, lifecycle: str = "EXPLORING", **fields: Any) -> tuple[str, dict[str, Any]]:
    """The state of a search for three tags."""
    numbers = {"targets_total": 3, "targets_completed": found, "discovery_goal": 3, "tags_discovered": found}
    return state(lifecycle_state=lifecycle, mission_phase="", current_target="", **{**numbers, **fields})


def test_a_search_tells_where_it_drives_and_what_it_finds() -> None:
    """The frontier from the result of its choice; the tags as they become more."""
    start = {**START, "operation": "nav.choose_frontier"}
    chosen = step([], event="attempt.done", attempt="a1")
    chosen[1]["step"]["data"]["result"] = {"pose": {"x": 1.0, "y": 2.5, "yaw": 0.0}}
    monitor = told(
        step([], commands=[start]),
        chosen,
        searching(0),
        searching(1),
        searching(1),
        searching(3),
        searching(4),
    )
    assert texts(monitor) == [
        (1.0, "nav.choose_frontier: x 1.00 m, y 2.50 m"),
        (3.0, "1/3 tags found"),
        (5.0, "3/3 tags found"),
        (6.0, "4 tags found"),
    ]


@pytest.mark.parametrize(
    ("found", "visited", "targets", "verdict"),
    [(3, 3, 3, 0), (3, 6, 3, 0), (2, 2, 2, 1), (3, 2, 3, 1), (0, 0, 0, 1), (3, 3, 0, 1)],
)
def test_a_search_is_done_when_its_goal_was_found_and_everything_visited(
    found: int, visited: int, targets: int, verdict: int
) -> None:
    """Without any target there was no visit, whatever the counters of the search say."""
    walked = step([])
    walked[1]["view"]["total"] = targets
    end = searching(found, "DONE", targets_completed=visited, targets_total=targets or 3)
    assert told(walked, end).verdict == verdict


def test_all_is_told_when_every_published_outcome_has_come() -> None:
    """Also of a second sweep, and of readings that are no visit: the steps tell what was published."""
    told_of = {"source": "bridge", "mission_id": ID, "target": "1", "status": "OK"}
    publish = {"command": "publish", **told_of}
    monitor = told(step([], commands=[publish, publish]), observation("1"))
    assert not monitor.all_received
    monitor.take(*observation("1"), at=105.0)
    assert monitor.all_received
    assert list(monitor.results) == ["1"]
    monitor.take(*state(targets_total=1, targets_completed=3), at=106.0)
    assert not monitor.all_received


def test_the_newest_reading_of_a_tag_is_the_last() -> None:
    """A tag that is read again is news again."""
    monitor = told(observation("1"), observation("2"), observation("1", status=2, detail="scan_timeout"))
    assert [(r.target, r.status) for r in monitor.results.values()] == [("2", "OK"), ("1", "SCAN_FAILED")]


def test_the_clock_stops_at_the_end() -> None:
    """The summary tells how long the mission took, not how long stopping took."""
    monitor = told(state(), state(lifecycle_state="DONE"))
    assert monitor.elapsed(200.0) == 1.0


def asked(deadline: float | None, left: float | None = None) -> dict[str, Any]:
    """A question as a view tells it."""
    choices = [{"name": name, "label": name.upper(), "severity": 0} for name in ("go_on", "stay")]
    told = {"state": "S", "question": "Go on?", "choices": choices, "default": "stay"}
    return {**told, "deadline": deadline, "left": left}


def test_a_question_is_told_once_and_runs_against_its_deadline() -> None:
    """Also a hold that stops its clock is seen."""
    monitor = told(step([], time=5.0, asking=[asked(20.0)]), step([], time=6.0, asking=[asked(20.0)]))
    assert texts(monitor) == [(0.0, "Go on? (lupin answer go_on or lupin answer stay)")]
    (question,) = monitor.asking(103.0)
    assert (question.choices, question.default) == ((("go_on", "GO_ON"), ("stay", "STAY")), "stay")
    assert (question.left, question.stopped) == (12.0, False)
    monitor.take(*step([], time=8.0, asking=[asked(None, 12.0)]), 103.0)
    (question,) = monitor.asking(150.0)
    assert (question.left, question.stopped) == (12.0, True)
    monitor.take(*step([], time=9.0), 151.0)
    assert monitor.asking(151.0) == []
    assert len(monitor.happenings) == 1
