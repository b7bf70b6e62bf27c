"""Limits and units of the arm's joints: the numbers themselves, and what holds for every input."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lupin_arm import joints
from lupin_arm.joints import ARM, OutsideLimits, clamp_jaw, clamp_pose, jaw_from_degrees, jaw_to_degrees

ANY = st.floats(allow_nan=True, allow_infinity=True)
FINITE = st.floats(allow_nan=False, allow_infinity=False)
FOUR = st.tuples(FINITE, FINITE, FINITE, FINITE)


def test_the_command_windows() -> None:
    assert [(joint.name, joint.window_deg) for joint in ARM] == [
        ("shoulder_pan", (-86.0, 90.0)),
        ("shoulder_lift", (-86.0, 85.0)),
        ("elbow", (-90.0, 90.0)),
        ("wrist", (-90.0, 88.0)),
    ]
    assert [joint.state_name for joint in ARM] == [
        "shoulder_pan_joint",
        "shoulder_lift_joint",
        "elbow_joint",
        "wrist_joint",
    ]


def test_a_window_is_what_the_servo_reaches_of_a_quarter_turn_in_whole_degrees() -> None:
    for joint in ARM:
        (low, high), (servo_low, servo_high) = joint.window_deg, joint.servo_deg
        assert (low, high) == (math.ceil(max(servo_low, -90.0)), math.floor(min(servo_high, 90.0)))


@given(FOUR)
def test_a_clamped_pose_may_be_commanded_and_is_the_nearest(angles: tuple[float, ...]) -> None:
    pose = clamp_pose(angles)
    assert joints.check_pose(pose) == pose
    for joint, asked, given_ in zip(ARM, angles, pose, strict=True):
        assert given_ == asked or given_ in (joint.low, joint.high)
    assert clamp_pose(pose) == pose


@given(st.lists(ANY, min_size=4, max_size=4))
def test_what_is_not_finite_is_refused_and_never_clamped(angles: list[float]) -> None:
    if all(map(math.isfinite, angles)):
        clamp_pose(angles)
        return
    with pytest.raises(OutsideLimits, match="is not an angle"):
        clamp_pose(angles)


@given(ANY)
def test_an_angle_is_checked_against_its_window(angle: float) -> None:
    wrist = ARM[3]
    if wrist.low <= angle <= wrist.high:
        wrist.check(angle)
        return
    with pytest.raises(OutsideLimits, match=r"^wrist: .* deg is not within -90 to 88$"):
        wrist.check(angle)


@given(FOUR)
def test_what_a_servo_reaches_is_in_its_range_and_the_nearest(angles: tuple[float, ...]) -> None:
    pan, lift, elbow, wrist = angles
    reached = joints.reach_pose((pan, lift, elbow, wrist))
    for joint, asked, angle in zip(ARM, angles, reached, strict=True):
        low, high = (math.radians(limit) for limit in joint.servo_deg)
        assert low <= angle <= high
        assert angle in (asked, low, high)
    assert joints.reach_pose(reached) == reached


@pytest.mark.parametrize("angles", [(), (0.0,) * 3, (0.0,) * 5])
def test_a_pose_has_four_angles(angles: tuple[float, ...]) -> None:
    with pytest.raises(OutsideLimits) as refused:
        clamp_pose(angles)
    assert str(refused.value) == (
        f"expected 4 angles (shoulder_pan, shoulder_lift, elbow, wrist), got {len(angles)}"
    )


def test_the_arm_is_read_out_of_all_joints_of_the_robot() -> None:
    told = {"wheel_left_joint": 7.0, **{joint.state_name: n for n, joint in enumerate(ARM)}}
    assert joints.read_pose(told) == (0.0, 1.0, 2.0, 3.0)
    assert joints.read_pose({**told, "elbow_joint": math.nan}) is None
    del told["wrist_joint"]
    assert joints.read_pose(told) is None


def test_the_jaw_is_open_at_minus_thirty_and_closed_at_thirty() -> None:
    assert jaw_from_degrees(-30.0) == pytest.approx(-0.20)
    assert jaw_from_degrees(30.0) == pytest.approx(0.25)
    assert jaw_from_degrees(0.0) == pytest.approx(0.025)
    assert (jaw_from_degrees(-90.0), jaw_from_degrees(90.0)) == pytest.approx((-0.20, 0.25))


@given(st.floats(-30.0, 30.0))
def test_degrees_of_the_jaw_and_back(degrees: float) -> None:
    assert jaw_to_degrees(jaw_from_degrees(degrees)) == pytest.approx(degrees, abs=1e-9)


@given(ANY)
def test_the_jaw_stays_within_its_range(angle: float) -> None:
    if not math.isfinite(angle):
        for convert in (clamp_jaw, jaw_from_degrees, jaw_to_degrees):
            with pytest.raises(OutsideLimits, match=r"^gripper: .* is not an angle$"):
                convert(angle)
        return
    assert -0.20 <= clamp_jaw(angle) <= 0.25
    assert -0.20 <= jaw_from_degrees(angle) <= 0.25
    assert -30.0 - 1e-9 <= jaw_to_degrees(angle) <= 30.0 + 1e-9


def test_the_farthest_joint_decides() -> None:
    assert joints.farthest((0.0, 0.0, 0.0, 0.0), (0.1, -0.4, 0.3, 0.0)) == pytest.approx(0.4)
