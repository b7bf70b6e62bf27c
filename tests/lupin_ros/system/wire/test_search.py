"""War stories of an exploration, on the running orchestrator; docs/war-stories.md links here."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Iterator, Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from geometry_msgs.msg import Quaternion
from nav_msgs.msg import OccupancyGrid

from lupin_greenhouse.layout import BUNDLED
from lupin_msgs.msg import DiscoveredTag, DiscoveredTags
from lupin_msgs.srv import StartMission
from lupin_ros.adapter.node import Qos
from tests.lupin_ros.system.wire.wire import AT_ONCE, OK, Drive, Wire

pytestmark = pytest.mark.timeout(120)

UNKNOWN, FREE, WALL = -1, 0, 100
#: The edges of a map in metres; it begins at the origin.
LENGTH, WIDTH = 6.0, 4.0
#: What a planner keeps from walls, in metres.
CLEARANCE = 0.35


class Search(Wire):
    """The wire of a search: a map, and the tags that were seen."""

    def __init__(self, folder: Path, **parameters: Any) -> None:
        super().__init__(folder, **parameters)
        self._map = self.ros.publisher(OccupancyGrid, "/map", Qos.LATCHED)
        self._seen = self.ros.publisher(DiscoveredTags, "/perception/discovered_tags", Qos.LATCHED)
        self._sightings = 3

    def begin(self) -> None:
        """Come to rest, with a map of which there is more to find."""
        super().begin()
        self.draw(half_open)

    def draw(self, cell: Callable[[float, float], int], resolution: float = 0.1) -> list[tuple[float, float]]:
        """Tell a map; return where its walls are."""
        grid = OccupancyGrid()
        grid.header.frame_id = "map"
        grid.info.resolution = resolution
        grid.info.width, grid.info.height = round(LENGTH / resolution), round(WIDTH / resolution)
        grid.info.origin.orientation.w = 1.0
        places = [
            ((column + 0.5) * resolution, (row + 0.5) * resolution)
            for row in range(grid.info.height)
            for column in range(grid.info.width)
        ]
        grid.data = [cell(*place) for place in places]
        self._map.publish(grid)
        return [place for place, value in zip(places, grid.data, strict=True) if value == WALL]

    def see(self, distances: Mapping[str, float], again: bool = False) -> None:
        """Tell tags that were seen just now, so far from where the robot is, and lying flat."""
        places = {name: (distance, 0.0) for name, distance in distances.items()}
        self.see_at(places, Quaternion(w=1.0), again)

    def see_at(
        self, places: Mapping[str, tuple[float, float]], facing: Quaternion, again: bool = False
    ) -> None:
        """Tell tags that were seen just now at these places, all facing the same way.

        Each time they were seen once more, for what is told just the same in two missions is not news.
        """
        message = DiscoveredTags()
        message.header.stamp = self.ros.stamp()
        self._sightings += not again
        for name, (x, y) in places.items():
            tag = DiscoveredTag(tag_id=name, sightings=self._sightings)
            tag.pose_in_map.position.x, tag.pose_in_map.position.y = x, y
            tag.pose_in_map.orientation = facing
            message.tags.append(tag)
        self._seen.publish(message)

    def explore(self, goal: int) -> str:
        """Start an exploration; return its id."""
        request = StartMission.Request(mission_type="ExplorationMission", discovery_goal=goal)
        answer = self.operator.call(StartMission, "/mission/start", request)
        assert answer.accepted, answer.error_message
        return str(answer.mission_id)

    def until_sweep(self, distances: Mapping[str, float]) -> str:
        """Start an exploration and let it see all its tags on the first leg; return its id."""
        self.base.plan.appendleft(Drive.accept)
        mission = self.explore(len(distances))
        self.until_driving()
        self.see(distances)
        self.until(lambda: self.operator.state.lifecycle_state == "MONITORING", "the sweep")
        return mission

    def visits(self, mission: str) -> list[tuple[str, int]]:
        """Return the tags that were visited in sweeps, with their outcomes."""
        told = [o for o in self.operator.observations if o.mission_id == mission]
        return [(o.tag_reading.tag_id, o.status) for o in told if o.source == "MonitoringMission"]


def half_open(x: float, y: float) -> int:
    """Return a cell of a hall of which the far half is not known yet."""
    return FREE if x < LENGTH / 2 else UNKNOWN


def closed(x: float, y: float) -> int:
    """Return a cell of a hall with walls all around."""
    return FREE if 0.2 < x < LENGTH - 0.2 and 0.2 < y < WIDTH - 0.2 else WALL


def along_a_wall(x: float, y: float) -> int:
    """Return a cell of a strip of 0.3 m before a wall, which ends in a wider place."""
    if y < 0.2:
        return WALL
    return FREE if y < 0.5 or (x > 4.5 and y < 2.0) else UNKNOWN


@pytest.fixture(scope="module")
def running(ros_domain: int, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Search]:
    """One node for all tests here: each leaves it with its mission ended."""
    given = {"monitoring_sweeps": 1, "seed_climate_on_discovery": False}
    wire = Search(tmp_path_factory.mktemp("wire"), **given)
    wire.offer_base()
    wire.offer_bridge()
    wire.start_node()
    yield wire
    wire.close()


@pytest.mark.parametrize("divert", ["battery", "dock"])
def test_a_sweep_that_was_interrupted_goes_on_where_it_was(wire: Search, divert: str) -> None:
    """Stories 4, 8 and A9: it ended, stood still, or began anew."""
    wire.base.plan.extend([Drive.arrive_at_once, Drive.accept])
    mission = wire.until_sweep({"1": 1.0, "2": 2.0, "3": 3.0})
    second = wire.until_driving(3)
    if divert == "battery":
        wire.battery(0.1)
    else:
        wire.ask("dock")
    wire.until_docked()
    wire.charge()
    wire.ask("resume")
    wire.until_done(mission)
    wire.until(lambda: len(wire.visits(mission)) >= 3, "all visits")
    assert wire.visits(mission) == [("1", OK), ("2", OK), ("3", OK)]
    assert wire.drives[4].place == second.place
    told = [state.lifecycle_state for state in wire.operator.states if state.mission_id == mission]
    changes = [after for before, after in pairwise(told) if before != after]
    assert changes == ["EXPLORING", "MONITORING", "RETURNING", "MONITORING", "RETURNING", "DONE"]


def test_an_abort_at_the_dock_ends_a_sweep(wire: Search) -> None:
    """Story 9: the callback crashed."""
    wire.base.plan.extend([Drive.arrive_at_once, Drive.accept])
    mission = wire.until_sweep({"1": 1.0, "2": 2.0})
    wire.until_driving(3)
    wire.ask("dock")
    wire.until_docked()
    wire.ask("abort")
    wire.until_done(mission)
    assert wire.visits(mission) == [("1", OK)]
    wire.until_done(wire.start("1"))


#: How far they are: neither in the order of texts nor of numbers.
FIVE = {"15": 2.0, "18": 5.0, "2": 3.0, "3": 1.0, "5": 4.0}
NEAREST = ["3", "15", "2", "5", "18"]


def test_a_sweep_visits_the_nearest_first_and_ends(wire: Search) -> None:
    """Story 16: in the order of texts, for ever."""
    mission = wire.until_sweep(FIVE)
    wire.until_done(mission)
    wire.until(lambda: len(wire.visits(mission)) >= 5, "all visits")
    assert [tag for tag, _ in wire.visits(mission)] == NEAREST


def test_sweeps_without_a_number_go_on_until_told_otherwise(wire: Search) -> None:
    """Story 16: where that is what somebody wants."""
    wire.configure(monitoring_sweeps=0)
    wire.base.plan.extend([Drive.arrive_at_once] * 6 + [Drive.accept])
    mission = wire.until_sweep(FIVE)
    wire.until_driving(8)
    wire.ask("abort")
    wire.until_done(mission)
    assert [tag for tag, _ in wire.visits(mission)] == [*NEAREST, "3"]


@pytest.mark.parametrize("resolution", [0.05, 0.025])
def test_goals_of_a_search_keep_their_distance_from_walls(wire: Search, resolution: float) -> None:
    """Story 18: they kept four cells, and planners refused them."""
    walls = wire.draw(along_a_wall, resolution)
    wire.localize(1.0, 0.35)
    wire.until_quiet()
    wire.base.plan.append(Drive.accept)
    mission = wire.explore(1)
    goal = wire.until_driving().place
    wire.ask("abort")
    wire.until_done(mission)
    assert min(math.dist(goal, wall) for wall in walls) >= CLEARANCE


def test_a_tag_counts_that_is_found_anew_just_as_it_was_found_before(wire: Search) -> None:
    """Story A17, the other way round: what a registry has left out since the start is a find."""
    wire.until_done(wire.until_sweep({"1": 1.0}))
    wire.base.plan.append(Drive.accept)
    driven = len(wire.drives)
    mission = wire.explore(1)
    wire.until_driving(driven + 1)
    wire.see({"1": 1.0}, again=True)
    wire.until_quiet()
    assert wire.operator.state.tags_discovered == 0
    wire.see({}, again=True)
    wire.until_quiet()  # only the last of several lists is kept for who has no time
    wire.see({"1": 1.0}, again=True)
    wire.until_done(mission)
    wire.until(lambda: wire.visits(mission), "the visit")
    assert wire.visits(mission) == [("1", OK)]


def test_no_goal_of_a_sweep_lies_in_a_table_of_the_layout(wire: Search) -> None:
    """Story 19: the plate of tag 26 faces the table across the aisle."""
    layout = json.loads(BUNDLED.read_text(encoding="utf-8"))
    tag, tables = layout["tags"]["26"], layout["tables"].values()
    wire.base.plan.append(Drive.accept)
    mission = wire.explore(1)
    wire.until_driving()
    half = math.sqrt(0.5)
    wire.see_at({"26": (tag["x"], tag["y"])}, Quaternion(x=-half, w=half))
    wire.until_done(mission)
    x, y = wire.drives[1].place
    assert y > tag["y"], "before the plate"
    assert not any(t["x0"] <= x <= t["x1"] and t["y0"] <= y <= t["y1"] for t in tables)


@pytest.mark.parametrize("tags", [{}, {"1": 1.0}], ids=["nothing", "a tag"])
def test_a_search_without_frontiers_ends_before_its_time(wire: Search, tags: dict[str, float]) -> None:
    """Story A21: it went on for its 180 s. What was found is visited."""
    wire.configure(frontier_timeout_s=1.0)
    wire.draw(closed)
    wire.until_quiet()
    mission = wire.explore(2)
    wire.operator.in_state("EXPLORING")
    wire.see(tags)
    wire.until_done(mission)
    wire.until(lambda: len(wire.visits(mission)) >= len(tags), "all visits")
    assert wire.visits(mission) == [(tag, OK) for tag in tags]
    assert wire.operator.state.last_error.startswith("no_frontiers: no frontier in a map of 2400 known cells")


def test_a_search_sets_off_however_uncertain_the_pose_is(wire: Search) -> None:
    """Story 24: its map is in the making, and the limit of an inspection failed every leg."""
    wire.base.plan.extend([Drive.accept, Drive.accept])
    mission = wire.explore(1)
    first = wire.until_driving()
    wire.localize(variance=9.0)
    wire.until_quiet()
    first.arrive()
    wire.until_driving(2)
    wire.see({"1": 1.0})
    wire.until_done(mission)
    wire.until(lambda: wire.visits(mission), "the visit")
    assert wire.visits(mission) == [("1", OK)]


def test_a_search_whose_time_is_up_on_the_way_drives_home_at_once(wire: Search) -> None:
    """Story A2: no goal was sent any more."""
    wire.configure(exploration_timeout_s=1.0)
    wire.base.plan.append(Drive.accept)
    mission = wire.explore(3)
    leg = wire.until_driving()
    wire.until_done(mission)
    assert leg.ended is not None
    assert [drive.arrived - leg.ended < AT_ONCE for drive in wire.drives[1:]] == [True]
    assert wire.operator.state.last_error == "exploration_timeout"


def test_a_divert_on_the_way_drives_home_at_once_and_does_not_renew_the_time(wire: Search) -> None:
    """Stories A3 and A9: the dock goal came 3 s late, and after charging the time began anew."""
    limit = 2.5
    wire.configure(exploration_timeout_s=limit)
    wire.base.plan.append(Drive.accept)
    mission = wire.explore(3)
    leg = wire.until_driving()
    wire.until_later(0.6 * limit)
    wire.battery(0.1)
    wire.until_docked()
    assert leg.ended is not None
    assert wire.drives[1].arrived - leg.ended < AT_ONCE
    wire.until_later(0.4 * limit)  # at the dock no time runs
    wire.charge()
    wire.base.plan.append(Drive.accept)
    wire.ask("resume")
    wire.until_driving(3)
    resumed = time.monotonic()
    wire.until_done(mission)
    assert wire.drives[3].arrived - resumed < 0.8 * limit
    assert wire.operator.state.last_error == "exploration_timeout"
