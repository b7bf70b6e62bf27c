"""The pictures of a run, compared as text."""

from __future__ import annotations

import io

import pytest
from rich.console import Console

from lupin_cli.terminal import view
from lupin_cli.terminal.tables import print_network
from lupin_engine.chart.model import Chart
from lupin_engine.plugin.profile import TargetResult
from lupin_greenhouse.messages import read_state
from lupin_greenhouse.profile import PROFILE
from lupin_ros.launch.monitor import RunMonitor
from tests import shipped
from tests.lupin_ros.launch.messages import MISSION_ID, observation, state, step

Interface = pytest.importorskip("lupin_ros.adapter.network", reason="ROS 2 is not installed here").Interface

MISSION = "MISSION.InspectionMission"
INSPECTING = f"{MISSION}.INSPECTING"
DRIVING = ("", "MISSION", MISSION, INSPECTING, f"{INSPECTING}.NAVIGATING", f"{INSPECTING}.NAVIGATING.DRIVING")


@pytest.fixture(scope="module")
def chart() -> Chart:
    """The inspection mission."""
    return shipped.mission("inspection")


@pytest.fixture
def monitor() -> RunMonitor:
    """A mission on its way to the second of three tags, twelve seconds into the second try."""
    monitor = RunMonitor(PROFILE, MISSION_ID, 100.0)
    monitor.take(*state(current_target="1", targets_completed=0), at=100.0)
    monitor.take(*observation("1", {"temperature": 21.5, "co2": 412.0}), at=103.0)
    monitor.take(*state(), at=103.0)
    monitor.take(*step([("nav.go_to", 2, 165.0)], DRIVING, time=105.0), at=105.0)
    return monitor


def drawn(thing: object, width: int = 100, encoding: str = "utf-8") -> str:
    file = io.TextIOWrapper(io.BytesIO(), encoding=encoding)
    console = Console(file=file, width=width, color_system=None, force_terminal=False)
    console.print(thing)
    file.flush()
    buffer = file.buffer
    assert isinstance(buffer, io.BytesIO)
    return buffer.getvalue().decode(encoding)


def test_the_tree_shows_the_outer_states_and_opens_the_active_path(chart: Chart) -> None:
    """The slot is left out; helper end states and history as well."""
    lines = [("  " * line.depth + line.name, line.role) for line in view.tree_lines(chart, DRIVING)]
    assert lines == [
        ("BOOT", "idle"),
        ("READY", "idle"),
        ("InspectionMission", "path"),
        ("  PREPARE", "idle"),
        ("  INSPECTING", "path"),
        ("    NAVIGATING", "path"),
        ("      FOLDING", "idle"),
        ("      DRIVING", "active"),
        ("    SCANNING", "idle"),
        ("    PUBLISHING", "idle"),
        ("RETURNING", "idle"),
        ("DONE", "idle"),
        ("FAULT", "idle"),
    ]


def test_the_picture_tells_where_the_mission_stands(monitor: RunMonitor, chart: Chart) -> None:
    """State, target, counts, time against the deadline, battery, events, targets so far."""
    text = drawn(view.picture(monitor, chart, 117.0))
    for part in (
        "InspectionMission lupin-1  INSPECTING · NAVIGATING  00:17.0",
        "● DRIVING",
        "tag 5",
        "1/3 targets",
        "✔ 1 visited",
        "nav.go_to  try 2",
        "12.0 s of 60 s",
        "83%",
        "00:03.0  tag 1 OK: temperature 21.5, co2 412",
        "1✔  5…",
    ):
        assert part in text
    assert "PAUSED" not in text


def test_a_question_is_in_the_picture(chart: Chart) -> None:
    """With what can be answered, how, and what counts when nobody does."""
    choices = [{"name": name, "label": label} for name, label in (("go_on", "Go on"), ("stay", "Stay here"))]
    asking = {"state": "S", "question": "On to tag 5?", "choices": choices, "default": "stay"}
    monitor = RunMonitor(PROFILE, MISSION_ID, 100.0)
    monitor.take(*step([], time=5.0, asking=[{**asking, "deadline": 95.0, "left": None}]), 110.0)
    text = drawn(view.picture(monitor, chart, 120.0))
    for line in ("On to tag 5?", "1, or lupin answer go_on: Go on", "2, or lupin answer stay: Stay here"):
        assert line in text
    assert "else stay in 01:20" in text
    monitor.take(*step([], time=6.0, asking=[{**asking, "deadline": None, "left": 30.0}]), 111.0)
    assert "else stay with 00:30.0 left; the clock stands still" in drawn(view.picture(monitor, chart, 120.0))


