"""The calls of ros-mcp 3.1.2, a server of others for AI agents: what each of its 31 tools asks."""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.lupin_ros.world import Operator, World
from tests.plugins.gateway.served import OpenPage, until

pytestmark = [pytest.mark.node, pytest.mark.core, pytest.mark.timeout(180)]

Frame = dict[str, Any]
NAVIGATE, NAVIGATE_TYPE = "/navigate_to_pose", "nav2_msgs/action/NavigateToPose"
STATE, STATE_TYPE = "/mission/state", "lupin_msgs/msg/MissionState"
PAUSE = "/mission/pause"
NO_CHANGE = "no client changes parameters; give them where the node is started: --set NODE.NAME=VALUE"


def ask(question: str, **arguments: Any) -> Frame:
    """A call of the services that describe the network."""
    return call(f"/rosapi/{question}", arguments)


def call(service: str, arguments: Frame | None = None) -> Frame:
    return {"op": "call_service", "service": service, "type": "rosapi_msgs/srv/Any", "args": arguments or {}}


def publish(topic: str, type_: str, *messages: Frame) -> list[tuple[Frame, Any]]:
    said = [{"op": "publish", "topic": topic, "msg": message} for message in messages]
    frames = [
        {"op": "advertise", "topic": topic, "type": type_},
        *said,
        {"op": "unadvertise", "topic": topic},
    ]
    return [(frame, None) for frame in frames]


def has(name: str, *values: Any) -> Callable[[Frame], bool]:
    """Whether a list of the answer has these."""
    return lambda answer: set(values) <= set(answer[name])


def fields(*names: str) -> Callable[[Frame], bool]:
    """Whether the first definition has these fields."""
    return lambda answer: answer["typedefs"][0]["fieldnames"] == list(names)


TWIST, TRIGGER, STATUS = "geometry_msgs/msg/Twist", "std_srvs/srv/Trigger", "action_msgs/msg/GoalStatusArray"
TWIST_FIELDS = fields("linear", "angular")
VERSION = (ask("get_ros_version"), lambda a: a["version"] == 2 and a["distro"] in ("jazzy", "kilted"))
SPEED = (ask("get_param", name="/lupin_sim:speed"), lambda a: a["value"] == "10.0")
SUBSCRIBED = (
    {"op": "subscribe", "topic": STATE, "type": STATE_TYPE},
    lambda m: m["lifecycle_state"] == "READY",
)
#: Where the simulated robot stands.
PLACE = {"position": {"x": 0.5, "y": 0.5}, "orientation": {"w": 1.0}}
POSE = {"pose": {"header": {"frame_id": "map"}, "pose": PLACE}}
ACTION = {"action": NAVIGATE, "action_type": NAVIGATE_TYPE}
GOAL = {"op": "send_action_goal", **ACTION, "args": POSE, "feedback": True}
GOALS = {"op": "subscribe", "topic": f"{NAVIGATE}/_action/status", "type": STATUS}
CANCEL = {"op": "cancel_action_goal", "action": NAVIGATE, "id": "goal_1"}
#: What each tool asks, in order, and the answer: fields, a condition, a refusal, or None for no answer.
TOOLS: dict[str, list[tuple[Frame, Any]]] = {
    "connect_to_robot": [VERSION],
    "detect_ros_version": [VERSION],
    "get_topics": [(ask("topics"), has("topics", STATE, "/parameter_events"))],
    "get_topic_type": [(ask("topic_type", topic=STATE), {"type": STATE_TYPE})],
    "get_topic_details": [
        (ask("topic_type", topic=STATE), {"type": STATE_TYPE}),
        (ask("publishers", topic=STATE), {"publishers": ["/mission_orchestrator"]}),
        (ask("subscribers", topic=STATE), has("subscribers", "/lupin_sim")),
    ],
    "get_message_details": [(ask("message_details", type="geometry_msgs/Twist"), TWIST_FIELDS)],
    "subscribe_once": [SUBSCRIBED],
    "subscribe_for_duration": [SUBSCRIBED],
    "publish_once": publish("/cmd_vel", TWIST, {"linear": {"x": 0.05}}),
    "publish_for_durations": publish("/cmd_vel", TWIST, {"linear": {"x": 0.05}}, {}),
    "get_services": [(ask("services"), has("services", PAUSE))],
    "get_service_type": [(ask("service_type", service=PAUSE), {"type": TRIGGER})],
    "get_service_details": [
        (ask("service_type", service=PAUSE), {"type": TRIGGER}),
        (ask("service_request_details", type=TRIGGER), lambda a: len(a["typedefs"]) == 1),
        (ask("service_response_details", type=TRIGGER), fields("success", "message")),
        (ask("service_node", service=PAUSE), {"node": "/mission_orchestrator"}),
    ],
    "call_service": [(call(PAUSE), lambda a: a["message"] == "pause refused: no mission is running")],
    "get_nodes": [(ask("nodes"), has("nodes", "/lupin_gateway", "/lupin_sim", "/mission_orchestrator"))],
    "get_node_details": [
        (ask("node_details", node="/mission_orchestrator"), has("publishing", STATE)),
        (ask("node_details", node="/mission_orchestrator"), has("services", PAUSE)),
    ],
    "get_parameter": [SPEED],
    "has_parameter": [SPEED],
    "get_parameter_details": [
        SPEED,
        (ask("describe_parameters"), "/rosapi/describe_parameters: the gateway does not offer it"),
    ],
    "set_parameter": [SPEED, (ask("set_param", name="a:b", value="1"), f"/rosapi/set_param: {NO_CHANGE}")],
    "delete_parameter": [SPEED, (ask("delete_param", name="a:b"), f"/rosapi/delete_param: {NO_CHANGE}")],
    "get_parameters": [(call("/lupin_sim/list_parameters"), lambda a: "speed" in a["result"]["names"])],
    "get_actions": [(ask("action_servers"), has("action_servers", NAVIGATE))],
    "get_action_details": [
        (ask("interfaces"), has("interfaces", NAVIGATE_TYPE)),
        (ask("action_goal_details", type=NAVIGATE_TYPE), fields("pose", "behavior_tree")),
        (ask("action_result_details", type=NAVIGATE_TYPE), fields("error_code", "error_msg")),
        (ask("action_feedback_details", type=NAVIGATE_TYPE), lambda a: len(a["typedefs"]) > 1),
    ],
    "send_action_goal": [(GOAL, {"error_code": 0, "error_msg": ""})],
    "get_action_status": [(GOALS, lambda message: message["status_list"][0]["status"] == 4)],
    "cancel_action_goal": [(CANCEL, f"{NAVIGATE}: no goal with the id 'goal_1' is under way")],
    # What these ask, they ask of the network below, or of their own disk.
    "ping_robots": [],
    "get_verified_robot_spec": [],
    "get_verified_robots_list": [],
    "view_saved_image": [],
}  # fmt: skip
_NUMBERS = itertools.count()


