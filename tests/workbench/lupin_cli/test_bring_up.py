"""Nodes that cannot be loaded: what starts none of them needs none of their messages."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from click.testing import CliRunner

from lupin_cli.main import lupin
from lupin_engine.errors import UsageError

pytest.importorskip("rclpy", reason="ROS 2 is not installed here")

#: It drives and calls a service of its own.
DELIVER = Path(__file__).parents[3] / "docs" / "ten" / "deliver.yaml"
WRONG = (
    "--sim: parameter 'fault': expected one of none, reject, abort, stall, refuse_cancel, lose_localization, "
    "got 'x'"
)


def broken(plugin: str, node: str) -> str:
    """The text of a node whose module cannot be imported."""
    return (
        f"node '{node}' of plugin '{plugin}' cannot be loaded from lupin_{plugin}.node:main: "
        f"import of lupin_{plugin}.node halted; None in sys.modules"
    )


def told(mission: object, *arguments: str) -> str:
    """What `lupin run` says that cannot be started with these arguments."""
    result = CliRunner().invoke(lupin, ["run", str(mission), *arguments])
    assert isinstance(result.exception, UsageError), result.output
    return str(result.exception)


def test_a_mission_that_does_not_use_a_node_does_not_need_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """A delivery reads no tags; who sets a parameter of the bridge is answered."""
    monkeypatch.setitem(sys.modules, "lupin_bridge.node", None)
    assert told(DELIVER, "--sim", "fault=x") == WRONG
    assert told(DELIVER, "--set", "greenhouse_bridge.seed=1") == broken("bridge", "greenhouse_bridge")


def test_a_node_that_is_started_must_load(monkeypatch: pytest.MonkeyPatch) -> None:
    """An inspection reads tags: without the bridge nothing is started."""
    monkeypatch.setitem(sys.modules, "lupin_bridge.node", None)
    assert told("inspection", "--sim", "fault=x") == f"{WRONG}\n{broken('bridge', 'greenhouse_bridge')}"
