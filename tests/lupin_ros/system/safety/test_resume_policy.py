"""`resume_policy: continue` ends the hold `restarted` and nothing else: real processes, killed with -9.

Every other hold is engaged before, during or after the restart; then nothing moves without a person's resume.
"""

from __future__ import annotations

import math
import socket
import time
from collections.abc import Iterator

import pytest
from tf2_msgs.msg import TFMessage
from websockets.sync.client import connect

from lupin_ros.adapter.node import Qos
from tests.lupin_ros.plugins.gateway.conftest import free_port
from tests.lupin_ros.world import Operator, World

pytestmark = pytest.mark.timeout(240)

NODE = "mission_orchestrator"
FAR_TAG = "29"
#: Seconds for which nothing may move after the policy has done what it does; it looks once a second.
WATCHED_S = 3.0
#: What the pose of a standing robot may differ by, in metres.
STILL_M = 0.01


class Watcher(Operator):
    """An operator who sees where the robot is."""

    def __init__(self, world: World) -> None:
        super().__init__()
        self.world = world
        self.place = (0.0, 0.0)
        self.ros.subscribe(TFMessage, "/tf", Qos.TRANSFORMS, self._on_transforms)

    def _on_transforms(self, message: TFMessage) -> None:
        for found in message.transforms:
            if found.child_frame_id == "base_link":
                self.place = found.transform.translation.x, found.transform.translation.y

    def driving(self) -> None:
        """Start a mission and let the robot drive half a metre."""
        self.world.start_all(speed=1.0)
        self.in_state("READY")
        assert self.start(FAR_TAG).accepted
        self.until_moved("the first half metre")

    def until_moved(self, what: str) -> None:
        """Wait until the robot has driven half a metre."""
        begin = self.place
        self.until(lambda: math.dist(self.place, begin) > 0.5, what)

    def wait(self, seconds: float) -> None:
        """Only watch for a while."""
        until = time.monotonic() + seconds
        self.until(lambda: time.monotonic() > until, "the time")

    def until_still(self) -> None:
        """Wait until the robot stands."""
        seen: list[tuple[float, float]] = []

        def is_still() -> bool:
            seen.append(self.place)
            return len(seen) > 20 and len(set(seen[-20:])) == 1

        self.until(is_still, "the robot stands")

    def kill(self) -> None:
        """Kill the orchestrator with -9, and let the base stop by itself."""
        process = self.world.processes[NODE]
        process.kill()
        process.wait(10.0)
        self.states.clear()
        self.until_still()

    def start_again(self) -> None:
        """Start the next one, which resumes by itself."""
        self.world.start(NODE, estop_timeout_s=10.0, resume_policy="continue")

    def until_continued(self) -> None:
        """Wait until the policy has ended its hold."""
        text = "the hold restarted is released (by='resume_policy')"
        self.until(lambda: text in self.world.log(NODE).read_text(), text)

    def assert_stands(self) -> None:
        """Watch for a while: 0 m are driven."""
        begin = self.place
        self.wait(WATCHED_S)
        assert math.dist(self.place, begin) < STILL_M
        assert self.state.paused

    def stop(self, engaged: bool) -> None:
        """Engage or release the emergency stop of the robot."""
        self.set_parameter("lupin_sim", "estop", engaged)


@pytest.fixture
def watcher(world: World) -> Iterator[Watcher]:
    found = Watcher(world)
    yield found
    found.ros.close()


def test_the_restart_alone_needs_no_person(watcher: Watcher) -> None:
    """Twice: the second one replays what the policy did in the first one."""
    watcher.driving()
    for _ in range(2):
        watcher.kill()
        watcher.start_again()
        watcher.until_moved("it goes on by itself")


@pytest.mark.parametrize("when", ["before", "after"])
def test_a_pause_is_the_operators(watcher: Watcher, when: str) -> None:
    watcher.driving()
    if when == "before":
        assert watcher.ask("pause").success
        watcher.until_still()
    watcher.kill()
    watcher.start_again()
    watcher.held()
    if when == "after":
        assert watcher.ask("pause").success
        watcher.until_still()
    watcher.until_continued()
    watcher.assert_stands()
    watcher.resume()
    watcher.until_moved("somebody has resumed")


@pytest.mark.core
@pytest.mark.parametrize("when", ["before", "during", "after"])
def test_a_stop_that_is_let_go_moves_nothing(watcher: Watcher, when: str) -> None:
    watcher.driving()
    if when == "before":
        watcher.stop(True)
        watcher.held()
        watcher.until_still()
    watcher.kill()
    if when == "during":
        watcher.stop(True)
    watcher.start_again()
    watcher.held()
    if when == "after":
        watcher.stop(True)
    watcher.until(lambda: watcher.state.estop_engaged, "the stop is heard")
    watcher.until_continued()
    watcher.assert_stands()
    watcher.stop(False)
    watcher.until(lambda: not watcher.state.estop_engaged, "the stop is let go")
    watcher.assert_stands()
    watcher.resume()
    watcher.until_moved("somebody has resumed")


def test_a_robot_at_its_dock_stays_there(watcher: Watcher) -> None:
    """DOCKED waits for a person: it is published as paused, though no hold of the chart is engaged."""
    watcher.driving()
    watcher.set_parameter("lupin_sim", "battery", 0.1)
    watcher.in_state("RETURNING")
    watcher.held()
    watcher.until_still()
    watcher.set_parameter("lupin_sim", "battery", 0.9)
    watcher.until(lambda: not watcher.state.battery_low, "charged")
    watcher.kill()
    watcher.start_again()
    watcher.held()
    watcher.until_continued()
    watcher.assert_stands()
    assert watcher.state.lifecycle_state == "RETURNING"
    watcher.resume()
    watcher.until_moved("somebody has resumed")


@pytest.mark.parametrize("when", ["before", "during"])
def test_a_pause_by_a_lost_link_stays(watcher: Watcher, when: str) -> None:
    """Also where nobody was there to be asked for it when the link was lost."""
    port = free_port()
    watcher.world.start("lupin_gateway", port=port, on_link_lost="pause")
    watcher.until(lambda: _is_open(port), "the gateway")
    with connect(f"ws://127.0.0.1:{port}/_ros"):
        watcher.driving()
        if when == "during":
            watcher.kill()
    if when == "before":
        watcher.held()
        watcher.until_still()
        watcher.kill()
    else:
        watcher.wait(4.0)  # the gateway finds the link lost after 2 s
    watcher.start_again()
    watcher.held()
    watcher.until_continued()
    watcher.assert_stands()
    watcher.resume()
    watcher.until_moved("somebody has resumed")


def _is_open(port: int) -> bool:
    try:
        socket.create_connection(("127.0.0.1", port), 1.0).close()
    except OSError:
        return False
    return True
