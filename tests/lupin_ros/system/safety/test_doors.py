"""Who finds our nodes from another computer: two network namespaces, with real DDS between them."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from lupin_ros.adapter.dds.profile import RANGE, variables
from tests.lupin_ros.computers import ADDRESSES, Computers, NoComputers, connected
from tests.lupin_ros.world import PATIENCE, World

pytestmark = pytest.mark.timeout(240)

STRANGER = Path(__file__).with_name("stranger.py")
#: Seconds for which the stranger looks around where nobody is to be found: an open node is found within 3.
LOOKS_S = 8.0
#: How the orchestrator's answer begins: it lacks a robot.
ANSWERED = "start refused: "


@pytest.fixture(scope="module")
def computers() -> Iterator[Computers]:
    with ExitStack() as stack:
        try:
            found = stack.enter_context(connected(Computers()))
        except NoComputers as problem:
            pytest.skip(str(problem))
        yield found


def stranger(computers: Computers, number: int, seconds: float, **shell: str) -> str:
    """Look around from one of the computers, and return what the stranger was told."""
    environment = {**os.environ, RANGE: "SUBNET", **shell}
    environment.pop(variables()[0], None)
    line = computers.on(number, sys.executable, str(STRANGER), str(seconds))
    done = subprocess.run(line, env=environment, capture_output=True, text=True, timeout=PATIENCE + seconds)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


def orchestrator(world: World, computers: Computers, doors: str) -> None:
    """Start the orchestrator on our computer, with nothing said about the doors or with what is said."""
    with pytest.MonkeyPatch.context() as patch:
        patch.delenv(variables()[0], raising=False)
        patch.setenv(RANGE, doors)
        lupin = str(Path(sys.executable).with_name("lupin"))
        world.run("mission_orchestrator", computers.on(0, lupin, "node", "mission_orchestrator"))


@pytest.mark.core
@pytest.mark.parametrize(
    "shell", [{}, {"ROS_STATIC_PEERS": ADDRESSES[0]}], ids=["by the subnet", "by our address"]
)
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
