"""The lifecycle services of real nodes, spoken to as Nav2's lifecycle manager does, without its bond."""

from __future__ import annotations

import json
import socket
from collections.abc import Sequence
from typing import Any

import pytest
from geometry_msgs.msg import PoseStamped
from lifecycle_msgs.msg import Transition, TransitionEvent
from lifecycle_msgs.srv import ChangeState, GetAvailableStates, GetAvailableTransitions, GetState
from nav2_msgs.action import NavigateToPose
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, String
from std_srvs.srv import Trigger

from lupin_engine_msgs.srv import Command
from lupin_greenhouse import PAGES_TOPIC
from lupin_msgs.srv import ConfirmTag, GetField, GetTagReading, SetArmPreset
from lupin_ros.adapter.node import GoalCallbacks, Qos
from lupin_ros.service.names import COMMAND_SERVICE, POSSIBLE_TOPIC
from tests.lupin_ros.system.safety.matrix.page import Page
from tests.lupin_ros.world import Operator, World

pytestmark = pytest.mark.timeout(180)

ORCHESTRATOR = "mission_orchestrator"
#: In the order in which a manager brings them up.
MANAGED = (
    *("greenhouse_bridge", "perception_aggregator", "lupin_twin", "lupin_arm"),
    *("nav_watchdog", "lupin_gateway", ORCHESTRATOR),
)
CONFIGURE, ACTIVATE = Transition.TRANSITION_CONFIGURE, Transition.TRANSITION_ACTIVATE
DEACTIVATE, CLEANUP = Transition.TRANSITION_DEACTIVATE, Transition.TRANSITION_CLEANUP
SHUTDOWN = Transition.TRANSITION_UNCONFIGURED_SHUTDOWN


class Manager(Operator):
    """The calls of nav2_lifecycle_manager: each transition is followed by a look at the state."""

    def change(self, node: str, transition: int, label: str = "") -> tuple[bool, str]:
        """Ask for a transition; return whether it was made, and the state after it."""
        request = ChangeState.Request(transition=Transition(id=transition, label=label))
        done = self.call(ChangeState, f"/{node}/change_state", request).success
        return done, self.state_of(node)

    def state_of(self, node: str) -> str:
        """Return the state of a node."""
        return str(self.call(GetState, f"/{node}/get_state", GetState.Request()).current_state.label)

    def all(self, nodes: Sequence[str], transition: int, state: str) -> None:
        """Take nodes through a transition, one after the other."""
        for node in nodes:
            assert self.change(node, transition) == (True, state), node

    def command(self, verb: str) -> tuple[bool, str, str]:
        """Command the orchestrator."""
        answer = self.call(Command, COMMAND_SERVICE, Command.Request(verb=verb))
        return answer.accepted, answer.code, answer.message


@pytest.fixture
def manager(ros_domain: int) -> Any:
    """A manager on the domain of the world."""
    manager = Manager("lifecycle_manager")
    yield manager
    manager.ros.close()


def _free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as found:
        return int(found.getsockname()[1])


def refusals(manager: Manager, state: str) -> None:
    """See that each node refuses with its state."""

    def why(node: str) -> str:
        return f"refused: {node} is {state}: activate it first"

    tag = GetTagReading.Request(tag_id="1")
    read = manager.call(GetTagReading, "/greenhouse_bridge/get_tag_reading", tag)
    assert read.error_message == why("greenhouse_bridge")
    confirm = manager.call(ConfirmTag, "/perception/confirm_tag", ConfirmTag.Request(expected_tag_id="1"))
    assert confirm.error_message == why("perception_aggregator")
    assert manager.call(GetField, "/twin/get_field", GetField.Request()).error_message == why("lupin_twin")
    arm = manager.call(SetArmPreset, "/lupin/arm/preset", SetArmPreset.Request(name="tuck"))
    assert arm.message == why("lupin_arm")
    start = manager.start("1")
    assert (start.accepted, start.error_message) == (False, f"start {why(ORCHESTRATOR)}")


