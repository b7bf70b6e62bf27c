"""The panel of today against real processes: all that it uses over ROS 2, as it uses it."""

from __future__ import annotations

import json
import math
import re
import signal
from collections.abc import Iterator
from itertools import pairwise
from statistics import median
from typing import Any

import pytest

pytest.importorskip("greenhouse_sim", reason="mdp-greenhouse is not installed here")

from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy

from lupin_harness.domains import claimed_domain
from tests.lupin_ros.launch.hmi.panel import Json, Panel
from tests.lupin_ros.launch.hmi.rows import (
    CALLED,
    FIELD,
    LATCHED,
    NOT_OURS,
    PERIODS,
    POSE,
    READ,
    READ_BESIDE,
    READ_IN_TEXT,
    ROBOT,
    SERVOS,
    SHOWN,
    TOLD,
    UNITS,
    unread,
)
from tests.lupin_ros.launch.processes import Lupin

pytestmark = [
    pytest.mark.timeout(300),
    pytest.mark.filterwarnings("ignore:module 'sre_.*' is deprecated:DeprecationWarning"),
]

#: Messages for which the tests have room, so that they miss nothing of what was sent at once: the gateway
#: keeps ten, and of an abort, which tells the outcome of every target that is left, a page may miss some.
ROOM = 100

OK, UNREACHABLE, SCAN_FAILED, SKIPPED = range(4)
READING = 0

# --- the scene --------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def up(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Lupin]:
    """All missions and everything simulated, as an operator starts it; ends when asked, leaves nothing."""
    folder = tmp_path_factory.mktemp("hmi")
    library = f"lupin_arm.library_path={folder / 'arm_library.json'}"
    quick = ("localization_timeout_s=5 s", "lupin_arm.preset_duration=1 s", "lupin_arm.init_duration=1 s")
    settings = [part for value in (library, *quick) for part in ("--set", value)]
    with claimed_domain() as domain, pytest.MonkeyPatch.context() as patch:
        patch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        command = Lupin("up", "--speed", "4", *settings, domain=domain, log_dir=folder / "log")
        try:
            command.until_line("Ctrl-C stops everything", 120.0)
            yield command
            command.process.send_signal(signal.SIGINT)
            assert command.end() == 0, command.output
            assert command.processes() == {}
            assert "Traceback" not in command.output
        finally:
            command.kill()


@pytest.fixture(scope="module")
def page(up: Lupin) -> Iterator[Panel]:
    """A page that was open all the time, and has seen a mission."""
    page = Panel(up.domain)
    topics = {**SHOWN, **READ_BESIDE}
    page.knows(topics)
    for topic, (kind, _) in topics.items():
        page.subscribe(topic, kind, depth=ROOM)
    page.subscribe("/tf_static", "tf2_msgs/TFMessage")
    explore(page)
    yield page
    page.close()


@pytest.fixture
def panel(page: Panel) -> Panel:
    """The page, its stop reset, and a robot that is well, fast, and has nothing to do."""
    page.reset()
    simulate(page, battery=1.0, fault="none", speed=2.0)
    page.fresh("/mission/state")
    page.until(
        lambda: not (page.state["estop_engaged"] or page.state["battery_low"]), "nothing pressed or low"
    )
    if page.state["lifecycle_state"] not in ("READY", "DONE"):  # left by a test that failed
        page.call("/mission/abort", "std_srvs/Trigger")
        page.call("/mission/reset", "std_srvs/Trigger")
    page.until(lambda: page.state["lifecycle_state"] in ("READY", "DONE"), "READY or DONE")
    return page


def explore(page: Panel) -> None:
    """Let a mission find, read and look at some tags."""
    page.until(lambda: page.state["estop_engaged"], "the stop of a page that was just loaded")
    page.reset()
    answer = page.start("ExplorationMission", goal=3)
    assert answer["accepted"], answer
    page.until(lambda: [o for o in readings(page) if o["source"] == "MonitoringMission"], "a visit")
    page.press("abort")
    page.until(lambda: page.state["lifecycle_state"] == "DONE", "the end of the exploration")


def simulate(page: Panel, **values: float | str) -> None:
    """Change the simulated robot, which no page can."""
    parameters = [Parameter(name, value=value).to_parameter_msg() for name, value in values.items()]
    answer = page.call(f"/{ROBOT}/set_parameters", "rcl_interfaces/SetParameters", parameters=parameters)
    assert all(result["successful"] for result in answer["results"]), answer


def readings(page: Panel) -> list[Json]:
    """Return the readings that the table of the page has."""
    return [o for o in page.all("/floranova/observations") if o["kind"] == READING]


def by_source(page: Panel) -> dict[str, list[Json]]:
    """Return when the latest observations were made, by who made them: as many as are kept for late pages."""
    found: dict[str, list[Json]] = {}
    for observation in page.all("/floranova/observations"):
        found.setdefault(observation["source"], []).append(observation["header"]["stamp"])
    return {source: stamps[-10:] for source, stamps in found.items()}


def text(page: Panel, topic: str) -> Any:
    """Return the JSON in a topic's last message; what a browser could not read is an error."""

    def refuse(word: str) -> Any:
        raise AssertionError(f"{word} in {topic}")

    return json.loads(page.last(topic)["data"], parse_constant=refuse)


