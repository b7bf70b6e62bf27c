"""The simulated robot's floor, body and faults: without ROS, time as an argument."""

from __future__ import annotations

import math
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lupin_engine.errors import LupinError
from lupin_greenhouse.layout import Table, Tag
from lupin_greenhouse.plates import LENGTH, WIDTH
from lupin_sim.faults import Faults, InjectedFault
from lupin_sim.floor import ROBOT_RADIUS, Floor, Point
from lupin_sim.layout import Floorplan, load_layout
from lupin_sim.robot import TURN_RATE, FloorPose, Robot

WALL = Table("T", 1.0, 1.2, 0.0, 6.0)


def length(start: Point, path: list[Point]) -> float:
    return sum(math.dist(a, b) for a, b in zip([start, *path], path, strict=False))


# --- floor


def test_free_floor_is_crossed_in_a_straight_line() -> None:
    assert Floor([]).path((0.5, 0.5), (3.0, 7.0)) == [(3.0, 7.0)]


def test_a_path_goes_around_a_table_and_keeps_clear_of_it() -> None:
    floor, start, goal = Floor([WALL]), (0.5, 1.0), (2.0, 1.0)
    path = floor.path(start, goal)
    assert path is not None
    assert path[-1] == goal
    assert 10.0 < length(start, path) < 12.0
    corners = [start, *path]
    between = [
        (a[0] + (b[0] - a[0]) * i / 50, a[1] + (b[1] - a[1]) * i / 50)
        for a, b in zip(corners, path, strict=False)
        for i in range(51)
    ]
    assert min(WALL.distance(*point) for point in between) > ROBOT_RADIUS - 0.02


@pytest.mark.parametrize(
    ("start", "goal"),
    [((0.5, 5.0), (1.08, 6.125)), ((0.5, 5.0), (1.344, 6.078)), ((1.33, 3.0), (0.93, 6.278))],
)
def test_a_goal_just_behind_a_corner_is_reached(start: Point, goal: Point) -> None:
    """The last corner of the path before it is beside it, and sees it as the first one."""
    path = Floor([WALL]).path(start, goal)
    assert path is not None
    assert path[-1] == goal
    assert math.dist(path[-2], goal) < 0.06


def test_the_same_request_gives_the_same_path() -> None:
    assert Floor([WALL]).path((0.5, 1.0), (2.0, 1.0)) == Floor([WALL]).path((0.5, 1.0), (2.0, 1.0))


def test_a_goal_too_near_a_table_is_moved_aside_by_little() -> None:
    path = Floor([WALL]).path((0.5, 1.0), (0.95, 3.0))
    assert path is not None
    assert math.dist(path[-1], (0.95, 3.0)) <= 0.25
    assert WALL.distance(*path[-1]) >= ROBOT_RADIUS - 1e-6


@pytest.mark.parametrize("goal", [(-1.0, 1.0), (2.0, 9.0), (1.5, 1.5)])
def test_there_is_no_path_into_a_table_or_out_of_the_greenhouse(goal: Point) -> None:
    assert Floor([Table("T", 1.0, 2.0, 1.0, 2.0)]).path((0.5, 0.5), goal) is None


def test_there_is_no_path_through_a_closed_wall() -> None:
    assert Floor([Table("T", 1.0, 1.2, -1.0, 9.0)]).path((0.5, 1.0), (2.0, 1.0)) is None


def test_a_robot_that_stands_too_near_a_table_gets_away() -> None:
    path = Floor([WALL]).path((0.98, 1.0), (0.5, 1.0))
    assert path is not None
    assert path[-1] == (0.5, 1.0)


@pytest.mark.parametrize(
    ("tables", "start", "goal"),
    [
        ([Table("L", 0.0, 0.88, 2.0, 6.0), Table("R", 1.12, 4.0, 2.0, 6.0)], (1.0, 1.0), (1.0, 7.0)),
        ([Table("L", 1.0, 3.0, 0.0, 3.88), Table("R", 1.0, 3.0, 4.12, 8.0)], (0.5, 4.0), (3.5, 4.0)),
    ],
    ids=["along", "across"],
)
def test_a_passage_as_wide_as_the_robot_is_passed(tables: list[Table], start: Point, goal: Point) -> None:
    assert Floor(tables).path(start, goal) == [goal]
    assert Floor(tables).path(goal, start) == [start]


GREENHOUSE = load_layout()
FLOOR = Floor(GREENHOUSE.tables)
#: Where the robot fits, on no grid.
ANYWHERE = np.random.default_rng(7).uniform((0.0, 0.0), (WIDTH, LENGTH), (1000, 2)).tolist()
PLACES = st.sampled_from([(x, y) for x, y in ANYWHERE if FLOOR.is_free(x, y)])


@pytest.mark.slow
@given(start=PLACES, goal=PLACES)
def test_a_path_ends_where_it_should_and_the_robot_fits_all_along(start: Point, goal: Point) -> None:
    path = FLOOR.path(start, goal)
    assert path is not None
    assert path[-1] == goal
    for (x, y), (u, v) in pairwise([start, *path]):
        for share in np.linspace(0.0, 1.0, 40):
            place = x + share * (u - x), y + share * (v - y)
            assert GREENHOUSE.clearance(*place) > ROBOT_RADIUS - 0.02, (
                "between two looks it may come a little nearer"
            )


