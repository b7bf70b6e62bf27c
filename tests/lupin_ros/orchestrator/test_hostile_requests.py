"""Every service and action that our nodes serve, with requests that nobody should send.

One table: what is sent, and what the answer begins with. All nodes run as processes. After each row the
server answers a sound request, and what can be seen from outside is as it was; in the end every process lives
and none has logged a traceback. A service that is not in the table fails a test of its own.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("greenhouse_sim", reason="mdp-greenhouse is not installed here")

from control_msgs.action import GripperCommand
from geometry_msgs.msg import PoseStamped
from mirte_msgs.srv import SetServoAngleWithSpeed
from nav2_msgs.action import NavigateToPose
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool, Trigger

from lupin_arm.joints import ARM
from lupin_arm.library import ROUNDING, Library, Sequence, StoredPose, Waypoint
from lupin_engine_msgs.action import RunMission
from lupin_engine_msgs.srv import Command, Draw, Explain
from lupin_msgs.msg import TwinState
from lupin_msgs.srv import (
    ArmLibraryEdit,
    ArmRecord,
    CalibrateArm,
    ConfirmTag,
    GetArmLibrary,
    GetField,
    GetTagReading,
    PlayArmSequence,
    SaveArmPose,
    SetArmPreset,
    StartMission,
)
from lupin_ros.adapter.node import GoalCallbacks, Qos
from tests.lupin_ros.world import Operator, World

pytestmark = pytest.mark.timeout(180)

NODES = (
    "greenhouse_bridge",
    "lupin_arm",
    "lupin_arm_sim",
    "lupin_sim",
    "lupin_twin",
    "mission_orchestrator",
    "perception_aggregator",
)
#: What every ROS node serves by itself.
ROS_OWN = (
    "describe_parameters",
    "get_parameter_types",
    "get_parameters",
    "get_type_description",
    "list_parameters",
    "set_parameters",
    "set_parameters_atomically",
    *("change_state", "get_state", "get_available_states"),  # wrong ones: test_lifecycle.py
    *("get_available_transitions", "get_transition_graph"),
)
#: No answer is longer: it is shown on a screen.
LONGEST_ANSWER = 500

LIBRARY, SERVO = "/lupin/arm/library", "/io/servo/hiwonder"
SPEED = "set_angle_with_speed"
JOINTS = [joint.name for joint in ARM]

#: What may stand for a name, and is none.
TEXTS = {
    "empty": "",
    "blank": " \t",
    "a path up": "../x",
    "an absolute path": "/etc/passwd",
    "two lines": "x\ny",
    "a NUL": "/\0y",  # on the wire a text ends there
    "an escape": "x\x1b[2J",
    "not ASCII": "\N{SNOWMAN}",
    "a template": "${home}",
    "huge": "x" * 100_000,
}
NUMBERS = {"NaN": math.nan, "infinite": math.inf, "minus infinite": -math.inf}
POSE = [0.0] * 4


Row = tuple[str, dict[str, Any], str]


@dataclass
class Served:
    """A service: its type, a sound request, what shows that it was carried out, and hostile requests.

    Each of those has a name, its fields, and what the text of the answer begins with. `refused` says of an
    answer whether it is a no, and what it says.
    """

    kind: Any
    sound: dict[str, Any] = field(default_factory=dict)
    is_sound: Callable[[Any], bool] = lambda answer: bool(answer.success)
    hostile: list[Row] = field(default_factory=list)
    refused: Callable[[Any], tuple[bool, str]] = lambda answer: (not answer.success, answer.message)


def texts(into: str, begin: str, /, *without: str, **fields: Any) -> list[Row]:
    """Return a row for every text, in a field."""
    return [
        (f"{into}: {what}", {**fields, into: text}, begin)
        for what, text in TEXTS.items()
        if what not in without
    ]


def numbers(into: str, begin: str, /, **fields: Any) -> list[Row]:
    """Return a row for every number that is none, in a field."""
    return [(f"{into}: {what}", {**fields, into: number}, begin) for what, number in NUMBERS.items()]


def _no_status(answer: Any) -> tuple[bool, str]:
    """Judge an answer that has no text; the reason is in the log."""
    return not answer.status, ""


def slider(*hostile: Row) -> Served:
    """Return the slider of a joint, of the arm's node or of a servo's driver."""
    angles = [*numbers("angle", "", degrees=True), *numbers("angle", "", degrees=False)]
    sound = {"angle": 5.0, "rate": 100.0, "degrees": True}
    return Served(
        SetServoAngleWithSpeed, sound, lambda answer: bool(answer.status), [*angles, *hostile], _no_status
    )


def request_of_the_mission(reason: str) -> Served:
    """Return one of the requests without fields: nothing is running, and the answer says what that means."""
    refused = lambda answer: (not answer.success, answer.message)  # noqa: E731
    return Served(Trigger, {}, lambda answer: answer.message == reason, [("at rest", {}, reason)], refused)


def start(*tags: str) -> dict[str, Any]:
    return {"mission_type": "InspectionMission", "tag_sequence": list(tags)}


AREA = {"sensor_type": "temperature", "resolution": 0.5, "bbox_max_x": 2.0, "bbox_max_y": 2.0}


def _but(name: str) -> dict[str, Any]:
    """Return a sound request for a field, but for one of its fields."""
    return {other: value for other, value in AREA.items() if other != name}


RATES = [*numbers("rate", "", angle=1.0), ("rate: next to nothing", {"angle": 60.0, "rate": 1e-30}, "")]
FAR = [
    ("angle: out of reach", {"angle": 170.0, "degrees": True}, ""),
    ("angle: degrees as radians", {"angle": 60.0, "degrees": False}, ""),
]
INVALID = "invalid name '"

TABLE: dict[str, Served] = {
    # --- mission_orchestrator: what it may do is what the chart takes in READY ------------------------------
    "/mission/start": Served(
        StartMission,
        {"mission_type": "DanceMission"},  # one that runs is sent in the end
        lambda answer: answer.error_message.startswith("unknown mission 'DanceMission'; "),
        [
            *texts("mission_type", "unknown mission '"),
            ("a tag: a path", start("../x"), "unknown tag '../x'"),
            ("a tag: empty", start(""), "unknown tag ''"),
            ("a tag: one of two", start("1", "x\ny"), "unknown tag 'x\\ny'"),
            ("a tag: huge", start("7" * 100_000), "unknown tag '7777"),
            (
                "tags: very many",
                start(*map(str, range(1000, 21_000))),
                "tag_sequence has 20000 elements; at most 1000",
            ),
        ],
        lambda answer: (not answer.accepted and not answer.mission_id, answer.error_message),
    ),
    **{
        f"/mission/{name}": request_of_the_mission(reason)
        for name, reason in {
            "abort": "abort is not possible in READY; it is possible in RETURNING or a running mission",
            "dock": "dock is not possible in READY; it is possible in a running mission",
            "pause": "pause refused: no mission is running",
            "reset": "reset is not possible in READY; it is possible in FAULT",
            "resume": "resume is not possible in READY because nothing is paused",
            "skip_current": "skip_current is not possible in READY; "
            "it is possible in INSPECTING or MONITORING",
        }.items()
    },
    "/mission_orchestrator/command": Served(
        Command,
        {"verb": "start", "mission": "DanceMission"},
        lambda answer: answer.message.startswith("unknown mission 'DanceMission'; "),
        [
            *texts("verb", "unknown verb '", "huge"),
            (
                "verb: huge",
                {"verb": TEXTS["huge"]},
                "refused: too long: verb has 100000 letters",
            ),
            *texts("mission", "unknown mission '", "huge", verb="start"),
            *texts("request", "dock refused: its request is no JSON: ", "empty", "huge", verb="dock"),
            ("request: huge", {"verb": "dock", "request": TEXTS["huge"]}, "refused: too long: request has "),
            (
                "request: a list",
                {"verb": "dock", "request": "[]"},
                "dock refused: its request must be ",
            ),
            ("request: deep", {"verb": "dock", "request": "[" * 60_000}, "dock refused: its request is no "),
            (
                "a field: unknown",
                {"verb": "dock", "request": '{"in": 3}'},
                "dock refused: unknown field ",
            ),
            *[
                (
                    f"a choice: {what}",
                    {"verb": "answer", "request": json.dumps({"choice": text})},
                    {"empty": "answer refused: ", "huge": "refused: too long: "}.get(what, "the answer '"),
                )
                for what, text in TEXTS.items()
            ],
            (
                "tags: a text",
                {"verb": "start", "mission": "InspectionMission", "request": '{"tag_sequence": "1"}'},
                "",
            ),
            (
                "tags: unknown",
                {"verb": "start", "mission": "InspectionMission", "request": '{"tag_sequence": ["x", 7]}'},
                "unknown tag 'x'",
            ),
            *texts("command_id", "dock is not possible in READY", "huge", verb="dock"),
            *texts("by", "dock is not possible in READY", "huge", verb="dock"),
        ],
        lambda answer: (not answer.accepted and not answer.mission_id, answer.message),
    ),
    "/mission_orchestrator/draw": Served(
        Draw,
        {"folded": ["MISSION.InspectionMission"]},
        lambda answer: answer.success and "data-state" in answer.svg,
        [
            *texts("chart", "another chart runs: ", "empty"),
            *[(f"folded: {what}", {"folded": [text]}, "no state '") for what, text in TEXTS.items()],
            ("folded: very many", {"folded": [str(n) for n in range(10_000)]}, "no state '0'"),
        ],
        lambda answer: (not answer.success and not answer.svg, answer.message),
    ),
    "/mission_orchestrator/explain": Served(
        Explain,
        {"element": "READY"},
        lambda answer: answer.success and json.loads(answer.explanation)["rules"],
        [
            *texts("chart", "another chart runs: ", "empty", element="READY"),
            *texts("element", "no state or transition '", "empty"),
        ],
        lambda answer: (not answer.success and not answer.explanation, answer.message),
    ),
    # --- greenhouse_bridge ----------------------------------------------------------------------------------
    "/greenhouse_bridge/get_tag_reading": Served(
        GetTagReading,
        {"tag_id": "1"},
        lambda answer: answer.status == GetTagReading.Response.STATUS_OK and answer.reading.readings,
        texts("tag_id", "unknown tag '"),
        lambda answer: (answer.status != 0 and not answer.reading.tag_id, answer.error_message),
    ),
    # --- perception_aggregator: this tag is not in sight ----------------------------------------------------
    "/perception/confirm_tag": Served(
        ConfirmTag,
        {"expected_tag_id": "29"},
        lambda answer: answer.error_message == "tag '29' not discovered",
        texts("expected_tag_id", "tag '"),
        lambda answer: (not answer.detected, answer.error_message),
    ),
    # --- lupin_twin -----------------------------------------------------------------------------------------
    "/twin/get_field": Served(
        GetField,
        AREA,
        lambda answer: answer.ok and (answer.width, answer.height) == (4, 4),
        [
            *texts("sensor_type", "unknown sensor type '", "empty", "blank", **_but("sensor_type")),
            ("sensor_type: empty", {**AREA, "sensor_type": " "}, "the sensor type is empty; allowed: "),
            *[
                row
                for bound in ("bbox_min_x", "bbox_min_y", "bbox_max_x", "bbox_max_y")
                for row in numbers(bound, "the bounds must be finite", **_but(bound))
            ],
            *numbers("resolution", "the resolution must be above 0 m", **_but("resolution")),
            ("resolution: zero", {**AREA, "resolution": 0.0}, "the resolution must be above 0 m, got 0"),
            (
                "resolution: negative",
                {**AREA, "resolution": -1.0},
                "the resolution must be above 0 m, got -1",
            ),
            ("bounds: turned round", {**AREA, "bbox_max_x": -1.0}, "the bounds of x are the wrong way round"),
            ("cells: too many", {**AREA, "resolution": 1e-4}, "2 m x 2 m at 0.0001 m are more than 250000"),
            (
                "cells: without end",
                {**AREA, "bbox_max_x": 3e38, "resolution": 1e-38},
                "3e+38 m x 2 m at 1e-38 m",
            ),
        ],
        lambda answer: (not answer.ok and not answer.values and not answer.width, answer.error_message),
    ),
    # --- lupin_arm ------------------------------------------------------------------------------------------
    "/lupin/arm/preset": Served(SetArmPreset, {"name": "home"}, hostile=texts("name", "unknown preset '")),
    "/lupin/arm/init": Served(Trigger),
    "/lupin/arm/set_torque": Served(SetBool, {"data": True}),
    **{f"/lupin/arm/{joint}/{SPEED}": slider(*RATES) for joint in JOINTS},
    f"/lupin/gripper/{SPEED}": slider(),
    "/lupin/arm/calibrate": Served(
        CalibrateArm,
        {"action": "status"},
        lambda answer: answer.success and (answer.state, answer.message) == ("IDLE", "ready"),
        [
            *texts("action", "unknown action '"),
            (
                "action: start",
                {"action": "start"},
                "calibration needs the real servos, and this is a simulation",
            ),
            ("action: commit", {"action": "commit"}, "there is nothing to commit"),
        ],
    ),
    f"{LIBRARY}/list": Served(GetArmLibrary),
    f"{LIBRARY}/save_pose": Served(
        SaveArmPose,
        {"name": "here", "arm_rad": POSE, "overwrite": True},
        hostile=[
            *texts("name", INVALID, arm_rad=POSE),
            ("name: taken", {"name": "here", "arm_rad": POSE}, "pose 'here' exists; choose another name"),
            *[
                (f"angle: {what}", {"name": "bad", "arm_rad": [0.0, number, 0.0, 0.0]}, "a pose has finite")
                for what, number in NUMBERS.items()
            ],
            *numbers("gripper_rad", "a pose has finite", name="bad", arm_rad=POSE, has_gripper=True),
            (
                "angles: none",
                {"name": "bad"},
                "expected 4 angles (shoulder_pan, shoulder_lift, elbow, wrist), got 0",
            ),
            ("angles: five", {"name": "bad", "arm_rad": [0.0] * 5}, "expected 4 angles"),
            ("angles: very many", {"name": "bad", "arm_rad": [0.0] * 100_000}, "expected 4 angles"),
        ],
    ),
    f"{LIBRARY}/goto_pose": Served(
        SetArmPreset,
        {"name": "here"},
        hostile=[*texts("name", INVALID), ("name: unknown", {"name": "there"}, "unknown pose 'there'")],
    ),
    f"{LIBRARY}/play": Served(
        PlayArmSequence,
        {"name": "still", "speed": 2.0},
        hostile=[
            *texts("name", INVALID),
            ("name: unknown", {"name": "wave"}, "unknown sequence 'wave'"),
            ("name: a pose's", {"name": "here"}, "unknown sequence 'here'"),
            *numbers("speed", "the speed ", name="still"),
        ],
    ),
    f"{LIBRARY}/record": Served(
        ArmRecord,
        {"action": "save"},
        lambda answer: answer.message == "nothing is being recorded",
        [
            *texts("action", "unknown action '"),
            *texts("mode", "unknown mode '", "empty", "blank", action="start"),
            *texts("name", INVALID, "empty", "blank", action="start"),
            ("action: cancel", {"action": "cancel"}, "nothing is being recorded"),
        ],
    ),
    f"{LIBRARY}/delete": Served(
        ArmLibraryEdit,
        {"kind": "pose", "name": "here", "new_name": "here"},
        hostile=[
            *texts("kind", "unknown kind '", name="here"),
            *texts("name", INVALID, kind="pose"),
            *texts("new_name", INVALID, "empty", kind="pose", name="here"),
            ("name: unknown", {"kind": "pose", "name": "there"}, "unknown pose 'there'"),
            ("name: of the other kind", {"kind": "sequence", "name": "here"}, "unknown sequence 'here'"),
        ],
    ),
    f"{LIBRARY}/stop": Served(Trigger),
    # --- lupin_arm_sim: as bad as the vendor's drivers, and no worse ----------------------------------------
    f"{SERVO}/enable_all_servos": Served(SetBool, {"data": True}),
    **{f"{SERVO}/{joint}/{SPEED}": slider(*RATES, *FAR) for joint in JOINTS},
    f"{SERVO}/gripper/{SPEED}": slider(),
}
CASES = [(name, *row) for name, served in TABLE.items() for row in served.hostile]


class Greenhouse(Operator):
    """All of our nodes, at rest, and somebody who looks at what can be seen of them."""

    def __init__(self, world: World, library: Path) -> None:
        super().__init__("stranger")
        self.world = world
        self.library = library
        self.angles: dict[str, float] = {}
        self.twin: list[TwinState] = []
        self.ros.subscribe(JointState, "/joint_states", Qos.DETECTION, self._on_states)
        self.ros.subscribe(TwinState, "/twin/state", Qos.LATCHED, self.twin.append)

    def _on_states(self, message: JointState) -> None:
        self.angles.update(zip(message.name, message.position, strict=True))

    def ask(self, service: str, **fields: Any) -> Any:
        """Call a service of the table."""
        kind = TABLE[service].kind
        return self.call(kind, service, kind.Request(**fields))

    def seen(self) -> tuple[Any, ...]:
        """Return what no hostile request may change."""
        listing = self.ask(f"{LIBRARY}/list").json
        return self.state.lifecycle_state, self.state.mission_id, listing, len(self.twin[-1].tags)

    def settle(self) -> None:
        """Wait until the arm's node takes commands again."""
        self.until(lambda: self.ask("/lupin/arm/preset", name="home").success, "the arm is free")


