"""The box behind a tag and the places in it, by what must hold wherever the greenhouse lies."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lupin_greenhouse.poses import Pose, pose_of
from lupin_perception.boxes import (
    BoxView,
    PlanterBox,
    Size,
    box_from_tag,
    column_depth,
    column_fraction,
    column_of,
    is_inside,
)
from lupin_sim.camera import facing

SIZE = Size(0.8, 0.4)
FRACTIONS = st.floats(-1.0, 1.0)
DEPTHS = st.floats(0.0, 1.0)
HEADINGS = st.floats(-math.pi, math.pi)
PLACES = st.floats(-50.0, 50.0)


def tag(x: float = 2.0, y: float = 0.0, heading: float = 0.0, z: float = 0.1) -> Pose:
    pose = pose_of((x, y, z), facing(heading))
    assert pose is not None
    return pose


def box(x: float = 2.0, y: float = 0.0, heading: float = 0.0, offset: float = 0.0) -> PlanterBox:
    found = box_from_tag(tag(x, y, heading), SIZE, offset)
    assert found is not None
    return found


def test_the_box_of_a_tag_that_faces_plus_x() -> None:
    """The worked example of the reference."""
    found = box()
    assert found.normal.tolist() == pytest.approx([1.0, 0.0])
    assert found.lateral.tolist() == pytest.approx([0.0, 1.0])
    assert found.place(0.0, 0.5).tolist() == pytest.approx([1.8, 0.0])
    assert np.allclose(found.footprint(), [[2.0, 0.4], [2.0, -0.4], [1.6, -0.4], [1.6, 0.4]])
    assert box(offset=0.1).origin.tolist() == pytest.approx([2.0, 0.1])


@given(heading=HEADINGS, offset=st.floats(-0.5, 0.5))
def test_the_middle_of_a_box_is_aside_of_its_tag_along_its_front(heading: float, offset: float) -> None:
    found, place = box(heading=heading, offset=offset), tag().position[:2]
    assert np.allclose(found.origin - place, offset * found.lateral, atol=1e-9)


@pytest.mark.parametrize("rotation", [(0.0, 0.0, 0.3, 1.0), (1.0, 0.0, 0.0, 0.0)])
def test_a_tag_that_faces_up_or_down_has_no_box(rotation: tuple[float, ...]) -> None:
    pose = pose_of((0.0, 0.0, 0.0), rotation)
    assert pose is not None
    assert box_from_tag(pose, SIZE) is None


@given(x=PLACES, y=PLACES, heading=HEADINGS, turn=HEADINGS, f=FRACTIONS, d=DEPTHS)
def test_turning_and_moving_the_greenhouse_turns_and_moves_every_bloom(
    x: float, y: float, heading: float, turn: float, f: float, d: float
) -> None:
    world = pose_of((x, y, 0.0), (0.0, 0.0, math.sin(turn / 2), math.cos(turn / 2)))
    assert world is not None
    before = box_from_tag(tag(heading=heading), SIZE)
    after = box_from_tag(world @ tag(heading=heading), SIZE)
    assert before is not None
    assert after is not None
    cosine, sine = math.cos(turn), math.sin(turn)
    moved = np.array(((cosine, -sine), (sine, cosine))) @ before.place(f, d) + (x, y)
    assert np.allclose(after.place(f, d), moved, atol=1e-6)


@given(heading=HEADINGS, roll=HEADINGS)
def test_how_a_plate_is_turned_about_its_own_normal_changes_nothing(heading: float, roll: float) -> None:
    rolled = pose_of((0.0, 0.0, 0.0), (0.0, 0.0, math.sin(roll / 2), math.cos(roll / 2)))
    assert rolled is not None
    found = box_from_tag(tag(heading=heading) @ rolled, SIZE)
    assert found is not None
    assert np.allclose(found.normal, (math.cos(heading), math.sin(heading)), atol=1e-6)


@given(heading=HEADINGS, f=FRACTIONS, d=DEPTHS)
def test_every_bloom_is_within_the_footprint_and_behind_the_tag(heading: float, f: float, d: float) -> None:
    found = box(heading=heading)
    corners, place = found.footprint(), found.place(f, d)
    sides = np.roll(corners, -1, axis=0) - corners
    off = place - corners
    turns = sides[:, 0] * off[:, 1] - sides[:, 1] * off[:, 0]
    assert (turns <= 1e-9).all() or (turns >= -1e-9).all()
    assert float((place - tag().position[:2]) @ found.normal) <= 1e-9


def test_places_are_taken_row_by_row() -> None:
    found = box(heading=1.0)
    rows = found.place((0.5, -0.5), (0.2, 0.9))
    assert np.allclose(rows, [found.place(0.5, 0.2), found.place(-0.5, 0.9)])


def test_boxes_are_alike_up_to_a_shift_and_a_turn() -> None:
    assert box().is_like(box(x=2.04, heading=0.09), 0.05, 0.1)
    assert not box().is_like(box(x=2.06), 0.05, 0.1)
    assert not box().is_like(box(heading=0.11), 0.05, 0.1)


# --- where across the box


def test_the_image_and_the_pan_together_tell_the_fraction() -> None:
    view = BoxView(0.5, 0.5)
    assert view.fraction(0.0, 0.0) == 0.0
    assert view.fraction(0.0, 1.0) == 0.5
    assert view.fraction(0.5, 1.0) == 1.0
    assert view.fraction(-0.5, -1.0) == -1.0


def test_a_fraction_is_not_clamped_so_that_a_neighbours_bloom_shows_as_one() -> None:
    """War story 50: clamped, it would be credited to the edge of this box."""
    fraction = BoxView(0.5, 0.5).fraction(1.6, 0.0)
    assert fraction == 1.6
    assert not is_inside(fraction, 1.1, 0.1)


@given(pan=st.floats(-3.0, 3.0), bearing=st.floats(-1.0, 1.0))
def test_left_and_right_are_alike(pan: float, bearing: float) -> None:
    view = BoxView(0.4, 0.6)
    assert view.fraction(-pan, -bearing) == -view.fraction(pan, bearing)


def test_a_camera_that_sees_nothing_across_sees_the_middle() -> None:
    assert BoxView(0.0, 0.0).fraction(1.0, 1.0) == 0.0


@pytest.mark.parametrize(
    ("fraction", "margin", "inside"),
    [(1.0, 0.0, True), (1.01, 0.0, False), (1.1, 0.1, True), (-1.1, 0.1, True), (1.5, 0.1, False)],
)
def test_a_margin_beside_the_box_still_counts(fraction: float, margin: float, inside: bool) -> None:
    assert is_inside(fraction, 0.8, margin) == inside


def test_a_box_without_width_holds_nothing() -> None:
    assert not is_inside(0.0, 0.0, 0.1)


@given(f=FRACTIONS, columns=st.integers(1, 20))
def test_a_column_is_where_the_fraction_is(f: float, columns: int) -> None:
    column = column_of(f, columns)
    assert 0 <= column < columns
    assert abs(column_fraction(column, columns) - f) <= 1.0 / columns + 1e-9


@given(f=st.floats(1.0, 1e6), columns=st.integers(1, 20))
def test_what_is_beyond_an_edge_is_in_the_outermost_column(f: float, columns: int) -> None:
    assert column_of(f, columns) == columns - 1
    assert column_of(-f, columns) == 0


@given(column=st.integers(0, 1000), base=DEPTHS, spread=st.floats(0.0, 0.5))
def test_the_depth_stays_in_the_box_and_near_its_base(column: int, base: float, spread: float) -> None:
    depth = column_depth(column, base, spread)
    assert 0.0 <= depth <= 1.0
    assert abs(depth - base) <= spread + 1e-9


def test_the_scatter_is_the_same_every_time_and_forms_no_line() -> None:
    depths = [column_depth(column, 0.5, 0.18) for column in range(7)]
    assert depths == [column_depth(column, 0.5, 0.18) for column in range(7)]
    assert depths[0] == pytest.approx(0.32)
    assert depths[1] == pytest.approx(0.5 + (0.6180339887498949 - 0.5) * 0.36)
    gaps = np.diff(depths)
    assert (gaps > 0.0).any()
    assert (gaps < 0.0).any()
    assert min(abs(a - b) for i, a in enumerate(depths) for b in depths[:i]) > 0.01
