"""Missions that come while the node runs: a file and a binding dropped into the folder are a mission."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import GetParameters, SetParameters
from std_msgs.msg import String

from lupin_engine.missions.folders import default_missions_folder
from lupin_msgs.srv import SetArmPreset
from lupin_ros.adapter.node import Qos, RosNode
from tests.lupin_ros.world import PATIENCE, Operator, World

pytestmark = pytest.mark.timeout(180)

TUTORIAL = Path(__file__).parents[3] / "docs" / "tutorial"


class Desk(Operator):
    """An operator who also sees which missions there are."""

    def __init__(self) -> None:
        super().__init__("desk")
        self.offers: list[dict[str, Any]] = []
        #: Nodes of this test that work while it waits.
        self.others: list[RosNode] = []
        topic = "/mission_orchestrator/missions"
        self.ros.subscribe(String, topic, Qos.LATCHED, lambda m: self.offers.append(json.loads(m.data)))

    def until(self, condition: Callable[[], Any], what: str, timeout: float = PATIENCE) -> None:
        """Work until `condition` holds, and let the others work."""

        def holds() -> Any:
            for node in self.others:
                node.spin_once(0.0)
            return condition()

        super().until(holds, what, timeout)

    def offered(self, mission: str) -> dict[str, Any]:
        """Wait until a mission is offered, and return how."""
        found: list[dict[str, Any]] = []

        def there() -> bool:
            found[:] = [m for o in self.offers[-1:] for m in o["missions"] if m["mission"] == mission]
            return bool(found)

        self.until(there, f"{mission} is offered")
        return found[0]

    def problem(self) -> str:
        """Wait until something is wrong with the files, and return what."""
        self.until(lambda: self.offers and self.offers[-1]["problems"], "a problem of the files")
        return "\n".join(self.offers[-1]["problems"])


class Arm:
    """The server of the arm's presets."""

    def __init__(self, ros: RosNode) -> None:
        self.asked: list[str] = []
        self.answers = True
        ros.serve(SetArmPreset, "/lupin/arm/preset", self._answer)

    def _answer(self, request: Any, response: Any) -> Any:
        self.asked.append(request.name)
        response.success, response.message = self.answers, "" if self.answers else "no such pose"
        return response


@pytest.fixture
def desk(ros_domain: int) -> Iterator[Desk]:
    """An operator on the same domain."""
    desk = Desk()
    yield desk
    desk.ros.close()


@pytest.fixture
def missions(tmp_path: Path) -> Path:
    """A folder with the inspection alone."""
    folder, shipped = tmp_path / "missions", default_missions_folder()
    shutil.copytree(shipped / "parts", folder / "parts")
    for name in ("lifecycle.yaml", "inspection.yaml"):
        shutil.copy(shipped / name, folder)
    return folder


Change = tuple[str, str]
ONE_ROUND: tuple[Change, ...] = (
    ("patrol_rounds: {type: count, default: 2", "patrol_rounds: {type: count, default: 1"),
    ("patrol_photo_s: {type: duration, default: 3 s", "patrol_photo_s: {type: duration, default: 100 ms"),
)


def put(source: Path, folder: Path, *changes: Change) -> Path:
    """Put a file into a folder, changed; at once, as a careful person would."""
    text = source.read_text(encoding="utf-8")
    for old, new in changes:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    folder.mkdir(exist_ok=True)
    aside = folder / f"{source.name}.new"
    aside.write_text(text, encoding="utf-8")
    return aside.replace(folder / source.name)


def drop_patrol(missions: Path, *changes: Change, binding: tuple[Change, ...] = ()) -> Path:
    """Do what the tutorial ends with; return the file of the binding."""
    bound = put(TUTORIAL / "bindings" / "photo_arm.yaml", missions / "bindings", *binding)
    put(TUTORIAL / "patrol.yaml", missions, *changes)
    return bound


def start_all(world: World, missions: Path) -> None:
    """Start the nodes with a folder of missions."""
    world.start_all(missions_path=missions)