@pytest.fixture(scope="module")
def greenhouse(ros_domain: int, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Greenhouse]:
    """All nodes as processes; each must live on to the end, and none may have met what it did not expect."""
    folder = tmp_path_factory.mktemp("hostile")
    world, path = World(folder), folder / "arm_library.json"
    library = Library(path)
    library.save_pose("here", StoredPose(arm=POSE), overwrite=False)
    waypoints = [Waypoint(t=0.0, arm=POSE), Waypoint(t=0.1, arm=POSE)]
    library.save_sequence("still", Sequence(duration_s=0.1, waypoints=waypoints), overwrite=False)
    given = {"lupin_arm": {"library_path": path}, "lupin_twin": {"store_file": folder / "twin.sqlite"}}
    for node in NODES:
        world.start(node, **given.get(node, {}))
    greenhouse = Greenhouse(world, path)
    try:
        greenhouse.in_state("READY")
        # A tag is in view at the start: who begins before the twin has told of it sees it appear.
        greenhouse.until(lambda: greenhouse.twin and greenhouse.twin[-1].tags, "the tag in sight is told")
        greenhouse.until(lambda: greenhouse.angles, "the arm tells its angles")
        greenhouse.settle()
        yield greenhouse
        dead = [name for name, process in world.processes.items() if process.poll() is not None]
        assert dead == []
    finally:
        greenhouse.ros.close()
        killed = world.stop()
    assert killed == []
    logs = {node: world.log(node).read_text() for node in NODES}
    assert [node for node, text in logs.items() if "Traceback" in text or "callback failed" in text] == []