def servers(page: Panel) -> dict[str, dict[str, str]]:
    """Return who serves what: type by service, by node."""
    nodes = page.node.get_node_names_and_namespaces()
    return {
        name: {
            service: kinds[0]
            for service, kinds in page.node.get_service_names_and_types_by_node(name, namespace)
        }
        for name, namespace in nodes
        if name != page.node.get_name()
    }


def full(kind: str, group: str) -> str:
    """Return the name of a type as the graph has it."""
    package, _, name = kind.partition("/")
    return f"{package}/{group}/{name}"


# --- every row --------------------------------------------------------------------------------------------


def test_every_topic_that_it_shows_is_published_by_ours_with_its_type(panel: Panel) -> None:
    for topic, (kind, nodes) in {**SHOWN, **READ_BESIDE}.items():
        found = panel.node.get_publishers_info_by_topic(topic)
        assert {info.topic_type for info in found} == {full(kind, "msg")}, topic
        assert {info.node_name for info in found} >= nodes, topic
        for info in found:
            assert info.qos_profile.reliability is ReliabilityPolicy.RELIABLE, topic
            latched = info.qos_profile.durability is DurabilityPolicy.TRANSIENT_LOCAL
            assert latched is (topic in LATCHED) or topic == "/rosout", topic


def test_every_topic_that_it_tells_is_heard_by_ours_with_its_type(panel: Panel) -> None:
    for topic, (kind, nodes) in TOLD.items():
        found = panel.node.get_subscriptions_info_by_topic(topic)
        assert {info.topic_type for info in found} == {full(kind, "msg")}, topic
        assert {info.node_name for info in found} == nodes, topic


def test_every_service_that_it_calls_is_served_by_one_of_ours_with_its_type(panel: Panel) -> None:
    served = servers(panel)
    for service, (kind, node) in CALLED.items():
        by = {name: found[service] for name, found in served.items() if service in found}
        assert by == {node: full(kind, "srv")}, service


def test_what_is_not_ours_is_nobodys(panel: Panel) -> None:
    """Whoever serves one of these one day moves it to the tables above."""
    for name, reason in NOT_OURS.items():
        assert not panel.node.get_publishers_info_by_topic(name), (name, reason)
        others = [
            i for i in panel.node.get_subscriptions_info_by_topic(name) if i.node_name in servers(panel)
        ]
        assert name == "/tf_static" or not others, (name, reason)
        assert not any(name in found for found in servers(panel).values()), (name, reason)


# --- coming late ------------------------------------------------------------------------------------------


def test_a_page_that_is_loaded_later_shows_all_that_is_known(up: Lupin, panel: Panel) -> None:
    """Nothing changes meanwhile; every field that it reads is there, of the type that it expects."""
    late = Panel(up.domain, "late")
    late.reset()
    topics = {topic: kind for topic, (kind, _) in {**SHOWN, **READ_BESIDE}.items() if topic != "/plan"}
    late.knows(topics)
    for topic, kind in topics.items():
        late.subscribe(topic, kind, depth=ROOM)
    try:
        late.call(
            "/mission/pause", "std_srvs/Trigger"
        )  # refused, and logged: else nobody may have a word to say
        late.until(lambda: all(map(late.count, topics)), "a message of each topic")
        assert [unread(late.last(topic), wanted, topic) for topic, wanted in READ.items()] == [[]] * len(READ)
        for topic, wanted in READ_IN_TEXT.items():
            assert unread(text(late, topic), wanted, topic) == []

        # Observations are told once: of each source, what this page has seen last, the late one has in order.
        def alike() -> bool:
            panel.work()
            return by_source(late) == by_source(panel)

        late.until(alike, "the backlog")
        for observation in late.all("/floranova/observations"):
            assert unread(observation, READ["/floranova/observations"], "observation") == []
    finally:
        late.close()


def test_a_page_that_hears_nothing_latched_is_told_again(up: Lupin, panel: Panel) -> None:
    """The gateway may not know a publisher yet: then a page hears only what comes after."""
    raced = Panel(up.domain, "raced")
    raced.reset()
    again = {**SHOWN, **READ_BESIDE}
    for event in ("/floranova/observations", "/plan", "/rosout"):
        del again[event]
    for topic, (kind, _) in again.items():
        raced.subscribe(topic, kind, hears_latched=False)
    try:
        raced.until(lambda: all(map(raced.count, again)), "a message of each topic")
        raced.until(lambda: all(raced.count(topic) > 5 for topic in PERIODS), "some of each")
        for topic, period in PERIODS.items():
            between = median(b - a for a, b in pairwise(raced.arrivals(topic)))
            assert period / 2 < between < period * 2, topic
    finally:
        raced.close()


