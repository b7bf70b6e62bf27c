"""The exploration mission over real ROS 2: what is read, published and counted, tag by tag."""

from __future__ import annotations

import math
import signal
from collections import Counter
from typing import Any

import pytest

pytest.importorskip("greenhouse_sim", reason="mdp-greenhouse is not installed here")

from geometry_msgs.msg import PoseWithCovarianceStamped

from lupin_engine.plugin.wire import seconds_of
from lupin_msgs.msg import DiscoveredTag, DiscoveredTags, Observation
from lupin_msgs.srv import StartMission
from lupin_ros.adapter.node import Qos
from lupin_sim.camera import Plate, plates_of
from lupin_sim.detector import CLASSES, PEST, blooms_of
from lupin_sim.layout import load_layout
from tests.lupin_ros.world import Operator, World

pytestmark = pytest.mark.timeout(180)

SEEDED, WATCHED = "ExplorationMission", "MonitoringMission"
AGGREGATOR = "perception_aggregator"
PLATES = {plate.id: plate for plate in plates_of(load_layout())}


def explore(operator: Operator, goal: int) -> str:
    """Start the mission and return its id."""
    operator.until(
        lambda: operator.states and operator.state.lifecycle_state in ("READY", "DONE"), "READY or DONE"
    )
    request = StartMission.Request(mission_type=SEEDED, discovery_goal=goal)
    answer = operator.call(StartMission, "/mission/start", request)
    assert answer.accepted, answer.error_message
    return str(answer.mission_id)


def tags(operator: Operator, source: str) -> list[str]:
    return [o.tag_reading.tag_id for o in operator.observations if o.source == source]


def until_done(operator: Operator) -> None:
    """Wait until the mission has ended and every reading of its sweep has come: two topics keep no order."""
    operator.in_state("DONE")
    read = operator.state.targets_total
    operator.until(lambda: len(tags(operator, WATCHED)) >= read, f"{read} readings")


def until_beds_are_told(operator: Operator, mission_id: str) -> None:
    """Wait until there was a word of the flowers at every tag that was read."""
    operator.until(lambda: beds(operator, mission_id).keys() >= set(tags(operator, WATCHED)), "the flowers")


def readings(operator: Operator, mission_id: str) -> list[Any]:
    """The readings of a mission; without one the aggregator reads what is in sight."""
    told = [o for o in operator.observations if o.mission_id == mission_id]
    return [o for o in told if o.kind == Observation.KIND_TAG_READING]


def beds(operator: Operator, mission_id: str) -> dict[str, Any]:
    """What was told of flowers, by tag."""
    told = [o for o in operator.observations if o.kind == Observation.KIND_FLOWER]
    return {o.flower.tag_id: o.flower for o in told if o.mission_id == mission_id}


def is_there(pose: Any, plate: Plate) -> bool:
    """Say whether a tag is told where its plate hangs, and facing as it does."""
    place, q = pose.position, pose.orientation
    normal = 2.0 * (q.x * q.z + q.w * q.y), 2.0 * (q.y * q.z - q.w * q.x)
    aims = normal == pytest.approx((math.cos(plate.yaw), math.sin(plate.yaw)), abs=1e-3)
    return bool(aims) and math.dist((place.x, place.y), (plate.x, plate.y)) < 1e-3


def test_tags_are_read_when_seen_and_again_when_visited_and_their_flowers_are_told(
    world: World, operator: Operator
) -> None:
    """Each once as a seed and once in the sweep, where its plate is; the published mission stays the same."""
    world.start_search(speed=4.0, monitoring_sweeps=1, flower_scan_dwell_s=1.0)
    mission_id = explore(operator, 4)
    until_done(operator)
    until_beds_are_told(operator, mission_id)
    visited = tags(operator, WATCHED)
    assert len(visited) == len(set(visited)) == operator.state.targets_total >= 4
    assert max(Counter(tags(operator, SEEDED)).values()) == 1
    for observation in readings(operator, mission_id):
        assert (observation.status, observation.status_detail) == (Observation.STATUS_OK, "")
        assert is_there(observation.tag_pose_in_map, PLATES[observation.tag_reading.tag_id])
    assert {s.mission_type for s in operator.states if s.mission_id} == {SEEDED}
    found = beds(operator, mission_id)
    assert set(found) == set(visited)
    for tag_id, bed in found.items():
        blooms = blooms_of(tag_id)
        pest = any(bloom.kind == PEST for bloom in blooms)
        assert (bed.species, bed.anomaly) == (CLASSES[blooms[0].kind], pest)
        assert is_there(bed.pose.pose, PLATES[tag_id])
        assert len(bed.box_footprint.points) == 4


def test_an_aggregator_that_is_killed_and_started_again_changes_nothing(
    world: World, operator: Operator
) -> None:
    """In the middle of the search: what was found stays found, and the mission goes on to its end.

    The robot stands until the new one is there: with nobody who looks it would have seen everything in vain.
    """
    lists: list[DiscoveredTags] = []
    operator.ros.subscribe(DiscoveredTags, "/perception/discovered_tags", Qos.LATCHED, lists.append)
    world.start_search(speed=4.0, monitoring_sweeps=1, flower_scan_dwell_s=1.0)
    mission_id = explore(operator, 5)
    operator.until(lambda: operator.state.tags_discovered >= 2, "two tags")
    operator.hit(1, "stall")
    world.processes[AGGREGATOR].send_signal(signal.SIGKILL)
    world.processes[AGGREGATOR].wait(10.0)
    killed = operator.ros.now()
    world.start(AGGREGATOR)
    operator.until(lambda: any(seconds_of(told.header.stamp) > killed for told in lists), "the new one")
    operator.set_parameter("lupin_sim", "fault", "none")
    until_done(operator)
    until_beds_are_told(operator, mission_id)
    found = [s.tags_discovered for s in operator.states if s.lifecycle_state == "EXPLORING"]
    assert found == sorted(found), "nothing that was found was lost"
    assert operator.state.targets_completed == operator.state.targets_total >= 5
    assert set(beds(operator, mission_id)) == set(tags(operator, WATCHED))


