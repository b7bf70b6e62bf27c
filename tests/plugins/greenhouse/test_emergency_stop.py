"""What nodes take for an emergency stop."""

from __future__ import annotations

import pytest

pytest.importorskip("rclpy", reason="ROS 2 is not installed here")

from std_msgs.msg import Bool

from lupin_greenhouse.node.estop import StopListener
from lupin_greenhouse.stops import HMI, HMI_TOPIC, PAGES, PAGES_TOPIC, ROBOT, StopState
from tests.plugins.fakes import FakeRos

ENGAGED, RELEASED, SILENT = StopState((ROBOT,)), StopState(), StopState((ROBOT,), (ROBOT,))


class Button:
    """An emergency stop at `/stop` that a node listens to."""

    def __init__(self, timeout: float = 2.0, topic: str = "/stop") -> None:
        self.ros = FakeRos()
        self.heard: list[StopState] = []
        self.stop = StopListener(self.ros, topic, timeout, self.heard.append)  # type: ignore[arg-type]

    def tell(self, engaged: bool, topic: str = "/stop") -> None:
        self.ros.subscriptions[topic](Bool(data=engaged))

    def tell_steadily(self, every: float = 0.5, seconds: float = 4.0) -> None:
        """Tell that it is released, and come to the moment at which it is told once more."""
        for _ in range(round(seconds / every)):
            self.tell(False)
            self.be_silent(every)

    def be_silent(self, seconds: float) -> None:
        for _ in range(round(seconds / 0.25)):
            self.ros.pass_time(0.25)


def test_it_is_what_was_said_last_and_is_told_on_change_and_at_first() -> None:
    button = Button()
    for engaged in (False, False, True, True, False):
        button.tell(engaged)
    assert button.heard == [RELEASED, ENGAGED, RELEASED]


def test_one_that_was_told_steadily_and_falls_silent_is_engaged() -> None:
    """Its bridge has died: who presses the button now is not heard. That is told once."""
    button = Button()
    button.tell_steadily()
    button.be_silent(1.5)
    assert button.heard == [RELEASED]
    button.be_silent(0.25)
    assert button.heard == [RELEASED, SILENT]
    assert button.stop.reason == "the emergency stop is silent (/stop)"
    button.be_silent(10.0)
    assert button.heard == [RELEASED, SILENT]
    assert not any(timer.running for timer in button.ros.timers)


def test_it_is_what_it_says_when_it_is_heard_again() -> None:
    button = Button()
    button.tell_steadily()
    button.be_silent(2.0)
    button.tell_steadily()
    assert button.heard[-1] == RELEASED
    button.be_silent(2.0)
    assert button.heard.count(SILENT) == 2


@pytest.mark.parametrize(("every", "seconds"), [(0.5, 3.5), (1.0, 100.0), (5.0, 100.0)])
def test_one_that_speaks_only_now_and_then_is_taken_at_its_word(every: float, seconds: float) -> None:
    button = Button()
    button.tell_steadily(every, seconds)
    button.be_silent(100.0)
    assert button.heard == [RELEASED]
    assert not any(timer.running for timer in button.ros.timers)


def test_a_timeout_of_zero_is_none() -> None:
    button = Button(timeout=0.0)
    button.tell_steadily()
    button.be_silent(100.0)
    assert button.heard == [RELEASED]
    assert button.ros.timers == []


def test_who_has_closed_hears_of_nothing() -> None:
    button = Button()
    button.tell_steadily()
    button.stop.close()
    button.be_silent(10.0)
    button.tell(True)
    assert button.heard == [RELEASED]


def test_each_source_holds_the_robot_by_itself() -> None:
    button = Button()
    button.tell(True, PAGES_TOPIC)
    button.tell(True, HMI_TOPIC)
    button.tell(False)
    assert button.stop.engaged
    assert button.stop.sources == (PAGES, HMI)
    assert button.stop.reason == "the emergency stop is engaged (/lupin/gateway/stop, /lupin/hmi/estop)"
    button.tell(False, PAGES_TOPIC)
    assert button.stop.sources == (HMI,)


def test_of_several_writers_only_silence_releases_the_stop_of_other_hmis() -> None:
    button = Button()
    button.ros.node.publishers = 2
    button.tell(True, HMI_TOPIC)
    for _ in range(7):
        button.tell(False, HMI_TOPIC)
        button.be_silent(0.25)
    assert button.stop.sources == (HMI,)
    button.be_silent(0.5)
    assert not button.stop.engaged
    assert not any(timer.running for timer in button.ros.timers)


def test_a_node_that_was_busy_hears_what_has_waited_before_it_takes_silence_for_a_release() -> None:
    """A look after a standstill counts as one, however long that was."""
    button = Button()
    button.tell(True, HMI_TOPIC)
    button.ros.time += 100.0
    button.ros.pass_time(0.25)
    button.tell(True, HMI_TOPIC)
    assert button.heard == [StopState((HMI,))]


def test_who_publishes_the_robots_own_stop_does_not_hear_it() -> None:
    button = Button(topic="")
    assert set(button.ros.subscriptions) == {PAGES_TOPIC, HMI_TOPIC}