@pytest.mark.core
def test_nav2s_lifecycle_manager_brings_all_up_and_down(world: World, manager: Manager) -> None:
    """Startup, reset, startup and shutdown; in every other state requests are refused by name."""
    heard: list[TransitionEvent] = []
    manager.ros.subscribe(TransitionEvent, "/lupin_twin/transition_event", Qos.EVENT, heard.append)
    world.start("lupin_sim", speed=10.0)
    for node in MANAGED:
        given = {"port": _free_port()} if node == "lupin_gateway" else {}
        world.start(node, autostart_node=False, **given)
    for node in MANAGED:
        assert manager.state_of(node) == "unconfigured"
    manager.in_state("READY")
    refusals(manager, "unconfigured")
    manager.all(MANAGED, CONFIGURE, "inactive")
    refusals(manager, "inactive")
    manager.all(MANAGED, ACTIVATE, "active")
    assert manager.start("1").accepted
    manager.in_state("DONE")

    assert manager.change("lupin_twin", ACTIVATE) == (False, "active")
    assert manager.change("lupin_twin", 200) == (False, "active")
    for label in ("explode", "x" * 100_000, "x\ny", "\N{SNOWMAN}"):
        assert manager.change("lupin_twin", DEACTIVATE, label) == (False, "active")
    log = world.log("lupin_twin").read_text()
    assert "lifecycle: transition 3 refused: active has no such transition" in log
    assert "Traceback" not in log
    states = manager.call(
        GetAvailableStates, "/lupin_twin/get_available_states", GetAvailableStates.Request()
    )
    assert {"unconfigured", "inactive", "active", "finalized"} <= {
        each.label for each in states.available_states
    }
    possible = manager.call(
        GetAvailableTransitions, "/lupin_twin/get_available_transitions", GetAvailableTransitions.Request()
    )
    assert {each.transition.label for each in possible.available_transitions} == {"deactivate", "shutdown"}
    assert [each.goal_state.label for each in heard if each.goal_state.id < 10] == ["inactive", "active"]

    down = MANAGED[::-1]
    manager.all(down, DEACTIVATE, "inactive")
    manager.all(down, CLEANUP, "unconfigured")
    manager.all(MANAGED, CONFIGURE, "inactive")
    manager.all(MANAGED, ACTIVATE, "active")
    manager.all(down, DEACTIVATE, "inactive")
    manager.all(down, CLEANUP, "unconfigured")
    manager.all(down, SHUTDOWN, "finalized")
    refusals(manager, "finalized")


@pytest.mark.core
def test_a_deactivated_orchestrator_holds_its_mission(world: World, manager: Manager) -> None:
    """Nothing moves, no request and no policy lets it go on; then it is activated, and a person resumes."""
    world.start_all(speed=2.0, resume_policy="continue")
    manager.in_state("READY")
    assert manager.start("1", "5").accepted
    manager.in_state("INSPECTING", "NAVIGATING")
    records: list[dict[str, Any]] = []

    def foreseen(verb: str) -> list[tuple[bool, str, str]]:
        asked = [one for one in records[-1]["requests"] if one["request"] == f"operator.{verb}"]
        return [(one["possible"], one["code"], one["reason"]) for one in asked]

    manager.ros.subscribe(String, POSSIBLE_TOPIC, Qos.LATCHED, lambda m: records.append(json.loads(m.data)))
    assert manager.change(ORCHESTRATOR, DEACTIVATE) == (True, "inactive")
    manager.held()
    told = f"restarted: {ORCHESTRATOR} was deactivated: activate it, then resume"
    assert manager.state.last_error == told
    for verb in ("resume", "abort", "dock", "skip_current"):
        text = f"{verb} refused: {ORCHESTRATOR} is inactive: activate it first"
        assert manager.command(verb) == (False, "inactive", text)
        manager.until(lambda v=verb: foreseen(v), "what can be asked")
        assert foreseen(verb)[-1] == (False, "inactive", text)  # what buttons show
    assert manager.command("pause")[0]
    assert manager.change(ORCHESTRATOR, CLEANUP) == (True, "unconfigured")
    manager.all((ORCHESTRATOR,), CONFIGURE, "inactive")
    manager.all((ORCHESTRATOR,), ACTIVATE, "active")
    seen = len(manager.states)
    manager.until(lambda: len(manager.states) > seen + 12, "more than two seconds")
    assert all(state.paused for state in manager.states[seen:])
    assert manager.command("resume")[0]
    manager.until_done(published=2)