def answer(page: OpenPage, frame: Frame) -> Any:
    """Send a frame as a tool does; return what comes back: fields, a message, a refusal, or None."""
    number, before = frame.get("id", f"tool-{next(_NUMBERS)}"), len(page.frames)
    page.send({**frame, **({"id": number} if frame["op"] != "subscribe" else {})})
    if frame["op"] in ("advertise", "publish", "unadvertise"):
        page.work_off()

    def replies() -> Iterator[Any]:
        for each in page.frames[before:]:
            if each["op"] == "publish" and each["topic"] == frame.get("topic"):
                yield each["msg"]
            elif each["op"] in ("service_response", "action_result") and each["id"] == number:
                yield each["values"]
            elif each["op"] == "status" and each.get("id", number) == number:
                yield each["msg"]

    if frame["op"] in ("advertise", "publish", "unadvertise"):
        return next(replies(), None)
    (found,) = until(lambda: list(itertools.islice(replies(), 1)), f"an answer to {frame}", 60.0)
    return found


def test_each_tool_is_answered_or_refused_with_a_reason(
    gateway: Callable[..., str], world: World, operator: Operator
) -> None:
    """A new connection for each, as ros-mcp has it; the robot is simulated, and no mission is under way."""
    world.start_all()
    operator.in_state("READY")
    port = int(gateway(engineer_names="[]").rsplit(":", 1)[1].partition("/")[0])
    for tool, asked in TOOLS.items():
        page = OpenPage(port)
        for frame, expected in asked:
            found = until(lambda p=page, f=frame, e=expected: _fitting(p, f, e), f"{tool}: {frame}", 60.0)
            assert found, tool
        page.close()


def _fitting(page: OpenPage, frame: Frame, expected: Any) -> bool:
    """Return whether a frame is answered as expected; what nodes have is found some moments late."""
    found = answer(page, frame)
    return bool(expected(found)) if callable(expected) and isinstance(found, dict) else found == expected


def test_the_page_says_how_each_tool_fares() -> None:
    """In the table of docs/gateway.md."""
    rows = Path("docs/gateway.md").read_text(encoding="utf-8").partition("### ros-mcp")[2].splitlines()
    first = " ".join(row.split("|")[1] for row in rows if row.startswith("|"))
    assert sorted(re.findall(r"`(\w+)`", first)) == sorted(TOOLS)
    assert len(TOOLS) == 31


def test_a_role_learns_of_what_it_may_use(
    gateway: Callable[..., str], world: World, operator: Operator, tmp_path: Path
) -> None:
    """A viewer sees declared topics and services, no action, and no parameter."""
    world.start_all()
    operator.in_state("READY")
    file, secret = tmp_path / "tokens", "v" * 32
    file.write_text(f"hall viewer 2099-01-01 {secret}\n", encoding="utf-8")
    file.chmod(0o600)
    port = int(gateway(engineer_names="[]", tokens=file).rsplit(":", 1)[1].partition("/")[0])
    page = OpenPage(port, Authorization=f"Bearer {secret}")
    topics = until(
        lambda: (found := answer(page, ask("topics"))["topics"]) and STATE in found and found, "topics"
    )
    assert "/parameter_events" not in topics
    assert PAUSE not in answer(page, ask("services"))["services"]
    assert answer(page, ask("action_servers")) == {"action_servers": []}
    assert answer(page, ask("topics_for_type", type="rcl_interfaces/msg/ParameterEvent")) == {"topics": []}
    details = answer(page, ask("node_details", node="/mission_orchestrator"))
    assert STATE in details["publishing"]
    assert not {"/parameter_events", PAUSE} & {*details["publishing"], *details["services"]}
    refused = "needs the role engineer; hall is viewer"
    assert answer(page, ask("publishers", topic="/parameter_events")) == (
        f"/rosapi/publishers: subscribing to /parameter_events {refused}"
    )
    assert answer(page, ask("get_param", name="/lupin_sim:speed")) == (
        "calling /rosapi/get_param needs the role operator; hall is viewer"
    )
    assert answer(page, ask("node_details", node="/mission_orchestrato")) == (
        "/rosapi/node_details: there is no node /mission_orchestrato; did you mean '/mission_orchestrator'?"
    )
    page.close()
