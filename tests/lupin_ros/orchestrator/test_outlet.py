"""Live values in the loop's time: two clocks are read for that, and the process may wait between."""

from __future__ import annotations

from lupin_engine.machine.event import Event
from lupin_ros.orchestrator.outlet import NodeClock, RosOutlet


class Clocks:
    """The two clocks of a node; while the second one is read, `waits` seconds go by."""

    def __init__(self) -> None:
        self.at, self.waits = 0.0, 0.0

    def elapsed(self) -> float:
        """Return seconds of the steady clock."""
        return self.at

    def now(self) -> float:
        """Return seconds of the wall clock."""
        self.at += self.waits
        return 1000.0 + self.at


class Queue:
    """The part of the loop that an outlet knows."""

    def __init__(self) -> None:
        self.stamps: list[float] = []

    def post(self, event: Event) -> None:
        """Keep when something was so."""
        self.stamps.append(event.data["stamp"])

    def work(self) -> None:
        """Leave it there."""


def test_a_stop_right_after_a_release_is_not_older_than_that() -> None:
    """What is older than the last report is dropped; of a stop it would be the stop that is dropped."""
    clocks, queue = Clocks(), Queue()
    outlet = RosOutlet(queue, NodeClock(clocks))  # type: ignore[arg-type]
    outlet.value("robot.estop", False, clocks.now())
    clocks.at, clocks.waits = 0.001, 0.010  # a busy machine lets the process wait
    outlet.value("robot.estop", True, 1000.001)
    assert queue.stamps == sorted(queue.stamps)


def test_what_was_measured_before_the_last_report_stays_before_it() -> None:
    clocks, queue = Clocks(), Queue()
    clocks.at = 5.0
    outlet = RosOutlet(queue, NodeClock(clocks))  # type: ignore[arg-type]
    for stamp in (1004.0, 1003.0, 1004.5):
        outlet.value("robot.estop", True, stamp)
    assert queue.stamps == [4.0, 3.0, 4.5]
