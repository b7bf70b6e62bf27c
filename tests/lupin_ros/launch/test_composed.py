"""Nodes that share a process: real ones, which begin, end and fail together."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from lupin_harness.domains import claimed_domain
from lupin_ros.adapter.network import other_participants
from lupin_ros.adapter.node import RosNode
from tests.lupin_ros.helpers import spin_until
from tests.lupin_ros.launch.processes import PATIENCE

NODES = ("greenhouse_bridge", "lupin_twin")


@pytest.fixture
def onlooker(monkeypatch: pytest.MonkeyPatch) -> Iterator[RosNode]:
    """A node of a domain in which this process and its children are alone."""
    with claimed_domain() as domain:
        monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))
        monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        with RosNode("onlooker") as ros:
            yield ros


@contextmanager
def started(*arguments: str) -> Iterator[subprocess.Popen[str]]:
    """Start `lupin node`, which does not survive the body."""
    line = [sys.executable, "-m", "lupin_cli.main", "node", *arguments]
    with subprocess.Popen(line, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as process:
        try:
            yield process
        finally:
            process.kill()


def said(process: subprocess.Popen[str]) -> str:
    """Wait for the end, and return what was printed."""
    return process.communicate(timeout=PATIENCE)[0]


def seen(ros: RosNode) -> set[str]:
    """Return the names of the other nodes."""
    return set(ros.node.get_node_names()) - {ros.name}


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_they_are_one_participant_and_a_signal_ends_all(onlooker: RosNode, number: signal.Signals) -> None:
    """Each is on the network by its name; they end as each would end by itself."""
    with started(*NODES) as together:
        spin_until([onlooker], lambda: seen(onlooker) == set(NODES), PATIENCE, "both nodes")
        assert other_participants(onlooker.node) == 1
        together.send_signal(number)
        told = said(together)
    assert (together.returncode, "Traceback" in told) == (0, False), told
    spin_until([onlooker], lambda: not seen(onlooker), what="that both are gone")


def test_one_that_cannot_be_started_ends_the_others(onlooker: RosNode) -> None:
    """They are started again together: some of them would look like all."""
    with started(*NODES, "--ros-args", "-p", "greenhouse_bridge:backend:=abacus") as together:
        told = said(together)
    assert (together.returncode, "Traceback" in told) == (1, False), told
    assert "abacus" in told


def test_what_keeps_the_robot_safe_shares_no_process(onlooker: RosNode) -> None:
    """Said with the way to start it."""
    with started("nav_watchdog", "lupin_twin", "mission_orchestrator") as together:
        told = said(together)
    why = "nav_watchdog, mission_orchestrator: shares no process; start each with `lupin node NAME`"
    assert f"lupin: {why}\n" in told
    assert together.returncode == 2
