"""The stop of one source is never released by another's false: a gateway, another HMI, a robot."""

from __future__ import annotations

import json
import math
import socket
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from std_msgs.msg import Bool
from tf2_msgs.msg import TFMessage

from lupin_gateway.guard import RESET_STOP, STOPS_TOPIC
from lupin_gateway.node.rules import TAKEN_OVER_S
from lupin_greenhouse.stops import PAGES_TOPIC
from lupin_ros.adapter.node import Qos
from tests.lupin_ros.plugins.gateway.conftest import free_port
from tests.lupin_ros.world import Operator, World
from tests.plugins.gateway.served import OpenPage, until

pytestmark = pytest.mark.timeout(240)

#: A tag that is far from the start, and the robot's speed in m/s.
FAR_TAG, SPEED = "29", 0.5
#: Seconds for which two sources are told at the same time, between two messages of an HMI, and until a robot
#: that was told to stop stands and is seen to.
BOTH_S, HMI_S, STANDS_S = 6.0, 0.5, 0.5
#: Seconds until a stop of several writers is over, and what a busy machine adds.
QUIET_S, BUSY_S = 2.0, 2.0


class Hall(Operator):
    """An operator who sees where the robot is, with a gateway and another HMI that has its own connection."""

    def __init__(self, world: World) -> None:
        super().__init__()
        self.world = world
        self.place = (0.0, 0.0)
        self.port = free_port()
        self.hmi: bool | None = None
        self.ros.subscribe(TFMessage, "/tf", Qos.TRANSFORMS, self._on_transforms)
        self._hmi = self.ros.publisher(Bool, "/lupin/hmi/estop", Qos.EVENT)
        self.ros.steady_timer(HMI_S, self._tell)

    def say(self, stopped: bool) -> None:
        """Let the other HMI say once whether it is stopped."""
        self._hmi.publish(Bool(data=stopped))

    def _tell(self) -> None:
        if self.hmi is not None:
            self.say(self.hmi)

    def _on_transforms(self, message: TFMessage) -> None:
        for found in message.transforms:
            if found.child_frame_id == "base_link":
                self.place = found.transform.translation.x, found.transform.translation.y

    def open_gateway(self, **parameters: object) -> OpenPage:
        """Start a gateway, and return a page on it."""
        self.world.start("lupin_gateway", port=self.port, **parameters)
        self.until(self._is_open, "the gateway")
        return OpenPage(self.port)

    def kill_gateway(self) -> None:
        """As a crash does."""
        self.world.processes["lupin_gateway"].kill()
        self.world.processes["lupin_gateway"].wait(10.0)

    def _is_open(self) -> bool:
        try:
            socket.create_connection(("127.0.0.1", self.port), 1.0).close()
        except OSError:
            return False
        return True

    def drive(self) -> None:
        """Start everything and a mission, and let the robot drive."""
        self.world.start_all(speed=2.0 * SPEED)
        self.in_state("READY")
        assert self.start(FAR_TAG).accepted
        start = self.place
        self.until(lambda: math.dist(self.place, start) > 0.5, "the first half metre")

    def engaged(self, expected: bool = True, within: float = 60.0) -> None:
        """Wait until the state says that the stop is engaged, or not."""
        self.until(lambda: self.state.estop_engaged is expected, f"engaged: {expected}", within)

    def stays_stopped(self, seconds: float) -> None:
        """See that the stop does not flap, that nobody can resume, and that the robot stands."""
        self.wait(STANDS_S)
        self.states.clear()
        place, end = self.place, time.monotonic() + seconds
        while time.monotonic() < end:
            assert not self.ask("resume").success
            self.wait(0.2)
        assert {state.estop_engaged for state in self.states} == {True}
        assert math.dist(self.place, place) == 0.0

    def wait(self, seconds: float) -> None:
        end = time.monotonic() + seconds
        self.until(lambda: time.monotonic() >= end, "the time")


@pytest.fixture
def hall(world: World) -> Iterator[Hall]:
    found = Hall(world)
    yield found
    found.ros.close()


