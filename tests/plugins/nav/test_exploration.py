"""What choose_frontier waits for, what it says meanwhile, and what it chooses; without a network."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="ROS 2 is not installed here")

from geometry_msgs.msg import PoseWithCovarianceStamped, TransformStamped
from nav_msgs.msg import OccupancyGrid
from tf2_msgs.msg import TFMessage

from lupin_nav.client import SEARCH_PERIOD_S
from lupin_nav.exploration import SILENCE_S
from lupin_ros.adapter.node import Qos
from tests.plugins.nav.bench import NavBench

NO_POSE = "no pose: no transform from map to base_link, no /amcl_pose"


def grid(cells: Any, resolution: float = 0.5, frame: str = "map") -> OccupancyGrid:
    array = np.asarray(cells, dtype=np.int8)
    message = OccupancyGrid()
    message.header.frame_id = frame
    message.info.height, message.info.width = array.shape
    message.info.resolution = resolution
    message.info.origin.orientation.w = 1.0
    message.data.frombytes(array.tobytes())
    return message


def half_known() -> np.ndarray[Any, Any]:
    """20 x 20 cells: the left half is free, the right one unknown."""
    cells = np.full((20, 20), -1)
    cells[:, :10] = 0
    return cells


def at(x: float, y: float) -> PoseWithCovarianceStamped:
    message = PoseWithCovarianceStamped()
    message.header.frame_id = "map"
    message.pose.pose.position.x, message.pose.pose.position.y = x, y
    message.pose.pose.orientation.w = 1.0
    return message


def transform(parent: str, child: str, x: float, y: float) -> TFMessage:
    stamped = TransformStamped(child_frame_id=child)
    stamped.header.frame_id = parent
    stamped.transform.translation.x, stamped.transform.translation.y = x, y
    stamped.transform.rotation.w = 1.0
    return TFMessage(transforms=[stamped])


class Bench(NavBench):
    """What happens to the driver, in the words of these tests."""

    def choose(self, attempt: str = "a1", **arguments: Any) -> None:
        self.client.start(attempt, "choose_frontier", arguments)

    def hear(self, topic: str, message: Any) -> None:
        self.ros.subscriptions[topic](message)

    @property
    def told(self) -> list[str]:
        return [report[2] for report in self.outlet.reports if report[0] == "progress"]

    @property
    def chosen(self) -> tuple[float, float, float]:
        kind, _, result = self.outlet.reports[-1]
        assert kind == "done", self.outlet.reports
        pose = result["pose"]
        return pose["x"], pose["y"], pose["yaw"]


def test_it_waits_for_map_and_pose_and_names_what_is_missing() -> None:
    bench = Bench()
    bench.choose()
    bench.hear("/map", grid(np.full((3, 3), -1)))
    bench.hear("/amcl_pose", at(1.0, 1.0))
    bench.ros.pass_time(SEARCH_PERIOD_S)
    bench.hear("/map", grid(half_known()))
    assert bench.told == [
        "no /map received",
        NO_POSE,
        "no frontier in a map of 0 known cells (0 clusters too small, 0 cells without clearance)",
    ]
    assert bench.outlet.kinds("a1") == ["accepted", "done"]


def test_the_pose_looks_from_the_robot_to_the_frontier() -> None:
    bench = Bench()
    bench.choose()
    bench.hear("/amcl_pose", at(0.75, 0.75))
    bench.hear("/map", grid(half_known()))
    x, y, yaw = bench.chosen
    assert (x, y) == (4.75, 4.75)
    assert yaw == pytest.approx(math.pi / 4)


def test_the_transforms_tell_where_the_robot_is_rather_than_a_pose_that_was_seeded_once() -> None:
    """War story 24: with a map in the making, the localizer's pose is where the robot started."""
    bench = Bench()
    bench.choose()
    bench.hear("/amcl_pose", at(0.75, 0.75))
    bench.hear("/tf_static", transform("map", "odom", 4.75, 0.0))
    bench.hear("/tf", transform("odom", "base_link", 0.0, 9.75))
    bench.hear("/map", grid(half_known()))
    x, y, yaw = bench.chosen
    assert (x, y) == (4.75, 4.75)
    assert yaw == pytest.approx(-math.pi / 2)


def test_transforms_that_have_ceased_tell_no_more_where_the_robot_is() -> None:
    """A base that died an hour ago: what the localizer says counts, and without that it waits."""
    bench = Bench()
    bench.choose()
    bench.hear("/tf_static", transform("map", "odom", 4.75, 0.0))
    bench.hear("/tf", transform("odom", "base_link", 0.0, 9.75))
    bench.ros.pass_time(SILENCE_S + 1.0)
    bench.hear("/map", grid(half_known()))
    assert bench.told[-1] == NO_POSE
    bench.hear("/amcl_pose", at(0.75, 0.75))
    bench.ros.pass_time(SEARCH_PERIOD_S)
    x, y, yaw = bench.chosen
    assert (x, y) == (4.75, 4.75)
    assert yaw == pytest.approx(math.pi / 4)


def test_a_map_of_which_nothing_is_left_says_what_it_has_instead() -> None:
    """War story 22: what is missing has a name."""
    cells = np.full((9, 9), 0)
    cells[0, 0] = cells[4, 4] = -1  # two cells that are frontier here, four there
    cells[8, 7] = 100
    cells[8, 8] = -1
    cells[6, 0] = 40
    bench = Bench(changed={"frontier_robot_clearance_m": 0.5})
    bench.choose()
    bench.hear("/amcl_pose", at(0.0, 0.0))
    bench.hear("/map", grid(cells))
    assert bench.told[-1] == (
        "no frontier in a map of 78 known cells"
        " (2 clusters too small, 1 cells without clearance, 1 neither free nor solid)"
    )


