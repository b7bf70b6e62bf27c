"""All that today's page listens to, publishes and calls, with the types that it names, behind the doors."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import pytest
from action_msgs.srv import CancelGoal
from geometry_msgs.msg import PoseStamped, Twist
from mirte_msgs.srv import SetNeopixel, SetServoAngleWithSpeed
from nav_msgs.msg import OccupancyGrid, Odometry
from nav_msgs.msg import Path as Plan
from sensor_msgs.msg import BatteryState, Imu, JointState, LaserScan
from std_msgs.msg import Bool, String
from std_srvs.srv import SetBool, Trigger
from tf2_msgs.msg import TFMessage

from lupin_msgs import srv
from lupin_msgs.msg import MissionState, Observation, TwinState, TwinTagState
from lupin_ros.adapter.node import Qos, RosNode
from tests.lupin_ros.plugins.gateway.page import Page

pytestmark = [pytest.mark.node, pytest.mark.timeout(120)]

VERSIONS = pytest.mark.parametrize("version", ["1", "2"])
OpenPage = Callable[..., Page]

#: Topic, quality, what is published, and a part of what the page then reads.
LISTENS: list[tuple[str, Qos, Any, dict[str, Any]]] = [
    ("/mission/state", Qos.LATCHED, MissionState(lifecycle_state="READY"), {"lifecycle_state": "READY"}),
    (
        "/floranova/observations",
        Qos.BACKLOG,
        Observation(status=3, status_detail="skipped"),
        {"status": 3, "status_detail": "skipped"},
    ),
    (
        "/twin/state",
        Qos.LATCHED,
        TwinState(tags=[TwinTagState(tag_id="5", stale_seconds=math.nan)]),
        {"tags.0.tag_id": "5", "tags.0.stale_seconds": None},
    ),
    ("/camera/tag_detections_json", Qos.EVENT, String(data="[]"), {"data": "[]"}),
    ("/map", Qos.LATCHED, OccupancyGrid(data=[-1, 0, 65]), {"data": [-1, 0, 65]}),
    ("/plan", Qos.EVENT, Plan(poses=[PoseStamped()]), {"poses.0.pose.orientation.w": 1.0}),
    ("/tf", Qos.TRANSFORMS, TFMessage(), {"transforms": []}),
    ("/tf_static", Qos.STATIC_TRANSFORMS, TFMessage(), {"transforms": []}),
    ("/lupin/arm/library/state", Qos.LATCHED, String(data="{}"), {"data": "{}"}),
    ("/io/power/power_watcher", Qos.EVENT, BatteryState(percentage=math.nan), {"percentage": None}),
    ("/io/imu/movement/data", Qos.SENSOR, Imu(), {"linear_acceleration.x": 0.0}),
    ("/scan", Qos.SENSOR, LaserScan(ranges=[math.inf, 1.5]), {"ranges": [None, 1.5]}),
    ("/odom", Qos.SENSOR, Odometry(child_frame_id="base"), {"child_frame_id": "base"}),
    ("/joint_states", Qos.EVENT, JointState(name=["elbow"]), {"name": ["elbow"]}),
]

#: Topic, class, what the page publishes, and what arrives.
PUBLISHES: list[tuple[str, Any, dict[str, Any], Callable[[Any], Any], Any]] = [
    (
        "/goal_pose",
        PoseStamped,
        {"header": {"frame_id": "map"}, "pose": {"position": {"x": 1, "y": 2}, "orientation": {"w": 1}}},
        lambda m: (m.header.frame_id, m.pose.position.x, m.pose.orientation.w),
        ("map", 1.0, 1.0),
    ),
    ("/cmd_vel", Twist, {"linear": {"x": 0.2}, "angular": {"z": -0.1}}, lambda m: m.angular.z, -0.1),
    ("/cmd_vel_manual", Twist, {"linear": {"x": 0.2}}, lambda m: m.linear.x, 0.2),
    ("/lupin/hmi/estop", Bool, {"data": True}, lambda m: m.data, True),
]

ARM = "/lupin/arm"
JOINTS = [f"{ARM}/{name}" for name in ("shoulder_pan", "shoulder_lift", "elbow", "wrist")] + [
    "/lupin/gripper"
]
CANCEL = {"goal_info": {"goal_id": {"uuid": [0] * 16}, "stamp": {"sec": 0, "nanosec": 0}}}
#: Service, class, request as the page makes it.
CALLS: list[tuple[str, Any, dict[str, Any]]] = [
    (
        "/mission/start",
        srv.StartMission,
        {"mission_type": "ExplorationMission", "tag_sequence": [], "discovery_goal": 5},
    ),
    *((f"/mission/{name}", Trigger, {}) for name in ("pause", "resume", "abort", "skip_current")),
    *((f"/mission/{name}", Trigger, {}) for name in ("dock", "reset")),
    (
        "/twin/get_field",
        srv.GetField,
        {
            "sensor_type": "temperature", "resolution": 0.25,
            "bbox_min_x": -1, "bbox_min_y": -1, "bbox_max_x": 5.5, "bbox_max_y": 4,
        },
    ),
    (f"{ARM}/preset", srv.SetArmPreset, {"name": "home"}),
    (f"{ARM}/library/goto_pose", srv.SetArmPreset, {"name": "mine"}),
    (f"{ARM}/library/list", srv.GetArmLibrary, {}),
    (f"{ARM}/library/save_pose", srv.SaveArmPose, {"name": "a", "from_current": True, "overwrite": True}),
    (
        f"{ARM}/library/record",
        srv.ArmRecord,
        {"action": "start", "mode": "kinesthetic", "include_gripper": True, "overwrite": True},
    ),
    (f"{ARM}/library/play", srv.PlayArmSequence, {"name": "a", "speed": 1}),
    (f"{ARM}/library/delete", srv.ArmLibraryEdit, {"kind": "pose", "name": "a"}),
    (f"{ARM}/library/stop", Trigger, {}),
    (f"{ARM}/calibrate", srv.CalibrateArm, {"action": "status"}),
    (f"{ARM}/set_torque", SetBool, {"data": True}),
    (f"{ARM}/init", Trigger, {}),
    *(
        (f"{joint}/set_angle_with_speed", SetServoAngleWithSpeed, {"angle": 10, "rate": 30, "degrees": True})
        for joint in JOINTS
    ),
    ("/lupin/leds/set", SetNeopixel, {"color": {"r": 255, "g": 0, "b": 0}}),
    ("/lupin/leds/auto", Trigger, {}),
    ("/lupin/nav/clear_map", Trigger, {}),
    ("/navigate_to_pose/_action/cancel_goal", CancelGoal, CANCEL),
    ("/navigate_through_poses/_action/cancel_goal", CancelGoal, CANCEL),
]  # fmt: skip


def short(kind: Any) -> str:
    """The type as the page writes it."""
    return f"{kind.__module__.split('.')[0]}/{kind.__name__}"


def part(message: Any, path: str) -> Any:
    """Read a field of a field."""
    for name in path.split("."):
        message = message[int(name)] if name.isdecimal() else message[name]
    return message


@pytest.mark.core
@VERSIONS
def test_topics(
    version: str, gateway: Callable[..., str], page: OpenPage, make_node: Callable[..., RosNode]
) -> None:
    """Each arrives, with null for what is no number, whatever its quality of service."""
    ros = make_node("robot")
    publishers = {name: ros.publisher(type(message), name, qos) for name, qos, message, _ in LISTENS}
    one = page(gateway(engineer_names="[]"), ros, version=version)
    for name, _, message, _ in LISTENS:
        one.subscribe(name, short(type(message)))
    one.subscribe("/rosout", "rcl_interfaces/Log")
    one.call("/rosapi/get_time", "rosapi/GetTime", {})
    one.until(lambda: all(each.get_subscription_count() for each in publishers.values()), "subscriptions")
    for name, _, message, _ in LISTENS:
        publishers[name].publish(message)
    ros.log.info("hello")
    for name, _, _, expected in LISTENS:
        got = one.until(lambda n=name: one.messages(n), name)[-1]
        assert {path: part(got, path) for path in expected} == expected
    one.until(lambda: any("hello" in each["msg"] for each in one.messages("/rosout")), "the log")
    assert one.status() == []


@pytest.mark.core
@VERSIONS
def test_publications(
    version: str, gateway: Callable[..., str], page: OpenPage, make_node: Callable[..., RosNode]
) -> None:
    """The first message of each arrives; STOP comes last, for it keeps back every motion behind it."""
    ros = make_node("robot")
    heard: dict[str, list[Any]] = {name: [] for name, *_ in PUBLISHES}
    for name, kind, *_ in PUBLISHES:
        ros.subscribe(kind, name, Qos.EVENT, heard[name].append)
    one = page(gateway(engineer_names="[]"), ros, version=version)
    for name, kind, message, read, expected in PUBLISHES:
        one.publish(name, short(kind), message)
        one.until(lambda n=name, r=read, e=expected: e in map(r, heard[n]), name)
    assert one.status() == []


@pytest.mark.core
@VERSIONS
def test_calls(
    version: str, gateway: Callable[..., str], page: OpenPage, make_node: Callable[..., RosNode]
) -> None:
    """Each reaches its server with every field that the page gave, and is answered."""
    ros = make_node("robot")
    asked: dict[str, Any] = {}

    def serving(name: str) -> Callable[[Any, Any], Any]:
        def serve(request: Any, response: Any) -> Any:
            asked[name] = request
            return response

        return serve

    for name, kind, _ in CALLS:
        ros.serve(kind, name, serving(name))
    one = page(gateway(engineer_names="[]"), ros, version=version)
    one.until(lambda: CALLS[-1][0] in served(one), "all services")
    for name, kind, request in CALLS:
        answer = one.call(name, short(kind), request)
        assert isinstance(answer, dict), answer
        assert list(answer) == list(kind.Response.get_fields_and_field_types())
        for field, value in request.items():
            if not isinstance(value, dict):
                assert getattr(asked[name], field) == value, (name, field)
    assert one.call("/rosapi/get_time", "rosapi/GetTime", {})["time"]["sec"] > 1e9
    assert one.status() == []


def served(one: Page) -> list[str]:
    """The services that a page sees, with those of actions."""
    answers = {name: one.call("/rosapi/service_type", "", {"service": name}) for name, *_ in CALLS}
    assert all(isinstance(answer, dict) for answer in answers.values()), answers
    return [name for name, answer in answers.items() if answer["type"]]
