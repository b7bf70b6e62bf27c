"""Motions of the arm: whatever is asked for, what is sent is inside all limits."""

from __future__ import annotations

import itertools
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lupin_arm.joints import ARM, DEFAULT_RATE, MAX_RATE, OutsideLimits, Pose, check_pose, farthest
from lupin_arm.trajectory import (
    Point,
    Trajectory,
    TrajectorySample,
    clamp_speed,
    move,
    replay,
    time_for,
)

ANY = st.floats(allow_nan=True, allow_infinity=True)
WINDOWS = st.tuples(*(st.floats(joint.low, joint.high) for joint in ARM))
ANY_POSE = st.tuples(ANY, ANY, ANY, ANY)
SAMPLES = st.lists(st.builds(TrajectorySample, ANY | st.floats(0.0, 60.0), WINDOWS | ANY_POSE), max_size=8)

ZERO: Pose = (0.0, 0.0, 0.0, 0.0)
FAR: Pose = (1.0, -1.0, 1.0, -1.0)


def assert_may_be_sent(trajectory: Trajectory, start: Pose) -> None:
    assert trajectory.problem(start) is None
    before = Point(start, 0.0)
    for point in trajectory.points:
        check_pose(point.pose)
        assert point.time > before.time
        assert farthest(before.pose, point.pose) <= MAX_RATE * (point.time - before.time) * (1 + 1e-6)
        before = point
    assert trajectory.points[0].time >= 0.1


@given(target=WINDOWS | ANY_POSE, seconds=ANY, start=WINDOWS)
def test_every_move_is_inside_the_limits_or_refused(target: Pose, seconds: float, start: Pose) -> None:
    try:
        trajectory = move(target, seconds, start)
    except ValueError:
        assert not math.isfinite(sum(map(abs, (*target, seconds)))) or seconds > 3600.0
    else:
        assert_may_be_sent(trajectory, start)


@given(samples=SAMPLES, speed=ANY | st.floats(-1.0, 4.0), start=WINDOWS)
def test_every_replay_is_inside_the_limits_or_refused(
    samples: list[TrajectorySample], speed: float, start: Pose
) -> None:
    try:
        trajectory = replay(samples, speed, start)
    except ValueError:
        return
    assert len(trajectory.points) == len(samples)
    assert_may_be_sent(trajectory, start)


@given(st.lists(WINDOWS, min_size=1, max_size=8), WINDOWS)
def test_recordings_that_are_sound_are_never_refused(poses: list[Pose], start: Pose) -> None:
    samples = [TrajectorySample(index * 0.05, pose) for index, pose in enumerate(poses)]
    assert_may_be_sent(replay(samples, 2.0, start), start)


def test_a_move_takes_as_long_as_it_should() -> None:
    assert move(FAR, 3.0, ZERO).points == (Point(FAR, 3.0),)
    assert move(FAR, 0.0).duration == 0.1
    assert move(FAR, 0.1, ZERO).duration == pytest.approx(1.0 / MAX_RATE)


def test_a_move_is_clamped_to_the_windows() -> None:
    assert move((9.0, 9.0, -9.0, -9.0), 3.0).target == tuple(
        math.radians(angle) for angle in (90.0, 85.0, -90.0, -90.0)
    )


@pytest.mark.parametrize("seconds", [math.nan, math.inf, 3601.0])
def test_a_move_needs_a_time(seconds: float) -> None:
    with pytest.raises(ValueError, match=r"is not a number|would take longer than 3600 s"):
        move(ZERO, seconds)


def test_a_rate_is_a_time_for_a_way() -> None:
    assert time_for(1.0, 0.5) == 2.0
    assert time_for(1.0, 0.0) == time_for(1.0, -3.0) == pytest.approx(1.0 / DEFAULT_RATE)
    assert time_for(1.0, 1e9) == pytest.approx(1.0 / MAX_RATE)
    assert time_for(0.0, 1.0) == 0.1
    with pytest.raises(ValueError, match="the rate inf is not a number"):
        time_for(1.0, math.inf)