def test_what_is_shown_of_the_world_is_in_the_units_that_are_written_beside_it(panel: Panel) -> None:
    state, twin = panel.state, panel.last("/twin/state")
    assert 0.0 <= state["battery_percentage"] <= 1.0
    assert state["started_at"]["sec"] > 1e9
    assert {tag["tag_id"] for tag in twin["tags"]} >= {o["tag_reading"]["tag_id"] for o in readings(panel)}
    visited = [tag for tag in twin["tags"] if tag["readings"]]
    for tag in visited:
        assert tag["tag_id"].isdecimal()
        assert tag["pose"]["orientation"]["w"] != 0.0
        assert tag["last_observed"]["sec"] > 1e9  # wall clock, so the page counts the age from it
        assert 0.0 <= tag["stale_seconds"] < 300.0
        for reading in tag["readings"]:
            low, high = UNITS[reading["name"]]
            assert low <= reading["value"] <= high, reading
    bloomed = [tag for tag in visited if tag["flowers"]]
    assert bloomed
    for tag in bloomed:
        assert tag["species"] in ("tulip_red", "tulip_white", "tulip_pink")
        assert 0.0 < tag["species_confidence"] <= 1.0
        assert len(tag["box_footprint"]["points"]) == 4
        assert all(bloom["position"]["z"] == 0.0 for bloom in tag["flowers"])


def test_the_map_and_the_robot_on_it(panel: Panel) -> None:
    """The map has free, occupied and unknown cells by the panel's thresholds; the robot stands at home."""
    grid = panel.last("/map")
    assert len(grid["data"]) == grid["info"]["width"] * grid["info"]["height"]
    assert {cell <= 20 for cell in grid["data"] if cell >= 0} == {True, False}
    assert all(cell <= 20 or cell >= 65 for cell in grid["data"])
    assert min(grid["data"]) == -1
    panel.fresh("/tf")
    place = panel.place()
    assert place is not None
    assert math.dist(place[:2], (0.5, 0.5)) < 0.05
    assert panel.count("/tf_static") == 0


def test_a_click_on_the_map_drives_there_and_a_stop_ends_it(panel: Panel) -> None:
    """The plan is shown while it drives; after a stop and a reset it stays where it is."""

    def click(x: float, y: float) -> None:
        position, orientation = {"x": x, "y": y, "z": 0.0}, {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}
        pose = {"position": position, "orientation": orientation}
        panel.publish(
            "/goal_pose", "geometry_msgs/PoseStamped", {"header": {"frame_id": "map"}, "pose": pose}
        )

    def at(x: float, y: float) -> bool:
        place = panel.place()
        return place is not None and math.dist(place[:2], (x, y)) < 0.05

    plans = panel.count("/plan")
    click(0.5, 1.5)
    panel.until(lambda: panel.count("/plan") > plans, "a plan")
    plan = panel.all("/plan")[plans]
    assert plan["header"]["frame_id"] == "map"
    ends = [pose["pose"]["position"] for pose in plan["poses"]]
    assert math.dist((ends[0]["x"], ends[0]["y"]), (0.5, 0.5)) < 0.5
    assert (ends[-1]["x"], ends[-1]["y"]) == (0.5, 1.5)
    assert unread(plan, {"poses": [{"pose": POSE}]}, "plan") == []
    panel.until(lambda: at(0.5, 1.5), "there")

    simulate(panel, speed=0.2)
    click(0.5, 0.5)
    panel.until(lambda: not at(0.5, 1.5), "on the way back")
    panel.stop()
    panel.until(lambda: panel.state["estop_engaged"], "the stop")
    panel.reset()
    panel.until(lambda: not panel.state["estop_engaged"], "the reset")
    stands_still(panel)
    simulate(panel, speed=2.0)
    click(0.5, 0.5)
    panel.until(lambda: at(0.5, 0.5), "home")


def stands_still(panel: Panel) -> tuple[float, float, float] | None:
    """Return where the robot is, which is where it stays."""

    def told() -> tuple[float, float, float] | None:
        for _ in range(5):
            panel.fresh("/tf")
        return panel.place()

    place = told()
    assert told() == place
    return place


# --- missions ---------------------------------------------------------------------------------------------


def in_state(panel: Panel, lifecycle: str, phase: str = "") -> bool:
    state = panel.state
    return bool(state["lifecycle_state"] == lifecycle and phase in ("", state["mission_phase"]))


def patrol(panel: Panel) -> str:
    """Press "Patrol known tags", and catch the robot on its way to the first."""
    simulate(panel, speed=0.05)
    answer = panel.start("InspectionMission")
    assert answer == {"accepted": True, "mission_id": answer["mission_id"], "error_message": ""}
    panel.until(lambda: in_state(panel, "INSPECTING", "NAVIGATING"), "on the way")
    return str(answer["mission_id"])


def end(panel: Panel) -> None:
    """Abort what runs, before the robot is anywhere, and wait until it is home."""
    assert panel.press("abort") == {"success": True, "message": "abort accepted"}
    simulate(panel, speed=5.0)
    panel.until(lambda: in_state(panel, "DONE"), "home")


def outcomes(panel: Panel, mission_id: str) -> list[tuple[str, int]]:
    """Return the tags of a mission that have their result, as the table gets them."""
    return [
        (o["tag_reading"]["tag_id"], o["status"]) for o in readings(panel) if o["mission_id"] == mission_id
    ]