@pytest.mark.core
@pytest.mark.parametrize("shared_false", [True, False])
def test_the_stop_of_another_hmi_is_not_released_by_the_gateway(hall: Hall, shared_false: bool) -> None:
    """It says true twice a second while the gateway says false, and ends 2 s after it says so no more."""
    page = hall.open_gateway(shared_false=shared_false)
    hall.drive()
    hall.hmi = True
    hall.engaged(within=HMI_S + BUSY_S)
    hall.stays_stopped(BOTH_S)
    hall.hmi, told = None, time.monotonic()
    hall.engaged(False, within=QUIET_S + BUSY_S)
    assert time.monotonic() - told > QUIET_S - HMI_S
    assert hall.ask("resume").success
    page.close()


def test_the_stop_of_a_page_outlives_what_others_say_and_its_gateway(hall: Hall, own_state: Path) -> None:
    page = hall.open_gateway()
    hall.drive()
    page.stop(True)
    hall.hmi = False
    hall.engaged(within=BUSY_S)
    hall.stays_stopped(BOTH_S)

    # Killed, and started again: it knows what it had, and says so before anything else.
    hall.kill_gateway()
    hall.stays_stopped(BOTH_S)
    page = hall.open_gateway()
    hall.stays_stopped(BOTH_S)

    # Killed and started again without what it had: its false is not that of the one that said true.
    hall.kill_gateway()
    for kept in own_state.parents[2].rglob("stops.json"):
        kept.unlink()
    page = hall.open_gateway()
    hall.stays_stopped(BOTH_S)

    # Somebody who says it anew, and takes it back, is heard.
    page.stop(True)
    hall.wait(1.0)
    page.stop(False)
    hall.engaged(False, within=QUIET_S + BUSY_S)
    assert hall.ask("resume").success
    page.close()


@pytest.mark.core
def test_a_stop_that_a_gateway_has_taken_over_can_be_reset_at_once(hall: Hall, own_state: Path) -> None:
    """It is told for some seconds nevertheless: who has not heard it of this gateway would keep it."""
    page = hall.open_gateway()
    hall.drive()
    page.stop(True)
    hall.engaged(within=BUSY_S)
    # The robot is stopped before the disk has it; without it there would be nothing to take over.
    (kept,) = own_state.parents[2].rglob("stops.json")
    hall.until(lambda: json.loads(kept.read_text())["stops"], "a stop on the disk")
    hall.kill_gateway()
    told: list[tuple[float, bool]] = []
    hall.ros.subscribe(
        Bool, PAGES_TOPIC, Qos.EVENT, lambda message: told.append((time.monotonic(), message.data))
    )
    begun = time.monotonic()
    page = hall.open_gateway()
    page.send({"op": "subscribe", "topic": STOPS_TOPIC})
    shown = until(lambda: [each["msg"]["data"] for each in page.frames if each["op"] == "publish"], "stops")
    (stop,) = json.loads(shown[0])["stops"]
    assert page.call(RESET_STOP, name=stop["name"])["values"]["success"]
    hall.engaged(False, within=TAKEN_OVER_S + BUSY_S)
    assert told[0][1]
    assert next(moment for moment, stopped in told if not stopped) > begun + TAKEN_OVER_S
    page.close()


def test_a_gateway_that_dies_while_no_page_stops_is_no_stop(hall: Hall) -> None:
    page = hall.open_gateway()
    hall.drive()
    page.work_off()
    hall.kill_gateway()
    hall.states.clear()
    place = hall.place
    hall.wait(BOTH_S)
    assert {state.estop_engaged for state in hall.states} == {False}
    assert math.dist(hall.place, place) > 1.0


def test_an_hmi_that_is_alone_releases_its_stop_at_once(hall: Hall) -> None:
    hall.drive()
    hall.say(True)
    hall.engaged()
    assert not hall.ask("resume").success
    hall.say(False)
    hall.engaged(False, within=0.9 * QUIET_S)
    assert hall.ask("resume").success