def test_the_speed_of_a_replay() -> None:
    assert [clamp_speed(speed) for speed in (0.0, 1.0, 0.1, -1.0, 7.0)] == [1.0, 1.0, 0.25, 0.25, 2.0]
    with pytest.raises(ValueError, match="the speed nan is not a number"):
        clamp_speed(math.nan)


def test_a_replay_begins_with_a_move_to_where_it_was_recorded() -> None:
    recorded = [TrajectorySample(0.0, FAR), TrajectorySample(2.0, ZERO)]
    there, rest = replay(recorded, 1.0, ZERO).points
    assert there == Point(FAR, 1.0 / DEFAULT_RATE)
    assert rest.time - there.time == pytest.approx(2.0)


def test_double_speed_halves_the_recorded_times_but_not_the_way_to_the_start() -> None:
    recorded = [TrajectorySample(0.0, FAR), TrajectorySample(2.0, ZERO), TrajectorySample(5.0, FAR)]
    times = [point.time for point in replay(recorded, 2.0, ZERO).points]
    assert times == pytest.approx([1.0 / DEFAULT_RATE + more for more in (0.0, 1.0, 2.5)])


def test_samples_at_one_time_or_too_fast_are_stretched() -> None:
    recorded = [
        TrajectorySample(0.0, ZERO),
        TrajectorySample(0.0, ZERO),
        TrajectorySample(0.01, FAR),
        TrajectorySample(-5.0, FAR),
    ]
    times = [point.time for point in replay(recorded, 1.0, ZERO).points]
    steps = [after - before for before, after in itertools.pairwise(times)]
    assert steps == pytest.approx([0.01, 1.0 / MAX_RATE, 0.01])


@pytest.mark.parametrize(
    ("samples", "reason"),
    [
        ([], "there is nothing to play"),
        ([TrajectorySample(math.nan, ZERO)], "the time nan is not a number"),
        (
            [TrajectorySample(0.0, ZERO), TrajectorySample(1e9, ZERO)],
            "the motion would take longer than 3600 s",
        ),
        ([TrajectorySample(0.0, (0.0,) * 5)], r"expected 4 angles \(.*\), got 5"),
    ],
)
def test_what_cannot_be_played(samples: list[TrajectorySample], reason: str) -> None:
    with pytest.raises(ValueError, match=f"^{reason}$"):
        replay(samples, 1.0, ZERO)


@pytest.mark.parametrize(
    ("points", "reason"),
    [
        ((), "the motion has no points"),
        ((Point((2.0, 0.0, 0.0, 0.0), 3.0),), "shoulder_pan: 114.6 deg is not within -86 to 90"),
        ((Point((math.nan, 0.0, 0.0, 0.0), 3.0),), "shoulder_pan: nan deg is not within -86 to 90"),
        ((Point(ZERO, 0.0),), "the times of a motion must increase, up to 3600 s"),
        ((Point(ZERO, 1.0), Point(ZERO, 1.0)), "the times of a motion must increase, up to 3600 s"),
        ((Point(ZERO, math.nan),), "the times of a motion must increase, up to 3600 s"),
        ((Point(ZERO, 1.0), Point(FAR, 1.1)), "a joint would be faster than 180 deg/s"),
        ((Point(FAR, 0.1),), "a joint would be faster than 180 deg/s"),
    ],
)
def test_what_must_not_be_sent(points: tuple[Point, ...], reason: str) -> None:
    assert Trajectory(points).problem(ZERO) == reason


def test_where_a_motion_is() -> None:
    trajectory = Trajectory((Point(FAR, 2.0), Point(ZERO, 4.0)))
    half = (0.5, -0.5, 0.5, -0.5)
    assert [trajectory.at(time, ZERO) for time in (0.0, 1.0, 2.0, 3.0, 9.0)] == [ZERO, half, FAR, half, ZERO]
    assert (trajectory.duration, trajectory.target) == (4.0, ZERO)


def test_an_angle_that_is_none_is_no_move() -> None:
    with pytest.raises(OutsideLimits, match=r"^elbow: inf is not an angle$"):
        move((0.0, 0.0, math.inf, 0.0), 3.0)