def test_explore_and_monitor(panel: Panel) -> None:
    """What the page has seen when it was open from the beginning."""
    states = panel.all("/mission/state")
    first = states[0]
    assert (first["lifecycle_state"], first["mission_id"], first["started_at"]["sec"]) == ("READY", "", 0)
    lifecycles = [s["lifecycle_state"] for s in states]
    order = sorted(set(lifecycles), key=lifecycles.index)
    passed = [name for name in order if name in ("READY", "EXPLORING", "MONITORING", "RETURNING", "DONE")]
    assert passed == ["READY", "EXPLORING", "MONITORING", "RETURNING", "DONE"]
    searching = [s for s in states if s["lifecycle_state"] == "EXPLORING"]
    assert all(s["mission_phase"] == "" and s["discovery_goal"] == 3 for s in searching)
    counts = [s["tags_discovered"] for s in searching]
    assert counts == sorted(counts)
    watching = [s for s in states if s["lifecycle_state"] == "MONITORING"]
    assert {s["mission_phase"] for s in watching} >= {"NAVIGATING", "SCANNING"}
    assert all(s["current_target"].isdecimal() for s in watching)
    assert {s["mission_type"] for s in searching + watching} == {"ExplorationMission"}
    sources = {o["source"] for o in readings(panel) if o["mission_id"]}
    assert sources == {"ExplorationMission", "MonitoringMission"}
    visits = [o for o in readings(panel) if o["source"] == "MonitoringMission"]
    assert all(o["status"] == OK and o["tag_reading"]["readings"] for o in visits)
    # A sighting on the map: fresh, and where the tag is.
    assert all(o["tag_pose_in_map"]["orientation"]["w"] != 0.0 for o in visits)
    assert all(o["header"]["stamp"]["sec"] - o["tag_reading"]["stamp"]["sec"] <= 5 for o in visits)


def test_a_patrol_is_paused_resumed_skipped_docked_and_aborted(panel: Panel) -> None:
    mission = patrol(panel)
    assert re.fullmatch(r"lupin-[0-9a-f]{8}", mission)
    state = panel.state
    assert (state["mission_type"], state["mission_id"]) == ("InspectionMission", mission)
    assert (state["targets_total"], state["current_target"]) == (29, "1")
    assert (state["tags_discovered"], state["discovery_goal"]) == (0, 0)
    assert panel.buttons() == {"pause", "skip_current", "abort"}
    again = {"mission_type": "InspectionMission", "tag_sequence": [], "discovery_goal": 0}
    assert panel.call("/mission/start", "lupin_msgs/StartMission", **again) == {
        "accepted": False,
        "mission_id": "",
        "error_message": "start refused: a mission is already running",
    }

    assert panel.press("pause") == {"success": True, "message": "pause accepted"}
    panel.until(lambda: panel.state["paused"], "paused")
    assert panel.buttons() == {"resume", "skip_current", "abort"}
    refused = {"success": False, "message": "pause refused: paused by the operator"}
    assert panel.call("/mission/pause", "std_srvs/Trigger") == refused
    assert panel.press("resume") == {"success": True, "message": "resume accepted"}
    panel.until(lambda: not panel.state["paused"] and in_state(panel, "INSPECTING", "NAVIGATING"), "driving")
    assert panel.state["current_target"] == "1"

    assert panel.press("skip_current") == {"success": True, "message": "skip_current accepted"}
    panel.until(lambda: panel.state["current_target"] == "2", "the second tag")
    assert panel.state["targets_skipped"] == 1
    panel.until(lambda: outcomes(panel, mission), "the row of the first tag")
    assert outcomes(panel, mission) == [("1", SKIPPED)]

    assert panel.call("/mission/dock", "std_srvs/Trigger") == {"success": True, "message": "dock accepted"}
    simulate(panel, speed=5.0)
    panel.until(lambda: in_state(panel, "RETURNING") and panel.state["paused"], "docked")
    simulate(panel, speed=0.05)
    assert panel.press("resume") == {"success": True, "message": "resume accepted"}
    panel.until(lambda: in_state(panel, "INSPECTING", "NAVIGATING"), "on the way again")
    assert panel.state["current_target"] == "2"

    end(panel)
    last = panel.state
    assert last["mission_id"] == mission
    assert (last["last_error"], last["last_event"]) == ("mission_aborted", "mission aborted")
    panel.until(lambda: len(outcomes(panel, mission)) >= 29, "the rest of the rows")
    assert set(outcomes(panel, mission)) == {(tag, SKIPPED) for tag, _ in outcomes(panel, mission)}
    assert (last["targets_skipped"], len(outcomes(panel, mission))) == (29, 29)
    assert panel.buttons() == {"start"}


@pytest.mark.parametrize(
    ("service", "message"),
    [
        ("pause", "pause refused: no mission is running"),
        ("resume", "resume is not possible in STATE because nothing is paused"),
        ("abort", "abort is not possible in STATE; it is possible in RETURNING or a running mission"),
        (
            "skip_current",
            "skip_current is not possible in STATE; it is possible in INSPECTING or MONITORING",
        ),
        ("dock", "dock is not possible in STATE; it is possible in a running mission"),
        ("reset", "reset is not possible in STATE; it is possible in FAULT"),
    ],
)
def test_what_makes_no_sense_is_refused_with_a_reason_to_show(
    panel: Panel, service: str, message: str
) -> None:
    """Consoles may ask when the page's button is grey; nothing changes."""
    before = panel.state
    answer = panel.call(f"/mission/{service}", "std_srvs/Trigger")
    assert answer == {"success": False, "message": message.replace("STATE", before["lifecycle_state"])}
    assert panel.state["lifecycle_state"] == before["lifecycle_state"]