@pytest.mark.parametrize(
    ("service", "fields", "begin"),
    [(service, fields, begin) for service, _, fields, begin in CASES],
    ids=[f"{service.strip('/').replace('/', '.')}-{what}" for service, what, _, _ in CASES],
)
def test_a_hostile_request_is_answered_and_changes_nothing(
    greenhouse: Greenhouse, service: str, fields: dict[str, Any], begin: str
) -> None:
    served, before = TABLE[service], greenhouse.seen()
    refused, text = served.refused(greenhouse.ask(service, **fields))
    assert refused
    assert text.startswith(begin)
    assert len(text) <= LONGEST_ANSWER
    assert text.isprintable()
    assert greenhouse.seen() == before


@pytest.mark.parametrize("service", TABLE)
def test_after_all_of_them_a_sound_request_is_carried_out(greenhouse: Greenhouse, service: str) -> None:
    served = TABLE[service]
    greenhouse.until(lambda: served.is_sound(greenhouse.ask(service, **served.sound)), "a sound answer")


@pytest.mark.parametrize("joint", JOINTS)
@pytest.mark.parametrize(
    ("angle", "degrees"), [(1e30, True), (-1e30, True), (90.0, False), (-1e-30, True)], ids=str
)
def test_wrong_units_are_brought_inside_the_limits(
    greenhouse: Greenhouse, joint: str, angle: float, degrees: bool
) -> None:
    """Degrees for radians, say: the arm goes to the end of its window and not farther."""
    name = f"/lupin/arm/{joint}/{SPEED}"
    request = {"angle": angle, "rate": 1e9, "degrees": degrees}
    greenhouse.until(lambda: greenhouse.ask(name, **request).status, "taken")
    index = JOINTS.index(joint)
    target = ARM[index].clamp(angle)
    told = lambda: greenhouse.angles[ARM[index].state_name]  # noqa: E731
    greenhouse.until(lambda: abs(told() - target) < 0.01, "the joint is there")
    low, high = ARM[index].low - ROUNDING, ARM[index].high + ROUNDING
    assert low <= told() <= high


