"""What messages of ROS mean to the language."""

from __future__ import annotations

import math

import pytest

from lupin_engine.plugin.types import POSE
from lupin_engine.plugin.wire import pose_fields, pose_from


@pytest.mark.parametrize("length", [0.5, 1.0, 3.0])
@pytest.mark.parametrize("yaw", [0.0, 1.0, -2.5, math.pi / 2])
def test_a_pose_has_the_heading_of_a_quaternion_of_any_length(yaw: float, length: float) -> None:
    fields = pose_fields({"x": 1.0, "y": 2.0, "yaw": yaw})
    turned = {"x": 0.0, "y": 0.0, **fields["orientation"]}
    message = {**fields, "orientation": {name: length * part for name, part in turned.items()}}
    assert pose_from(message, POSE) == pytest.approx({"x": 1.0, "y": 2.0, "yaw": yaw})


def test_a_quaternion_that_nobody_filled_in_is_no_turn() -> None:
    message = {"position": {"x": 1.0, "y": 2.0}, "orientation": dict.fromkeys("xyzw", 0.0)}
    assert pose_from(message, POSE) == {"x": 1.0, "y": 2.0, "yaw": 0.0}
