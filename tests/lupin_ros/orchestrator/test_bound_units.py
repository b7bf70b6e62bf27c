"""Units of bindings over real ROS 2: a service, an action and topics that know nothing of them."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from control_msgs.action import GripperCommand
from mirte_msgs.srv import GetServoOffset, SetServoAngle
from rclpy.action import ActionServer
from std_msgs.msg import Float32MultiArray, Int32

from lupin_engine.plugin.types import parse_quantity
from lupin_ros.adapter.node import RosNode
from lupin_ros.orchestrator.binding_client import BoundClient
from tests.lupin_ros.helpers import spin_until
from tests.lupin_ros.orchestrator.bound import binding_of
from tests.plugins.fakes import FakeOutlet

MakeNode = Callable[..., RosNode]
WRIST = Path(__file__).parents[3] / "docs" / "wrist" / "bindings" / "wrist.yaml"
SETTINGS = {"wrist_slack": math.radians(2), "wider": 0.01}


def quantity(text: str) -> float:
    """Return what the engine makes of a quantity in a mission."""
    found = parse_quantity(text)
    assert found is not None
    return found[0]


class Bench:
    """The client of a binding, and a node that somebody else wrote, on the other side."""

    def __init__(self, make_node: MakeNode, text: str) -> None:
        self.engine, self.other = make_node("engine"), make_node("other")
        self.nodes = [self.engine, self.other]
        self.outlet = FakeOutlet()
        self.client = BoundClient(self.engine, binding_of(text), self.outlet, SETTINGS)

    def ready(self) -> None:
        """Wait until the servers are there."""
        spin_until(self.nodes, lambda: not self.client.missing(), what="the servers")

    def ended(self, attempt: str, *kinds: str) -> tuple[Any, ...]:
        """Wait until these are the reports of an attempt, and return the last."""
        spin_until(self.nodes, lambda: self.outlet.kinds(attempt) == list(kinds), what=str(kinds))
        return self.outlet.reports[-1]


# -- the wrist of the documentation ------------------------------------------------------------------------


class Wrist(Bench):
    """The servo and the feeler of the documentation."""

    def __init__(self, make_node: MakeNode) -> None:
        super().__init__(make_node, WRIST.read_text(encoding="utf-8"))
        self.asked: list[tuple[float, bool]] = []
        plain = self.other.node
        plain.create_service(SetServoAngle, "/wrist/set_angle", self._turn)
        plain.create_service(GetServoOffset, "/wrist/get_offset", self._middle)
        self.feeler = plain.create_publisher(Int32, "/wrist/feeler", 10)
        self.ready()

    def _turn(self, request: Any, response: Any) -> Any:
        self.asked.append((request.angle, request.degrees))
        response.status = True
        return response

    def _middle(self, _: Any, response: Any) -> Any:
        response.centidegrees = -450
        return response


@pytest.fixture
def wrist(make_node: MakeNode) -> Wrist:
    """The client with its wrist, when they have found each other."""
    return Wrist(make_node)


def test_an_argument_arrives_in_the_unit_of_the_service(wrist: Wrist) -> None:
    """60 deg and the slack of 2 deg are 62 on the wire, to the last digit."""
    wrist.client.start("a1", "turn", {"angle": quantity("60 deg")})
    assert wrist.ended("a1", "accepted", "done") == ("done", "a1", {})
    assert wrist.asked == [(62.0, True)]


def test_a_result_is_kept_in_its_base_unit(wrist: Wrist) -> None:
    """-450 hundredths of a degree."""
    wrist.client.start("a1", "middle", {})
    (_, _, result) = wrist.ended("a1", "accepted", "done")
    assert result == {"off": pytest.approx(math.radians(-4.5))}


def test_an_event_tells_base_units(wrist: Wrist) -> None:
    """7 on the wire are 7 mm."""
    spin_until(wrist.nodes, lambda: wrist.feeler.get_subscription_count() == 1)
    wrist.feeler.publish(Int32(data=7))
    spin_until(wrist.nodes, lambda: wrist.outlet.events)
    assert wrist.outlet.events == [("wrist.touched", {"bent": quantity("7 mm")})]


# -- an action, and messages both ways ---------------------------------------------------------------------

GRIPPER = """
binding: gripper
summary: A gripper that counts in centimetres, with joints that count in degrees.
params:
  wider: {type: number, unit: cm, default: 1 cm, summary: how much wider it opens}
codes:
  grip_failed: {label: nothing is gripped}
operations:
  open:
    summary: Open it.
    arguments:
      width: {type: length, unit: cm, min: 0 mm, max: 20 cm, summary: between the fingers}
    action: {name: /gripper, type: control_msgs/action/GripperCommand}
    with: {command: {position: "${ width + param.wider }", max_effort: "${ width / '1 m' }"}}
    done_when: status == 'succeeded'
    code: grip_failed
    result:
      width: {type: number, unit: cm, from: "${ result.position - param.wider }"}
    mock: {result: {width: 8 cm}}
actions:
  pose:
    summary: Send joints.
    arguments:
      joints: {type: list of angle, unit: deg, summary: angles of the joints}
    topic: {name: /joints, type: std_msgs/msg/Float32MultiArray}
    with: {data: "${ joints }"}
values:
  gripper.joints:
    summary: Where the joints are.
    type: list of number
    unit: deg
    topic: {name: /joints_now, type: std_msgs/msg/Float32MultiArray}
    from: ${ message.data }
"""


class Gripper(Bench):
    """A gripper that opens as far as it is told, and tells that."""

    def __init__(self, make_node: MakeNode) -> None:
        super().__init__(make_node, GRIPPER)
        self.goals: list[tuple[float, float]] = []
        self.joints: list[list[float]] = []
        plain = self.other.node
        self._server = ActionServer(plain, GripperCommand, "/gripper", self._open)
        plain.create_subscription(
            Float32MultiArray, "/joints", lambda message: self.joints.append(list(message.data)), 10
        )
        self.now = plain.create_publisher(Float32MultiArray, "/joints_now", 10)
        self.ready()

    def _open(self, goal: Any) -> Any:
        command = goal.request.command
        self.goals.append((command.position, command.max_effort))
        goal.succeed()
        return GripperCommand.Result(position=command.position)


@pytest.fixture
def gripper(make_node: MakeNode) -> Gripper:
    """The client with its gripper, when they have found each other."""
    return Gripper(make_node)


def test_a_goal_and_its_result(gripper: Gripper) -> None:
    """There in centimetres, here in metres; a quantity divided by one is a plain number."""
    gripper.client.start("a1", "open", {"width": quantity("80 mm")})
    assert gripper.ended("a1", "accepted", "done") == ("done", "a1", {"width": quantity("8 cm")})
    assert gripper.goals == [(9.0, 0.08)]


def test_lists_have_a_unit_as_well(gripper: Gripper) -> None:
    """Each element, in both directions."""
    spin_until(gripper.nodes, lambda: gripper.other.node.count_publishers("/joints") == 1)
    spin_until(gripper.nodes, lambda: gripper.now.get_subscription_count() == 1)
    angles = [quantity("30 deg"), quantity("-90 deg")]

    def sent() -> bool:
        gripper.client.act("pose", {"joints": angles})
        return bool(gripper.joints)

    spin_until(gripper.nodes, sent)
    assert gripper.joints[0] == [30.0, -90.0]
    gripper.now.publish(Float32MultiArray(data=[30.0, -90.0]))
    spin_until(gripper.nodes, lambda: gripper.outlet.values)
    assert gripper.outlet.of("gripper.joints") == [angles]
