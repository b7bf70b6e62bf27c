"""The panel of today against real processes: every topic, service and action that it uses, as it uses them."""

from __future__ import annotations

import json
import math
import re
import signal
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from statistics import median
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="ROS 2 is not installed here")
pytest.importorskip("greenhouse_sim", reason="mdp-greenhouse is not installed here")

from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy

from lupin_engine.harness.domains import claimed_domain
from tests.launch.panel import CANCEL_DRIVES, STOP_TOPIC, Json, Panel
from tests.launch.processes import Lupin

pytestmark = [pytest.mark.ros, pytest.mark.timeout(300)]

ORCHESTRATOR, AGGREGATOR, TWIN, ARM = "mission_orchestrator", "perception_aggregator", "lupin_twin", "lupin_arm"
ROBOT, SERVOS = "lupin_sim", "lupin_arm_sim"

OK, UNREACHABLE, SCAN_FAILED, SKIPPED = range(4)
READING = 0

# --- what the panel uses ----------------------------------------------------------------------------------

#: Topics that it shows: type, and who of ours publishes them.
SHOWN = {
    "/mission/state": ("lupin_msgs/MissionState", {ORCHESTRATOR}),
    "/floranova/observations": ("lupin_msgs/Observation", {ORCHESTRATOR, AGGREGATOR}),
    "/twin/state": ("lupin_msgs/TwinState", {TWIN}),
    "/camera/tag_detections_json": ("std_msgs/String", {ROBOT}),
    "/map": ("nav_msgs/OccupancyGrid", {ROBOT}),
    "/plan": ("nav_msgs/Path", {ROBOT}),
    "/tf": ("tf2_msgs/TFMessage", {ROBOT}),
    "/lupin/arm/library/state": ("std_msgs/String", {ARM}),
    "/io/power/power_watcher": ("sensor_msgs/BatteryState", {ROBOT}),
    "/joint_states": ("sensor_msgs/JointState", {SERVOS}),
    "/rosout": ("rcl_interfaces/Log", {ORCHESTRATOR, AGGREGATOR, TWIN, ARM, ROBOT, SERVOS}),
}
#: Topics that it does not show, and that others of today read beside it.
READ_BESIDE = {
    "/perception/discovered_tags": ("lupin_msgs/DiscoveredTags", {AGGREGATOR}),
    "/perception/box_geometry_json": ("std_msgs/String", {AGGREGATOR}),
}
#: Topics that it tells: type, and who of ours listens.
TOLD = {
    "/goal_pose": ("geometry_msgs/PoseStamped", {ROBOT}),
    STOP_TOPIC: ("std_msgs/Bool", {ROBOT}),
}
#: Services that it calls: type, and who of ours answers.
CALLED = {
    "/mission/start": ("lupin_msgs/StartMission", ORCHESTRATOR),
    "/mission/pause": ("std_srvs/Trigger", ORCHESTRATOR),
    "/mission/resume": ("std_srvs/Trigger", ORCHESTRATOR),
    "/mission/abort": ("std_srvs/Trigger", ORCHESTRATOR),
    "/mission/skip_current": ("std_srvs/Trigger", ORCHESTRATOR),
    # It has no button for these two; consoles do.
    "/mission/dock": ("std_srvs/Trigger", ORCHESTRATOR),
    "/mission/reset": ("std_srvs/Trigger", ORCHESTRATOR),
    "/twin/get_field": ("lupin_msgs/GetField", TWIN),
    "/lupin/arm/preset": ("lupin_msgs/SetArmPreset", ARM),
    "/lupin/arm/library/list": ("lupin_msgs/GetArmLibrary", ARM),
    "/lupin/arm/library/save_pose": ("lupin_msgs/SaveArmPose", ARM),
    "/lupin/arm/library/goto_pose": ("lupin_msgs/SetArmPreset", ARM),
    "/lupin/arm/library/record": ("lupin_msgs/ArmRecord", ARM),
    "/lupin/arm/library/play": ("lupin_msgs/PlayArmSequence", ARM),
    "/lupin/arm/library/stop": ("std_srvs/Trigger", ARM),
    "/lupin/arm/library/delete": ("lupin_msgs/ArmLibraryEdit", ARM),
    "/lupin/arm/calibrate": ("lupin_msgs/CalibrateArm", ARM),
    "/lupin/arm/set_torque": ("std_srvs/SetBool", ARM),
    "/lupin/arm/init": ("std_srvs/Trigger", ARM),
    "/lupin/arm/shoulder_pan/set_angle_with_speed": ("mirte_msgs/SetServoAngleWithSpeed", ARM),
    "/lupin/arm/shoulder_lift/set_angle_with_speed": ("mirte_msgs/SetServoAngleWithSpeed", ARM),
    "/lupin/arm/elbow/set_angle_with_speed": ("mirte_msgs/SetServoAngleWithSpeed", ARM),
    "/lupin/arm/wrist/set_angle_with_speed": ("mirte_msgs/SetServoAngleWithSpeed", ARM),
    "/lupin/gripper/set_angle_with_speed": ("mirte_msgs/SetServoAngleWithSpeed", ARM),
    CANCEL_DRIVES: ("action_msgs/CancelGoal", ROBOT),
}
#: What else it uses, and why nobody of ours has it.
NOT_OURS = {
    "/tf_static": "the robot's description tells it; the chain of places is whole without it",
    "/cmd_vel": "driving by hand goes to the base; the simulated one takes goals only",
    "/cmd_vel_manual": "driving by hand goes to the robot's drive mux",
    "/io/imu/movement/data": "a gauge of the robot's own driver; nothing of ours reads it",
    "/scan": "the same, of the laser; the simulated robot tells the map that comes of it",
    "/odom": "the same, of the wheels; where the robot is stands in /tf",
    "/navigate_through_poses/_action/cancel_goal": "no mission of ours drives through several places",
    "/lupin/leds/set": "the LED bridge of the robot",
    "/lupin/leds/auto": "the LED bridge of the robot",
    "/lupin/nav/clear_map": "starts the robot's SLAM anew; a simulated map begins anew with each mission",
    "/rosapi/get_time": "part of the gateway",
}