@pytest.mark.parametrize(
    ("mission", "tags", "message"),
    [
        ("", [], "unknown mission ''; allowed: 'ExplorationMission', 'InspectionMission'"),
        ("Inspection", [], "unknown mission 'Inspection'; did you mean 'InspectionMission'?"),
        ("InspectionMission", ["1", "99"], "unknown tag '99'; the layout has 29 tags: 1, 2, 3,"),
    ],
)
def test_a_start_that_cannot_be_is_refused_with_a_reason_to_show(
    panel: Panel, mission: str, tags: list[str], message: str
) -> None:
    answer = panel.start(mission, tags=tags)
    assert (answer["accepted"], answer["mission_id"]) == (False, "")
    assert answer["error_message"].startswith(message)
    assert panel.buttons() == {"start"}


def test_stop_holds_the_mission_until_somebody_resumes(panel: Panel) -> None:
    """The page cancels the drive behind the mission's back and says stop; nothing of the mission is lost."""
    mission = patrol(panel)
    panel.stop()
    panel.until(lambda: panel.state["estop_engaged"] and panel.state["paused"], "stopped")
    state = panel.state
    assert (state["last_error"], state["last_event"], state["last_event_severity"]) == (
        "estop_engaged",
        "e-stop engaged",
        1,
    )
    assert panel.buttons() == {"resume", "skip_current", "abort"}
    assert panel.press("resume") == {"success": False, "message": "resume refused: e-stop engaged"}
    stopped = stands_still(panel)

    panel.reset()
    panel.until(lambda: not panel.state["estop_engaged"], "the reset")
    assert stands_still(panel) == stopped
    assert panel.state["paused"]

    assert panel.press("resume") == {"success": True, "message": "resume accepted"}
    panel.until(lambda: panel.place() != stopped, "it drives on")
    assert (panel.state["current_target"], outcomes(panel, mission)) == ("1", [])
    end(panel)


def test_a_stop_keeps_missions_from_starting(panel: Panel) -> None:
    """As a page that was just loaded: its stop is engaged. After the reset the start ends the hold."""
    panel.stop()
    panel.until(lambda: panel.state["estop_engaged"], "stopped")
    assert panel.buttons() == set()
    answer = panel.call("/mission/start", "lupin_msgs/StartMission", mission_type="InspectionMission")
    assert answer["error_message"] == "start refused: e-stop engaged"
    panel.reset()
    patrol(panel)
    assert not panel.state["paused"]
    end(panel)


def test_low_battery_docks_the_robot_and_a_charge_and_resume_go_on(panel: Panel) -> None:
    patrol(panel)
    simulate(panel, speed=0.5, battery=0.1)
    panel.until(lambda: in_state(panel, "RETURNING"), "on the way home")
    state = panel.state
    assert (state["battery_low"], state["last_event"], state["last_event_severity"]) == (
        True,
        "battery low",
        1,
    )
    assert state["battery_percentage"] == pytest.approx(0.1)
    simulate(panel, speed=5.0)
    panel.until(lambda: panel.state["paused"], "docked")
    assert panel.press("resume") == {"success": False, "message": "resume refused: battery low"}
    simulate(panel, battery=0.9, speed=0.05)
    panel.until(lambda: not panel.state["battery_low"], "charged")
    assert panel.press("resume") == {"success": True, "message": "resume accepted"}
    panel.until(lambda: in_state(panel, "INSPECTING"), "going on")
    end(panel)


def test_a_fault_ends_with_a_reset(panel: Panel) -> None:
    """Without a place on the map the mission gives up; the page shows why, and a console resets."""
    simulate(panel, fault="lose_localization")
    panel.subscribe("/amcl_pose", "geometry_msgs/PoseWithCovarianceStamped")
    panel.until(lambda: panel.last("/amcl_pose")["pose"]["covariance"][0] > 1.0, "lost")
    assert panel.start("InspectionMission")["accepted"]
    panel.until(lambda: in_state(panel, "FAULT"), "the fault")
    state = panel.state
    assert state["last_error"].startswith("localization_failed")
    assert (state["last_event"], state["last_event_severity"]) == ("localization failed", 2)
    assert panel.buttons() == set()
    answer = panel.call("/mission/start", "lupin_msgs/StartMission", mission_type="InspectionMission")
    assert answer["error_message"] == "start refused: the orchestrator is in FAULT; reset it first"
    simulate(panel, fault="none")
    assert panel.call("/mission/reset", "std_srvs/Trigger") == {"success": True, "message": "reset accepted"}
    panel.until(lambda: panel.buttons() == {"start"}, "ready again")
    assert panel.state["last_error"] == ""


# --- the arm's page ---------------------------------------------------------------------------------------

