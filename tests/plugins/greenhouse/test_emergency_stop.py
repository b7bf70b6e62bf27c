"""What nodes take for an emergency stop."""

from __future__ import annotations

import pytest

pytest.importorskip("rclpy", reason="ROS 2 is not installed here")

from std_msgs.msg import Bool

from lupin_greenhouse.node.estop import ENGAGED, RELEASED, SILENT, EmergencyStop
from tests.plugins.fakes import FakeRos


class Button:
    """An emergency stop at `/stop` that a node listens to."""

    def __init__(self, timeout: float = 2.0) -> None:
        self.ros = FakeRos()
        self.heard: list[str] = []
        self.stop = EmergencyStop(self.ros, "/stop", timeout, self.heard.append)  # type: ignore[arg-type]

    def tell(self, engaged: bool) -> None:
        self.ros.subscriptions["/stop"](Bool(data=engaged))

    def tell_steadily(self, every: float = 0.5, seconds: float = 4.0) -> None:
        """Tell that it is released, and come to the moment at which it is told once more."""
        for _ in range(round(seconds / every)):
            self.tell(False)
            self.be_silent(every)

    def be_silent(self, seconds: float) -> None:
        for _ in range(round(seconds / 0.5)):
            self.ros.pass_time(0.5)


def test_it_is_what_was_said_last() -> None:
    button = Button()
    button.tell(False)
    button.tell(True)
    button.tell(False)
    assert button.heard == [RELEASED, ENGAGED, RELEASED]


def test_one_that_was_told_steadily_and_falls_silent_is_engaged() -> None:
    """Its bridge has died: who presses the button now is not heard. That is told once."""
    button = Button()
    button.tell_steadily()
    button.be_silent(1.5)
    assert set(button.heard) == {RELEASED}
    button.be_silent(0.5)
    assert button.heard[-2:] == [RELEASED, SILENT]
    button.be_silent(10.0)
    assert button.heard.count(SILENT) == 1


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
    assert set(button.heard) == {RELEASED}
    assert not any(timer.running for timer in button.ros.timers)


def test_a_timeout_of_zero_is_none() -> None:
    button = Button(timeout=0.0)
    button.tell_steadily()
    button.be_silent(100.0)
    assert set(button.heard) == {RELEASED}
    assert button.ros.timers == []


def test_who_has_closed_hears_of_no_silence() -> None:
    button = Button()
    button.tell_steadily()
    button.stop.close()
    button.be_silent(10.0)
    assert set(button.heard) == {RELEASED}