LATCHED = {
    "/mission/state",
    "/floranova/observations",
    "/twin/state",
    "/map",
    "/lupin/arm/library/state",
    *READ_BESIDE,
}
#: Seconds between two messages of what is told again and again, because pages may not hear what is latched.
PERIODS = {
    "/mission/state": 0.2,
    "/twin/state": 1.0,
    "/lupin/arm/library/state": 0.2,
    "/perception/discovered_tags": 0.5,
    "/perception/box_geometry_json": 1.0,
}

# --- what it reads: a type, fields, or a list of one of them ----------------------------------------------

STAMP = {"sec": int, "nanosec": int}
POINT = {"x": float, "y": float, "z": float}
POSE = {"position": POINT, "orientation": {**POINT, "w": float}}
SENSOR = {"name": str, "value": float}
TAG_READING = {"tag_id": str, "stamp": STAMP, "readings": [SENSOR]}
BLOOM = {"position": POINT, "species": str, "confidence": float, "anomaly": bool}
READ = {
    "/mission/state": {
        "mission_id": str,
        "mission_type": str,
        "lifecycle_state": str,
        "mission_phase": str,
        "current_target": str,
        "targets_total": int,
        "targets_completed": int,
        "targets_failed": int,
        "targets_unreachable": int,
        "targets_skipped": int,
        "last_error": str,
        "last_event": str,
        "last_event_severity": int,
        "tags_discovered": int,
        "discovery_goal": int,
        "estop_engaged": bool,
        "paused": bool,
        "battery_percentage": float,
        "battery_low": bool,
        "started_at": STAMP,
    },
    "/floranova/observations": {
        "tag_reading": TAG_READING,
        "status": int,
        "status_detail": str,
        "tag_pose_in_map": POSE,
    },
    "/twin/state": {
        "tags": [
            {
                "tag_id": str,
                "pose": POSE,
                "readings": [SENSOR],
                "last_observed": STAMP,
                "stale_seconds": float,
                "species": str,
                "species_confidence": float,
                "anomaly": bool,
                "flowers": [BLOOM],
                "box_footprint": {"points": [POINT]},
            }
        ]
    },
    "/map": {"info": {"resolution": float, "width": int, "height": int, "origin": POSE}, "data": [int]},
    "/tf": {
        "transforms": [
            {
                "header": {"frame_id": str},
                "child_frame_id": str,
                "transform": {"translation": POINT, "rotation": POSE["orientation"]},
            }
        ]
    },
    "/io/power/power_watcher": {"percentage": float},
    "/joint_states": {"name": [str], "position": [float]},
    "/perception/discovered_tags": {"tags": [{"tag_id": str, "pose_in_map": POSE, "sightings": int}]},
}
#: The same for topics that carry JSON themselves.
READ_IN_TEXT = {
    "/camera/tag_detections_json": [{"id": int, "corners": [[float]], "dist": float}],
    "/perception/box_geometry_json": [
        {"id": str, "x": float, "y": float, "yaw": float, "width": float, "depth": float, "height": float}
    ],
    "/lupin/arm/library/state": {
        "recording": bool,
        "playing": bool,
        "name": str,
        "mode": str,
        "progress": float,
        "elapsed_s": float,
        "n_waypoints": int,
        "torque": bool,
    },
}
FIELD = {
    "ok": bool,
    "error_message": str,
    "width": int,
    "height": int,
    "origin_x": float,
    "origin_y": float,
    "resolution_used": float,
    "value_min": float,
    "value_max": float,
    "sample_count": int,
}
#: Least and greatest value of each sensor in the unit that the panel writes beside it.
UNITS = {
    "temperature": (0.0, 40.0),
    "humidity": (0.0, 100.0),
    "co2": (200.0, 1500.0),
    "light": (0.0, 2000.0),
    "soil_moisture": (0.0, 1.0),
}