def test_a_mission_can_be_started_as_soon_as_its_file_is_there(
    world: World, desk: Desk, missions: Path, make_node: Callable[..., RosNode]
) -> None:
    """No restart, no Python: the file and its binding are dropped in, and the next start names it."""
    arm_node = make_node("arm_server")
    arm = Arm(arm_node)
    desk.others.append(arm_node)
    start_all(world, missions)
    desk.in_state("READY")
    unknown = desk.start("1", mission="PatrolMission")
    assert unknown.error_message == ("unknown mission 'PatrolMission'; did you mean 'InspectionMission'?")
    drop_patrol(missions, *ONE_ROUND)
    answer = desk.start("1", "5", mission="PatrolMission")
    assert answer.accepted, answer.error_message
    desk.until_done(published=2)
    assert arm.asked == ["inspect", "home", "inspect", "home"]
    assert [(o.tag_reading.tag_id, o.status) for o in desk.observations] == [("1", 0), ("5", 0)]
    assert desk.state.last_error == ""
    assert desk.start("1").accepted  # the inspection is as it was
    desk.in_state("DONE")


def test_what_is_offered_is_told(world: World, desk: Desk, missions: Path) -> None:
    """A display can list the missions, and make a form for the request of each."""
    start_all(world, missions)
    tags = desk.offered("InspectionMission")["request"][0]
    assert (tags["name"], tags["type"], tags["required"]) == ("tag_sequence", "list of tag", False)
    assert [tag["id"] for tag in tags["default"]][:3] == ["1", "2", "3"]
    drop_patrol(missions)
    patrol = desk.offered("PatrolMission")
    assert patrol["summary"].startswith("Take the camera to some places, twice a day")
    (places,) = patrol["request"]
    assert [tag["id"] for tag in places["default"]] == ["1", "5", "12"]
    assert (places["computed"], places["may_be_empty"]) == ("tags.named(param.patrol_places)", False)
    answer = desk.call(
        GetParameters, "/mission_orchestrator/get_parameters", GetParameters.Request(names=["patrol_pause_s"])
    )
    assert answer.values[0].double_value == 12 * 3600.0
    (missions / "patrol.yaml").unlink()
    desk.until(lambda: len(desk.offers[-1]["missions"]) == 1, "the patrol is gone")
    gone = desk.call(
        GetParameters, "/mission_orchestrator/get_parameters", GetParameters.Request(names=["patrol_pause_s"])
    )
    assert [value.type for value in gone.values] == []


@pytest.mark.core
def test_a_broken_file_changes_nothing_and_is_told(world: World, desk: Desk, missions: Path) -> None:
    """The missions that were there stay; what is wrong is told with its place, and to who asks for it."""
    start_all(world, missions)
    desk.in_state("READY")
    drop_patrol(missions, ("on_done: PATROLLING", "on_done: PATROLING"))
    problem = desk.problem()
    assert problem.startswith(f"{missions}/patrol.yaml:30:14: error: ")
    assert problem.endswith("no state is called 'PATROLING' here; did you mean 'PATROLLING'? [unknown-state]")
    refused = desk.start("1", mission="PatrolMission")
    assert refused.error_message == (
        "unknown mission 'PatrolMission'; did you mean 'InspectionMission'?; "
        f"what is new cannot be used: {problem}"
    )
    assert desk.start("1").accepted
    desk.in_state("DONE")
    assert problem in world.log("mission_orchestrator").read_text(encoding="utf-8")