def test_every_tag_of_the_real_layout_can_be_approached() -> None:
    layout = load_layout()
    tables = layout.tables
    assert (len(tables), len(layout.tags)) == (10, 29)
    floor = Floor(tables)
    assert floor.is_free(0.5, 0.5)
    for table in tables:
        for side in ((table.x0 - 0.2, table.y0), (table.x1 + 0.2, table.y1)):
            assert floor.path((0.5, 0.5), side) is not None


def test_a_greenhouse_is_what_its_layout_file_says(tmp_path: Path) -> None:
    file = tmp_path / "layout.json"
    file.write_text('{"1": {"x": 0.5, "y": 2, "sensors": []}}')
    assert load_layout(str(file)) == Floorplan((), (Tag("1", 0.5, 2.0),))
    with pytest.raises(LupinError, match=r"nowhere\.json' cannot be used"):
        load_layout("nowhere.json")


def test_clearance_is_the_way_to_the_nearest_table_or_wall() -> None:
    layout = Floorplan((Table("T", 1.0, 2.0, 1.0, 2.0),))
    assert layout.clearance(2.5, 1.5) == 0.5
    assert layout.clearance(2.3, 2.4) == pytest.approx(0.5)
    assert layout.clearance(1.5, 1.5) == 0.0
    assert layout.clearance(3.9, 5.0) == pytest.approx(0.1)
    assert layout.clearance(2.0, -0.5) == -0.5


# --- robot


def test_a_velocity_is_obeyed_for_its_time_and_not_beyond_what_the_robot_can() -> None:
    robot = Robot(FloorPose(0.0, 0.0, 0.0), now=100.0, speed=0.5)
    robot.obey(9.0, 0.0, 100.5)
    robot.advance(101.0)
    assert (robot.pose, robot.by_hand) == (FloorPose(0.25, 0.0, 0.0), False)
    robot.obey(0.5, 0.25 * math.pi, 104.0)
    for tick in range(21):  # a quarter turn in two seconds, however it is cut: the arc of a circle
        robot.advance(101.0 + 0.1 * tick)
    radius = 0.5 / (0.25 * math.pi)
    assert (robot.pose.x, robot.pose.y) == pytest.approx((0.25 + radius, radius))
    assert robot.pose.yaw == pytest.approx(math.pi / 2)
    robot.braked = True
    robot.advance(103.2)
    robot.braked = False
    robot.halt()
    robot.advance(103.8)
    assert (robot.pose.x, robot.pose.y) == pytest.approx((0.25 + radius, radius))


def test_the_robot_drives_turns_and_arrives() -> None:
    robot = Robot(FloorPose(0.0, 0.0, 0.0), now=100.0, speed=0.5)
    robot.follow([(1.0, 0.0)], math.pi / 2)
    robot.advance(101.0)
    assert robot.pose == FloorPose(0.5, 0.0, 0.0)
    assert robot.remaining == 0.5
    robot.advance(102.0)
    assert (robot.pose.x, robot.arrived) == (1.0, False)
    robot.advance(102.0 + math.pi / 2 / (TURN_RATE * robot.speed))
    assert robot.arrived
    assert robot.pose == FloorPose(1.0, 0.0, math.pi / 2)


@pytest.mark.parametrize("steps", [1, 7, 1000])
def test_the_size_of_a_step_does_not_matter(steps: int) -> None:
    robot = Robot(FloorPose(0.0, 0.0, 0.0), now=0.0, speed=0.7)
    robot.follow([(1.0, 0.5), (0.2, 2.0)], 1.0)
    for step in range(1, steps + 1):
        robot.advance(4.0 * step / steps)
    reference = Robot(FloorPose(0.0, 0.0, 0.0), now=0.0, speed=0.7)
    reference.follow([(1.0, 0.5), (0.2, 2.0)], 1.0)
    reference.advance(4.0)
    assert math.dist((robot.pose.x, robot.pose.y), (reference.pose.x, reference.pose.y)) < 1e-9
    assert robot.pose.yaw == pytest.approx(reference.pose.yaw)


def test_the_brake_and_an_empty_battery_stop_the_robot_and_the_goal_stays() -> None:
    robot = Robot(FloorPose(0.0, 0.0, 0.0), now=0.0, speed=1.0)
    robot.follow([(5.0, 0.0)], 0.0)
    robot.braked = True
    robot.advance(1.0)
    assert (robot.pose.x, robot.arrived) == (0.0, False)
    robot.braked, robot.drain_per_s = False, 0.5
    robot.advance(2.0)
    robot.advance(3.0)
    robot.advance(4.0)
    assert (robot.pose.x, robot.charge) == (2.0, 0.0)
    robot.charge = 1.0
    robot.advance(5.0)
    assert robot.pose.x == 3.0
    robot.halt()
    robot.advance(6.0)
    assert (robot.pose.x, robot.arrived) == (3.0, True)