def test_flags_are_in_the_title(monitor: RunMonitor, chart: Chart) -> None:
    """They are what an operator must not miss."""
    monitor.take(*state(paused=True, estop_engaged=True, battery_low=True), at=118.0)
    first = drawn(view.picture(monitor, chart, 118.0), width=120).splitlines()[0]
    assert all(pill in first for pill in (" E-STOP ", " PAUSED ", " BATTERY LOW "))


@pytest.mark.parametrize("width", [60, 80, 100, 200])
def test_the_picture_keeps_its_size(monitor: RunMonitor, chart: Chart, width: int) -> None:
    """It is redrawn in place: no line may be longer than the terminal, and none may come and go."""
    heights = set()
    for moment in (105.0, 150.0, 170.0):
        lines = drawn(view.picture(monitor, chart, moment), width=width).splitlines()
        assert max(map(len, lines)) <= width
        heights.add(len(lines))
    assert len(heights) == 1


def test_a_terminal_without_unicode_gets_ascii(monitor: RunMonitor, chart: Chart) -> None:
    """Over a serial line as well."""
    text = drawn(view.picture(monitor, chart, 117.0), encoding="ascii")
    assert "* DRIVING" in text
    assert "+ 1 visited" in text


def test_the_table_is_hollow_where_a_tag_lacks_the_sensor() -> None:
    """Known sensors in their order with their unit, then others; failures with their reason."""
    readings = [
        TargetResult("1", "OK", "", {"co2": 412.0, "temperature": 21.5}),
        TargetResult("5", "SCAN_FAILED", "scan_timeout", {}),
        TargetResult("12", "OK", "", {"wind": 3.0, "humidity": 55.123}),
    ]
    rows = [line.split() for line in drawn(view.results_table(readings, PROFILE)).splitlines()]
    assert ["tag", "status", "°C", "%", "ppm", "wind", "reason"] in rows
    assert ["1", "OK", "21.5", "·", "412", "·"] in rows
    assert ["5", "SCAN_FAILED", "·", "·", "·", "·", "scan_timeout"] in rows
    assert ["12", "OK", "·", "55.12", "·", "3"] in rows
    assert view.value_columns(readings, PROFILE) == ["temperature", "humidity", "co2", "wind"]


def test_the_summary_is_one_sentence(monitor: RunMonitor) -> None:
    """How it ended, what was visited, how long it took, and for a failure what was said last."""
    assert view.summary(monitor, 117.0).plain == "given up in INSPECTING: 1 visited of 3 targets in 17.0 s"
    failed = state(lifecycle_state="DONE", targets_completed=2, targets_failed=1, last_error="scan_timeout")
    monitor.take(*failed, at=120.0)
    assert view.summary(monitor, 140.0).plain == (
        "DONE: 2 visited, 1 failed of 3 targets in 20.0 s; last: scan_timeout"
    )


def test_a_state_is_one_plain_line() -> None:
    """For logs and pipes."""
    assert view.plain_state(read_state(state()[1]), PROFILE) == "INSPECTING NAVIGATING  tag 5  1/3"
    done = state(lifecycle_state="DONE", mission_phase="", current_target="", targets_completed=3)
    assert view.plain_state(read_state(done[1]), PROFILE) == "DONE  3/3"


def searching(**fields: object) -> tuple[str, dict[str, object]]:
    """The state of a mission that searches for five tags and has found two."""
    found = {"targets_total": 5, "targets_completed": 2, "discovery_goal": 5, "tags_discovered": 2}
    return state(
        **{"lifecycle_state": "EXPLORING", "mission_phase": "", "current_target": "", **found, **fields}
    )


