"""An action server that misbehaves: never answers, answers late or twice, loses what it was asked."""

from __future__ import annotations

import time
from collections.abc import Iterator

import pytest

from lupin_engine.machine.operations import CANCEL_DEADLINE
from tests.lupin_ros.system.wire.wire import OK, UNREACHABLE, Drive, Wire, leave_open, running_node

pytestmark = pytest.mark.timeout(120)

#: Seconds that a drive may take.
LIMIT = 2.5


@pytest.fixture(scope="module")
def running(ros_domain: int, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Wire]:
    """One node for all tests here: each leaves it with its mission ended."""
    with running_node(tmp_path_factory.mktemp("wire"), nav_timeout_s=LIMIT, dock_timeout_s=LIMIT) as wire:
        yield wire


def test_goals_that_are_never_answered_are_given_up_and_the_mission_goes_on(wire: Wire) -> None:
    """Story 12: the deadline covers the send as well. The robot has one goal at a time, lost or not."""
    wire.base.plan.extend([leave_open] * 2)
    mission = wire.start("1", "2")
    wire.until_done(mission)
    assert wire.outcomes(mission) == [("1", UNREACHABLE), ("2", OK)]
    assert wire.details(mission) == ["nav_timeout", ""]
    first, second, *others = [drive.arrived for drive in wire.drives]
    assert second - first >= LIMIT
    assert len(others) == 2


def test_a_drive_home_that_is_never_answered_ends_the_mission(wire: Wire) -> None:
    """Nothing waits for ever: story 13."""
    wire.base.plan.extend([Drive.arrive_at_once, leave_open])
    mission = wire.start("1")
    wire.until_done(mission)
    assert wire.outcomes(mission) == [("1", OK)]
    assert wire.operator.state.last_error == "nav_timeout"


def test_a_goal_that_is_accepted_after_a_pause_is_cancelled(wire: Wire) -> None:
    """Story A4: nobody knew of a handle when the pause came; the robot must not set off."""
    wire.base.plan.append(leave_open)
    mission = wire.start("1")
    wire.until(lambda: wire.drives, "the goal")
    assert wire.operator.ask("pause").success
    wire.until_held()
    late = wire.drives[0]
    late.accept()
    wire.until(lambda: late.cancels, "the cancel on the wire")
    wire.until(lambda: late.ended, "the robot stopped")
    assert wire.operator.ask("resume").success
    wire.until_done(mission)
    assert wire.outcomes(mission) == [("1", OK)]


def test_a_goal_that_is_accepted_after_an_e_stop_is_cancelled(wire: Wire) -> None:
    """The same for the button, which nobody releases before the goal is taken."""
    wire.base.plan.append(leave_open)
    mission = wire.start("1")
    wire.until(lambda: wire.drives, "the goal")
    wire.estop(True)
    wire.until_held()
    wire.drives[0].accept()
    wire.until(lambda: wire.drives[0].cancels, "the cancel on the wire")
    assert [drive.drives for drive in wire.drives] == [False]
    wire.estop(False)
    wire.until(lambda: not wire.operator.state.estop_engaged, "released")
    assert wire.operator.ask("resume").success
    wire.until_done(mission)
    assert wire.outcomes(mission) == [("1", OK)]


def test_a_goal_that_is_accepted_after_it_timed_out_is_cancelled(wire: Wire) -> None:
    """It belongs to an attempt that nobody waits for, while the next one drives."""
    wire.base.plan.extend([leave_open, Drive.accept])
    mission = wire.start("1")
    second = wire.until_driving(2)
    late = wire.drives[0]
    late.accept()
    wire.until(lambda: late.cancels, "the cancel on the wire")
    assert second.cancels == []
    second.arrive()
    wire.until_done(mission)
    assert wire.outcomes(mission) == [("1", OK)]


def test_feedback_of_a_goal_that_was_not_answered_counts_as_its_acceptance(wire: Wire) -> None:
    """The answer was lost, yet the robot drives: a pause stops it."""
    wire.base.plan.append(leave_open)
    mission = wire.start("1")
    wire.until(lambda: wire.drives, "the goal")
    silent = wire.drives[0]
    silent.accept(times=0)
    silent.feed_back(3.0)
    assert wire.operator.ask("pause").success
    wire.until(lambda: silent.cancels, "the cancel on the wire")
    assert wire.operator.ask("resume").success
    wire.until_done(mission)
    assert wire.outcomes(mission) == [("1", OK)]


