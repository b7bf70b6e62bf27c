"""Who finds our nodes from another computer: two network namespaces, with real DDS between them."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import uuid
from collections.abc import Iterator
from pathlib import Path

import pytest

from lupin_engine.ros.adapter.dds.profile import RANGE, VARIABLES
from tests.ros.world import PATIENCE, World

pytestmark = pytest.mark.timeout(240)

STRANGER = Path(__file__).with_name("stranger.py")
#: Addresses of ours and of the stranger.
OURS, THEIRS = "10.213.77.1", "10.213.77.2"
#: Seconds for which the stranger looks around where nobody is to be found: an open node is found within 3.
LOOKS_S = 8.0
#: How the orchestrator's answer begins: it lacks a robot.
ANSWERED = "start refused: "


def ip(*arguments: str) -> None:
    """Run `ip`; skip the test where that is not allowed."""
    done = subprocess.run(["ip", *arguments], capture_output=True, text=True)
    if done.returncode:
        pytest.skip(f"no network namespaces here: ip {' '.join(arguments)}: {done.stderr.strip()}")


class Computers:
    """Two computers with a cable between them; the second has a shared memory of its own."""

    def __init__(self) -> None:
        mark = uuid.uuid4().hex[:6]
        self.names = [f"lupin-{mark}-{side}" for side in "ab"]
        self._ends = [f"lu{mark}{side}" for side in "ab"]

    def connect(self) -> None:
        """Make them."""
        for name in self.names:
            ip("netns", "add", name)
        ip("link", "add", self._ends[0], "type", "veth", "peer", "name", self._ends[1])
        for name, end, address in zip(self.names, self._ends, (OURS, THEIRS), strict=True):
            ip("link", "set", end, "netns", name)
            ip("-n", name, "address", "add", f"{address}/24", "dev", end)
            ip("-n", name, "link", "set", end, "up")
            ip("-n", name, "link", "set", "lo", "up")

    def remove(self) -> None:
        """Take them away, and the cable with them."""
        for name in self.names:
            subprocess.run(["ip", "netns", "delete", name], capture_output=True)

    def on(self, number: int, *command: str) -> list[str]:
        """Return the command line that runs a command on one of them."""
        there = ["ip", "netns", "exec", self.names[number]]
        memory = 'mount -t tmpfs tmpfs /dev/shm && exec "$@"'
        return [*there, *(["unshare", "-m", "sh", "-c", memory, "-"] if number else []), *command]


@pytest.fixture(scope="module")
def computers() -> Iterator[Computers]:
    if os.geteuid() or not shutil.which("ip") or not shutil.which("unshare"):
        pytest.skip("no network namespaces here: they need root, ip and unshare")
    found = Computers()
    try:
        found.connect()
        yield found
    finally:
        found.remove()


def stranger(computers: Computers, number: int, seconds: float, **shell: str) -> str:
    """Look around from one of the computers, and return what the stranger was told."""
    environment = {**os.environ, RANGE: "SUBNET", **shell}
    environment.pop(VARIABLES[0], None)
    line = computers.on(number, sys.executable, str(STRANGER), str(seconds))
    done = subprocess.run(line, env=environment, capture_output=True, text=True, timeout=PATIENCE + seconds)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


def orchestrator(world: World, computers: Computers, doors: str) -> None:
    """Start the orchestrator on our computer, with nothing said about the doors or with what is said."""
    with pytest.MonkeyPatch.context() as patch:
        patch.delenv(VARIABLES[0], raising=False)
        patch.setenv(RANGE, doors)
        lupin = str(Path(sys.executable).with_name("lupin"))
        world.run("mission_orchestrator", computers.on(0, lupin, "node", "mission_orchestrator"))


@pytest.mark.parametrize("shell", [{}, {"ROS_STATIC_PEERS": OURS}], ids=["by the subnet", "by our address"])
def test_nobody_on_another_computer_finds_us(
    world: World, computers: Computers, shell: dict[str, str]
) -> None:
    orchestrator(world, computers, "")
    assert stranger(computers, 0, PATIENCE).startswith(ANSWERED), "on our own computer it is there"
    assert stranger(computers, 1, LOOKS_S, **shell) == "nobody"
    assert stranger(computers, 0, PATIENCE).startswith(ANSWERED), "and still is"


def test_who_asks_for_the_network_gets_it(world: World, computers: Computers) -> None:
    """So the stranger does look where we are."""
    orchestrator(world, computers, "SUBNET")
    assert stranger(computers, 1, PATIENCE).startswith(ANSWERED)
