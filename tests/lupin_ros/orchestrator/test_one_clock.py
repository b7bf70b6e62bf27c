"""Every stamp that orchestrator and bridge tell is of one clock: the simulated one where there is one."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

pytest.importorskip("greenhouse_sim", reason="mdp-greenhouse is not installed here")

from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav2_msgs.action import NavigateToPose
from rosgraph_msgs.msg import Clock

from lupin_ros.adapter.node import Qos, ServedGoal
from tests.lupin_ros.helpers import to_time
from tests.lupin_ros.world import Operator, World

pytestmark = pytest.mark.timeout(180)

#: Where simulated time begins, how far each tick moves it, and how long a tick takes; in seconds.
BEGIN, STEP, TICK = 1000.0, 0.02, 0.02
#: Sums of steps and whole nanoseconds differ by less than this, in seconds.
ROUNDING = 1e-6


def seconds(stamp: Time) -> float:
    """Return a stamp as seconds."""
    return float(stamp.sec) + float(stamp.nanosec) * 1e-9


class Outside:
    """What the nodes do not bring along: an operator, a localizer, a base that is there at once, a clock."""

    def __init__(self, simulated: bool) -> None:
        self.operator = Operator()
        self.time, self.ticking = BEGIN, True
        ros = self.operator.ros
        ros.serve_action(
            NavigateToPose, "navigate_to_pose", admit=lambda _: True, started=_arrive, cancelled=_stop
        )
        pose = PoseWithCovarianceStamped()
        pose.header.frame_id = "map"
        ros.publisher(PoseWithCovarianceStamped, "/amcl_pose", Qos.LATCHED).publish(pose)
        if simulated:
            self._clock = ros.publisher(Clock, "/clock", Qos.EVENT)
            ros.steady_timer(TICK, self._tick)

    def _tick(self) -> None:
        if self.ticking:
            self.time += STEP
        self._clock.publish(Clock(clock=to_time(self.time)))

    def inspect(self, tag: str) -> None:
        """Let a mission of one tag run to its end."""
        operator = self.operator
        operator.in_state("READY")
        answer = operator.start(tag)
        assert answer.accepted, answer.error_message
        operator.in_state("DONE")
        operator.until(lambda: operator.observations, "the observation")

    def stamps(self) -> Iterator[tuple[str, float]]:
        """Yield every stamp that was told since the clock was known, with what it is of."""
        for state in self.operator.states:
            yield f"{state.lifecycle_state} told", seconds(state.header.stamp)
            if state.mission_id:
                yield f"{state.lifecycle_state} started", seconds(state.started_at)
        for observation in self.operator.observations:
            yield "observation", seconds(observation.header.stamp)
            yield "reading", seconds(observation.tag_reading.stamp)


def _arrive(goal: ServedGoal) -> None:
    goal.succeed(NavigateToPose.Result())


def _stop(goal: ServedGoal) -> None:
    goal.cancel(NavigateToPose.Result())


@pytest.fixture
def outside(ros_domain: int, request: pytest.FixtureRequest) -> Iterator[Outside]:
    """What is around the nodes; with a simulated clock, where a test asks for it."""
    outside = Outside(request.param)
    yield outside
    outside.operator.ros.close()


def start_both(world: World, simulated: bool) -> None:
    """Start the nodes whose stamps are looked at."""
    world.start("greenhouse_bridge", use_sim_time=simulated)
    world.start("mission_orchestrator", use_sim_time=simulated)


@pytest.mark.parametrize("outside", [True], ids=["simulated"], indirect=True)
def test_stamps_are_of_simulated_time_with_use_sim_time(world: World, outside: Outside) -> None:
    """States, the mission's start, observations and the bridge's readings: none is of the wall clock."""
    start_both(world, simulated=True)
    outside.operator.in_state("READY")
    outside.operator.states.clear()  # a node that has not heard of the clock yet tells 0
    outside.inspect("1")
    assert len(outside.operator.observations) == 1
    assert [told for told in outside.stamps() if not BEGIN <= told[1] <= outside.time + ROUNDING] == []


@pytest.mark.parametrize("outside", [False], ids=["real"], indirect=True)
def test_stamps_of_all_nodes_are_comparable_without_it(world: World, outside: Outside) -> None:
    """No age is half a million hours: what is told of one mission lies within that mission."""
    began = outside.operator.ros.now()
    start_both(world, simulated=False)
    outside.inspect("1")
    ended = outside.operator.ros.now()
    assert len(outside.operator.observations) == 1
    assert [told for told in outside.stamps() if not began - ROUNDING <= told[1] <= ended + ROUNDING] == []


@pytest.mark.parametrize("outside", [True], ids=["simulated"], indirect=True)
def test_deadlines_wait_while_simulated_time_stands_still(world: World, outside: Outside) -> None:
    """The mission's timers are of the clock of its stamps; the state is told all the same."""
    operator = outside.operator
    world.start("greenhouse_bridge", use_sim_time=True)
    world.start("mission_orchestrator", use_sim_time=True, flower_scan_dwell_s=5.0)
    operator.in_state("READY")
    assert operator.start("1").accepted
    operator.until(lambda: operator.observations, "the reading")
    outside.ticking = False
    stood = outside.time
    operator.until(
        lambda: seconds(operator.state.header.stamp) == pytest.approx(stood), "time to stand still"
    )
    seen = len(operator.states)
    operator.until(lambda: len(operator.states) > seen + 10, "two seconds of real time")
    assert (operator.state.lifecycle_state, operator.state.mission_phase) == ("INSPECTING", "SCANNING")
    outside.ticking = True
    operator.in_state("DONE")
    assert outside.time >= stood + 1.0