def test_a_deactivated_arm_stops_where_it_is(world: World, manager: Manager) -> None:
    """In the midst of a motion; it is not moved again before it is active, and goes on by a request only."""
    world.start("lupin_arm_sim")
    world.start("lupin_arm", preset_duration=6.0)
    joints: list[JointState] = []
    manager.ros.subscribe(JointState, "/joint_states", Qos.DETECTION, joints.append)
    manager.until(lambda: joints, "the joints")

    def went(since: int) -> float:
        both = zip(joints[since].position, joints[-1].position, strict=True)
        return max(abs(one - other) for one, other in both)

    tuck = SetArmPreset.Request(name="tuck")
    manager.until(lambda: manager.call(SetArmPreset, "/lupin/arm/preset", tuck).success, "the preset")
    manager.until(lambda: went(0) > 0.1, "a motion")
    assert manager.change("lupin_arm", DEACTIVATE) == (True, "inactive")
    seen = len(joints) + 8
    manager.until(lambda: len(joints) > seen + 10, "a second")
    assert went(seen) < 0.02
    assert not manager.call(SetArmPreset, "/lupin/arm/preset", tuck).success
    assert manager.call(Trigger, "/lupin/arm/library/stop", Trigger.Request()).success
    assert manager.change("lupin_arm", ACTIVATE) == (True, "active")
    assert went(seen) < 0.02
    assert manager.call(SetArmPreset, "/lupin/arm/preset", tuck).success
    manager.until(lambda: went(seen) > 0.1, "a motion again")


@pytest.mark.core
def test_stops_work_in_every_state(world: World, manager: Manager) -> None:
    """The stop of a page outlives what a manager does with the gateway; the watchdog ends goals, inactive."""
    port = _start_pages(world, manager)
    stops: list[bool] = []
    manager.ros.subscribe(Bool, PAGES_TOPIC, Qos.LATCHED, lambda message: stops.append(message.data))
    for node in ("nav_watchdog", "lupin_gateway"):
        assert manager.change(node, DEACTIVATE) == (True, "inactive")
    ends = _drive(manager)
    page = Page(port)
    page.stop(True)
    manager.until(lambda: ends, "the end of the goal by the watchdog")
    assert "all goals are cancelled" in world.log("nav_watchdog").read_text()
    manager.until(lambda: manager.state.estop_engaged, "the stop")
    assert manager.change("lupin_gateway", CLEANUP) == (True, "unconfigured")
    manager.all(("lupin_gateway",), CONFIGURE, "inactive")
    manager.all(("lupin_gateway",), ACTIVATE, "active")
    page.close()
    stops.clear()
    manager.until(lambda: len(stops) > 5, "what the gateway says")
    assert all(stops)
    assert manager.state.estop_engaged


def test_gateway_and_watchdog_stay_while_something_moves(world: World, manager: Manager) -> None:
    """A mission that drives, and a goal; a page of an inactive gateway may pause and not start."""
    port = _start_pages(world, manager)
    assert manager.start("1").accepted
    manager.in_state("INSPECTING", "NAVIGATING")
    seen = len(manager.states)
    manager.until(lambda: len(manager.states) > seen + 3, "what others hear as well")
    for node in ("nav_watchdog", "lupin_gateway"):
        for transition in (DEACTIVATE, Transition.TRANSITION_ACTIVE_SHUTDOWN):
            assert manager.change(node, transition) == (False, "active")
    assert "refused: a mission drives: pause it first" in world.log("nav_watchdog").read_text()
    text = "refused: a mission has the base (INSPECTING): pause it first"
    assert text in world.log("lupin_gateway").read_text()
    assert manager.command("pause")[0]
    manager.held()
    manager.until(lambda: manager.change("lupin_gateway", DEACTIVATE)[0], "deactivated")
    page = Page(port)
    for verb, expected in (("resume", False), ("pause", True)):
        number = page.begin("call_service", service=COMMAND_SERVICE, args={"verb": verb})
        manager.until(lambda n=number: n in page.answers, verb)
        answer = page.answers[number]
        inactive = "lupin_gateway is inactive: activate it first"
        assert (inactive in str(answer["values"])) is not expected, answer
    page.close()


def _start_pages(world: World, manager: Manager) -> int:
    port = _free_port()
    world.start_all(speed=1.0)
    world.start("nav_watchdog")
    world.start("lupin_gateway", port=port)
    manager.in_state("READY")
    for node in ("nav_watchdog", "lupin_gateway"):
        assert manager.state_of(node) == "active"
    return port


def _drive(manager: Manager) -> list[int]:
    """Drive by a plain goal; return the status of its end."""
    ends: list[int] = []
    accepted: list[bool] = []
    client = manager.ros.action(NavigateToPose, "navigate_to_pose")
    manager.until(client.ready, "navigation")
    pose = PoseStamped()
    pose.header.frame_id = "map"
    pose.pose.position.x, pose.pose.position.y, pose.pose.orientation.w = 0.5, 7.5, 1.0
    reports = GoalCallbacks(
        accepted=lambda: accepted.append(True), ended=lambda status, _: ends.append(status)
    )
    client.send(NavigateToPose.Goal(pose=pose), reports)
    manager.until(lambda: accepted, "the goal is taken")
    return ends