@pytest.mark.parametrize("number", NUMBERS.values(), ids=NUMBERS)
def test_a_goal_that_is_no_place_is_rejected(greenhouse: Greenhouse, number: float) -> None:
    goal = NavigateToPose.Goal(pose=PoseStamped())
    goal.pose.header.frame_id, goal.pose.pose.position.x = "map", number
    assert _send(greenhouse, NavigateToPose, "navigate_to_pose", goal) == "rejected"


@pytest.mark.parametrize(
    "frame", [text for what, text in TEXTS.items() if what != "empty"], ids=[w for w in TEXTS if w != "empty"]
)
def test_a_goal_in_another_frame_is_rejected(greenhouse: Greenhouse, frame: str) -> None:
    goal = NavigateToPose.Goal(pose=PoseStamped())
    goal.pose.header.frame_id = frame
    assert _send(greenhouse, NavigateToPose, "navigate_to_pose", goal) == "rejected"


@pytest.mark.parametrize("number", NUMBERS.values(), ids=NUMBERS)
def test_a_jaw_is_not_sent_to_what_is_no_angle(greenhouse: Greenhouse, number: float) -> None:
    goal = GripperCommand.Goal()
    goal.command.position = number
    name = "/mirte_master_gripper_controller/gripper_cmd"
    assert _send(greenhouse, GripperCommand, name, goal) == "rejected"
    goal.command.position = 0.1
    assert _send(greenhouse, GripperCommand, name, goal) == "succeeded"