def test_a_project_uses_the_shipped_lifecycle_by_its_name(world: World, desk: Desk, missions: Path) -> None:
    """What it overrides is run, and taken over when it changes; an override of a hold is refused."""
    extending = "lifecycle: ward-robot\nextends: greenhouse-robot\n"
    added = """\
states:
  MISSION: {on_done: DISINFECTING}
  DISINFECTING:
    on: {mission.start: {refuse: mission_running}}
    after: {500 ms: RETURNING}
"""
    lifecycle = missions / "lifecycle.yaml"
    lifecycle.write_text(extending + added)
    start_all(world, missions)
    desk.in_state("READY")
    assert desk.start("1").accepted
    desk.until_done(published=1)
    phases = [name.partition("/")[0] for name in desk.seen()]
    assert list(dict.fromkeys(phases))[-4:] == ["INSPECTING", "DISINFECTING", "RETURNING", "DONE"]
    lifecycle.write_text(f"{extending}holds: {{pause: {{code: battery_low}}}}\n{added}")
    problem = desk.problem()
    assert problem.startswith(f"{lifecycle}:3:9: error: holds.pause: the hold 'pause' of greenhouse-robot, ")
    lifecycle.write_text(extending)
    desk.until(lambda: not desk.offers[-1]["problems"], "the lifecycle is right again")
    seen = len(desk.states)
    assert desk.start("1").accepted
    desk.until_done(published=2)
    assert "DISINFECTING" not in {state.lifecycle_state for state in desk.states[seen:]}


def test_a_binding_is_held_against_the_definition(world: World, desk: Desk, missions: Path) -> None:
    """What the service does not have is found when the file is read, not when the robot stands there."""
    start_all(world, missions)
    desk.in_state("READY")
    wrong = (("response.success", "response.succes"), ('{name: "${ pose }"}', '{nam: "${ pose }"}'))
    file = drop_patrol(missions, binding=wrong)
    assert desk.problem().splitlines() == [
        f"{file}:13:12: error: operations.move.with: lupin_msgs/srv/SetArmPreset.Request has no field 'nam'; "
        "did you mean 'name'? [unknown-argument]",
        f"{file}:14:25: error: operations.move.done_when: 'response' has no 'succes'; "
        "did you mean 'success'? [unknown-name]",
    ]


def test_a_binding_reaches_what_the_owner_of_the_robot_allows(
    world: World, desk: Desk, missions: Path, make_node: Callable[..., RosNode]
) -> None:
    """What is put into the folder later is refused like that, and taken once it is allowed."""
    desk.others.append(make_node("arm_server"))
    start_all(world, missions)
    desk.in_state("READY")
    file = drop_patrol(missions, *ONE_ROUND, binding=(("/lupin/arm/preset", "/other/arm"),))
    allow = missions.parent / "lupin.yaml"
    assert desk.problem() == (
        f"{file}:12:21: error: operations.move.service: it is not allowed to call the service '/other/arm'; "
        f"write /other/arm under 'allow: services' in {allow} [not-allowed]"
    )
    assert [mission["mission"] for mission in desk.offers[-1]["missions"]] == ["InspectionMission"]
    allow.write_text("allow: {services: /other/*}", encoding="utf-8")
    desk.offered("PatrolMission")


LAMP = """\
actions:
  lamp:
    summary: Tell what somebody else tells.
    topic: {name: /joint_states, type: std_msgs/msg/Bool}
    with: {data: true}
"""


def test_a_binding_does_not_publish_what_a_plugin_publishes(world: World, desk: Desk, missions: Path) -> None:
    """Who may subscribe to it may not publish it, whatever a pattern of the owner says."""
    (missions.parent / "lupin.yaml").write_text("allow: {publish: /*}", encoding="utf-8")
    start_all(world, missions)
    desk.in_state("READY")
    file = drop_patrol(missions, *ONE_ROUND, binding=(("operations:", f"{LAMP}operations:"),))
    assert desk.problem().startswith(
        f"{file}:10:19: error: actions.lamp.topic: it is not allowed to publish on the topic "
        "'/joint_states', "
        "which belongs to plugin 'arm'; write /joint_states, without '*', under 'allow: publish' in "
    )
    assert [mission["mission"] for mission in desk.offers[-1]["missions"]] == ["InspectionMission"]