def test_a_second_search_begins_with_nothing(world: World, operator: Operator) -> None:
    """War stories A17 and A41: what the first one found is not there at once in the second."""
    world.start_search(monitoring_sweeps=1, seed_climate_on_discovery=False)
    explore(operator, 3)
    operator.in_state("DONE")
    second = explore(operator, 3)
    operator.until(lambda: operator.state.mission_id == second, "the second mission")
    operator.in_state("DONE")
    operator.until(lambda: len(tags(operator, WATCHED)) >= 6, "the readings of both")
    states = [s for s in operator.states if s.mission_id == second]
    searching = [s for s in states if s.lifecycle_state == "EXPLORING"]
    assert searching, "it had to search again"
    assert searching[0].tags_discovered == 0
    log = world.log("mission_orchestrator").read_text()
    assert log.count("from before the mission") <= 3, "what is told twice a second is noted once"


def test_a_latched_list_of_an_earlier_day_counts_for_nothing(world: World, operator: Operator) -> None:
    """A41: a registry that was never restarted tells its old finds to whoever subscribes."""
    feed = operator.ros.publisher(DiscoveredTags, "/perception/discovered_tags", Qos.LATCHED)
    plates = list(PLATES.values())[:3]
    old = DiscoveredTags()
    old.header.stamp = operator.ros.stamp()
    for plate in plates:
        old.tags.append(_tag(plate.id, plate.x, plate.y))
    feed.publish(old)
    world.start("greenhouse_bridge")
    world.start("lupin_sim", speed=10.0)
    world.start("mission_orchestrator", exploration_timeout_s=2.0)
    mission_id = explore(operator, 3)
    operator.in_state("DONE")
    mine = [s for s in operator.states if s.mission_id == mission_id]
    assert {s.tags_discovered for s in mine} == {0}
    assert operator.state.last_error == "exploration_timeout"
    assert readings(operator, mission_id) == []


def _tag(name: str, x: float, y: float) -> DiscoveredTag:
    tag = DiscoveredTag(tag_id=name, sightings=9)
    tag.pose_in_map.position.x, tag.pose_in_map.position.y = x, y
    tag.pose_in_map.orientation.w = 1.0
    return tag


def test_without_a_map_the_search_ends_and_says_what_was_missing(world: World, operator: Operator) -> None:
    """War story 22: not only that it took too long."""
    world.start("greenhouse_bridge")
    world.start("lupin_sim", start_pose="[0.5, 0.5, 3.0]")  # with no tag in view
    world.start("mission_orchestrator", map_topic="/nowhere", frontier_timeout_s=1.0)
    explore(operator, 3)
    operator.in_state("DONE")
    assert operator.state.last_error == "no_frontiers: no /nowhere received"
    assert (operator.state.targets_total, operator.state.targets_completed) == (3, 0)
    assert "MONITORING" not in {s.lifecycle_state for s in operator.states}


def test_docking_while_it_searches_and_resuming_searches_on(world: World, operator: Operator) -> None:
    """The map that was seen stays known, and so do the tags: it is one mission."""
    world.start_search(speed=4.0, monitoring_sweeps=1)
    operator.hit(1, "stall")  # one tag is in view from the start, and nothing is missed meanwhile
    mission_id = explore(operator, 4)
    operator.until(lambda: operator.state.tags_discovered >= 1, "the first tag")
    assert operator.ask("dock").success
    operator.until(lambda: operator.state.lifecycle_state == "RETURNING" and operator.state.paused, "docked")
    found = operator.state.tags_discovered
    assert found >= 1
    assert operator.ask("resume").success
    operator.in_state("EXPLORING")
    assert operator.state.tags_discovered >= found
    until_done(operator)
    assert operator.state.mission_id == mission_id
    assert len(set(tags(operator, WATCHED))) >= 4


@pytest.mark.core
def test_a_pause_on_the_way_to_a_frontier_stops_the_robot(world: World, operator: Operator) -> None:
    """Nothing new is chosen, driven to or found while it is held."""
    world.start_search(speed=1.0, monitoring_sweeps=1)
    explore(operator, 4)
    operator.in_state("EXPLORING")
    assert operator.ask("pause").success
    operator.until(lambda: operator.state.paused, "paused")
    poses: list[PoseWithCovarianceStamped] = []
    operator.ros.subscribe(PoseWithCovarianceStamped, "/amcl_pose", Qos.LATCHED, poses.append)
    operator.until(lambda: len(poses) >= 2 and _place(poses[-1]) == _place(poses[-2]), "standing still")
    stopped = len(poses)
    operator.until(lambda: len(poses) >= stopped + 2, "two more poses")
    places = {_place(pose) for pose in poses[stopped - 1 :]}
    assert len(places) == 1
    assert operator.ask("resume").success
    operator.until(lambda: not operator.state.paused, "resumed")
    (place,) = places
    operator.until(lambda: _place(poses[-1]) != place, "the robot drives on")
    assert operator.ask("abort").success
    operator.in_state("DONE")


def _place(message: PoseWithCovarianceStamped) -> tuple[float, float]:
    return message.pose.pose.position.x, message.pose.pose.position.y
