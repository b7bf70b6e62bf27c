"""The warehouse's robot over real ROS 2: the engine's node speaks what the profile says, and nothing else."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from diagnostic_msgs.srv import AddDiagnostics
from std_srvs.srv import Trigger

from lupin_harness.domains import claimed_domain
from lupin_ros.adapter.node import CallFailure, Qos, RosNode
from tests.lupin_ros.helpers import spin_until
from tests.lupin_ros.launch.processes import Lupin
from tests.lupin_ros.system.warehouse.picker import FAR
from tests.lupin_ros.world import World
from tests.warehouse.installed import HERE, MISSIONS, install

pytestmark = pytest.mark.timeout(180)

PATIENCE = 60.0
PICKER = [sys.executable, str(Path(__file__).with_name("picker.py"))]


class Clerk:
    """Somebody who gives orders and watches what becomes of them."""

    def __init__(self) -> None:
        self.ros = RosNode("clerk")
        self.states: list[DiagnosticStatus] = []
        self.outcomes: list[DiagnosticStatus] = []
        self.ros.subscribe(DiagnosticStatus, "/picker/state", Qos.BACKLOG, self.states.append)
        self.ros.subscribe(DiagnosticStatus, "/picker/outcomes", Qos.BACKLOG, self.outcomes.append)

    def order(self, text: str) -> tuple[bool, str]:
        """Give an order: the mission, then the shelves."""
        return self._call(AddDiagnostics, "/picker/order", AddDiagnostics.Request(load_namespace=text))

    def ask(self, name: str) -> tuple[bool, str]:
        """Ask for something that any operator may ask for."""
        return self._call(Trigger, f"/picker/{name}", Trigger.Request())

    def _call(self, kind: Any, name: str, request: Any) -> tuple[bool, str]:
        caller, answers = self.ros.service(kind, name), []
        self.until(caller.ready, name)
        caller.call(request, PATIENCE, answers.append)
        self.until(lambda: answers, f"the answer of {name}")
        assert not isinstance(answers[0], CallFailure), answers[0]
        return answers[0].success, answers[0].message

    def until(self, condition: Callable[[], Any], what: str) -> None:
        """Work until a condition holds."""
        spin_until([self.ros], condition, PATIENCE, f"{what}; last seen: {self.states[-1:]}")

    def in_state(self, doing: str, **also: str) -> None:
        """Wait until the state that was published last is that one."""
        wanted = {"doing": doing, **also}
        self.until(lambda: self.states and wanted.items() <= told(self.states[-1]).items(), str(wanted))

    def seen(self) -> list[str]:
        """Return what the robot did, each change once."""
        names = [" ".join(filter(None, map(told(s).get, ("doing", "phase", "shelf")))) for s in self.states]
        return [name for i, name in enumerate(names) if i == 0 or names[i - 1] != name]


def told(message: DiagnosticStatus) -> dict[str, str]:
    """Return the values of a message."""
    return {pair.key: pair.value for pair in message.values}


@pytest.fixture(scope="module", autouse=True)
def _installed(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Let processes that are started here find the warehouse's package."""
    site = tmp_path_factory.mktemp("site")
    install(site)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONPATH", str(site))
        yield


@pytest.fixture
def clerk(world: World) -> Iterator[Clerk]:
    """A clerk, and a robot that is idle; shelf B2 is empty."""
    world.run("picker", [*PICKER, "B2"])
    world.start("mission_orchestrator", missions_path=MISSIONS, mission_id_prefix="order")
    clerk = Clerk()
    clerk.in_state("IDLE")
    yield clerk
    clerk.ros.close()


@pytest.mark.core
def test_an_order_is_fetched(clerk: Clerk) -> None:
    """The states from beginning to end, each shelf told once, and the counts."""
    accepted, order = clerk.order("FetchOrder A1 B2 C3")
    assert accepted, order
    assert order.startswith("order-")
    clerk.in_state("PARKED")
    clerk.until(lambda: len(clerk.outcomes) >= 3, "three outcomes")

    phases = ("DRIVING", "GRIPPING", "CHOOSING")
    legs = [f"FETCHING {phase} {shelf}" for shelf in ("A1", "B2", "C3") for phase in phases]
    assert [state for state in clerk.seen() if state != "WAKING"] == ["IDLE", *legs, "PARKING", "PARKED"]
    last = clerk.states[-1]
    assert (last.name, last.hardware_id, last.level) == ("FetchOrder", order, DiagnosticStatus.WARN)
    counts = {"shelves": "3", "PICKED": "2", "MISSING": "1", "LEFT": "0"}
    assert counts.items() <= told(last).items()

    assert [(o.name, o.message, o.hardware_id) for o in clerk.outcomes] == [
        ("A1", "PICKED", order),
        ("B2", "MISSING", order),
        ("C3", "PICKED", order),
    ]
    assert [o.level for o in clerk.outcomes] == [
        DiagnosticStatus.OK,
        DiagnosticStatus.WARN,
        DiagnosticStatus.OK,
    ]
    assert told(clerk.outcomes[0]) == {"reason": "", "width": "0.12", "force": "8.0"}
    assert told(clerk.outcomes[1])["reason"]


def test_a_bad_order_is_refused_with_the_reason(clerk: Clerk) -> None:
    """And nothing happens."""
    assert clerk.order("FetchOrder") == (False, "the order names no shelf")
    accepted, reason = clerk.order("FetchOrders A1")
    assert not accepted
    assert "did you mean 'FetchOrder'?" in reason
    assert clerk.ask("halt") == (False, "halt refused: no order is being picked")
    clerk.in_state("IDLE")
    assert clerk.outcomes == []