def test_what_is_to_be_avoided_is_waited_past_until_the_map_has_something_else() -> None:
    bench = Bench()
    bench.hear("/amcl_pose", at(0.75, 0.75))
    bench.choose("a1", avoid=[{"x": 4.5, "y": 4.5, "yaw": 3.0}])
    bench.choose("a2")
    bench.hear("/map", grid(half_known()))
    assert bench.told[-1] == (
        "no frontier in a map of 200 known cells (0 clusters too small, 0 cells without clearance, 1 avoided)"
    )
    assert (bench.outlet.kinds("a1"), bench.outlet.kinds("a2")) == (["accepted"], ["accepted", "done"])
    more = half_known()
    more[:, 10:12] = 0
    bench.hear("/map", grid(more))
    assert bench.outlet.kinds("a1") == ["accepted", "done"]
    assert bench.chosen[0] == 5.75


def test_how_near_is_avoided_is_a_parameter() -> None:
    bench = Bench(changed={"frontier_avoid_distance_m": 0.3})
    bench.hear("/amcl_pose", at(0.75, 0.75))
    bench.choose(avoid=[{"x": 4.5, "y": 4.5, "yaw": 0.0}])
    bench.hear("/map", grid(half_known()))
    assert bench.chosen[:2] == (4.75, 4.75)


def test_a_grid_of_no_cells_is_told() -> None:
    bench = Bench()
    bench.choose()
    bench.hear("/amcl_pose", at(0.0, 0.0))
    bench.hear("/map", OccupancyGrid())
    assert bench.told[-1] == "/map has no cells"


def test_clearance_is_metres_whatever_the_map() -> None:
    """War story 18: four cells of 5 cm are less than the planner keeps from walls."""
    cells = np.full((40, 16), -1)
    cells[:, 0] = 100
    cells[:, 1:8] = 0
    bench = Bench()
    bench.choose()
    bench.hear("/amcl_pose", at(0.2, 1.0))
    bench.hear("/map", grid(cells, resolution=0.05))
    assert bench.told[-1] == (
        "no frontier in a map of 320 known cells (0 clusters too small, 40 cells without clearance)"
    )
    bench.hear("/map", grid(cells, resolution=0.06))
    assert bench.outlet.kinds("a1") == ["accepted", "done"]


def test_a_second_search_uses_the_map_that_is_there() -> None:
    bench = Bench()
    bench.choose("a1")
    bench.hear("/amcl_pose", at(0.75, 0.75))
    bench.hear("/map", grid(half_known()))
    bench.choose("a2")
    assert bench.outlet.kinds("a2") == ["accepted", "done"]


def test_a_robot_that_is_found_later_is_noticed_within_a_second() -> None:
    bench = Bench()
    bench.choose()
    bench.hear("/map", grid(half_known()))
    bench.hear("/tf", transform("map", "base_link", 1.0, 1.0))
    bench.ros.pass_time(SEARCH_PERIOD_S)
    assert bench.outlet.kinds("a1") == ["accepted", "done"]


def test_nothing_runs_when_nobody_searches() -> None:
    bench = Bench()
    bench.choose()
    bench.hear("/amcl_pose", at(0.75, 0.75))
    bench.hear("/map", grid(half_known()))
    bench.ros.pass_time(SEARCH_PERIOD_S)
    assert not any(timer.running for timer in bench.ros.timers)


def test_a_search_can_be_cancelled_and_a_closed_driver_says_nothing() -> None:
    bench = Bench()
    bench.choose("a1")
    bench.client.cancel("a1")
    bench.choose("a2")
    bench.client.close()
    bench.hear("/amcl_pose", at(0.75, 0.75))
    bench.hear("/map", grid(half_known()))
    bench.ros.pass_time(SEARCH_PERIOD_S)
    assert bench.outlet.kinds("a1") == ["accepted", "cancelled"]
    assert bench.outlet.kinds("a2") == ["accepted"]


def test_a_map_in_another_frame_is_ignored_and_warned_about_once() -> None:
    bench = Bench()
    bench.choose()
    for _ in range(2):
        bench.hear("/map", grid(half_known(), frame="odom"))
    assert bench.told == ["no /map received"]
    assert bench.ros.log.warnings == [
        ("message in another frame ignored", {"topic": "/map", "frame": "odom", "expected": "map"})
    ]


def test_who_never_searches_hears_neither_map_nor_transforms() -> None:
    bench = Bench(changed={"map_topic": "/m"})
    assert not {"/m", "/tf", "/tf_static"} & set(bench.ros.subscriptions)
    bench.choose()
    profiles = {topic: bench.ros.profiles[topic] for topic in ("/m", "/tf", "/tf_static")}
    assert profiles == {"/m": Qos.LATCHED, "/tf": Qos.TRANSFORMS, "/tf_static": Qos.STATIC_TRANSFORMS}


def test_a_map_file_is_not_loaded_and_that_is_said_once() -> None:
    assert Bench().ros.log.warnings == []
    bench = Bench(changed={"map_yaml_path": "hall.yaml"})
    assert bench.ros.log.warnings == [
        (
            "map_yaml_path is ignored: this build loads no maps, Nav2 must have one already",
            {"map_yaml_path": "hall.yaml"},
        )
    ]
