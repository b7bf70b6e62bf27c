"""Poses in space, by what must hold for all of them."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from lupin_greenhouse.poses import Pose, between, heading, matrix, pose_of, product, seen_rotation
from tests.plugins.greenhouse.places import at, is_same

numbers = st.floats(-100.0, 100.0)


@st.composite
def poses(draw: st.DrawFn) -> Pose:
    """Any pose within 100 m."""
    turn = draw(st.tuples(*[st.floats(-1.0, 1.0)] * 4).filter(lambda q: math.hypot(*q) > 0.1))
    pose = pose_of(draw(st.tuples(numbers, numbers, numbers)), turn)
    assert pose is not None
    return pose


@given(a=poses(), b=poses(), c=poses())
def test_poses_compose_in_any_grouping(a: Pose, b: Pose, c: Pose) -> None:
    assert is_same((a @ b) @ c, a @ (b @ c))


@given(pose=poses())
def test_the_pose_that_changes_nothing_changes_nothing(pose: Pose) -> None:
    assert is_same(at() @ pose, pose)
    assert is_same(pose @ at(), pose)


@given(a=poses(), b=poses())
def test_a_product_of_quaternions_is_the_product_of_their_matrices(a: Pose, b: Pose) -> None:
    together = matrix(product(a.rotation, b.rotation))
    assert np.allclose(together, matrix(a.rotation) @ matrix(b.rotation), atol=1e-9)


@given(pose=poses())
def test_a_rotation_keeps_lengths_and_hands(pose: Pose) -> None:
    turn = matrix(pose.rotation)
    assert np.allclose(turn @ turn.T, np.eye(3), atol=1e-9)
    assert np.linalg.det(turn) == pytest.approx(1.0)


def test_a_place_ahead_of_a_robot_that_looks_along_y() -> None:
    there = at(1.0, 2.0, yaw=math.pi / 2) @ at(3.0)
    assert there.position.tolist() == pytest.approx([1.0, 5.0, 0.0])


@pytest.mark.parametrize(
    ("place", "turn"),
    [
        ((math.nan, 0, 0), (0, 0, 0, 1)),
        ((0, math.inf, 0), (0, 0, 0, 1)),
        ((0, 0, 0), (0, 0, 0, math.nan)),
        ((0, 0, 0), (0, 0, 0, 0)),
    ],
)
def test_what_says_no_pose_is_none(place: Any, turn: Any) -> None:
    assert pose_of(place, turn) is None


@pytest.mark.parametrize("scale", [1e-5, 3.0, 1e200])
def test_a_quaternion_of_any_length_is_a_rotation(scale: float) -> None:
    pose = pose_of((0, 0, 0), (0, 0, scale, scale))
    assert pose is not None
    assert pose.rotation.tolist() == pytest.approx([0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5)])


@pytest.mark.parametrize(
    ("told", "turn"),
    [
        ((0, 0, 0, 0), (0, 0, 0, 1)),  # nobody filled it in
        ((0, 0, 2, 0), (0, 0, 1, 0)),  # a true half turn
        ((0, 0, -1, 0), (0, 0, -1, 0)),
        ((0, 3, 0, 4), (0, 0.6, 0, 0.8)),
        ((0, 0, 0, math.nan), None),
        ((0, 0, math.inf, 1), None),
    ],
)
def test_a_tag_that_was_seen_has_a_turn_where_it_tells_numbers(told: Any, turn: Any) -> None:
    x, y, z, w = told
    assert seen_rotation(SimpleNamespace(x=x, y=y, z=z, w=w)) == turn


def test_halfway_is_halfway_and_by_the_shorter_way() -> None:
    one, other = at(0.0, yaw=3.0), at(2.0, yaw=-3.0)
    middle = between(one, other, 0.5)
    assert is_same(middle, at(1.0, yaw=math.pi))
    flipped = Pose(other.position, -other.rotation)
    assert is_same(between(one, flipped, 0.5), middle)


@given(a=poses(), b=poses())
def test_the_way_begins_and_ends_at_its_ends(a: Pose, b: Pose) -> None:
    assert is_same(between(a, b, 0.0), a)
    assert is_same(between(a, b, 1.0), b)


@given(yaw=st.floats(-3.1, 3.1), length=st.floats(0.1, 10.0))
def test_a_heading_is_read_off_a_turn_about_the_vertical(yaw: float, length: float) -> None:
    """Also by a quaternion that is not of length 1, as some people write them by hand."""
    turn = SimpleNamespace(x=0.0, y=0.0, z=length * math.sin(yaw / 2), w=length * math.cos(yaw / 2))
    assert heading(turn) == pytest.approx(yaw)
    other = SimpleNamespace(x=0.0, y=0.0, z=-turn.z, w=-turn.w)
    assert heading(other) == pytest.approx(yaw), "q and -q are the same rotation"
    assert at(1.0, 2.0, 3.0, yaw).plane == (1.0, 2.0)


def test_an_orientation_that_nobody_filled_in_is_no_turn() -> None:
    assert heading(SimpleNamespace(x=0.0, y=0.0, z=0.0, w=0.0)) == 0.0


@given(pose=poses())
def test_a_heading_is_where_the_turned_x_axis_points(pose: Pose) -> None:
    x, y, z, w = pose.rotation.tolist()
    ahead = matrix(pose.rotation)[:2, 0]
    assume(float(np.linalg.norm(ahead)) > 1e-3)
    yaw = heading(SimpleNamespace(x=x, y=y, z=z, w=w))
    assert np.allclose(ahead / np.linalg.norm(ahead), (math.cos(yaw), math.sin(yaw)), atol=1e-6)
