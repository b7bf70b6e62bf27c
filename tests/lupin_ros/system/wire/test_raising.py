"""Whatever raises while a step is carried out: the robot stops, the answer is true, the node goes on."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from std_srvs.srv import Trigger

from tests.lupin_ros.system.wire import raising
from tests.lupin_ros.system.wire.wire import AT_ONCE, OK, UNREACHABLE, Drive, Wire

pytestmark = pytest.mark.timeout(300)


#: Seconds within which a journal that raised is written again.
WRITES_AGAIN = 30.0


class Raising(Wire):
    """The wire of an orchestrator in which callbacks raise."""

    def start_process(self) -> None:
        """Start the process instead of the node's own."""
        self.switch = self.world.log("mission_orchestrator").with_name("raises")
        self.world.run("mission_orchestrator", [sys.executable, str(Path(raising.__file__))])

    def raise_in(self, name: str) -> None:
        """Have a callback raise from here on; '' for none."""
        self.switch.write_text(name)


@pytest.fixture(scope="module")
def wire(ros_domain: int, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Raising]:
    """One node, with a base that drives until it is told to stop."""
    folder = tmp_path_factory.mktemp("raising")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("RAISES", str(folder / "raises"))
        patch.setenv("PYTHONPATH", str(Path(__file__).parents[4]))
        wire = Raising(folder)
        wire.offer_base()
        wire.offer_bridge()
        wire.start_process()
        wire.operator.in_state("READY")
        yield wire
        wire.raise_in("")
        wire.close()


def test_a_drive_that_cannot_be_sent_is_over_at_once(wire: Raising) -> None:
    """War story A22: it counted as under way until its deadline of 60 s."""
    wire.begin()
    wire.raise_in("NavClient._go_to")
    begun = time.monotonic()
    mission = wire.start("1", "2")
    wire.until(lambda: wire.outcomes(mission), "the first tag is given up")
    assert time.monotonic() - begun < 10.0, "two tries, a second apart"
    assert wire.drives == []
    wire.raise_in("")
    wire.until_done(mission)
    assert wire.outcomes(mission) == [("1", UNREACHABLE), ("2", OK)]
    assert wire.details(mission)[0] == "driver_error: RuntimeError: NavClient._go_to raises"


@pytest.mark.long
@pytest.mark.parametrize("stop", ["pause", "estop"])
def test_whatever_raises_a_stop_stops(wire: Raising, stop: str) -> None:
    """Each callback in turn, at the moment at which the robot is to be stopped."""
    names = wire.switch.with_suffix(".names").read_text().splitlines()
    assert {
        "RecordPublisher.publish_step",
        "JournalGate.after_step",
        "Journal.handled",
        "RosNode.call_later",
    } <= set(names)
    wire.begin()
    pause = wire.ros.service(Trigger, "/mission/pause")
    wire.until(pause.ready, "pause")
    wire.base.plan.extend([Drive.accept] * (2 * len(names)))
    wire.start("1")
    failed = []
    for name in names:
        drive = wire.until_driving(len(wire.drives) or 1)
        wire.raise_in(name)
        answers: list[Any] = [Trigger.Response(success=True)] if stop == "estop" else []
        end = time.monotonic() + AT_ONCE
        if stop == "estop":
            wire.estop(True)
        else:
            pause.call(Trigger.Request(), AT_ONCE, answers.append)
        while not (drive.cancels and answers) and time.monotonic() < end:
            wire.ros.spin_once(0.01)
        wire.raise_in("")
        if not drive.cancels or not answers or not getattr(answers[0], "success", False):
            failed.append(f"{name}: {len(drive.cancels)} cancels, answers: {answers}")
        if not drive.cancels:
            wire.estop(True)
            wire.until(lambda drive=drive: drive.cancels, f"a stop after {name}")
        drives = len(wire.drives)
        wire.estop(False)
        wire.until(
            lambda: wire.operator.state.paused and not wire.operator.state.estop_engaged, f"held: {name}"
        )
        end = time.monotonic() + WRITES_AGAIN
        while not (answer := wire.operator.ask("resume")).success:
            # A journal that raised is begun anew; until then nothing moves. Its failure alone may have
            # stopped the robot, with the levels of the e-stop still on their way; a silent one is a stop.
            waits = ("the journal cannot be written", "e-stop engaged")
            assert any(word in answer.message for word in waits), f"{name}: {answer.message}"
            assert time.monotonic() < end, f"{name}: {answer.message}"
            wire.estop(False)
            wire.ros.spin_once(0.2)
        wire.until_driving(drives + 1)
    assert "\n".join(failed) == ""
    assert wire.operator.ask("abort").success
