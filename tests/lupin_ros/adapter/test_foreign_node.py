"""Nodes that packages bring may be plain rclpy: they end quietly, and their defects are their authors'."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.processes import ended

pytestmark = pytest.mark.timeout(180)

CATALOG = """\
from lupin_engine.plugin.contract import Plugin
PLUGIN = Plugin("far", "A far one.", nodes={"far_node": "far.node:main", "far_wreck": "far.node:wreck"})
"""
NODE = """\
import rclpy
from rclpy.node import Node

def main(arguments):
    rclpy.init(args=arguments)
    node = Node("far_node")
    node.create_timer(0.01, lambda: print("it spins as", node.get_fully_qualified_name(), flush=True))
    rclpy.spin(node)

def wreck(arguments):
    return 1 / len(arguments)
"""


@pytest.fixture
def installed(tmp_path: Path) -> dict[str, str]:
    """Install a package with two nodes; return an environment in which it is found."""
    (tmp_path / "far").mkdir()
    (tmp_path / "far" / "__init__.py").write_text("")
    (tmp_path / "far" / "catalog.py").write_text(CATALOG)
    (tmp_path / "far" / "node.py").write_text(NODE)
    (tmp_path / "far-1.2.dist-info").mkdir()
    (tmp_path / "far-1.2.dist-info" / "METADATA").write_text("Name: far\nVersion: 1.2\n")
    (tmp_path / "far-1.2.dist-info" / "entry_points.txt").write_text(
        "[lupin.plugins]\nfar = far.catalog:PLUGIN\n"
    )
    return {**os.environ, "PYTHONPATH": str(tmp_path), "XDG_STATE_HOME": str(tmp_path / "state")}


def lupin_node(*arguments: str) -> list[str]:
    """Return the command that runs a node."""
    return [sys.executable, "-m", "lupin_cli.main", "node", *arguments]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM], ids=lambda number: number.name)
def test_a_node_in_plain_rclpy_ends_quietly(
    installed: dict[str, str], ros_domain: int, number: signal.Signals
) -> None:
    """It gets its ROS arguments as rclpy wants them; how rclpy's spin ends at a signal is no defect."""
    command = lupin_node("far_node", "--ros-args", "-r", "__ns:=/there")
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    with ended(subprocess.Popen(command, env=installed, text=True, **pipes)) as node:
        assert node.stdout is not None
        assert "it spins as /there/far_node\n" in node.stdout  # the middleware may say something before
        node.send_signal(number)
        _, errors = node.communicate(timeout=60)
    assert (node.returncode, errors) == (0, "")


def test_a_defect_of_a_node_names_who_brought_it(installed: dict[str, str]) -> None:
    """One line and a file with the traceback, as always; but it is not the engine's."""
    done = subprocess.run(lupin_node("far_wreck"), env=installed, capture_output=True, text=True, timeout=150)
    first, second = done.stderr.splitlines()
    assert done.returncode == 70
    assert first == "lupin: a defect of the node 'far_wreck' of far 1.2: ZeroDivisionError: division by zero"
    assert "in wreck" in Path(second.removeprefix("lupin: please report ")).read_text()