JOINTS = ("shoulder_pan", "shoulder_lift", "elbow", "wrist")
#: What the sliders of the page reach, in degrees.
WINDOWS = {
    "shoulder_pan": (-86.0, 90.0),
    "shoulder_lift": (-86.0, 85.0),
    "elbow": (-90.0, 90.0),
    "wrist": (-90.0, 88.0),
}
#: The presets by the names of the interface document, and all others that buttons have; radians.
PRESETS = {
    "travel": (0.04, -0.01, 0.01, -1.57),
    "inspect": (0.0, -0.40, 0.90, -0.80),
    "home": (0.04, -0.01, 0.01, -1.57),
    "zero": (0.0, 0.0, 0.0, 0.0),
    "tuck": tuple(map(math.radians, (1.0, 0.0, 90.0, -90.0))),
    "pick": (0.0, -0.81, -1.57, -1.04),
    "place": (0.0, -0.23, -1.57, -1.54),
    "pick_open": tuple(map(math.radians, (1.0, -58.0, -38.0, -2.0))),
    "pick_closed": tuple(map(math.radians, (1.0, -58.0, -38.0, -2.0))),
    "detect_left": tuple(map(math.radians, (89.0, 12.0, -62.0, -78.0))),
}


def angles(panel: Panel) -> dict[str, float]:
    """Return where the joints are, by the names of the sliders."""
    states = panel.last("/joint_states")
    return {
        name.removesuffix("_joint"): angle
        for name, angle in zip(states["name"], states["position"], strict=True)
    }


def is_at(panel: Panel, **wanted: float) -> bool:
    """Tell whether joints are where they were sent, within a degree."""
    found = angles(panel)
    return all(abs(found[name] - angle) < math.radians(1.0) for name, angle in wanted.items())


def arrives(panel: Panel, **wanted: float) -> None:
    panel.until(lambda: is_at(panel, **wanted), f"the arm at {wanted}")


def slide(panel: Panel, joint: str, degrees: float) -> bool:
    """Pull a slider; the page sends degrees, and no rate of its own for the jaw."""
    name = "/lupin/gripper" if joint == "gripper" else f"/lupin/arm/{joint}"
    request = {"angle": degrees, "rate": 180.0, "degrees": True}
    answer = panel.call(f"{name}/set_angle_with_speed", "mirte_msgs/SetServoAngleWithSpeed", **request)
    return bool(answer["status"])


def preset(panel: Panel, name: str) -> Json:
    return panel.call("/lupin/arm/preset", "lupin_msgs/SetArmPreset", name=name)


def test_presets_move_the_arm(panel: Panel) -> None:
    for name, pose in PRESETS.items():
        answer = preset(panel, name)
        assert answer["success"], answer
        assert re.fullmatch(rf"{name}: sent, there in \d+\.\d s", answer["message"])
        arrives(panel, **dict(zip(JOINTS, pose, strict=True)))
    unknown = preset(panel, "fold")
    assert not unknown["success"]
    assert unknown["message"].startswith("unknown preset 'fold'; allowed: detect_left, home, inspect, pick")


def test_sliders_move_one_joint_each_as_far_as_it_goes(panel: Panel) -> None:
    assert panel.call("/lupin/arm/init", "std_srvs/Trigger")["success"]
    arrives(panel, **dict.fromkeys(JOINTS, 0.0))
    for joint, (low, high) in WINDOWS.items():
        for asked, reached in ((120.0, high), (-120.0, low), (0.0, 0.0)):
            assert slide(panel, joint, asked)
            others = {name: 0.0 for name in JOINTS if name != joint}
            arrives(panel, **{joint: math.radians(reached)}, **others)


def test_the_jaw_opens_and_closes(panel: Panel) -> None:
    """-30 degrees are open, +30 closed: -0.20 and +0.25 rad of its own joint."""
    for asked, reached in ((30.0, 0.25), (-30.0, -0.20), (90.0, 0.25), (0.0, 0.025)):
        assert slide(panel, "gripper", asked)
        arrives(panel, gripper=reached)


def torque(panel: Panel, on: bool) -> Json:
    return panel.call("/lupin/arm/set_torque", "std_srvs/SetBool", data=on)


def test_without_torque_nothing_moves_the_arm(panel: Panel) -> None:
    library = "/lupin/arm/library/state"
    assert torque(panel, False) == {"success": True, "message": "the servos are off: support the arm"}
    panel.until(lambda: not text(panel, library)["torque"], "torque off on the page")
    assert not slide(panel, "elbow", 10.0)
    refused = "the servos are off; switch them on first (/lupin/arm/set_torque)"
    assert preset(panel, "home") == {"success": False, "message": refused}
    assert torque(panel, True) == {"success": True, "message": "the servos are on"}
    panel.until(lambda: text(panel, library)["torque"], "torque on on the page")
    assert slide(panel, "elbow", 10.0)


def test_a_stop_holds_the_arm_too(panel: Panel) -> None:
    panel.stop()
    panel.until(lambda: panel.state["estop_engaged"], "stopped")
    refused = "the emergency stop is engaged ("  # by the robot's own stop, by the page's, or by both
    panel.until(lambda: preset(panel, "home")["message"].startswith(refused), "the arm to have heard of it")
    assert not slide(panel, "elbow", 20.0)


