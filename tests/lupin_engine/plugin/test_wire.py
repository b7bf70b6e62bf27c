"""What messages of ROS mean to the language."""

from __future__ import annotations

import math
from types import SimpleNamespace

import pytest

from lupin_engine.plugin.types import POSE
from lupin_engine.plugin.wire import SMALLEST_W, filled_in, pose_fields, pose_from, seconds_of, time_fields


@pytest.mark.parametrize("length", [0.5, 1.0, 3.0])
@pytest.mark.parametrize("yaw", [0.0, 1.0, -2.5, math.pi / 2])
def test_a_pose_has_the_heading_of_a_quaternion_of_any_length(yaw: float, length: float) -> None:
    fields = pose_fields({"x": 1.0, "y": 2.0, "yaw": yaw})
    turned = {"x": 0.0, "y": 0.0, **fields["orientation"]}
    message = {**fields, "orientation": {name: length * part for name, part in turned.items()}}
    assert pose_from(message, POSE) == pytest.approx({"x": 1.0, "y": 2.0, "yaw": yaw})


@pytest.mark.parametrize("seconds", [0.0, 12.25, -0.25, 1_790_000_000.123456])
def test_seconds_become_a_time_and_back(seconds: float) -> None:
    fields = time_fields(seconds)
    assert 0 <= fields["nanosec"] < 1_000_000_000
    assert seconds_of(SimpleNamespace(**fields)) == pytest.approx(seconds, abs=1e-6)


def test_nanoseconds_that_round_up_to_a_second_are_carried() -> None:
    assert time_fields(1.9999999999) == {"sec": 2, "nanosec": 0}


@pytest.mark.parametrize(
    ("w", "told"),
    [(0.0, SMALLEST_W), (-1e-12, -SMALLEST_W), (0.5, 0.5), (-1.0, -1.0), (SMALLEST_W, SMALLEST_W)],
)
def test_an_orientation_that_is_told_has_a_w(w: float, told: float) -> None:
    """A half turn would else look like one that nobody has filled in."""
    assert filled_in(w) == told


def test_a_quaternion_that_nobody_filled_in_is_no_turn() -> None:
    message = {"position": {"x": 1.0, "y": 2.0}, "orientation": dict.fromkeys("xyzw", 0.0)}
    assert pose_from(message, POSE) == {"x": 1.0, "y": 2.0, "yaw": 0.0}
