"""The simulated arm: as fast, as limited and as stubborn as a real one."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lupin_arm.joints import ARM, Pose
from lupin_arm.simulated import HAND_RATE, JAW_RATE, SERVO_RATE, SimulatedArm
from lupin_arm.trajectory import Point, Trajectory

ZERO: Pose = (0.0, 0.0, 0.0, 0.0)
FAR: Pose = (1.0, -1.0, 1.0, -1.0)

ANGLES = st.floats(-4.0, 4.0)
COMMANDS = st.lists(
    st.tuples(st.tuples(ANGLES, ANGLES, ANGLES, ANGLES), st.floats(0.001, 5.0), st.floats(0.0, 2.0)),
    max_size=6,
)


def to(pose: Pose, seconds: float) -> Trajectory:
    return Trajectory((Point(pose, seconds),))


def arm() -> SimulatedArm:
    return SimulatedArm(ZERO, 0.0, 0.0)


def test_it_moves_in_the_time_that_is_asked_for() -> None:
    simulated = arm()
    simulated.follow(to(FAR, 2.0), 0.0)
    simulated.advance(1.0)
    assert simulated.pose == pytest.approx((0.5, -0.5, 0.5, -0.5))
    assert simulated.moving
    simulated.advance(2.0)
    assert (simulated.pose, simulated.moving) == (FAR, False)


def test_a_servo_is_no_faster_than_it_is() -> None:
    simulated = arm()
    simulated.follow(to(FAR, 0.01), 0.0)
    simulated.advance(0.1)
    assert simulated.pose == pytest.approx(tuple(math.copysign(SERVO_RATE * 0.1, angle) for angle in FAR))


def test_an_angle_out_of_reach_is_ignored_without_a_word() -> None:
    simulated = arm()
    simulated.follow(to((0.5, 0.5, 0.5, 1.6), 1.0), 0.0)
    simulated.advance(5.0)
    pan, lift, elbow, wrist = simulated.pose
    assert (pan, lift, elbow) == (0.5, 0.5, 0.5)
    assert wrist < math.radians(88.0)


@given(COMMANDS)
def test_whatever_is_commanded_no_servo_leaves_its_range_or_speed(
    commands: list[tuple[Pose, float, float]],
) -> None:
    simulated, now = arm(), 0.0
    for pose, seconds, wait in commands:
        simulated.follow(to(pose, seconds), now)
        before = simulated.pose
        now += wait
        simulated.advance(now)
        for joint, old, new in zip(ARM, before, simulated.pose, strict=True):
            assert joint.servo_deg[0] <= math.degrees(new) + 1e-3
            assert math.degrees(new) - 1e-3 <= joint.servo_deg[1]
            assert abs(new - old) <= SERVO_RATE * wait + 1e-9


def test_switched_off_it_stays_and_switched_on_it_jumps_to_its_old_target() -> None:
    simulated = arm()
    simulated.follow(to(FAR, 1.0), 0.0)
    simulated.power(False, 0.5)
    simulated.advance(9.0)
    assert simulated.pose == pytest.approx((0.5, -0.5, 0.5, -0.5))
    assert not simulated.moving
    simulated.power(True, 9.0)
    assert simulated.moving
    simulated.advance(9.5)
    assert simulated.pose == FAR


def test_only_a_limp_arm_can_be_moved_by_hand() -> None:
    simulated = arm()
    simulated.push(FAR, 0.0)
    simulated.advance(1.0)
    assert simulated.pose == ZERO
    simulated.power(False, 1.0)
    simulated.advance(1.5)
    assert simulated.pose == pytest.approx(tuple(math.copysign(HAND_RATE * 0.5, angle) for angle in FAR))


def test_the_jaw_moves_at_its_own_speed_and_within_its_range() -> None:
    simulated = arm()
    assert simulated.send_jaw(0.25, 0.0)
    simulated.advance(0.1)
    assert simulated.jaw == pytest.approx(JAW_RATE * 0.1)
    assert not simulated.jaw_there
    simulated.stop_jaw(0.1)
    assert simulated.jaw_there
    assert not simulated.send_jaw(2.0, 0.1)
    assert simulated.jaw_there


def test_a_clock_that_is_set_back_moves_nothing() -> None:
    simulated = arm()
    simulated.follow(to(FAR, 1.0), 5.0)
    simulated.advance(5.5)
    half = simulated.pose
    simulated.advance(1.0)
    assert simulated.pose == half


def test_everything_is_told_by_the_names_of_the_joints() -> None:
    assert list(arm().angles) == [
        "shoulder_pan_joint",
        "shoulder_lift_joint",
        "elbow_joint",
        "wrist_joint",
        "gripper_joint",
    ]
