"""The watering of the examples with its valve as a process: no tag twice, whoever dies meanwhile."""

from __future__ import annotations

import re
import signal
import sys
from pathlib import Path

import pytest

from tests.lupin_ros.world import Operator, World

pytestmark = pytest.mark.timeout(180)

WATERING = Path(__file__).parents[4] / "examples" / "watering"


class Garden:
    """A robot with the valve, and what the valve's log says of it."""

    def __init__(self, world: World, operator: Operator, ledger: Path) -> None:
        self.world = world
        self.operator = operator
        self.ledger = ledger

    def valve(self, *program: str, **given: float) -> None:
        """Start the valve, or another program for it, with the ledger that it had before."""
        settings = {"ledger": self.ledger, "flow": 6.0, **given}
        told = [part for name, value in settings.items() for part in ("-p", f"{name}:={value}")]
        script = program or (str(WATERING / "valve.py"),)
        self.world.run("valve", [sys.executable, *script, "--ros-args", *told])

    def kill(self, node: str) -> None:
        """End a process as `kill -9` does."""
        self.world.processes[node].kill()
        self.world.processes[node].wait(10.0)

    def doses(self) -> list[str]:
        """The tags for which the valve was opened."""
        return re.findall(r"open for tag (\w+)", self.world.log("valve").read_text())

    def shut(self) -> list[float]:
        """How much had flowed whenever it was shut."""
        log = self.world.log("valve").read_text()
        return [float(litres) for litres in re.findall(r"shut after ([\d.]+)", log)]

    def start(self, *tags: str) -> None:
        """Start the mission when the robot is ready."""
        self.operator.in_state("READY")
        answer = self.operator.start(*tags, mission="WateringMission")
        assert answer.accepted, answer.error_message

    def go_on(self, **parameters: float) -> None:
        """Start the next orchestrator, which is held, and resume."""
        self.operator.states.clear()
        missions = WATERING / "missions"
        self.world.start("mission_orchestrator", estop_timeout_s=10.0, missions_path=missions, **parameters)
        self.operator.held()
        self.operator.resume()

    def begun(self) -> None:
        """Wait until the first dose flows."""
        self.operator.until(self.doses, "water")

    def told(self) -> list[tuple[str, int, str]]:
        """What became of each tag."""
        return [(o.tag_reading.tag_id, o.status, o.status_detail) for o in self.operator.observations]


@pytest.fixture
def garden(world: World, operator: Operator, tmp_path: Path) -> Garden:
    """Everything runs."""
    garden = Garden(world, operator, tmp_path / "valve.json")
    garden.valve()
    world.start_all(missions_path=WATERING / "missions", watering_cap=1.0)
    return garden


@pytest.mark.core
def test_a_killed_orchestrator_waters_nothing_twice(garden: Garden) -> None:
    """It dies while water flows: the valve shuts, and the next one goes on with the others, up to the cap."""
    garden.kill("valve")
    garden.valve(flow=9.0)
    garden.start("1", "5", "12")
    garden.begun()
    garden.kill("mission_orchestrator")
    garden.operator.until(garden.shut, "the valve is shut")
    assert 0.25 < garden.shut()[0] < 0.4
    garden.go_on(watering_cap=1.0)
    garden.operator.until_done(published=3)
    assert [(tag, status) for tag, status, _ in garden.told()] == [("1", 2), ("5", 0), ("12", 3)]
    assert garden.doses() == ["1", "5"]
    assert garden.operator.state.last_error == "cap_reached: 0.80 l of 1.00 l"


def test_a_new_orchestrator_shuts_what_a_killed_one_opened(garden: Garden) -> None:
    """The dose is cancelled before anything else is done; what had flowed is all that the tag gets."""
    garden.kill("valve")
    garden.valve(flow=0.6, orchestrator_timeout_s=60.0)  # 40 s for a dose
    garden.start("1")
    garden.begun()
    garden.kill("mission_orchestrator")
    garden.go_on()
    garden.operator.until_done(published=1)
    assert garden.shut()[0] < 0.4
    assert [(tag, status) for tag, status, _ in garden.told()] == [("1", 2)]
    assert garden.doses() == ["1"]


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGSTOP])
def test_the_valve_shuts_when_the_orchestrator_is_not_heard(garden: Garden, how: signal.Signals) -> None:
    """It is killed, or it hangs; nobody else does anything."""
    garden.kill("valve")
    garden.valve(flow=0.6)
    garden.start("1")
    garden.begun()
    process = garden.world.processes["mission_orchestrator"]
    process.send_signal(how)
    garden.operator.until(garden.shut, "the valve is shut")
    assert garden.shut()[0] < 0.1, "10 s"
    process.send_signal(signal.SIGCONT)


#: A valve that hears nobody.
DEAF = """
import sys
sys.path.insert(0, {folder!r})
import valve
valve.Valve.create_subscription = lambda *_, **__: None
valve.main()
"""


def test_a_valve_that_does_not_watch_gets_no_order(garden: Garden) -> None:
    """The robot is not ready, and says for what it waits."""
    garden.operator.in_state("READY")
    garden.operator.set_parameter("mission_orchestrator", "dependency_timeout_s", 10.0)
    garden.kill("valve")
    garden.operator.in_state("BOOT")
    garden.valve("-c", DEAF.format(folder=str(WATERING)))
    missing = "action server /valve/give to listen to /mission/state"
    garden.operator.until(lambda: missing in garden.operator.state.last_error, "what is missing")
    assert garden.operator.state.lifecycle_state == "FAULT"


def test_a_released_hold_waters_nothing_again(garden: Garden) -> None:
    """A pause shuts the valve at once; after it the robot goes on with the next tag."""
    garden.start("1", "5")
    garden.begun()
    assert garden.operator.ask("pause").success
    garden.operator.until(garden.shut, "the valve is shut")
    assert garden.shut()[0] < 0.4
    assert garden.operator.ask("resume").success
    garden.operator.until_done(published=2)
    assert [(tag, status) for tag, status, _ in garden.told()] == [("1", 2), ("5", 0)]
    assert garden.doses() == ["1", "5"]


def test_a_killed_valve_remembers_its_last_dose(garden: Garden) -> None:
    """It is in the ledger before the valve opens; the tag is refused until tomorrow."""
    garden.start("1")
    garden.begun()
    garden.kill("valve")
    garden.operator.until_done(published=1)
    garden.valve()
    again = ("1", "5")
    garden.operator.until(lambda: garden.operator.start(*again, mission="WateringMission").accepted, "start")
    garden.operator.until_done(published=3)
    assert [(tag, status) for tag, status, _ in garden.told()] == [("1", 2), ("1", 3), ("5", 0)]
    assert garden.doses() == ["1", "5"]
