"""The real nodes on which faulty runs are carried out: started once, and again when a run leaves them broken.

Where there is root, the robot (and a witness) is on another computer than the rest, behind a cable that can
be faulty, and the state of all nodes lies on a small disk of its own. Clocks and slow disks are those of
Python in the nodes: a machine has one clock, and a disk is as fast as it is.
"""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from lupin_msgs.srv import StartMission
from lupin_sim.layout import load_layout
from lupin_twin.place import store_path
from lupin_twin.records import Reading
from lupin_twin.store import StoreError, read
from tests.faults.cable import FaultyComputers, tell
from tests.faults.plan import (
    AGGREGATOR,
    ARM_SIM,
    GATEWAY,
    NODES,
    ORCHESTRATOR,
    ROBOT,
    WATCHDOG,
    Fault,
    Plan,
)
from tests.faults.strangers import Strangers
from tests.faults.verdict import name_of
from tests.lupin_ros.world import Operator, World

#: How large the disk is, in bytes, where it is one of its own.
DISK = 24_000_000
#: What the orchestrator is told: one sweep over what was found, and the arm is folded to drive.
SETTINGS = {
    "estop_timeout_s": 10.0,
    "nav_timeout_s": 30.0,
    "exploration_timeout_s": 40.0,
    "monitoring_sweeps": 1,
    "arm_patrol_enabled": True,
}
#: What is on the robot's computer.
ON_THE_ROBOT = (ROBOT, AGGREGATOR, ARM_SIM, WATCHDOG, "witness", "flood")
#: What Python does first in each node.
SITE = """\
import os, time
_ns, _s, _sync = time.time_ns, time.time, os.fdatasync
def _told(name):
    try:
        with open({folder!r} + "/" + name) as file:
            return float(file.read() or 0.0)
    except OSError:
        return 0.0
time.time_ns = lambda: _ns() + round(_told("clock") * 1e9)
time.time = lambda: _s() + _told("clock")
os.fdatasync = lambda file: (time.sleep(_told("sync")), _sync(file))[1]
"""
#: Whoever has to be there between two runs appears within so many seconds, on a busy computer.
APPEAR_S = 60.0


class Broken(Exception):
    """The nodes cannot be used for another run; the text says why."""


class Machines(World):
    """The nodes, each on its computer."""

    def __init__(self, folder: Path, computers: FaultyComputers | None) -> None:
        super().__init__(folder)
        self._computers = computers

    def run(self, node: str, command: Sequence[str]) -> subprocess.Popen[bytes]:
        """Start a process: what is of the robot on the robot."""
        if self._computers is not None and node in ON_THE_ROBOT:
            command = self._computers.on(1, *command)
        return super().run(node, command)


def free_port() -> int:
    """Return a port that nobody has now."""
    with socket.create_server(("127.0.0.1", 0)) as found:
        return int(found.getsockname()[1])


