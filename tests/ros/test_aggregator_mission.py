"""The aggregator fed by the simulated cameras: alone with the robot, and in a whole exploration."""

from __future__ import annotations

import math
import signal
from collections.abc import Callable
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="ROS 2 is not installed here")
pytest.importorskip("greenhouse_sim", reason="mdp-greenhouse is not installed here")

from nav2_msgs.action import NavigateToPose

from lupin_engine.middleware.node import Qos, RosNode
from lupin_msgs.msg import DiscoveredTags, Observation
from lupin_msgs.srv import StartMission
from lupin_perception.node import NAME, Aggregator
from lupin_perception.node import PARAMETERS as AGGREGATOR_PARAMETERS
from lupin_sim.camera import Plate, plates_of
from lupin_sim.detector import CLASSES, PEST, blooms_of
from lupin_sim.layout import load_layout
from lupin_sim.node import PARAMETERS as SIM_PARAMETERS
from lupin_sim.node import SimNode
from tests.ros.helpers import spin_until
from tests.ros.world import Operator, World

pytestmark = [pytest.mark.ros, pytest.mark.timeout(180)]

MakeNode = Callable[..., RosNode]
FEED = "/perception/discovered_tags"


def plates() -> dict[str, Plate]:
    return {plate.id: plate for plate in plates_of(load_layout())}


def species_of(tag_id: str) -> str:
    return CLASSES[blooms_of(tag_id)[0].kind]


class Pair:
    """The simulated robot and the aggregator, with an audience."""

    def __init__(self, make_node: MakeNode, start: str, *arguments: str) -> None:
        given = ["--ros-args", "-p", "detector:=true", "-p", f"start_pose:={start}", *arguments]
        self.robot = make_node("lupin_sim", given, SIM_PARAMETERS)
        self.sim = SimNode(self.robot)
        often = ["--ros-args", "-p", "publish_rate_hz:=50.0"]
        self.server = make_node(NAME, often, AGGREGATOR_PARAMETERS)
        Aggregator(self.server)
        self.audience = make_node("audience")
        self.lists: list[Any] = []
        self.observations: list[Any] = []
        self.audience.subscribe(DiscoveredTags, FEED, Qos.LATCHED, self.lists.append)
        self.audience.subscribe(Observation, "/floranova/observations", Qos.BACKLOG, self.observations.append)

    def until(self, condition: Callable[[], Any], what: str = "") -> None:
        spin_until([self.robot, self.server, self.audience], condition, what=what)

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
    publishers = pair.audience.node.get_publishers_info_by_topic(FEED)
    assert [publisher.node_name for publisher in publishers] == [NAME], "the robot's own feed is off"


def test_tags_seen_on_the_way_are_placed_as_well(make_node: MakeNode) -> None:
    """A tag is placed by where the camera was when it saw it, however late that is heard of."""
    pair = Pair(make_node, "[0.6, 0.6, 1.5708]", "-p", "speed:=2.0", "-p", "tag_field_of_view:=3.0")
    action, ends = pair.audience.action(NavigateToPose, "navigate_to_pose"), []
    pair.until(action.ready)
    goal = NavigateToPose.Goal()
    goal.pose.header.frame_id = "map"
    goal.pose.pose.position.x, goal.pose.pose.position.y = 0.6, 7.5
    goal.pose.pose.orientation.w = 1.0
    action.send(
        goal,
        accepted=lambda: None,
        feedback=lambda _: None,
        ended=lambda status, _: ends.append(status),
        rejected=lambda: ends.append(0),
    )
    pair.until(lambda: ends and len(pair.tags()) >= 3, "the drive has shown three tags")
    assert ends == [4]
    known = plates()
    assert [name for name, tag in pair.tags().items() if not is_placed(tag.pose_in_map, known[name])] == []


def explore(world: World, operator: Operator) -> str:
    """Start everything with the aggregator, and the mission; returns its id."""
    world.start("greenhouse_bridge")
    world.start("lupin_sim", speed=2.0, detector=True)
    world.start(NAME)
    world.start("mission_orchestrator", monitoring_sweeps=1, flower_scan_dwell_s=1.0)
    operator.in_state("READY")
    request = StartMission.Request(mission_type="ExplorationMission", discovery_goal=4)
    answer = operator.call(StartMission, "/mission/start", request)
    assert answer.accepted, answer.error_message
    return str(answer.mission_id)


def beds(operator: Operator, mission_id: str) -> dict[str, Any]:
    """What was told of flowers, by tag."""
    told = [o for o in operator.observations if o.kind == Observation.KIND_FLOWER]
    return {o.flower.tag_id: o.flower for o in told if o.mission_id == mission_id}


def test_an_exploration_finds_its_tags_and_their_flowers_by_the_aggregator(
    world: World, operator: Operator
) -> None:
    mission_id = explore(world, operator)
    operator.in_state("DONE")
    assert operator.state.targets_completed == operator.state.targets_total >= 4
    visited = {o.tag_reading.tag_id for o in operator.observations if o.source == "MonitoringMission"}
    found = beds(operator, mission_id)
    assert set(found) == visited
    for tag_id, bed in found.items():
        pest = any(bloom.kind == PEST for bloom in blooms_of(tag_id))
        assert (bed.species, bed.anomaly) == (species_of(tag_id), pest)
        assert is_placed(bed.pose.pose, plates()[tag_id])
        assert len(bed.box_footprint.points) == 4


def test_an_aggregator_that_was_killed_and_started_again_goes_on(world: World, operator: Operator) -> None:
    """The tags that are still to be visited are seen again there, and their flowers told."""
    mission_id = explore(world, operator)
    operator.until(lambda: beds(operator, mission_id), "the first flowers")
    before = set(beds(operator, mission_id))
    world.processes[NAME].send_signal(signal.SIGKILL)
    world.processes[NAME].wait(10.0)
    world.start(NAME)
    operator.in_state("DONE")
    assert operator.state.targets_completed == operator.state.targets_total >= 4
    after = {o.flower.tag_id for o in operator.observations if o.kind == Observation.KIND_FLOWER} - before
    assert after, "flowers after the restart"