@pytest.mark.parametrize("text", TEXTS.values(), ids=TEXTS)
@pytest.mark.parametrize("name", ["mission", "request", "by"])
def test_a_mission_is_not_run_by_a_goal_of_nonsense(greenhouse: Greenhouse, name: str, text: str) -> None:
    """It is aborted; what is only written down is shortened, so the mission is another's."""
    goal = RunMission.Goal(**{"mission": "DanceMission", name: text})
    assert _send(greenhouse, RunMission, "/mission/run", goal) == "ended as 6"


def _send(greenhouse: Greenhouse, kind: Any, name: str, goal: Any) -> str:
    """Send a goal and return how it ended."""
    action = greenhouse.ros.action(kind, name)
    greenhouse.until(action.ready, name)
    ends: list[str] = []
    action.send(
        goal,
        GoalCallbacks(
            ended=lambda status, _: ends.append("succeeded" if status == 4 else f"ended as {status}"),
            rejected=lambda: ends.append("rejected"),
        ),
    )
    greenhouse.until(lambda: ends, f"the end of a goal of {name}")
    return ends[0]


def test_every_service_and_action_of_our_nodes_is_in_the_table(greenhouse: Greenhouse) -> None:
    """A new one needs rows of its own."""
    greenhouse.until(lambda: set(TABLE) <= _offered(greenhouse)[0], "all services of the table")
    served, actions = _offered(greenhouse)
    assert served == set(TABLE)
    own = {"/navigate_to_pose", "/mirte_master_gripper_controller/gripper_cmd", "/mission/run"}
    assert actions == own


def _offered(greenhouse: Greenhouse) -> tuple[set[str], set[str]]:
    """Return the services and the actions of our nodes, as far as they have been found."""
    node = greenhouse.ros.node
    served, actions = set(), set()
    for name in {*NODES} & {*node.get_node_names()}:
        for service, _ in node.get_service_names_and_types_by_node(name, "/"):
            owner, action, _ = service.partition("/_action/")
            if action:
                actions.add(owner)
            elif service.rpartition("/")[2] not in ROS_OWN:
                served.add(service)
    return served, actions


def test_after_all_of_that_a_mission_starts(greenhouse: Greenhouse) -> None:
    answer = greenhouse.ask("/mission/start", **start("1"))
    assert answer.accepted, answer.error_message
    greenhouse.until(lambda: greenhouse.state.mission_id == answer.mission_id, "the mission")
    greenhouse.until(lambda: greenhouse.ask("/mission/abort").success, "an abort")
