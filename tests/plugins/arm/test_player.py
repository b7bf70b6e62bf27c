"""Replays: the way to the beginning, the speed, and when the jaw moves."""

from __future__ import annotations

import itertools
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lupin_arm.joints import JAW_CLOSED, JAW_OPEN, Pose
from lupin_arm.library import NotInLibrary, Sequence, Waypoint
from lupin_arm.player import JAW_MOVED, plan

HOME: Pose = (0.0, 0.0, 0.0, 0.0)
ANGLES = st.lists(st.floats(-1.4, 1.4), min_size=4, max_size=4)
JAWS = st.none() | st.floats(JAW_OPEN, JAW_CLOSED)


def sequence(*waypoints: Waypoint, jaw: bool = True) -> Sequence:
    """Return a sequence that ends with its last waypoint."""
    return Sequence(duration_s=waypoints[-1].t, include_gripper=jaw, waypoints=list(waypoints))


def turned(time: float, angle: float, jaw: float | None = None) -> Waypoint:
    """Return a waypoint with one joint turned."""
    return Waypoint(t=time, arm=[angle, 0.0, 0.0, 0.0], gripper=jaw)


def test_a_replay_begins_with_the_way_to_its_first_pose() -> None:
    """Hazard of section 4: from anywhere to the first pose in a tenth of a second."""
    replay = plan(sequence(turned(0.0, 1.2), turned(2.0, 1.0)), 1.0, HOME)
    way = 1.2 / math.radians(60.0)
    assert [point.time for point in replay.trajectory.points] == pytest.approx([way, way + 2.0])
    assert replay.duration == pytest.approx(way + 2.0)


@pytest.mark.parametrize(
    ("speed", "factor"),
    [(0.0, 1.0), (1.0, 1.0), (2.0, 2.0), (0.1, 0.25), (9.0, 2.0), (-1.0, 0.25)],
)
def test_the_speed_is_clamped(speed: float, factor: float) -> None:
    """Zero is the speed of the recording; twice as fast takes half as long."""
    replay = plan(sequence(turned(0.0, 0.0), turned(4.0, 1.0)), speed, HOME)
    first, last = replay.trajectory.points
    assert last.time - first.time == pytest.approx(4.0 / factor)
    assert all(len(point.pose) == 4 for point in replay.trajectory.points)


@pytest.mark.parametrize("speed", [math.nan, math.inf])
def test_a_speed_that_is_no_number_is_refused(speed: float) -> None:
    """NaN compares with nothing, and nobody means infinity."""
    with pytest.raises(NotInLibrary, match=f"the speed {speed} is not a number"):
        plan(sequence(turned(0.0, 0.0), turned(1.0, 0.0)), speed, HOME)


def test_the_jaw_moves_at_the_beginning_and_where_it_has_changed() -> None:
    """Events, not a stream: the first, then each change of more than 0.05 rad since the last command."""
    walk = [turned(0.0, 0.0, 0.0), turned(1.0, 0.1, 0.04), turned(2.0, 0.2, 0.06), turned(3.0, 0.3, -0.1)]
    replay = plan(sequence(*walk), 2.0, HOME)
    lead = replay.trajectory.points[0].time
    assert [(event.time - lead, event.angle) for event in replay.jaw] == [
        (0.0, 0.0),
        (pytest.approx(1.0), 0.06),
        (pytest.approx(1.5), -0.1),
    ]
    assert plan(sequence(*walk, jaw=False), 2.0, HOME).jaw == ()


@given(
    st.lists(st.tuples(st.floats(0.0, 2.0), ANGLES, JAWS), min_size=1, max_size=30),
    st.floats(allow_nan=False, allow_infinity=False),
    ANGLES,
)
def test_whatever_is_played_may_be_sent(
    steps: list[tuple[float, list[float], float | None]], speed: float, start: list[float]
) -> None:
    """Equal times too: the motion has no problem from where the arm is, and the jaw moves during it."""
    waypoints, now = [], 0.0
    for step, angles, jaw in steps:
        now += step
        waypoints.append(Waypoint(t=now, arm=angles, gripper=jaw))
    pan, lift, elbow, wrist = start
    replay = plan(sequence(*waypoints), speed, (pan, lift, elbow, wrist))
    assert replay.trajectory.problem((pan, lift, elbow, wrist)) is None
    assert len(replay.trajectory.points) == len(waypoints)
    assert all(0.0 < event.time <= replay.duration for event in replay.jaw)
    angles_sent = [event.angle for event in replay.jaw]
    assert all(abs(b - a) > JAW_MOVED for a, b in itertools.pairwise(angles_sent))
