"""Where the robot is by the transforms: composed, renewed, and unknown where the tree has a gap."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lupin_nav.transforms import Planar, Transforms


def stamped(parent: str, child: str, x: float, y: float, yaw: float = 0.0) -> Any:
    rotation = SimpleNamespace(x=0.0, y=0.0, z=math.sin(yaw / 2), w=math.cos(yaw / 2))
    transform = SimpleNamespace(translation=SimpleNamespace(x=x, y=y, z=0.0), rotation=rotation)
    return SimpleNamespace(header=SimpleNamespace(frame_id=parent), child_frame_id=child, transform=transform)


def tree(*transforms: Any) -> Transforms:
    found = Transforms()
    found.take(SimpleNamespace(transforms=transforms))
    return found


def close(place: Planar | None) -> Any:
    assert place is not None
    return pytest.approx((place.x, place.y, place.yaw))


def test_transforms_are_composed_from_the_robot_up_to_the_map() -> None:
    found = tree(stamped("odom", "base_link", 2.0, 0.0), stamped("map", "odom", 1.0, 1.0, math.pi / 2))
    assert (1.0, 3.0, math.pi / 2) == close(found.find("map", "base_link"))


def test_the_last_of_each_counts_and_slashes_do_not() -> None:
    found = tree(stamped("/map", "/base_link", 1.0, 0.0))
    found.take(SimpleNamespace(transforms=[stamped("map", "base_link", 5.0, 0.0)]))
    assert found.find("map", "/base_link") == Planar(5.0, 0.0, 0.0)


def test_a_frame_is_where_it_is_in_itself() -> None:
    assert tree().find("map", "map") == Planar(0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    "transforms",
    [
        (),
        (stamped("odom", "base_link", 0.0, 0.0),),
        (stamped("map", "odom", 0.0, 0.0),),
        (stamped("a", "base_link", 0.0, 0.0), stamped("base_link", "a", 0.0, 0.0)),
        (stamped("map", "base_link", math.nan, 0.0),),
    ],
)
def test_a_gap_a_circle_and_nonsense_are_no_place(transforms: tuple[Any, ...]) -> None:
    assert tree(*transforms).find("map", "base_link") is None


angles = st.floats(-3.1, 3.1)
lengths = st.floats(-100.0, 100.0)
planars = st.builds(Planar, lengths, lengths, angles)


@given(a=planars, b=planars, c=planars)
def test_composing_is_associative(a: Planar, b: Planar, c: Planar) -> None:
    left, right = (a @ b) @ c, a @ (b @ c)
    assert (left.x, left.y) == pytest.approx((right.x, right.y), abs=1e-9)
    assert math.cos(left.yaw - right.yaw) == pytest.approx(1.0)
