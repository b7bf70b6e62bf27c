"""Poses in space and the tree of frames, by what must hold for all of them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lupin_perception import transforms
from lupin_perception.transforms import HISTORY_S, Frames, Pose, between, matrix, pose_of, product

numbers = st.floats(-100.0, 100.0)


@st.composite
def poses(draw: st.DrawFn) -> Pose:
    """Any pose within 100 m."""
    turn = draw(st.tuples(*[st.floats(-1.0, 1.0)] * 4).filter(lambda q: math.hypot(*q) > 0.1))
    pose = pose_of(draw(st.tuples(numbers, numbers, numbers)), turn)
    assert pose is not None
    return pose


def at(x: float = 0.0, y: float = 0.0, z: float = 0.0, yaw: float = 0.0) -> Pose:
    pose = pose_of((x, y, z), (0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2)))
    assert pose is not None
    return pose


def is_same(one: Pose, other: Pose) -> bool:
    """Say whether two poses are one; q and -q are the same rotation."""
    places = np.allclose(one.position, other.position, atol=1e-9)
    return bool(places and np.allclose(matrix(one.rotation), matrix(other.rotation), atol=1e-9))


# --- poses


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


# --- frames


@given(a=poses(), b=poses(), c=poses())
def test_a_frame_is_found_through_those_between(a: Pose, b: Pose, c: Pose) -> None:
    frames = Frames()
    frames.add("camera", "tag_7", c, 1.0)
    frames.add("odom", "camera", b, 1.0)
    frames.add("/map", "/odom", a, 0.0, static=True)
    found = frames.find("map", "tag_7")
    assert found is not None
    assert is_same(found, a @ b @ c)


def test_a_frame_that_does_not_hang_below_the_other_is_not_found() -> None:
    frames = Frames()
    frames.add("camera", "tag_7", at(), 1.0)
    assert frames.find("map", "tag_7") is None
    assert frames.find("map", "tag_8") is None
    frames.add("tag_7", "camera", at(), 1.0)
    assert frames.find("map", "tag_7") is None, "it goes in circles"


def test_a_tag_is_placed_by_where_the_camera_was_when_it_saw_it() -> None:
    """A robot that has driven on must not take the tag with it."""
    frames = Frames()
    for moment in (0.0, 1.0, 2.0, 3.0):
        frames.add("map", "camera", at(moment), moment)
    frames.add("camera", "tag_7", at(1.0), 1.5)
    found = frames.find("map", "tag_7")
    assert found is not None
    assert found.position.tolist() == pytest.approx([2.5, 0.0, 0.0])


def test_a_tag_seen_before_the_camera_was_known_is_not_placed() -> None:
    frames = Frames()
    frames.add("camera", "tag_7", at(1.0), 1.5)
    frames.add("map", "camera", at(), 2.0)
    assert frames.find("map", "tag_7") is None
    frames.add("camera", "tag_7", at(1.0), 2.5)
    frames.add("map", "camera", at(), 3.0)
    assert frames.find("map", "tag_7") is not None


def test_a_robot_that_lost_its_way_places_no_new_tags() -> None:
    frames = Frames()
    frames.add("map", "odom", at(), 1.0)
    frames.add("odom", "camera", at(), 2.0)
    frames.add("camera", "tag_7", at(), 2.0)
    assert frames.find("map", "tag_7") is None


def test_an_old_view_is_forgotten_with_where_the_camera_was_then() -> None:
    frames = Frames()
    frames.add("map", "camera", at(), 0.0)
    frames.add("camera", "tag_7", at(), 0.0)
    frames.add("map", "camera", at(), HISTORY_S + 1.0)
    assert frames.find("map", "tag_7") is None


def test_what_was_overtaken_is_left_out_and_a_clock_set_back_begins_anew() -> None:
    frames = Frames()
    frames.add("map", "camera", at(5.0), 100.0)
    frames.add("map", "camera", at(1.0), 99.0)
    found = frames.find("map", "camera")
    assert found is not None
    assert found.position[0] == 5.0
    frames.add("map", "camera", at(2.0), 3.0)
    found = frames.find("map", "camera")
    assert found is not None
    assert found.position[0] == 2.0


def test_a_frame_with_another_parent_begins_anew() -> None:
    frames = Frames()
    frames.add("left", "tag_7", at(1.0), 1.0)
    frames.add("map", "tag_7", at(2.0), 0.5)
    found = frames.find("map", "tag_7")
    assert found is not None
    assert found.position[0] == 2.0


def test_there_is_room_for_so_many_frames_and_those_known_go_on(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(transforms, "MAX_FRAMES", 2)
    frames = Frames()
    assert frames.add("map", "a", at(), 1.0)
    assert frames.add("map", "b", at(), 1.0)
    assert not frames.add("map", "c", at(), 1.0)
    assert frames.add("map", "a", at(3.0), 2.0)
    found = frames.find("map", "a")
    assert found is not None
    assert found.position[0] == 3.0