def test_an_emergency_stop_outlives_new_missions(
    world: World, desk: Desk, missions: Path, make_node: Callable[..., RosNode]
) -> None:
    """It was told before the missions were loaded anew, and holds all the same."""
    desk.others.append(make_node("arm_server"))
    Arm(desk.others[0])
    start_all(world, missions)
    desk.in_state("READY")
    desk.set_parameter("lupin_sim", "estop", True)
    desk.until(lambda: desk.state.estop_engaged and desk.state.paused, "the stop is seen")
    drop_patrol(missions, *ONE_ROUND)
    desk.offered("PatrolMission")
    refused = desk.start("1", mission="PatrolMission")
    assert refused.error_message == "start refused: e-stop engaged"
    desk.set_parameter("lupin_sim", "estop", False)
    desk.until(lambda: not desk.state.estop_engaged, "the button is out")
    assert desk.state.paused
    assert desk.start("1", mission="PatrolMission").accepted
    desk.in_state("DONE")


@pytest.mark.core
def test_a_running_mission_is_not_touched(world: World, desk: Desk, missions: Path) -> None:
    """Files that change meanwhile wait until it is over."""
    start_all(world, missions)
    desk.in_state("READY")
    desk.offered("InspectionMission")
    desk.hit(1, "stall")  # until the files have changed
    assert desk.start("1", "5").accepted
    desk.in_state("INSPECTING")
    other = ("mission: InspectionMission", "mission: SecondMission")
    put(missions / "inspection.yaml", missions, other)
    second = desk.start("1")  # before every start the files are looked at
    assert second.error_message == "start refused: a mission is already running"
    desk.set_parameter("lupin_sim", "fault", "none")
    desk.offered("SecondMission")
    assert desk.state.lifecycle_state == "DONE"
    ended = next(state for state in desk.states if state.lifecycle_state == "DONE")
    assert ended.mission_type == "InspectionMission"
    log = world.log("mission_orchestrator").read_text(encoding="utf-8")
    assert log.index("mission ended") < log.index("missions loaded anew")


def test_a_file_that_is_put_beside_the_named_missions_is_offered_too(
    world: World, desk: Desk, missions: Path
) -> None:
    """As `lupin up inspection` starts it; what was there and is not named stays left out."""
    shutil.copy(default_missions_folder() / "exploration.yaml", missions)
    world.start_all(missions_path=default_missions_folder(), missions=[str(missions / "inspection.yaml")])
    desk.offered("InspectionMission")
    drop_patrol(missions)
    desk.offered("PatrolMission")
    assert [m["mission"] for m in desk.offers[-1]["missions"]] == ["InspectionMission", "PatrolMission"]


def refusal(desk: Desk, name: str, value: float) -> str:
    """Set a number of the orchestrator, as `ros2 param set` does, and return why not."""
    wanted = Parameter(
        name=name, value=ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=value)
    )
    request = SetParameters.Request(parameters=[wanted])
    answer = desk.call(SetParameters, "/mission_orchestrator/set_parameters", request)
    return str(answer.results[0].reason)


def test_parameters_of_missions_can_be_set_while_none_runs(world: World, desk: Desk, missions: Path) -> None:
    start_all(world, missions)
    desk.in_state("READY")
    desk.set_parameter("lupin_sim", "battery", 0.5)
    desk.until(lambda: desk.state.battery_percentage == pytest.approx(0.5), "half full")
    assert not desk.state.battery_low
    desk.set_parameter("mission_orchestrator", "battery_low_threshold", 0.6)
    desk.until(lambda: desk.state.battery_low, "half full is low now")
    assert desk.start("1").error_message == "start refused: battery low"
    drop_patrol(missions)
    desk.offered("PatrolMission")
    assert desk.state.battery_low, "what was set stays when missions come"
    assert refusal(desk, "battery_low_threshold", 2.0).startswith(
        "Parameter battery_low_threshold out of range"
    )
    assert refusal(desk, "approach_standoff_m", 0.4) == (
        "approach_standoff_m: read at the start of the node only; restart it with -p"
    )
    desk.set_parameter("mission_orchestrator", "battery_low_threshold", 0.2)
    desk.hit(1, "stall")
    assert desk.start("1").accepted
    desk.in_state("INSPECTING")
    assert refusal(desk, "battery_low_threshold", 0.6) == (
        "battery_low_threshold: can be set where a mission can be started, which is not so in INSPECTING"
    )
    assert not desk.state.battery_low