def test_the_robot_turns_to_where_it_drives_before_it_drives_there() -> None:
    robot = Robot(FloorPose(0.0, 0.0, 0.0), now=0.0, speed=0.5)
    robot.follow([(0.0, 0.4)], 0.0)
    turned = math.pi / 2 / (TURN_RATE * robot.speed)
    robot.advance(turned / 2)
    assert (robot.pose.x, robot.pose.y, robot.pose.yaw) == (0.0, 0.0, pytest.approx(math.pi / 4))
    robot.advance(turned + 0.4)
    assert (robot.pose.x, robot.pose.y) == (pytest.approx(0.0), pytest.approx(0.2))
    assert robot.pose.yaw == pytest.approx(math.pi / 2)


def test_a_robot_that_was_sent_nowhere_stays() -> None:
    robot = Robot(FloorPose(1.0, 2.0, 3.0), now=0.0, speed=0.5)
    robot.advance(10.0)
    assert (robot.arrived, robot.remaining, robot.pose, robot.charge) == (
        True,
        0.0,
        FloorPose(1.0, 2.0, 3.0),
        1.0,
    )


def test_a_corner_where_the_robot_is_turns_it_nowhere() -> None:
    robot = Robot(FloorPose(1.0, 2.0, 3.0), now=0.0, speed=0.5)
    robot.follow([(1.0, 2.0)], 3.0)
    robot.advance(1e-6)
    assert (robot.arrived, robot.pose) == (True, FloorPose(1.0, 2.0, 3.0))


def test_a_robot_that_was_halted_has_no_way_left() -> None:
    robot = Robot(FloorPose(0.0, 0.0, 0.0), now=0.0, speed=0.5)
    robot.follow([(1.0, 0.0), (1.0, 1.0)], 2.0)
    assert (robot.arrived, robot.remaining) == (False, 2.0)
    robot.halt()
    assert (robot.arrived, robot.remaining, robot.path) == (True, 0.0, [(0.0, 0.0)])


def test_time_that_runs_backwards_moves_nothing() -> None:
    robot = Robot(FloorPose(0.0, 0.0, 0.0), now=10.0, speed=1.0)
    robot.follow([(5.0, 0.0)], 0.0)
    robot.advance(5.0)
    assert robot.pose.x == 0.0
    robot.advance(6.0)
    assert robot.pose.x == 1.0


# --- faults


def test_nothing_goes_wrong_at_first() -> None:
    assert [fault.value for fault in InjectedFault] == [
        "none",
        "reject",
        "abort",
        "stall",
        "refuse_cancel",
        "lose_localization",
    ]
    faults = Faults()
    assert [fault for fault in InjectedFault if faults.now(fault)] == [InjectedFault.NONE]
    assert (faults.kind, faults.take()) == (InjectedFault.NONE, InjectedFault.NONE)


def test_another_fault_ends_what_a_running_goal_suffers() -> None:
    """A goal that runs can be rejected no more."""
    faults = Faults()
    faults.set(InjectedFault.STALL, 0, goal_running=True)
    faults.set(InjectedFault.REJECT, 1, goal_running=True)
    assert not faults.now(InjectedFault.STALL)
    assert faults.take() is InjectedFault.REJECT


def test_a_fault_without_a_count_lasts_until_it_is_changed() -> None:
    faults = Faults()
    faults.set(InjectedFault.REJECT, 0, goal_running=False)
    assert [faults.take() for _ in range(3)] == [InjectedFault.REJECT] * 3
    faults.set(InjectedFault.NONE, 0, goal_running=False)
    assert faults.take() is InjectedFault.NONE


def test_a_counted_fault_hits_that_many_goals() -> None:
    faults = Faults()
    faults.set(InjectedFault.ABORT, 2, goal_running=False)
    assert [faults.take() for _ in range(3)] == [InjectedFault.ABORT, InjectedFault.ABORT, InjectedFault.NONE]
    assert faults.kind is InjectedFault.NONE


def test_a_running_goal_is_hit_and_counts() -> None:
    faults = Faults()
    faults.set(InjectedFault.STALL, 1, goal_running=True)
    assert faults.now(InjectedFault.STALL)
    assert faults.kind is InjectedFault.NONE
    faults.goal_ended()
    assert not faults.now(InjectedFault.STALL)


def test_a_stalled_goal_goes_on_when_the_fault_is_lifted() -> None:
    faults = Faults()
    faults.set(InjectedFault.STALL, 0, goal_running=True)
    faults.set(InjectedFault.NONE, 0, goal_running=True)
    assert not faults.now(InjectedFault.STALL)


def test_localization_is_lost_without_a_goal_and_found_after_a_counted_one() -> None:
    faults = Faults()
    faults.set(InjectedFault.LOSE_LOCALIZATION, 1, goal_running=False)
    assert faults.now(InjectedFault.LOSE_LOCALIZATION)
    faults.take()
    assert faults.now(InjectedFault.LOSE_LOCALIZATION)
    faults.goal_ended()
    assert not faults.now(InjectedFault.LOSE_LOCALIZATION)
