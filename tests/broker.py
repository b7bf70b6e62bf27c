"""A real Mosquitto broker for a test: found, or fetched from the system's package registry without root.

What is fetched is unpacked into the user's cache, beside what other tests keep; the system is not touched.
"""

from __future__ import annotations

import contextlib
import os
import random
import shutil
import socket
import subprocess
import tempfile
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import pytest

#: Where system packages put servers, which is not on every user's path.
SYSTEM_FOLDERS = ("/usr/sbin", "/usr/local/sbin")
#: Seconds that a broker may take to end, or to take a message, on a busy machine.
PATIENCE = 20.0
#: Below those that Linux gives to who calls (`net.ipv4.ip_local_port_range`).
PORTS = range(20_000, 32_000)
#: It tells when it runs, and what goes wrong; never so much that nobody need read it.
QUIET = ("log_dest stderr", "log_type error", "log_type warning", "log_type information")
#: Seconds that fetching the broker may take.
FETCHING = 300


@cache
def mosquitto() -> tuple[str, str]:
    """Return the broker's program and the folder of its own libraries ('' for the system's)."""
    path = os.pathsep.join((os.environ.get("PATH", ""), *SYSTEM_FOLDERS))
    found = shutil.which("mosquitto", path=path)
    if found:
        return found, ""
    if not (shutil.which("apt-get") and shutil.which("dpkg")):
        pytest.skip("the broker Mosquitto is not installed: install the package mosquitto of your system")
    cache_folder = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    folder = cache_folder / "lupin-tests" / "mosquitto"
    if not folder.is_dir():
        problem = _fetch(folder)
        if problem and os.environ.get("CI"):
            pytest.fail(f"the broker Mosquitto cannot be fetched: {problem}")
        if problem:
            pytest.skip(f"the broker Mosquitto cannot be fetched; sudo apt install mosquitto: {problem}")
    libraries = next(iter((folder / "usr" / "lib").glob("*-linux-*")))
    return str(folder / "usr" / "sbin" / "mosquitto"), str(libraries)


def _fetch(folder: Path) -> str:
    """Download the package with what it needs and unpack it into `folder`; say what went wrong, if anything.

    With lists and archives in a folder of our own, apt needs neither root nor an earlier `apt-get update`.
    """
    folder.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="mosquitto-", dir=folder.parent) as name:
        work = Path(name)
        for made in ("state/lists/partial", "cache/archives/partial", "root"):
            (work / made).mkdir(parents=True)
        options = {
            "Dir::State": work / "state",
            "Dir::State::status": "/var/lib/dpkg/status",
            "Dir::Cache": work / "cache",
            "Debug::NoLocking": "true",
            "APT::Sandbox::User": "",
        }
        apt = ["apt-get", "-qq", *(f"-o{option}={value}" for option, value in options.items())]
        download = ["install", "--yes", "--no-install-recommends", "--download-only", "mosquitto"]
        for command in ([*apt, "update"], [*apt, *download]):
            ran = subprocess.run(command, capture_output=True, text=True, timeout=FETCHING)
            if ran.returncode:
                return ran.stderr.strip()[-300:]
        for package in (work / "cache" / "archives").glob("*.deb"):
            subprocess.run(["dpkg", "-x", str(package), str(work / "root")], check=True, timeout=FETCHING)
        try:
            (work / "root").rename(folder)
        except OSError:
            assert folder.is_dir()  # another run was quicker
    return ""


def free_port() -> int:
    """Return a port of the loopback interface that nobody uses, and that no caller is given by chance.

    Ports that the system hands out to callers are others: one of those could be taken between two starts of
    a broker, and a client that calls itself on one finds somebody there.
    """
    for port in random.sample(PORTS, len(PORTS)):
        with closing(socket.socket()) as probe, contextlib.suppress(OSError):
            probe.bind(("127.0.0.1", port))
            return port
    raise AssertionError(f"no port of {PORTS} is free")


def sockets_of(process: int) -> set[str]:
    """Return the numbers of the sockets that a process has open."""
    found = set()
    for descriptor in Path(f"/proc/{process}/fd").iterdir():
        with contextlib.suppress(FileNotFoundError):  # closed since
            kind, _, number = str(descriptor.readlink()).partition(":")
            found.update([number.strip("[]")] if kind == "socket" else [])
    return found


@dataclass
class Broker:
    """A broker on a port of the loopback interface; it can be killed and started again."""

    folder: Path
    settings: Sequence[str] = ("allow_anonymous true",)
    port: int = field(default_factory=free_port)
    _process: subprocess.Popen[bytes] | None = None

    def start(self) -> Broker:
        """Start the broker and wait until it takes connections."""
        program, libraries = mosquitto()
        configuration = self.folder / "mosquitto.conf"
        lines = [f"listener {self.port} 127.0.0.1", "persistence false", "user root", *QUIET, *self.settings]
        configuration.write_text("\n".join(lines) + "\n")
        environment = dict(os.environ)
        if libraries:
            environment["LD_LIBRARY_PATH"] = libraries
        self._process = subprocess.Popen(
            [program, "-c", str(configuration)], env=environment, stderr=subprocess.PIPE
        )
        assert self._process.stderr is not None
        said = []
        for line in self._process.stderr:
            said.append(line.decode())
            if "running" in said[-1]:
                return self
        raise AssertionError(f"the broker ended: {''.join(said)}")

    def signal(self, number: int) -> None:
        """Send a signal to the broker."""
        assert self._process is not None
        self._process.send_signal(number)

    def kill(self) -> None:
        """End the broker without a word to anybody."""
        if self._process is not None:
            self._process.kill()
            self._process.wait(PATIENCE)
            assert self._process.stderr is not None
            self._process.stderr.close()
            self._process = None


class Sensors:
    """Somebody who publishes at a broker."""

    def __init__(self, port: int) -> None:
        from paho.mqtt.client import Client
        from paho.mqtt.enums import CallbackAPIVersion

        self._client = Client(CallbackAPIVersion.VERSION2)
        self._client.connect("127.0.0.1", port)
        self._client.loop_start()

    def publish(self, topic: str, payload: Any, retain: bool = False) -> None:
        """Return when the broker has the message."""
        message = self._client.publish(topic, payload, qos=1, retain=retain)
        message.wait_for_publish(PATIENCE)
        assert message.is_published()

    def close(self) -> None:
        """Take leave."""
        self._client.disconnect()
        self._client.loop_stop()