def test_a_cancel_that_is_not_answered_is_sent_again(wire: Wire) -> None:
    """Stories 3 and A3: lost once, heard the second time; meanwhile nothing new is sent."""
    wire.base.plan.append(Drive.accept)
    wire.base.on_cancel = leave_open
    mission = wire.start("1")
    deaf = wire.until_driving()
    assert wire.operator.ask("pause").success
    wire.until(lambda: len(deaf.cancels) == 2, "the second cancel")
    assert wire.operator.ask("resume").success
    wire.base.on_cancel = Drive.stop
    wire.until(lambda: deaf.ended, "the robot stopped")
    wire.until_done(mission)
    assert deaf.ended is not None
    assert wire.drives[1].arrived >= deaf.ended
    assert wire.outcomes(mission) == [("1", OK)]


def test_a_cancel_that_is_never_answered_does_not_hold_up_the_mission(wire: Wire) -> None:
    """After its deadline the robot's next goal is sent, which preempts the old one."""
    wire.base.plan.append(Drive.accept)
    wire.base.on_cancel = leave_open
    mission = wire.start("1", "2")
    deaf = wire.until_driving()
    asked = time.monotonic()
    assert wire.operator.ask("skip_current").success
    wire.until_done(mission)
    assert wire.outcomes(mission)[1] == ("2", OK)
    assert wire.drives[1].arrived - asked >= CANCEL_DEADLINE
    wire.until(lambda: len(deaf.cancels) >= 4, "asking on, as long as it drives")


def test_a_cancel_that_is_answered_twice_stops_once(wire: Wire) -> None:
    """The second answer is about nothing."""

    def stop_twice(drive: Drive) -> None:
        drive.stop()
        drive.stop()

    wire.base.plan.append(Drive.accept)
    wire.base.on_cancel = stop_twice
    mission = wire.start("1")
    wire.until_driving()
    assert wire.operator.ask("pause").success
    wire.until(lambda: wire.drives[0].ended, "the robot stopped")
    assert wire.operator.ask("resume").success
    wire.until_done(mission)
    assert wire.outcomes(mission) == [("1", OK)]


def test_a_goal_that_is_accepted_twice_is_driven_once(wire: Wire) -> None:
    """A server that repeats itself."""
    wire.base.plan.append(lambda drive: drive.accept(times=2))
    mission = wire.start("1")
    wire.until_driving().arrive()
    wire.until_done(mission)
    assert wire.outcomes(mission) == [("1", OK)]
    assert len(wire.drives) == 2


def test_a_result_that_comes_twice_counts_once(wire: Wire) -> None:
    """The second one must not end the drive to the next tag."""

    wire.base.plan.extend([Drive.accept, Drive.accept])
    mission = wire.start("1", "2")
    first = wire.until_driving()
    wire.until(lambda: first.asked, "the request for the result")
    first.arrive(times=2)
    second = wire.until_driving(2)
    first.asked[0].answer(first.result())  # and once more, while the next one drives
    second.feed_back(2.0)
    assert wire.operator.ask("pause").success
    wire.until(lambda: second.ended, "the second drive cancelled: it was under way")
    assert wire.operator.state.current_target == "2"
    assert wire.operator.ask("resume").success
    wire.until_done(mission)
    assert wire.outcomes(mission) == [("1", OK), ("2", OK)]


def test_a_result_that_comes_after_the_pause_is_not_acted_on_before_the_resume(wire: Wire) -> None:
    """Story A42: the robot arrived in the moment of the pause. Nothing is read while it is held."""
    wire.base.plan.append(Drive.accept)
    wire.base.on_cancel = Drive.arrive
    mission = wire.start("1")
    wire.until_driving()
    assert wire.operator.ask("pause").success
    wire.until(lambda: wire.drives[0].ended, "arrived all the same")
    wire.until_held()
    assert (wire.bridge.calls, wire.outcomes(mission)) == ([], [])
    assert wire.operator.ask("resume").success
    wire.until_done(mission)
    assert wire.outcomes(mission) == [("1", OK)]


def test_a_drive_home_whose_cancel_is_lost_does_not_outlive_the_mission(wire: Wire) -> None:
    """Story A34: the mission is over, its goal must be cancelled until that is heard."""
    wire.base.plan.extend([Drive.accept, Drive.accept])
    mission = wire.start("1")
    wire.until_driving().arrive()
    home = wire.until_driving(2)
    wire.base.on_cancel = leave_open
    assert wire.operator.ask("abort").success
    wire.until_done(mission)
    wire.until(lambda: home.cancels, "the cancel")
    wire.base.on_cancel = Drive.stop
    wire.until(lambda: home.ended, "the robot stopped")
    assert len(wire.drives) == 2