def test_a_search_shows_the_tags_found(chart: Chart) -> None:
    """Its counters are of the search: nothing has been visited yet."""
    monitor = RunMonitor(PROFILE, MISSION_ID, 100.0)
    monitor.take(*searching(), at=100.0)
    assert "2/5 tags found" in drawn(view.picture(monitor, chart, 101.0))
    assert (
        view.plain_state(read_state(searching()[1]), PROFILE, searching=True) == "EXPLORING  2/5 tags found"
    )
    monitor.take(*searching(lifecycle_state="DONE"), at=110.0)
    assert view.summary(monitor, 140.0).plain == "DONE: 2/5 tags found in 10.0 s"


def test_what_was_found_and_visited_is_told_together(chart: Chart) -> None:
    """Two sweeps over what was found: more visits than targets."""
    monitor = RunMonitor(PROFILE, MISSION_ID, 100.0)
    found = searching(
        lifecycle_state="DONE", current_target="7", tags_discovered=5, targets_total=5, targets_completed=10
    )
    monitor.take(*found, at=110.0)
    assert view.summary(monitor, 110.0).plain == ("DONE: 5/5 tags found, 10 visited of 5 targets in 10.0 s")
    assert "10 visits to 5 targets" in drawn(view.picture(monitor, chart, 110.0))


def test_durations() -> None:
    """Minutes and seconds; never negative."""
    assert [view.clock(s) for s in (0.04, 61.25, 3600.0, -1.0)] == [
        "00:00.0",
        "01:01.2",
        "60:00.0",
        "00:00.0",
    ]


def test_the_strip_of_targets_keeps_the_current_one_in_sight(monitor: RunMonitor, chart: Chart) -> None:
    """Also after many of them, and where it is visited a second time."""
    for number in range(100, 130):
        monitor.take(*observation(str(number)), at=110.0)
    last = drawn(view.picture(monitor, chart, 117.0), width=72).splitlines()[-1]
    assert last == "╰─ … 120✔  121✔  122✔  123✔  124✔  125✔  126✔  127✔  128✔  129✔  5…  ──╯"
    monitor.take(*state(current_target="110"), at=111.0)
    again = drawn(view.picture(monitor, chart, 117.0), width=72).splitlines()[-1]
    assert " 110✔ " in again
    monitor.take(*state(current_target="1"), at=112.0)
    assert drawn(view.picture(monitor, chart, 117.0), width=72).splitlines()[-1].startswith("╰─  1✔  100✔ ")


LONG = "/perception/front_camera/detections/confirmed_by_the_second_look"
NETWORK = [
    Interface("topic", LONG, "perception_msgs/msg/ConfirmedDetections", ("/perception_aggregator",), ()),
    Interface("service", "/go", "std_srvs/srv/Trigger", ("/base",), ("/mission_orchestrator", "/operator")),
]


@pytest.mark.parametrize("width", [20, 40, 80, 200])
def test_no_name_of_the_map_is_ever_broken(
    width: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A table where there is room for it, else everything below each other."""
    monkeypatch.setenv("COLUMNS", str(width))
    print_network(NETWORK)
    told = capsys.readouterr().out
    words = told.replace(",", " ").split()
    for interface in NETWORK:
        ends = (name.removeprefix("/") for name in (*interface.producers, *interface.consumers))
        for name in (interface.name, interface.type, *ends):
            assert name in words
    if width == 80:
        assert [line.rstrip() for line in told.splitlines()] == [
            "topics",
            f"  {LONG}  perception_msgs/msg/ConfirmedDetections",
            "    published by perception_aggregator",
            "    read by nobody",
            "",
            "services",
            "",
            " name and type          served by   called by",
            " " + "─" * 55,
            " /go                    base        mission_orchestrator",
            " std_srvs/srv/Trigger               operator",
            "",
            "everybody understands everybody",
        ]


def test_a_mission_without_targets_says_nothing_of_targets(chart: Chart) -> None:
    """Neither in the picture nor in a line nor in the last one."""
    monitor = RunMonitor(PROFILE, MISSION_ID, 100.0)
    none = {"targets_total": 0, "targets_completed": 0, "current_target": ""}
    monitor.take(*state(**none), at=100.0)
    assert "no targets" in drawn(view.picture(monitor, chart, 101.0))
    assert view.plain_state(read_state(state(**none)[1]), PROFILE) == "INSPECTING NAVIGATING"
    monitor.take(*state(lifecycle_state="DONE", mission_phase="", **none), at=110.0)
    assert view.summary(monitor, 140.0).plain == "DONE in 10.0 s"