def listed(panel: Panel) -> Json:
    """Return what the page's lists show."""
    answer = panel.call("/lupin/arm/library/list", "lupin_msgs/GetArmLibrary")
    assert answer["success"]
    found: Json = json.loads(answer["json"])
    return found


def test_the_library_keeps_poses(panel: Panel) -> None:
    assert preset(panel, "inspect")["success"]
    pose = dict(zip(JOINTS, PRESETS["inspect"], strict=True))
    arrives(panel, **pose)
    save = {"name": "Bench_1", "from_current": True, "overwrite": True}
    answer = panel.call("/lupin/arm/library/save_pose", "lupin_msgs/SaveArmPose", **save)
    assert answer == {"success": True, "message": "saved 'bench_1'"}
    (entry,) = listed(panel)["poses"]
    assert unread(entry, {"name": str, "note": str, "has_gripper": bool}, "entry") == []
    assert (entry["name"], entry["has_gripper"]) == ("bench_1", True)

    assert preset(panel, "home")["success"]
    arrives(panel, wrist=-1.57)
    answer = panel.call("/lupin/arm/library/goto_pose", "lupin_msgs/SetArmPreset", name="bench_1")
    assert answer["success"], answer
    arrives(panel, **pose)
    unknown = panel.call("/lupin/arm/library/goto_pose", "lupin_msgs/SetArmPreset", name="bench_2")
    assert not unknown["success"]
    assert "bench_2" in unknown["message"]

    rename = {"kind": "pose", "name": "bench_1", "new_name": "bench_3"}
    assert panel.call("/lupin/arm/library/delete", "lupin_msgs/ArmLibraryEdit", **rename)["success"]
    assert [entry["name"] for entry in listed(panel)["poses"]] == ["bench_3"]
    delete = {"kind": "pose", "name": "bench_3", "new_name": ""}
    assert panel.call("/lupin/arm/library/delete", "lupin_msgs/ArmLibraryEdit", **delete)["success"]
    assert listed(panel)["poses"] == []


def record(panel: Panel, action: str, **more: Any) -> Json:
    return panel.call("/lupin/arm/library/record", "lupin_msgs/ArmRecord", action=action, **more)


@pytest.mark.parametrize("mode", ["teleop", "kinesthetic"])
def test_the_recorder_records_saves_and_plays(panel: Panel, mode: str) -> None:
    """Steered by the sliders, or moved by hand while the servos are off."""
    library = "/lupin/arm/library/state"
    assert panel.call("/lupin/arm/init", "std_srvs/Trigger")["success"]
    arrives(panel, **dict.fromkeys(JOINTS, 0.0))
    answer = record(panel, "start", mode=mode, include_gripper=True)
    assert answer["success"], answer
    panel.until(lambda: text(panel, library)["recording"], "recording on the page")
    assert (text(panel, library)["mode"], text(panel, library)["torque"]) == (mode, mode == "teleop")
    if mode == "teleop":
        assert slide(panel, "elbow", 40.0)
    else:
        hand = Parameter("hand", value=[0.0, 0.0, math.radians(40.0), 0.0]).to_parameter_msg()
        panel.call(f"/{SERVOS}/set_parameters", "rcl_interfaces/SetParameters", parameters=[hand])
    arrives(panel, elbow=math.radians(40.0))
    panel.until(lambda: text(panel, library)["n_waypoints"] > 1, "waypoints on the page")
    # Page and recorder hear of the joints apart from each other: by then the recorder, too, has seen the end.
    seen = text(panel, library)["elapsed_s"]
    panel.until(lambda: text(panel, library)["elapsed_s"] > seen + 1.0, "a second of holding still")
    saved = record(panel, "save", name="nod", overwrite=True)
    assert saved["success"], saved
    assert saved["message"] == "saved 'nod'"
    assert saved["duration_s"] > 0.0
    assert saved["n_waypoints"] > 1
    panel.until(lambda: text(panel, library)["torque"], "torque on the page")
    (entry,) = listed(panel)["sequences"]
    wanted = {"name": str, "mode": str, "duration_s": float, "n_waypoints": int, "include_gripper": bool}
    assert unread(entry, wanted, "entry") == []
    assert (entry["name"], entry["mode"], entry["include_gripper"]) == ("nod", mode, True)

    panel.call("/lupin/arm/init", "std_srvs/Trigger")
    arrives(panel, elbow=0.0)
    playing = panel.call("/lupin/arm/library/play", "lupin_msgs/PlayArmSequence", name="nod", speed=1.0)
    assert playing["success"], playing
    panel.until(lambda: text(panel, library)["playing"], "playing on the page")
    panel.until(lambda: not text(panel, library)["playing"], "the end of it")
    told = [json.loads(message["data"]) for message in panel.all(library)]
    assert all(0.0 <= state["progress"] <= 1.0 for state in told)
    assert {state["name"] for state in told if state["playing"]} == {"nod"}
    arrives(panel, elbow=math.radians(40.0))
    delete = {"kind": "sequence", "name": "nod", "new_name": ""}
    assert panel.call("/lupin/arm/library/delete", "lupin_msgs/ArmLibraryEdit", **delete)["success"]
    assert listed(panel)["sequences"] == []


