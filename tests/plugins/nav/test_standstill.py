"""Whether a robot stands after its drive was cancelled: braking, jumps of the localizer, driving by hand."""

from __future__ import annotations

import pytest

from lupin_nav.standstill import BRAKING_S, MOVED_M, STOOD_S, WATCHED_S, MovementWatch


def driven(speed: float, *, begin: float = 0.0, end: float = 20.0, runs: bool = False) -> float | None:
    """Return when it is said that a robot moves that drives from one time to another, or None."""
    watch = MovementWatch()
    watch.cancelled("a1", 0.0)
    for tick in range(200):
        now = 0.1 * tick
        x = speed * max(0.0, min(now, end) - begin)
        if watch.moves((x, 0.0), now, runs):
            return now
    return None


@pytest.mark.parametrize("runs", [True, False])
def test_a_robot_that_drives_on_is_found_when_it_should_stand(runs: bool) -> None:
    found = driven(0.5, runs=runs)
    assert found is not None
    assert BRAKING_S + MOVED_M / 0.5 <= found <= BRAKING_S + MOVED_M / 0.5 + 0.3


def test_a_robot_that_brakes_is_none() -> None:
    assert driven(0.5, end=BRAKING_S, runs=True) is None


def test_a_robot_is_not_watched_long_after_the_end_of_its_drive() -> None:
    """Somebody may drive it once it has stood; while the server has the goal, it is watched all the time."""
    late = BRAKING_S + STOOD_S + 0.3
    assert driven(0.5, begin=late) is None
    assert driven(0.5, begin=late, runs=True) is not None


def test_where_no_pose_comes_the_robot_has_stood() -> None:
    """Some localizers speak of a robot only while it moves."""
    watch = MovementWatch()
    watch.cancelled("a1", 0.0)
    assert not watch.moves((0.0, 0.0), 0.1, False)
    later = [0.1 * tick for tick in range(50, 90)]
    assert not any(watch.moves((0.5 * (now - 5.0), 0.0), now, False) for now in later)


def test_a_robot_that_never_stood_is_watched_as_long_as_it_may_be_its_drive() -> None:
    found = driven(0.06)
    assert found is not None
    assert BRAKING_S + STOOD_S < found < BRAKING_S + WATCHED_S


def test_a_jump_is_no_movement_and_noise_is_none() -> None:
    watch = MovementWatch()
    watch.cancelled("a1", 0.0)
    for tick in range(100):
        x = (3.0 if tick > 50 else 0.0) + 0.02 * (tick % 2)
        assert not watch.moves((x, 0.0), 0.1 * tick, True)


def test_the_next_drive_ends_the_watch_and_asking_again_does_not_begin_it_anew() -> None:
    watch = MovementWatch()
    watch.cancelled("a1", 0.0)
    watch.moves((0.0, 0.0), BRAKING_S, True)
    watch.cancelled("a1", BRAKING_S)
    assert not watch.moves((0.25, 0.0), BRAKING_S + 0.1, True)
    assert watch.moves((0.5, 0.0), BRAKING_S + 0.2, True)
    watch.cancelled("a2", 10.0)
    watch.forget()
    assert not any(watch.moves((float(x), 0.0), 20.0 + x, True) for x in range(10))
