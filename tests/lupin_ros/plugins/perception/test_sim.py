"""The aggregator fed by the simulated cameras."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import pytest
from nav2_msgs.action import NavigateToPose

from lupin_msgs.msg import DiscoveredTags, Observation
from lupin_perception.node import NAME, Aggregator
from lupin_perception.node import PARAMETERS as AGGREGATOR_PARAMETERS
from lupin_ros.adapter.node import GoalCallbacks, Qos, RosNode
from lupin_sim.camera import Plate, plates_of
from lupin_sim.detector import CLASSES, blooms_of
from lupin_sim.layout import load_layout
from lupin_sim.node import PARAMETERS as SIM_PARAMETERS
from lupin_sim.node import SimNode
from tests.lupin_ros.helpers import PATIENCE, spin_until

pytestmark = pytest.mark.timeout(180)

MakeNode = Callable[..., RosNode]
FEED = "/perception/discovered_tags"


def plates() -> dict[str, Plate]:
    return {plate.id: plate for plate in plates_of(load_layout())}


def species_of(tag_id: str) -> str:
    return CLASSES[blooms_of(tag_id)[0].kind]


#: Seconds that pass with each turn of the nodes.
TURN_S = 0.01


class Pair:
    """The simulated robot and the aggregator, with an audience.

    Time passes as they work: on a slow machine the robot drives slower, and neither sees less on its way.
    """

    def __init__(self, make_node: MakeNode, start: str, *arguments: str) -> None:
        given = ["--ros-args", "-p", f"start_pose:={start}", *arguments]
        self.now = 0.0
        self.robot = make_node("lupin_sim", given, SIM_PARAMETERS)
        self.robot.elapsed = lambda: self.now  # type: ignore[method-assign]
        self.sim = SimNode(self.robot)
        often = ["--ros-args", "-p", "publish_rate_hz:=50.0", "-p", "memory_file:=none"]
        self.server = make_node(NAME, often, AGGREGATOR_PARAMETERS)
        self.server.elapsed = self.robot.elapsed  # type: ignore[method-assign]
        Aggregator(self.server)
        self.audience = make_node("audience")
        self.lists: list[Any] = []
        self.observations: list[Any] = []
        self.audience.subscribe(DiscoveredTags, FEED, Qos.LATCHED, self.lists.append)
        self.audience.subscribe(Observation, "/floranova/observations", Qos.BACKLOG, self.observations.append)

    def until(self, condition: Callable[[], Any], what: str = "", timeout: float = PATIENCE) -> None:
        def holds() -> Any:
            self.now += TURN_S
            return condition()

        spin_until([self.robot, self.server, self.audience], holds, timeout, what)

    def tags(self) -> dict[str, Any]:
        return {tag.tag_id: tag for tag in self.lists[-1].tags} if self.lists else {}


def is_placed(pose: Any, plate: Plate) -> bool:
    """Say whether a tag is told where its plate hangs, to the millimetre, and facing as it does."""
    place, q = pose.position, pose.orientation
    near = math.dist((place.x, place.y), (plate.x, plate.y)) < 1e-3
    normal = 2.0 * (q.x * q.z + q.w * q.y), 2.0 * (q.y * q.z - q.w * q.x)
    return near and normal == pytest.approx((math.cos(plate.yaw), math.sin(plate.yaw)), abs=1e-3)


def test_what_the_simulated_cameras_see_is_placed_and_told(make_node: MakeNode) -> None:
    """In front of tag 19, which hangs on the left end of its table."""
    pair = Pair(make_node, "[0.9, 0.6, 0.0]")
    pair.until(lambda: pair.tags() and pair.observations, "tag 19 and its flowers")
    assert is_placed(pair.tags()["19"].pose_in_map, plates()["19"])
    (told,) = pair.observations
    assert (told.kind, told.flower.tag_id, told.flower.species) == (
        Observation.KIND_FLOWER,
        "19",
        species_of("19"),
    )
    assert len(told.flower.flowers) > 0


def test_tags_seen_on_the_way_are_placed_as_well(make_node: MakeNode) -> None:
    """A tag is placed by where the camera was when it saw it, however late that is heard of."""
    pair = Pair(make_node, "[0.6, 0.6, 1.5708]", "-p", "speed:=1.0", "-p", "tag_field_of_view:=3.0")
    action, ends = pair.audience.action(NavigateToPose, "navigate_to_pose"), []
    pair.until(action.ready)
    goal = NavigateToPose.Goal()
    goal.pose.header.frame_id = "map"
    goal.pose.pose.position.x, goal.pose.pose.position.y = 0.6, 7.5
    goal.pose.pose.orientation.w = 1.0
    action.send(
        goal, GoalCallbacks(ended=lambda status, _: ends.append(status), rejected=lambda: ends.append(0))
    )
    pair.until(lambda: ends and len(pair.tags()) >= 3, "the drive has shown three tags", 120.0)
    assert ends == [4]
    known = plates()
    assert [name for name, tag in pair.tags().items() if not is_placed(tag.pose_in_map, known[name])] == []


def test_a_pest_in_the_aisle_is_reported_where_the_robot_saw_it(make_node: MakeNode) -> None:
    """It sits where no tag is in view, 0.8 m ahead of a robot that looks at the wall."""
    pair = Pair(make_node, "[0.9, 0.6, 3.1416]", "-p", "pests:=[0.1, 0.6]")
    pair.until(lambda: pair.observations, "the report")
    (told,) = pair.observations
    assert told.kind == Observation.KIND_ANOMALY
    place = told.anomaly.pose.pose.position
    assert (place.x, place.y) == pytest.approx((0.9, 0.6), abs=1e-3)
    assert told.anomaly.description == "bug seen where no tag is in sight (confidence 0.80)"