def unread(value: Any, wanted: Any, at: str = "") -> list[str]:
    """Name what the panel would not find, or not as what it expects."""
    if isinstance(wanted, dict):
        missing = [f"{at}.{name}: missing" for name in wanted if name not in value]
        found = [unread(value[name], part, f"{at}.{name}") for name, part in wanted.items() if name in value]
        return sum(found, missing)
    if isinstance(wanted, list):
        return sum((unread(item, wanted[0], f"{at}[{i}]") for i, item in enumerate(value)), [])
    kinds = (int, float) if wanted is float else wanted
    if isinstance(value, bool) is (wanted is bool) and isinstance(value, kinds):
        return []
    return [f"{at}: {value!r} is no {wanted.__name__}"]


# --- the scene --------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def up(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Lupin]:
    """All missions and everything simulated, as an operator starts it; it ends when asked and leaves nothing."""
    folder = tmp_path_factory.mktemp("hmi")
    library = f"lupin_arm.library_path={folder / 'arm_library.json'}"
    settings = [part for value in (library, "localization_timeout_s=5 s") for part in ("--set", value)]
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
        page.subscribe(topic, kind)
    page.subscribe("/tf_static", "tf2_msgs/TFMessage")
    explore(page)
    yield page
    page.close()


@pytest.fixture
def panel(page: Panel) -> Panel:
    """The page, its stop reset, and a robot that is well, fast, and has nothing to do."""
    page.reset()
    simulate(page, battery=1.0, fault="none", speed=2.0)
    page.until(lambda: not (page.state["estop_engaged"] or page.state["battery_low"]), "nothing pressed or low")
    if page.state["lifecycle_state"] not in ("READY", "DONE"):  # left by a test that failed
        page.call("/mission/abort", "std_srvs/Trigger")
        page.call("/mission/reset", "std_srvs/Trigger")
    page.until(lambda: page.state["lifecycle_state"] in ("READY", "DONE"), "READY or DONE")
    return page


def explore(page: Panel) -> None:
    """Let a mission find, read and look at some tags."""
    page.reset()
    page.start("ExplorationMission", goal=3)
    page.until(lambda: [o for o in readings(page) if o["source"] == "MonitoringMission"], "a visit")
    page.press("abort")
    page.until(lambda: page.state["lifecycle_state"] == "DONE", "the end of the exploration")


def simulate(page: Panel, **values: float | str) -> None:
    """Change the simulated robot, which no page can."""
    parameters = [Parameter(name, value=value).to_parameter_msg() for name, value in values.items()]
    answer = page.call(
        f"/{ROBOT}/set_parameters", "rcl_interfaces/SetParameters", parameters=parameters
    )
    assert all(result["successful"] for result in answer["results"]), answer


def readings(page: Panel) -> list[Json]:
    """Return the readings that the table of the page has."""
    return [o for o in page.all("/floranova/observations") if o["kind"] == READING]


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
        others = [i for i in panel.node.get_subscriptions_info_by_topic(name) if i.node_name in servers(panel)]
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
        late.subscribe(topic, kind)
    try:
        late.until(lambda: all(map(late.count, topics)), "a message of each topic")
        assert {t: unread(late.last(t), wanted) for t, wanted in READ.items()} == dict.fromkeys(READ, [])
        found = {topic: unread(text(late, topic), wanted) for topic, wanted in READ_IN_TEXT.items()}
        assert found == dict.fromkeys(READ_IN_TEXT, [])

        # Observations are told once: what this page has seen, the late one has, in the same order.
        seen = [o["header"]["stamp"] for o in panel.all("/floranova/observations")]
        late.until(lambda: late.count("/floranova/observations") >= len(seen), "the backlog")
        kept = [o["header"]["stamp"] for o in late.all("/floranova/observations")]
        assert [stamp for stamp in kept if stamp in seen] == seen
        assert [unread(o, READ["/floranova/observations"]) for o in late.all("/floranova/observations")] == [
            []
        ] * late.count("/floranova/observations")
    finally:
        late.close()
