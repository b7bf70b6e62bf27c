"""Two topics of one battery: the worse one counts, and one that falls silent is reported."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from sensor_msgs.msg import BatteryState

from lupin_ros.adapter.node import Qos
from tests.lupin_ros.world import Operator, World

pytestmark = pytest.mark.timeout(240)

#: A tag that is far from the start, and the other topic of the battery.
FAR_TAG, OTHER = "29", "/battery"


class Robot(Operator):
    """An operator, and a second battery that is told twice a second while it has a charge."""

    def __init__(self) -> None:
        super().__init__()
        self.charge: float | None = None
        self._battery = self.ros.publisher(BatteryState, OTHER, Qos.EVENT)
        self.ros.steady_timer(0.5, self._tell)

    def _tell(self) -> None:
        if self.charge is not None:
            self._battery.publish(BatteryState(percentage=self.charge))


@pytest.fixture
def robot(world: World) -> Iterator[Robot]:
    found = Robot()
    yield found
    found.ros.close()


@pytest.mark.core
def test_the_worse_of_two_batteries_counts(world: World, robot: Robot) -> None:
    """The simulated robot says 100 % on /io/power/power_watcher."""
    world.start_all(speed=1.0, battery_timeout_s=3.0)
    robot.in_state("READY")
    assert robot.start(FAR_TAG).accepted
    robot.in_state("INSPECTING")
    robot.charge = 0.1
    robot.until(lambda: robot.state.battery_low, "a low battery")
    robot.states.clear()
    robot.until(lambda: len(robot.states) > 25, "five seconds")
    assert {(state.battery_low, round(state.battery_percentage, 2)) for state in robot.states} == {
        (True, 0.1)
    }
    assert robot.state.last_error == f"battery_low: {OTHER}"

    robot.charge = None
    robot.until(lambda: robot.state.last_error == f"battery_unknown: {OTHER}", "its silence")
    robot.until(lambda: robot.state.battery_percentage == 1.0, "the other one")
    assert not robot.state.battery_low


@pytest.mark.parametrize("docks", [False, True])
def test_a_battery_that_falls_silent_sends_the_robot_home_where_that_is_asked_for(
    world: World, robot: Robot, docks: bool
) -> None:
    world.start_all(speed=1.0, battery_timeout_s=3.0, silent_battery_is_empty=docks)
    robot.charge = 0.9
    robot.in_state("READY")
    assert robot.start(FAR_TAG).accepted
    robot.until(lambda: abs(robot.state.battery_percentage - 0.9) < 0.01, "the charge")
    robot.charge = None
    robot.until(lambda: robot.state.last_error == f"battery_unknown: {OTHER}", "its silence")
    if docks:
        robot.in_state("RETURNING")
    else:
        assert robot.state.lifecycle_state == "INSPECTING"
