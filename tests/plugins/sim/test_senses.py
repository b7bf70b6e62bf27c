"""What the simulated robot sees: the map ray by ray, tags and pests by camera."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lupin_greenhouse import layout
from lupin_greenhouse.layout import Table, Tag
from lupin_greenhouse.plates import LENGTH, WIDTH
from lupin_nav.approach import Quaternion, approach, approach_discovered, tables_of
from lupin_nav.frontier import OccupancyGrid, survey
from lupin_sim.camera import Camera, Plate, facing, plates_of
from lupin_sim.floor import Floor
from lupin_sim.layout import Floorplan, load_layout
from lupin_sim.lidar import FREE, OCCUPIED, ORIGIN_X, ORIGIN_Y, RESOLUTION, UNKNOWN, GrowingMap, Lidar
from lupin_sim.robot import FloorPose

TABLE = Table("T", 1.0, 3.0, 3.0, 4.0)
HALL = Floorplan((TABLE,))


def seen_from(layout: Floorplan, x: float, y: float, reach: float = 5.0) -> GrowingMap:
    grown = GrowingMap(Lidar(layout, reach))
    grown.reveal(x, y)
    return grown


def value_at(grown: GrowingMap, x: float, y: float) -> int:
    row, column = math.floor((y - ORIGIN_Y) / RESOLUTION), math.floor((x - ORIGIN_X) / RESOLUTION)
    return int(grown.cells[row, column])


def centres(mask: Any) -> tuple[Any, Any]:
    rows, columns = np.nonzero(mask)
    return ORIGIN_X + (columns + 0.5) * RESOLUTION, ORIGIN_Y + (rows + 0.5) * RESOLUTION


# --- the map


def test_at_first_nothing_is_known_and_that_is_worth_telling() -> None:
    grown = GrowingMap(Lidar(HALL, 1.0))
    assert (grown.cells == UNKNOWN).all()
    assert grown.changed
    assert grown.cells.shape == (162, 82)  # 8 m and 4 m of 5 cm, and a wall around


def test_an_empty_hall_is_seen_whole_with_its_walls() -> None:
    grown = seen_from(Floorplan(), 2.0, 4.0)
    inner = grown.cells[1:-1, 1:-1]
    assert np.count_nonzero(inner == UNKNOWN) == 0
    assert (inner == FREE).all()
    for wall in (grown.cells[0, 1:-1], grown.cells[-1, 1:-1], grown.cells[1:-1, 0], grown.cells[1:-1, -1]):
        assert np.count_nonzero(wall == OCCUPIED) > 0.9 * wall.size  # far corners are seen at a low angle
        assert not (wall == FREE).any()


def test_a_table_is_seen_from_its_front_and_hides_what_is_behind() -> None:
    grown = seen_from(HALL, 2.0, 2.0)
    assert set(np.unique(grown.cells).tolist()) == {-1, 0, 100}, "as others read a grid"
    assert value_at(grown, 2.0, 2.9) == FREE
    assert value_at(grown, 2.0, 3.01) == OCCUPIED
    assert value_at(grown, 2.0, 3.5) == UNKNOWN
    assert value_at(grown, 2.0, 4.5) == UNKNOWN
    assert value_at(grown, 0.2, 3.5) == FREE


def test_nothing_is_seen_beyond_the_range() -> None:
    grown = seen_from(Floorplan(), 2.0, 4.0, reach=1.5)
    xs, ys = centres(grown.cells != UNKNOWN)
    assert np.hypot(xs - 2.0, ys - 4.0).max() <= 1.5 + RESOLUTION
    assert value_at(grown, 2.0, 5.4) == FREE
    assert value_at(grown, 2.0, 5.6) == UNKNOWN


def test_what_was_seen_stays_known_and_only_news_count_as_a_change() -> None:
    grown = seen_from(Floorplan(), 1.0, 1.0, reach=1.0)
    before = grown.take().copy()
    assert not grown.changed
    grown.reveal(1.0, 1.0)
    assert not grown.changed
    grown.reveal(1.0, 1.5)
    assert grown.changed
    known = before != UNKNOWN
    assert (grown.cells[known] == before[known]).all()
    grown.take()
    grown.forget()
    assert grown.changed
    assert (grown.cells == UNKNOWN).all()


@given(x=st.floats(0.1, WIDTH - 0.1), y=st.floats(0.1, LENGTH - 0.1), reach=st.sampled_from([0.5, 2.0]))
def test_free_is_free_and_solid_is_solid_wherever_one_looks_from(x: float, y: float, reach: float) -> None:
    grown = seen_from(HALL, x, y, reach)
    xs, ys = centres(grown.cells == FREE)
    assert all(HALL.clearance(a, b) > 0.0 for a, b in zip(xs, ys, strict=True))
    xs, ys = centres(grown.cells == OCCUPIED)
    assert all(HALL.clearance(a, b) <= 0.0 for a, b in zip(xs, ys, strict=True))


def test_driving_from_frontier_to_frontier_reveals_the_greenhouse_and_ends() -> None:
    """The two halves together, without ROS: the search of the mission, on the map of the simulation."""
    layout = load_layout()
    floor, grown = Floor(layout.tables), GrowingMap(Lidar(layout, 1.5))
    place, legs = (0.5, 0.5), 0
    grown.reveal(*place)
    while True:
        found = survey(OccupancyGrid(grown.cells, RESOLUTION, ORIGIN_X, ORIGIN_Y), place).frontier
        if found is None:
            break
        legs += 1
        path = floor.path(place, (found.x, found.y))
        assert path is not None, "a frontier with clearance can be reached"
        place = path[-1]
        grown.reveal(*place)
        assert legs < 60, "the search makes no progress"
    known = np.count_nonzero(grown.cells == FREE) * RESOLUTION**2
    floor_area = WIDTH * LENGTH - sum((t.x1 - t.x0) * (t.y1 - t.y0) for t in layout.tables)
    assert known > 0.9 * floor_area


# --- the camera


def camera(
    *tags: Tag, tables: tuple[Table, ...] = (TABLE,), reach: float = 2.0, field: float = 1.0
) -> Camera:
    return Camera(Floorplan(tables, tags), reach, field)


def names(plates: list[Plate]) -> list[str]:
    return [plate.id for plate in plates]


FRONT = Tag("7", 2.0, 3.0)  # on the side towards y = 0


@pytest.mark.parametrize(
    ("pose", "seen"),
    [
        (FloorPose(2.0, 2.0, math.pi / 2), True),
        (FloorPose(2.0, 0.9, math.pi / 2), False),  # 2.1 m away
        (FloorPose(2.0, 2.0, math.pi / 2 + 0.49), True),
        (FloorPose(2.0, 2.0, math.pi / 2 + 0.51), False),  # the field is 0.5 to each side
        (FloorPose(2.0, 2.0, -math.pi / 2), False),
        (FloorPose(2.0, 2.0, math.pi / 2 + math.tau), True),
        (FloorPose(2.0, 5.0, -math.pi / 2), False),  # from behind, through the table
        (FloorPose(0.5, 2.9, 0.0), False),  # along the plate
        (FloorPose(1.2, 2.4, math.atan2(0.6, 0.8)), True),
    ],
)
def test_a_tag_is_seen_near_ahead_and_from_its_front(pose: FloorPose, seen: bool) -> None:
    assert names(camera(FRONT).sees(pose)) == (["7"] if seen else [])


def test_another_table_in_between_hides_a_tag() -> None:
    screen = Table("T", 1.5, 2.5, 2.3, 2.5)
    pose = FloorPose(2.0, 2.0, math.pi / 2)
    assert names(camera(FRONT, tables=(TABLE, screen)).sees(pose)) == []
    beside = Table("T", 2.2, 2.5, 2.3, 2.5)
    assert names(camera(FRONT, tables=(TABLE, beside)).sees(pose)) == ["7"]


def test_without_tags_nothing_is_seen() -> None:
    assert camera().sees(FloorPose(2.0, 2.0, 0.0)) == []


@pytest.mark.parametrize(
    ("tag", "heading"),
    [
        (Tag("a", 2.0, 3.0), -math.pi / 2),
        (Tag("b", 2.0, 4.0), math.pi / 2),
        (Tag("c", 1.0, 3.5), math.pi),
        (Tag("d", 3.0, 3.5), 0.0),
        (Tag("e", 2.0, 3.05), -math.pi / 2),  # a little inside its table
        (Tag("f", 3.05, 3.5), 0.0),  # a little before it
        (Tag("g", 1.3, 3.5), math.pi),  # well inside
    ],
)
def test_where_the_layout_does_not_say_it_a_plate_hangs_on_the_nearest_side_of_its_table(
    tag: Tag, heading: float
) -> None:
    (plate,) = plates_of(Floorplan((TABLE,), (tag,)))
    assert math.cos(plate.yaw - heading) == pytest.approx(1.0)
    assert (plate.x, plate.y) == (tag.x, tag.y)
    assert TABLE.distance(*plate.face) > 0.0


@pytest.mark.parametrize(
    ("table", "heading"), [(TABLE, math.pi / 2), (Table("T", 1.0, 2.0, 3.0, 6.0), 0.0)], ids=["wide", "long"]
)
def test_at_a_corner_it_hangs_on_the_long_side(table: Table, heading: float) -> None:
    (plate,) = plates_of(Floorplan((table,), (Tag("1", table.x1, table.y1),)))
    assert plate.yaw == heading


@pytest.mark.parametrize("tables", [(), (TABLE,)])
@pytest.mark.parametrize("yaw", layout.FACINGS.values())
def test_a_plate_faces_as_its_own_layout_says(tables: tuple[Table, ...], yaw: float) -> None:
    """It is seen from there, also a tag that the layout has in the middle of its table."""
    tag = Tag("7", 2.0, 3.5, facing=yaw)
    before, behind = ((2.0 + way * math.cos(yaw), 3.5 + way * math.sin(yaw)) for way in (1.6, -1.6))
    eye = camera(tag, tables=tables)
    assert names(eye.sees(FloorPose(*before, yaw + math.pi))) == ["7"]
    assert names(eye.sees(FloorPose(*behind, yaw))) == []


def test_a_tag_without_tables_looks_at_the_middle_of_the_floor() -> None:
    low, aside = plates_of(Floorplan((), (Tag("1", 2.0, 1.0), Tag("2", 1.0, 3.0))))
    assert (low.yaw, aside.yaw) == (math.pi / 2, math.pi / 4)


@given(yaw=st.floats(-10.0, 10.0))
def test_the_orientation_is_a_rotation_of_z_to_the_heading_and_never_looks_unpopulated(yaw: float) -> None:
    q: Quaternion = facing(yaw)
    assert math.hypot(*q) == pytest.approx(1.0)
    assert q[3] > 0.5
    goal = approach_discovered((0.0, 0.0), q, 0.5, 0.0)
    assert (goal.x, goal.y) == pytest.approx((0.5 * math.cos(yaw), 0.5 * math.sin(yaw)), abs=1e-9)


@pytest.mark.slow
def test_every_tag_of_the_greenhouse_can_be_seen_and_stood_before() -> None:
    layout = load_layout()
    floor, eye = Floor(layout.tables), Camera(layout, 1.0, 1.05)
    for plate in plates_of(layout):
        goal = approach_discovered((plate.x, plate.y), facing(plate.yaw), 0.5, 0.0)
        path = floor.path((0.5, 0.5), (goal.x, goal.y))
        assert path is not None, plate
        assert plate in eye.sees(FloorPose(*path[-1], goal.yaw)), plate


def is_seen_from_its_stand(told: Tag, true: Tag, tables: tuple[Table, ...]) -> bool:
    """Say whether a robot that is told of a tag sees it in a greenhouse where it is otherwise."""
    stand = approach((told.x, told.y), tables_of(tables), 0.5, 0.0, facing=told.facing)
    path = Floor(tables).path((0.5, 0.5), (stand.x, stand.y))
    assert path is not None
    seen = Camera(Floorplan(tables, (true,)), 1.0, 1.05).sees(FloorPose(*path[-1], stand.yaw))
    return names(seen) == [true.id]


@pytest.mark.slow
@pytest.mark.parametrize("tag", load_layout().tags, ids=lambda tag: tag.id)
def test_a_robot_sees_a_tag_exactly_if_its_layout_is_right_about_it(tag: Tag) -> None:
    true = {facing: replace(tag, facing=facing) for facing in layout.FACINGS.values()}
    tables = load_layout().tables
    seen = [facing for facing in true if is_seen_from_its_stand(tag, true[facing], tables)]
    assert seen == [tag.facing]


def test_a_robot_that_guesses_wrong_does_not_see_its_tag() -> None:
    """A tag at the corner of its table, before which there is most room on the side that it is not on."""
    tag, tables = next(tag for tag in load_layout().tags if tag.id == "4"), load_layout().tables
    guessing, end = replace(tag, facing=None), replace(tag, facing=math.pi / 2)
    assert is_seen_from_its_stand(guessing, tag, tables)
    assert not is_seen_from_its_stand(guessing, end, tables)
    assert is_seen_from_its_stand(end, end, tables)


def test_pests_are_seen_like_tags_but_from_all_sides() -> None:
    eye = Camera(HALL, 2.0, 1.0, [(2.0, 2.0), (2.0, 5.0)])
    assert eye.pests(FloorPose(2.0, 1.0, math.pi / 2)) == [(2.0, 2.0)], "the table hides the other one"
    assert eye.pests(FloorPose(2.0, 6.0, -math.pi / 2)) == [(2.0, 5.0)]
    assert eye.pests(FloorPose(2.0, 1.0, 0.0)) == []
    assert Camera(HALL, 2.0, 1.0).pests(FloorPose(2.0, 1.0, 0.0)) == []