class Arena:
    """Nodes, an operator and a witness; faults are put upon them, and lifted."""

    def __init__(self, folder: Path, computers: FaultyComputers | None) -> None:
        """Use `folder` for all files; the process is on the first of the computers."""
        self.folder, self.computers = folder, computers
        self._control = folder / "control"
        self._filler = folder / "state" / "filler"
        for each in (folder / "state", folder / "logs", self._control, folder / "site"):
            each.mkdir(parents=True, exist_ok=True)
        (folder / "site" / "sitecustomize.py").write_text(SITE.format(folder=str(self._control)))
        paths = [str(folder / "site"), *filter(None, [os.environ.get("PYTHONPATH")])]
        os.environ |= {"XDG_STATE_HOME": str(folder / "state"), "PYTHONPATH": os.pathsep.join(paths)}
        if computers is not None:
            size = f"size={DISK}"
            subprocess.run(["mount", "-t", "tmpfs", "-o", size, "tmpfs", folder / "state"], check=True)
        self.track = folder / "track.txt"
        self.world = Machines(folder / "logs", computers)
        self.operator = Operator()
        self.strangers = Strangers(self.operator.ros)
        self._settings: dict[str, dict[str, Any]] = {ORCHESTRATOR: SETTINGS, GATEWAY: {"port": free_port()}}
        self.places = {tag.id: (tag.x, tag.y) for tag in load_layout().tags}
        for node in NODES:
            self.start(node)
        witness = str(Path(__file__).with_name("witness.py"))
        self.world.run("witness", [sys.executable, witness, str(self.track)])

    def start(self, node: str) -> None:
        """Start a node as it always is."""
        self.world.start(node, **self._settings.get(node, {}))

    def close(self) -> list[str]:
        """End everything; return what did not end by itself."""
        self.operator.ros.close()
        return self.world.stop()

    def process(self, node: str) -> subprocess.Popen[bytes]:
        """Return the process of a node."""
        return self.world.processes[node]

    def begin(self, plan: Plan) -> str:
        """Start a mission as soon as that can be, and return its id.

        Raises:
            Broken: it cannot.
        """
        states, answers = self.operator.states, list[Any]()
        asked = StartMission.Request(
            mission_type="ExplorationMission" if plan.search else "InspectionMission",
            tag_sequence=list(plan.tags),
            discovery_goal=plan.search,
        )

        def accepted() -> bool:
            if not states or states[-1].lifecycle_state not in ("READY", "DONE"):
                return False
            answers.append(self.operator.call(StartMission, "/mission/start", asked))
            states.clear()  # the next try is after another word of the orchestrator
            return bool(answers[-1].accepted)

        states.clear()
        try:
            self.operator.set_parameter(ROBOT, "speed", plan.speed)
            self.operator.observations.clear()
            self.operator.until(accepted, "a mission to start", APPEAR_S)
        except AssertionError as problem:
            why = answers[-1].error_message if answers else ""
            raise Broken(f"{problem} {why}") from None
        return str(answers[-1].mission_id)

    def rows(self, mission_id: str) -> list[str]:
        """Return the targets that the twin has kept of a mission, once for each row."""
        try:
            content = read(store_path())
        except StoreError:
            return []
        kept = (each.record for each in content.rows)
        readings = (one for one in kept if isinstance(one, Reading) and one.mission_id == mission_id)
        return [name_of(one.tag_id, one.source) for one in readings]

    # -- faults -----------------------------------------------------------------------------------------

    def put(self, fault: Fault) -> list[str]:
        """Let something go wrong; return the nodes that it ended."""
        match fault.kind:
            case "kill" | "terminate" | "power":
                return self._end(fault)
            case "bit flip":
                ended = self._end(fault)
                self._flip_bit(fault.amount)
                return ended
            case "foreign stop":
                self.strangers.stops = True
            case "second battery":
                self.strangers.charge = fault.amount
            case "long list":
                self.strangers.entries = int(fault.amount)
            case "stranger's goal":
                self.strangers.send_goal()
            case "refused cancel":
                self._refuse_cancels(True)
            case "stop":
                self.process(fault.node).send_signal(signal.SIGSTOP)
            case "disk full":
                self._fill()
            case "disk slow" | "clock":
                name = "sync" if fault.kind == "disk slow" else "clock"
                (self._control / name).write_text(str(fault.amount))
            case "cut":
                self._cable(loss=1.0)
            case "lossy":
                self._cable(loss=fault.amount)
            case "slow":
                self._cable(delay=fault.amount)
            case "flood":
                flood = str(Path(__file__).with_name("flood.py"))
                self.world.run("flood", [sys.executable, flood, str(fault.lasts)])
        return []

    def lift(self, fault: Fault) -> None:
        """Mend it."""
        match fault.kind:
            case "stop":
                if self.process(fault.node).poll() is None:
                    self.process(fault.node).send_signal(signal.SIGCONT)
            case "disk full":
                self._filler.unlink(missing_ok=True)
            case "disk slow" | "clock":
                (self._control / ("sync" if fault.kind == "disk slow" else "clock")).unlink(missing_ok=True)
            case "cut" | "lossy" | "slow":
                self._cable()
            case "foreign stop":
                self.strangers.end_stop(told=bool(fault.amount))
            case "second battery":
                self.strangers.end_battery()
            case "long list":
                self.strangers.entries = 0
            case "refused cancel":
                self._refuse_cancels(False)

    def _end(self, fault: Fault) -> list[str]:
        nodes = NODES if fault.kind == "power" else (fault.node,)
        number = signal.SIGTERM if fault.kind == "terminate" else signal.SIGKILL
        lives = [node for node in nodes if self.process(node).poll() is None]
        for node in lives:
            self.process(node).send_signal(number)
        return lives

    def _refuse_cancels(self, on: bool) -> None:
        """Let navigation refuse to stop; a robot that is started anew does not."""
        self.strangers.set_fault("refuse_cancel" if on else "none")

    def _flip_bit(self, share: float) -> None:
        """Flip a bit of the newest journal, at a share of its length."""
        files = sorted(
            (self.folder / "state").rglob("journal/*/*.journal"), key=lambda file: file.stat().st_mtime
        )
        if not files:
            return
        with files[-1].open("r+b") as file:
            place = int(share * files[-1].stat().st_size)
            file.seek(place)
            found = file.read(1)
            file.seek(place)
            file.write(bytes([found[0] ^ 4]))

    def _fill(self) -> None:
        """Leave no room on the disk."""
        assert self.computers is not None, "this disk is everybody's"
        with self._filler.open("wb", buffering=0) as file:
            try:
                while True:
                    file.write(b"x" * 4096)
            except OSError:
                pass

    def _cable(self, loss: float = 0.0, delay: float = 0.0) -> None:
        assert self.computers is not None
        tell(self.computers.control, loss, delay)
