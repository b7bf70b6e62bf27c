"""Recordings: which poses are taken, where they end, and what becomes of them."""

from __future__ import annotations

import itertools
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lupin_arm.joints import ARM, Pose, check_pose
from lupin_arm.library import NotInLibrary
from lupin_arm.recorder import MAX_SECONDS, MAX_WAYPOINTS, MOVED, PERIOD_S, PoseRecording

#: When the arm's computer and ours began to count.
THERE, HERE = 1_000_000.0, 50.0


def pose(angle: float) -> Pose:
    """Return a pose with one joint turned."""
    return (angle, 0.0, 0.0, 0.0)


def recording(*moments: tuple[float, float], mode: str = "teleop") -> PoseRecording:
    """Return a recording of poses at times."""
    made = PoseRecording(mode, include_gripper=False)
    for time, angle in moments:
        made.sample(THERE + time, HERE + time, pose(angle), None)
    return made


def times(made: PoseRecording) -> list[float]:
    """Return the times of the waypoints."""
    return [round(waypoint.t, 6) for waypoint in made.waypoints]


def test_the_first_pose_is_always_taken() -> None:
    """It is where the replay goes first."""
    assert times(recording((3.0, 0.5))) == [0.0]


def test_a_pose_is_taken_when_time_has_passed_and_a_joint_has_moved() -> None:
    """Both, not one of them."""
    small = MOVED * 0.9
    made = recording((0.0, 0.0), (0.04, 1.0), (0.06, small), (0.08, MOVED * 1.01), (0.5, MOVED * 1.5))
    assert times(made) == [0.0, 0.08]


def test_a_jaw_that_moves_is_taken_too() -> None:
    """Where the jaw is recorded."""
    for include, number in ((True, 2), (False, 1)):
        made = PoseRecording("teleop", include)
        made.sample(THERE, HERE, pose(0.0), 0.0)
        made.sample(THERE + 1.0, HERE + 1.0, pose(0.0), 0.2)
        assert len(made.waypoints) == number
        assert made.waypoints[-1].gripper == (0.2 if include else None)


def test_poses_that_are_told_twice_or_late_are_left_out() -> None:
    """The times of a recording increase."""
    made = recording((0.0, 0.0), (0.2, 0.2), (0.2, 0.4), (0.1, 0.6), (0.3, 0.8))
    assert times(made) == [0.0, 0.2, 0.3]


@pytest.mark.parametrize("step", [3600.0, -3600.0, 2.0, -2.0])
def test_a_clock_that_is_set_neither_ends_nor_silences_a_recording(step: float) -> None:
    """War story 68: the clock of the arm's computer is stepped; our own tells how the recording goes on."""
    made = recording((0.0, 0.0), (0.5, 0.1))
    for time in (1.0, 1.5, 2.0):
        made.sample(THERE + time + step, HERE + time, pose(time), None)
    assert (times(made), made.full) == ([0.0, 0.5, 1.0, 1.5, 2.0], "")


def test_the_end_is_where_the_arm_was_last() -> None:
    """Who holds still at the end means that."""
    made = recording((0.0, 0.0), (1.0, 0.5), (2.0, 0.5))
    sequence = made.finish(HERE + 2.5, "now")
    assert sequence.duration_s == pytest.approx(2.5)
    assert [(w.t, w.arm[0]) for w in sequence.waypoints] == [
        (0.0, 0.0),
        (1.0, 0.5),
        (pytest.approx(2.5), 0.5),
    ]
    assert (sequence.mode, sequence.created, sequence.note) == ("teleop", "now", "")


def test_nothing_after_a_minute_is_kept() -> None:
    """Hazard of section 6: waypoints after 60 s were kept although the duration was capped."""
    made = recording(*[(second, second / 100.0) for second in range(70)])
    assert made.full == "cut at 60 s"
    sequence = made.finish(HERE + 70.0, "")
    assert sequence.duration_s == sequence.waypoints[-1].t == MAX_SECONDS
    assert len(sequence.waypoints) == 61


def test_so_many_waypoints_and_no_more() -> None:
    """The recording ends with the last of them."""
    made = recording(*[(number * PERIOD_S, 0.01 * (number % 100)) for number in range(MAX_WAYPOINTS + 50)])
    assert made.full == f"cut at {MAX_WAYPOINTS} waypoints"
    sequence = made.finish(HERE + 55.0, "")
    assert len(sequence.waypoints) == MAX_WAYPOINTS
    assert sequence.duration_s == pytest.approx((MAX_WAYPOINTS - 1) * PERIOD_S)
    assert made.elapsed(HERE + 55.0) == sequence.duration_s


def test_nothing_recorded_is_nothing() -> None:
    """And the recording goes on: it is not lost by asking."""
    made = recording()
    assert made.elapsed(HERE) == 0.0
    with pytest.raises(NotInLibrary) as refused:
        made.finish(HERE + 5.0, "")
    missing = "no joint states with all joints of the arm have arrived"
    assert str(refused.value) == f"nothing was recorded: {missing}"
    made.sample(THERE, HERE + 6.0, pose(0.1), None)
    assert len(made.finish(HERE + 7.0, "").waypoints) == 2


def test_what_a_hand_pushes_beyond_the_limits_is_taken_at_them() -> None:
    """The elbow's servo goes to -116 degrees, its window to -90."""
    made = PoseRecording("kinesthetic", include_gripper=False)
    made.sample(THERE, HERE, (0.0, 0.0, math.radians(-116.0), 0.0), None)
    assert made.waypoints[0].arm[2] == pytest.approx(math.radians(-90.0))
    assert made.clamped == 1


@given(
    st.lists(
        st.tuples(st.floats(-1.0, 2.0), st.lists(st.floats(-4.0, 4.0), min_size=4, max_size=4)), max_size=60
    ),
    st.booleans(),
    st.floats(-10.0, 200.0),
)
def test_whatever_is_recorded_can_be_kept(
    moments: list[tuple[float, list[float]]], jaw: bool, end: float
) -> None:
    """Times increase from 0 to the duration, angles are inside the limits, nothing is too long."""
    made, now = PoseRecording("teleop", include_gripper=jaw), 0.0
    for step, angles in moments:
        now += step
        pan, lift, elbow, wrist = angles
        made.sample(THERE + now, HERE + now, (pan, lift, elbow, wrist), angles[0])
    if not moments:
        with pytest.raises(NotInLibrary):
            made.finish(HERE + end, "")
        return
    sequence = made.finish(HERE + end, "")
    found = [waypoint.t for waypoint in sequence.waypoints]
    assert found[0] == 0.0
    assert all(later > earlier for earlier, later in itertools.pairwise(found))
    assert found[-1] == sequence.duration_s <= MAX_SECONDS
    assert len(found) <= MAX_WAYPOINTS
    for waypoint in sequence.waypoints:
        check_pose(waypoint.arm)
        assert len(waypoint.arm) == len(ARM)
        assert (waypoint.gripper is not None) == jaw
