"""Simulated time that misbehaves: it begins late, jumps on, jumps back. Nothing hangs for it."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from rosgraph_msgs.msg import Clock

from lupin_ros.adapter.node import Qos
from tests.lupin_ros.helpers import to_time
from tests.lupin_ros.system.wire.wire import OK, UNREACHABLE, Drive, Wire, leave_open

pytestmark = pytest.mark.timeout(120)

#: Where simulated time begins: as in a simulation that has run for a day. In seconds.
BEGIN = 86_400.0
#: How far each tick moves it, and how long a tick takes; in seconds. Twice as fast as real time.
STEP, TICK = 0.04, 0.02
#: Seconds of simulated time: at a tag after its reading, and for a drive.
DWELL, LIMIT = 1.0, 4.0


class Simulated(Wire):
    """A wire with a clock."""

    def tick_from(self, begin: float) -> None:
        """Let simulated time begin."""
        self.time = begin
        self._clock = self.ros.publisher(Clock, "/clock", Qos.EVENT)
        self.ros.steady_timer(TICK, self._tick)

    def _tick(self) -> None:
        self.time += STEP
        self._clock.publish(Clock(clock=to_time(self.time)))

    def until_read(self, mission: str, tag: str) -> None:
        """Wait until a tag was read: the robot stays at it for a while then."""
        self.until(lambda: (tag, OK) in self.outcomes(mission), f"the reading of {tag}")

    def until_time_is_known(self) -> None:
        """Wait until the node's stamps are of the time that it is now."""
        self.until(
            lambda: abs(self.operator.state.header.stamp.sec - self.time) < 2.0, "the node to know the time"
        )


@pytest.fixture(scope="module")
def running(ros_domain: int, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Simulated]:
    """One node for all tests here: each leaves it with its mission ended."""
    wire = Simulated(
        tmp_path_factory.mktemp("wire"), use_sim_time=True, flower_scan_dwell_s=DWELL, nav_timeout_s=LIMIT
    )
    wire.offer_base()
    wire.offer_bridge()
    wire.tick_from(BEGIN)
    wire.start_node()
    yield wire
    wire.close()


def test_a_clock_that_is_heard_of_late_is_no_dependency_that_is_late(wire: Simulated) -> None:
    """From nothing to a day in one tick: no wait of BOOT has lasted a day."""
    assert "FAULT" not in {state.lifecycle_state for state in wire.operator.states}


@pytest.mark.parametrize("jump", [-80_000.0, 3_600.0], ids=["back", "on"])
def test_a_jump_at_a_tag_does_not_keep_the_robot_there(wire: Simulated, jump: float) -> None:
    """The time at a tag is over when it is over."""
    mission = wire.start("1", "2")
    wire.until_read(mission, "1")
    wire.time += jump
    wire.until_done(mission)
    assert wire.outcomes(mission) == [("1", OK), ("2", OK)]


def test_a_jump_back_does_not_take_the_deadline_from_a_drive(wire: Simulated) -> None:
    """A goal that nobody answers is given up, and the second one as well."""
    wire.base.plan.extend([leave_open, leave_open])
    mission = wire.start("1")
    wire.until(lambda: wire.drives, "the goal")
    wire.time -= 1_000.0
    wire.until(lambda: len(wire.drives) == 2, "the second try")
    wire.time -= 1_000.0
    wire.until_done(mission)
    assert wire.outcomes(mission) == [("1", UNREACHABLE)]
    assert wire.details(mission) == ["nav_timeout"]


def test_a_jump_on_costs_a_drive_one_try(wire: Simulated) -> None:
    """By its clock the drive took an hour: it is cancelled, and tried again."""
    wire.base.plan.append(Drive.accept)
    mission = wire.start("1")
    drive = wire.until_driving()
    wire.time += 3_600.0
    wire.until(lambda: drive.cancels, "the cancel on the wire")
    wire.until_done(mission)
    assert wire.outcomes(mission) == [("1", OK)]


def test_jumps_while_paused_change_nothing(wire: Simulated) -> None:
    """Time that passes under a hold is nobody's."""
    wire.base.plan.append(Drive.accept)
    mission = wire.start("1")
    wire.until_driving()
    assert wire.operator.ask("pause").success
    wire.until_held()
    for jump in (3_600.0, -7_200.0, 50.0):
        wire.time += jump
        wire.until_time_is_known()
    assert wire.operator.ask("resume").success
    wire.until_done(mission)
    assert wire.outcomes(mission) == [("1", OK)]
    assert len(wire.drives) == 3


def test_a_clock_that_staggers_ends_the_mission_all_the_same(wire: Simulated) -> None:
    """Back and on all the time, as with two publishers of /clock."""
    mission = wire.start("1", "2")
    for tag in ("1", "2"):
        wire.until_read(mission, tag)
        wire.time -= 500.0
        wire.until_time_is_known()
        wire.time += 500.0
    wire.until_done(mission)
    assert wire.outcomes(mission) == [("1", OK), ("2", OK)]