def test_an_operator_halts_the_robot_and_lets_it_go_on(clerk: Clerk) -> None:
    """The drive is cancelled and begun again; a second order is refused meanwhile."""
    assert clerk.order(f"FetchOrder {FAR}")[0]
    clerk.in_state("FETCHING", phase="DRIVING", halted="no")
    assert clerk.order("FetchOrder A1") == (False, "start refused: an order is being picked")
    assert clerk.ask("halt") == (True, "halt accepted")
    clerk.in_state("FETCHING", halted="yes")
    assert clerk.ask("go_on") == (True, "go_on accepted")
    clerk.in_state("PARKED", halted="no")
    clerk.until(lambda: clerk.outcomes, "the outcome")
    assert [(o.name, o.message) for o in clerk.outcomes] == [(FAR, "PICKED")]


def test_an_order_that_is_called_off(clerk: Clerk) -> None:
    """Every shelf that nobody has been to is told as left."""
    assert clerk.order(f"FetchOrder A1 {FAR} C3")[0]
    clerk.in_state("FETCHING", shelf=FAR, phase="DRIVING")
    assert clerk.ask("call_off") == (True, "call_off accepted")
    clerk.in_state("PARKED")
    clerk.until(lambda: len(clerk.outcomes) >= 3, "three outcomes")
    assert [(o.name, o.message) for o in clerk.outcomes] == [("A1", "PICKED"), (FAR, "LEFT"), ("C3", "LEFT")]
    assert told(clerk.states[-1])["code"] == "called_off"


def test_the_requests_of_the_profile_are_verbs(clerk: Clerk) -> None:
    """Each by the name that the profile gives it for the terminal, and the fields of a start as options."""

    def lupin(*words: str) -> tuple[int, str]:
        command = [str(Path(sys.executable).with_name("lupin")), *words]
        done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE, check=False)
        return done.returncode, done.stdout + done.stderr

    assert lupin("halt") == (1, "halt refused: no order is being picked\n")
    assert lupin("start", "fetch") == (1, "the order names no shelf\n")
    code, said = lupin("start", "fetch", "--shelves", f"{FAR},C3")
    assert (code, said.startswith("FetchOrder order-")) == (0, True), said
    clerk.in_state("FETCHING", phase="DRIVING")
    assert lupin("halt") == (0, "halt accepted\n")
    code, said = lupin("state")
    assert (code, said.splitlines()[0]) == (0, f"FETCHING DRIVING  target {FAR}")
    assert "  possible   go-on, call-off\n" in said
    # Called off while it stands still: a robot that goes on may be through before a process has begun.
    assert lupin("call-off") == (0, "call-off accepted\n")
    clerk.in_state("PARKED")
    code, said = lupin("go-on")
    assert (code, said.startswith("go_on ")) == (1, True), said


# -- `lupin run` ----------------------------------------------------------------------------------------


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., Lupin]]:
    """Start `lupin run fetch` beside the missions, in a domain where the robot is; shelf B2 is empty."""
    monkeypatch.chdir(HERE)
    started: list[Lupin] = []
    with claimed_domain() as domain:
        monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))
        world = World(tmp_path)
        world.run("picker", [*PICKER, "B2"])

        def start(*arguments: str) -> Lupin:
            given = ("run", "fetch", *arguments)
            started.append(Lupin(*given, domain=domain, log_dir=tmp_path / "logs"))
            return started[-1]

        yield start
        for command in started:
            command.kill()
        assert world.stop() == []


def test_run_tells_of_shelves_and_parcels(run: Callable[..., Lupin]) -> None:
    """A line for every change, the table, one sentence; one shelf was empty, so the exit code is 1."""
    fetched = run("--shelves", "A1,B2")
    assert fetched.end() == 1, fetched.output
    assert "FETCHING DRIVING  shelf A1  0/2" in fetched.output
    # The twin and the simulated robot are another profile's.
    assert "stopping mission_orchestrator" in fetched.lines
    assert "shelf A1 PICKED: width 0.12, force 8" in fetched.output
    assert "shelf B2 MISSING" in fetched.output
    *_, last = [line for line in fetched.lines if line]
    assert last.startswith("PARKED: 1 picked, 1 missing of 2 targets in ")
    row = next(line for line in fetched.lines if line.strip().startswith("A1"))
    assert row.split() == ["A1", "PICKED", "0.12", "8"]


def test_an_interrupt_calls_the_order_off(run: Callable[..., Lupin]) -> None:
    """By the profile's own request; the robot parks, and the record has the profile's outcomes."""
    fetched = run("--shelves", f"{FAR},C3", "--json")
    fetched.until_line(f'"value": "{FAR}"')
    fetched.process.send_signal(signal.SIGINT)
    assert fetched.end() == 130, fetched.output
    assert "aborting the mission: PARKING follows; once more to stop it on the way" in fetched.output
    (result,) = fetched.records("result")
    assert (result["lifecycle"], result["total"]) == ("PARKED", 2)
    assert result["counts"] == {"PICKED": 0, "MISSING": 0, "LEFT": 2}
    assert [(each["shelf"], each["status"]) for each in result["readings"]] == [(FAR, "LEFT"), ("C3", "LEFT")]
