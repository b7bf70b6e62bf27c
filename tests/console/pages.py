"""`lupin simulate … --hmi` and `lupin replay … --hmi` as processes of their own, and pages at them."""

from __future__ import annotations

import json
import signal
import socket
import subprocess
import sys
import urllib.request
from collections.abc import Callable
from typing import Any

from tests.plugins.gateway.served import OpenPage, until

STATE, STEPS = "/mission/state", "/mission_orchestrator/steps"
SIMULATION, DO = "/simulation/state", "/simulation/do"
#: How the command is begun.
LUPIN = (sys.executable, "-m", "lupin_cli.main")
COMMAND = "/mission_orchestrator/command"


def free_port() -> int:
    """Return a port that nobody listens on."""
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        return int(found.getsockname()[1])


class ServedPages:
    """A verb that serves pages, from its first line to Ctrl-C; a context."""

    def __init__(self, *arguments: str) -> None:
        self.port = free_port()
        command = [*LUPIN, *arguments, "--hmi", "--port", str(self.port)]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        assert self.process.stdout is not None
        #: What it told when it was ready.
        self.line = self.process.stdout.readline().strip()
        assert self.line, self.process.communicate()[1]

    @property
    def url(self) -> str:
        """Where the page is."""
        return f"http://127.0.0.1:{self.port}/"

    def fetch(self, path: str) -> str:
        """Return what a path answers."""
        with urllib.request.urlopen(f"{self.url}{path}", timeout=60) as answer:
            return str(answer.read().decode())

    def history(self, path: str = "history?since=0") -> list[dict[str, Any]]:
        """Return the lines of the history."""
        return [json.loads(line) for line in self.fetch(path).splitlines()]

    def interrupt(self) -> tuple[int, str]:
        """Press Ctrl-C; return the exit code, and what was printed as an error."""
        self.process.send_signal(signal.SIGINT)
        _, errors = self.process.communicate(timeout=60)
        return self.process.returncode, errors

    def __enter__(self) -> ServedPages:
        return self

    def __exit__(self, *_: object) -> None:
        if self.process.poll() is None:
            self.interrupt()


class SimulationPage(OpenPage):
    """A page of a simulation, which reads what it tells."""

    def __init__(self, port: int) -> None:
        super().__init__(port)
        for topic in (STATE, STEPS, SIMULATION):
            self.send({"op": "subscribe", "topic": topic})

    def told(self, topic: str) -> list[Any]:  # type: ignore[override]
        """Return what a topic told so far."""
        published = [frame for frame in self.frames if frame["op"] == "publish"]
        found = [frame["msg"] for frame in published if frame["topic"] == topic]
        return found if topic == STATE else [json.loads(message["data"]) for message in found]

    def steps(self) -> list[dict[str, Any]]:
        """Return the records of steps of the simulation that runs."""
        self.work_off()
        return [record for record in self.told(STEPS) if record["boot"] == self.now["boot"]]

    @property
    def now(self) -> dict[str, Any]:
        """How the simulation stands."""
        until(lambda: self.told(SIMULATION), "how the simulation stands")
        found: dict[str, Any] = self.told(SIMULATION)[-1]
        return found

    def do(self, command: str, *words: str) -> tuple[bool, str]:
        """Do something to the simulation; return whether it was done, and what it said."""
        values = self.call(DO, command=command, words=list(words))["values"]
        return values["success"], values["message"]

    def command(self, verb: str, mission: str = "", **request: Any) -> dict[str, Any]:
        """Command the orchestrator; return its answer."""
        values = self.call(COMMAND, verb=verb, mission=mission, request=json.dumps(request))["values"]
        assert isinstance(values, dict), values
        return values

    def reaches(self, condition: Callable[[dict[str, Any]], Any], what: str) -> dict[str, Any]:
        """Wait until the simulation stands as wanted, and return how."""
        until(lambda: condition(self.now), f"{what}; it stands so: {self.now}")
        return self.now
