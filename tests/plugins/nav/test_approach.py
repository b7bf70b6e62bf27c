"""Where the robot stands to read a tag: the reference robot's cases, and properties over the real layout."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lupin_greenhouse import layout
from lupin_greenhouse.layout import Table
from lupin_greenhouse.poses import pose_of
from lupin_nav.approach import Approach, ApproachSource, Tables, approach, approach_discovered, clamp_standoff
from lupin_nav.overrides import Override
from lupin_nav.plates import Side, side_of
from lupin_sim.camera import facing

FACING_X = (0.0, math.sin(math.pi / 4), 0.0, math.cos(math.pi / 4))  # +Z of the plate along +X of the map
FACING_UP = (0.0, 0.0, 0.0, 1.0)  # no horizontal part
ONE_TABLE = Tables([Table("A", -0.5, 0.5, -0.5, 0.5)])


def where(found: Approach) -> tuple[float, float, float]:
    return found.x, found.y, found.yaw


@pytest.mark.parametrize(
    ("tag", "goal", "yaw"),
    [
        ((0.5, 0.0), (1.0, 0.0), math.pi),
        ((-0.5, 0.0), (-1.0, 0.0), 0.0),
        ((0.0, 0.5), (0.0, 1.0), -math.pi / 2),
        ((0.0, -0.5), (0.0, -1.0), math.pi / 2),
    ],
)
def test_goal_lies_beyond_the_tag_seen_from_its_table_and_looks_back(
    tag: tuple[float, float], goal: tuple[float, float], yaw: float
) -> None:
    found = approach(tag, ONE_TABLE, 0.5, 0.0)
    assert where(found)[:2] == pytest.approx(goal)
    assert math.cos(found.yaw - yaw) == pytest.approx(1.0)
    assert (found.source, found.table, found.standoff) == (ApproachSource.GEOMETRY, "A", 0.5)


def test_of_equidistant_tables_the_first_id_wins_whatever_their_order() -> None:
    tables = [Table("B", 1.9, 2.1, -0.1, 0.1), Table("A", -2.1, -1.9, -0.1, 0.1)]
    assert approach((0.0, 0.0), Tables(tables), 0.5, 0.0).table == "A"
    assert approach((0.0, 0.0), Tables(tables[::-1]), 0.5, 0.0).table == "A"


@pytest.mark.parametrize("tables", [Tables([]), ONE_TABLE])
@pytest.mark.parametrize("facing", layout.FACINGS.values())
def test_the_goal_is_where_the_layout_says_that_the_plate_faces(tables: Tables, facing: float) -> None:
    """Also where the guess would be another side: of the nearest table, or of none."""
    found = approach((0.7, 0.7), tables, 0.5, 0.3, facing=facing)
    there = 0.7 + 0.5 * math.cos(facing), 0.7 + 0.5 * math.sin(facing)
    assert where(found)[:2] == pytest.approx(there)
    assert math.cos(found.yaw - facing) == pytest.approx(-1.0)
    assert found.source is ApproachSource.GEOMETRY


@pytest.mark.parametrize(
    ("table", "facing"),
    [(Table("T", 1.0, 3.7, 3.0, 4.0), math.pi / 2), (Table("T", 1.0, 2.0, 7.0, 7.9), 0.0)],
)
def test_at_a_corner_the_guess_turns_away_from_the_wall(table: Table, facing: float) -> None:
    for x, y in ((table.x1, table.y1), (table.x1 - 0.05, table.y1), (table.x1, table.y1 - 0.05)):
        assert side_of((x, y), [table]) == Side(facing, "T")


def test_without_tables_the_goal_is_the_tag_with_the_fallback_heading() -> None:
    found = approach((1.0, 2.0), Tables([]), 0.5, 0.7)
    assert found == Approach(1.0, 2.0, 0.7, ApproachSource.FALLBACK, None, 0.0)


def test_a_tag_on_the_centre_falls_back_but_keeps_its_table() -> None:
    found = approach((0.0, 0.0), ONE_TABLE, 0.5, 0.7)
    assert found == Approach(0.0, 0.0, 0.7, ApproachSource.FALLBACK, "A", 0.0)


def test_a_heading_set_by_hand_is_kept_in_the_fallback() -> None:
    assert approach((0.0, 0.0), ONE_TABLE, 0.5, 0.7, Override(yaw=2.0)).yaw == 2.0


def test_a_goal_inside_the_next_table_is_pulled_back_in_steps() -> None:
    tables = Tables([Table("A", -0.5, 0.5, -0.5, 0.5), Table("B", 0.75, 3.0, -0.5, 0.5)])
    found = approach((0.5, 0.0), tables, 0.5, 0.0)
    assert where(found)[:2] == pytest.approx((0.7, 0.0))
    assert found.standoff == pytest.approx(0.2)  # the last step, which rounding must not lose


def test_the_edge_of_a_table_counts_as_inside() -> None:
    tables = Tables([Table("A", -0.5, 0.5, -0.5, 0.5), Table("B", 1.0, 3.0, -0.5, 0.5)])
    assert approach((0.5, 0.0), tables, 0.5, 0.0).standoff == pytest.approx(0.4)


def test_where_nothing_is_free_the_goal_is_the_tag() -> None:
    tables = Tables([Table("A", -0.5, 0.5, -0.5, 0.5), Table("B", 0.5, 3.0, -0.5, 0.5)])
    assert approach((0.5, 0.0), tables, 0.5, 0.3) == Approach(
        0.5, 0.0, 0.3, ApproachSource.FALLBACK, "A", 0.0
    )


@pytest.mark.parametrize(
    ("given_m", "used_m"), [(0.05, 0.2), (10.0, 1.5), (0.5, 0.5), (math.inf, 0.2), (math.nan, 0.2)]
)
def test_standoff_is_clamped(given_m: float, used_m: float) -> None:
    assert clamp_standoff(given_m) == used_m
    assert approach((0.5, 0.0), ONE_TABLE, given_m, 0.0).x == pytest.approx(0.5 + used_m)


def test_a_heading_set_by_hand_keeps_the_position() -> None:
    found = approach((0.5, 0.0), ONE_TABLE, 0.5, 0.0, Override(yaw=1.0))
    assert where(found) == pytest.approx((1.0, 0.0, 1.0))
    assert found.source is ApproachSource.OVERRIDE


def test_a_standoff_set_by_hand_keeps_the_heading_and_is_clamped_too() -> None:
    found = approach((0.5, 0.0), ONE_TABLE, 0.5, 0.0, Override(standoff=9.0))
    assert (found.x, abs(found.yaw), found.standoff) == pytest.approx((2.0, math.pi, 1.5))
    assert found.source is ApproachSource.OVERRIDE


def test_a_single_coordinate_set_by_hand_replaces_only_itself() -> None:
    found = approach((0.5, 0.0), ONE_TABLE, 0.5, 0.0, Override(goal_y=0.25))
    assert (found.x, found.y, abs(found.yaw)) == pytest.approx((1.0, 0.25, math.pi))


def test_a_pose_set_by_hand_is_taken_as_it_is_even_inside_a_table() -> None:
    found = approach((0.5, 0.0), ONE_TABLE, 0.5, 0.0, Override(yaw=1.0, goal_x=0.1, goal_y=0.2))
    assert found == Approach(0.1, 0.2, 1.0, ApproachSource.OVERRIDE, None, 0.5)


def test_the_result_cannot_be_changed() -> None:
    found = approach((0.5, 0.0), ONE_TABLE, 0.5, 0.0)
    with pytest.raises(dataclasses.FrozenInstanceError):
        found.x = 0.0  # type: ignore[misc]


def test_a_discovered_tag_is_approached_from_where_it_faces() -> None:
    found = approach_discovered((2.0, 0.0), FACING_X, 0.5, 0.0)
    assert (found.x, found.y, abs(found.yaw)) == pytest.approx((2.5, 0.0, math.pi))
    assert found.source is ApproachSource.DISCOVERED_NORMAL


@given(heading=st.floats(-math.pi, math.pi), roll=st.floats(-math.pi, math.pi))
def test_a_discovered_tag_is_looked_at_head_on_however_its_plate_hangs(heading: float, roll: float) -> None:
    """Also on a wall that is askew to the map, and turned about its own normal."""
    plate = pose_of((2.0, 1.0, 0.3), facing(heading))
    rolled = pose_of((0.0, 0.0, 0.0), (0.0, 0.0, math.sin(roll / 2), math.cos(roll / 2)))
    assert plate is not None
    assert rolled is not None
    x, y, z, w = (plate @ rolled).rotation.tolist()
    found = approach_discovered((2.0, 1.0), (x, y, z, w), 0.5, 0.0)
    assert where(found)[:2] == pytest.approx((2.0 + 0.5 * math.cos(heading), 1.0 + 0.5 * math.sin(heading)))
    assert math.cos(found.yaw - heading) == pytest.approx(-1.0)


def test_a_discovered_tag_without_direction_is_approached_from_the_robot() -> None:
    found = approach_discovered((2.0, 0.0), FACING_UP, 0.5, 0.3, robot=(0.0, 0.0))
    assert where(found) == pytest.approx((1.5, 0.0, 0.0))
    assert found.source is ApproachSource.DISCOVERED_ROBOT


@pytest.mark.parametrize("robot", [None, (2.0, 0.0)])
def test_a_discovered_tag_without_any_direction_is_the_goal(robot: tuple[float, float] | None) -> None:
    found = approach_discovered((2.0, 0.0), FACING_UP, 0.5, 0.3, robot)
    assert found == Approach(2.0, 0.0, 0.3, ApproachSource.FALLBACK, None, 0.0)


def test_the_standoff_of_a_discovered_tag_is_clamped() -> None:
    assert approach_discovered((2.0, 0.0), FACING_X, 99.0, 0.0).x == pytest.approx(3.5)


def test_the_goal_of_a_discovered_tag_is_pulled_back_from_a_known_table() -> None:
    tables = Tables([Table("B", 2.35, 4.0, -0.5, 0.5)])
    found = approach_discovered((2.0, 0.0), FACING_X, 0.5, 0.0, tables=tables)
    assert (found.x, found.y, found.standoff) == pytest.approx((2.3, 0.0, 0.3))
    walled = Tables([Table("B", 2.1, 4.0, -0.5, 0.5)])
    assert approach_discovered((2.0, 0.0), FACING_X, 0.5, 0.0, tables=walled).standoff == 0.5


@given(tag_id=st.sampled_from(sorted(layout.load().tags)), standoff=st.floats(0.0, 3.0))
def test_in_the_real_greenhouse_no_goal_lies_in_a_table_and_every_goal_faces_its_tag(
    tag_id: str, standoff: float
) -> None:
    known = layout.load()
    tag, tables = known.tags[tag_id], Tables(known.tables)
    found = approach((tag.x, tag.y), tables, standoff, 0.0)
    if found.source is ApproachSource.FALLBACK:
        assert (found.x, found.y) == (tag.x, tag.y)
        return
    assert not tables.inside(np.array([[found.x, found.y]])).any()
    assert math.hypot(found.x - tag.x, found.y - tag.y) == pytest.approx(found.standoff)
    assert found.x + found.standoff * math.cos(found.yaw) == pytest.approx(tag.x)
    assert found.y + found.standoff * math.sin(found.yaw) == pytest.approx(tag.y)


def test_in_the_real_greenhouse_every_tag_has_a_clear_goal_at_the_default_standoff() -> None:
    known = layout.load()
    tables = Tables(known.tables)
    found = {tag.id: approach((tag.x, tag.y), tables, 0.5, 0.0).source for tag in known.tags.values()}
    assert set(found.values()) == {ApproachSource.GEOMETRY}