def test_a_recording_is_discarded_and_what_is_not_there_is_not_played(panel: Panel) -> None:
    assert record(panel, "start")["success"]
    assert record(panel, "cancel") == {
        "success": True,
        "message": "the recording is discarded",
        "duration_s": 0.0,
        "n_waypoints": 0,
    }
    assert record(panel, "save", name="x", overwrite=True)["message"] == "nothing is being recorded"
    answer = panel.call("/lupin/arm/library/play", "lupin_msgs/PlayArmSequence", name="wave", speed=1.0)
    assert not answer["success"]
    assert "wave" in answer["message"]


def test_calibration_is_refused_in_a_simulation(panel: Panel) -> None:
    def calibrate(action: str) -> Json:
        return panel.call("/lupin/arm/calibrate", "lupin_msgs/CalibrateArm", action=action)

    refused = calibrate("start")
    assert (refused["success"], refused["state"]) == (False, "IDLE")
    assert refused["message"].startswith("calibration needs the real servos, and this is a simulation")
    nothing: Json = {"joint_names": [], "offsets_applied": [], "diffs_observed": []}
    assert calibrate("status") == {"success": True, "state": "IDLE", "message": "ready", **nothing}
    assert not calibrate("commit")["success"]
    assert calibrate("cancel")["success"]


# --- the twin's page --------------------------------------------------------------------------------------


def field(panel: Panel, sensor: str, resolution: float = 0.25, **box: float) -> Json:
    """Ask for a heat map, of the whole map where nothing else is said."""
    info = panel.last("/map")["info"]
    left, bottom = info["origin"]["position"]["x"], info["origin"]["position"]["y"]
    whole = {
        "bbox_min_x": left,
        "bbox_min_y": bottom,
        "bbox_max_x": left + info["width"] * info["resolution"],
        "bbox_max_y": bottom + info["height"] * info["resolution"],
    }
    request = {"sensor_type": sensor, "resolution": resolution, **whole, **box}
    return panel.call("/twin/get_field", "lupin_msgs/GetField", **request)


def read_tags(panel: Panel) -> list[Json]:
    """Return the twin's tags when all are read: an idle aggregator does so with those that were only seen."""

    def is_read() -> bool:
        return all(tag["readings"] for tag in panel.last("/twin/state")["tags"])

    panel.fresh("/twin/state")
    panel.until(is_read, "a reading of every tag")
    found: list[Json] = panel.last("/twin/state")["tags"]
    return found


@pytest.mark.parametrize("sensor", UNITS)
def test_a_heat_map_of_each_sensor(panel: Panel, sensor: str) -> None:
    """Null is transparent; the least and greatest value are those of the cells that are painted."""
    tags = read_tags(panel)
    answer = field(panel, sensor)
    assert unread(answer, FIELD, "answer") == []
    assert (answer["ok"], answer["error_message"], answer["resolution_used"]) == (True, "", 0.25)
    assert len(answer["values"]) == answer["width"] * answer["height"]
    info = panel.last("/map")["info"]
    assert answer["width"] == math.ceil(round(info["width"] * info["resolution"] / 0.25, 6))
    assert answer["height"] == math.ceil(round(info["height"] * info["resolution"] / 0.25, 6))
    assert answer["origin_x"] == pytest.approx(info["origin"]["position"]["x"])
    painted = [value for value in answer["values"] if value is not None]
    measured = {
        tag["tag_id"]: reading["value"]
        for tag in tags
        for reading in tag["readings"]
        if reading["name"] == sensor
    }
    assert answer["sample_count"] == len(measured)
    if not measured:
        assert (painted, answer["value_min"], answer["value_max"]) == ([], 0.0, 0.0)
        return
    assert None in answer["values"], "the far end of the greenhouse was not explored"
    assert (min(painted), max(painted)) == (answer["value_min"], answer["value_max"])
    low, high = min(measured.values()), max(measured.values())
    assert low - 1e-3 * abs(low) <= min(painted) <= max(painted) <= high + 1e-3 * abs(high)


def test_the_same_heat_map_twice_is_the_same(panel: Panel) -> None:
    """The page asks every five seconds: nothing new is worked out, and nothing changes."""
    read_tags(panel)
    assert field(panel, "co2") == field(panel, "co2")


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"sensor": "ph"}, "unknown sensor type 'ph'"),
        ({"sensor": ""}, "the sensor type is empty"),
        ({"sensor": "co2", "resolution": 0.0}, "resolution"),
        ({"sensor": "co2", "resolution": math.nan}, "resolution"),
        ({"sensor": "co2", "bbox_max_x": -100.0}, "the bounds of x are the wrong way round"),
        ({"sensor": "co2", "resolution": 1e-4}, "cells"),
    ],
)
def test_a_heat_map_that_cannot_be_says_why_and_has_no_cells(
    panel: Panel, wrong: dict[str, Any], message: str
) -> None:
    """The page keeps the last good one."""
    answer = field(panel, **wrong)
    assert message in answer["error_message"]
    assert (answer["ok"], answer["values"], answer["width"], answer["sample_count"]) == (False, [], 0, 0)
