"""A bringup that nothing comes of: why, and that nothing is left; a network on which nobody is."""

from __future__ import annotations

import errno
import os
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest

from lupin_engine.errors import Severity
from lupin_engine.plugin.profile import Progress
from lupin_engine.plugin.registry import build_catalog
from lupin_greenhouse.profile import PROFILE
from lupin_ros.launch import bringup as bringup_module
from lupin_ros.launch.bringup import Bringup, BringupSettings, RunFailed
from lupin_ros.launch.description import LaunchDescription, NodeLaunch
from lupin_ros.launch.interrupts import Interrupts
from lupin_ros.launch.monitor import RunMonitor
from lupin_ros.launch.nodes import LaunchableNode
from lupin_ros.launch.operator import Arrival
from tests.lupin_ros.launch.processes import until

CATALOG = build_catalog([], [PROFILE])


class Notes:
    """An observer that keeps what it is told."""

    def __init__(self) -> None:
        self.told: list[str] = []

    def note(self, text: str, severity: Severity = Severity.INFO) -> None:
        self.told.append(text)

    def arrived(self, kind: str, data: Any, monitor: RunMonitor) -> None:
        raise AssertionError("there is no mission")

    def show(self, monitor: RunMonitor) -> None:
        raise AssertionError("there is no mission")


class Nobody:
    """An operator on a network without nodes; a moment of its work is as long as the test says."""

    def __init__(self, spin: Callable[[], None]) -> None:
        self.spin = lambda seconds: spin()

    def nodes(self) -> frozenset[str]:
        return frozenset()

    services = actions = nodes

    def strangers(self) -> int:
        return 0

    def count(self, name: str) -> int:
        return 0

    def take(self) -> list[Any]:
        return []

    def close(self) -> None:
        """Nothing is open."""


class Ready(Nobody):
    """One who hears an orchestrator that is ready, once a look."""

    def __init__(self) -> None:
        super().__init__(lambda: None)
        self.told = 0

    def ready(self) -> bool:
        return True

    def is_published(self, topic: str) -> bool:
        return topic == "/told"

    def take(self) -> list[Any]:
        self.told += 1
        return [Arrival("state", {"lifecycle_state": "READY"}, 0.0)]


def begin(
    monkeypatch: pytest.MonkeyPatch,
    folder: Path,
    launches: tuple[NodeLaunch, ...] = (),
    command: Callable[..., Any] = lambda launch, folder: [],
    **settings: Any,
) -> Bringup:
    """Return a bringup that starts these nodes with these commands, and looks once they have ended."""
    monkeypatch.setattr(bringup_module, "settled", lambda onlooker: onlooker.look())
    monkeypatch.setattr(bringup_module, "describe_launch", lambda *_, **__: LaunchDescription(launches))
    monkeypatch.setattr(bringup_module, "command", command)

    def operator(_: object) -> Nobody:
        return Nobody(lambda: until(lambda: not bringup.supervisor.names, "the nodes have ended", 20.0))

    monkeypatch.setattr(bringup_module, "Operator", operator)
    bringup = Bringup(BringupSettings(PROFILE, folder, dict(os.environ), **settings), Notes(), Interrupts())
    return bringup


def test_every_node_that_dies_at_the_start_is_told_with_its_last_words(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Two with one reason are told as two: the exit code, the log, and its last lines."""
    launches = tuple(NodeLaunch(LaunchableNode(name, "")) for name in ("reader", "looker"))

    def command(launches: Sequence[NodeLaunch], *_: object) -> list[str]:
        (launch,) = launches
        return [sys.executable, "-c", f"print('no {launch.node.name} here'); raise SystemExit(3)"]

    with begin(monkeypatch, tmp_path, launches, command) as bringup, pytest.raises(RunFailed) as caught:
        bringup.bring_up([], CATALOG)
    assert str(caught.value).splitlines() == [
        f"reader ended with exit code 3; its log is {tmp_path / 'reader.log'}",
        "  | no reader here",
        f"looker ended with exit code 3; its log is {tmp_path / 'looker.log'}",
        "  | no looker here",
    ]
    assert caught.value.exit_code == 2


def test_a_disk_that_is_full_is_told_and_ends_what_was_started(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """The file with a node's parameters could not be written."""
    launches = tuple(NodeLaunch(LaunchableNode(name, "")) for name in ("reader", "looker"))

    def command(launches: Sequence[NodeLaunch], *_: object) -> list[str]:
        if launches[0].node.name == "looker":
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return [sys.executable, "-c", "import signal; signal.pause()"]

    with begin(monkeypatch, tmp_path, launches, command) as bringup:
        with pytest.raises(RunFailed) as caught:
            bringup.bring_up([], CATALOG)
        assert bringup.supervisor.names == ["reader"]
    assert bringup.supervisor.names == []
    told = f"looker cannot be started with its files in {tmp_path}: No space left on device"
    assert str(caught.value) == told


@pytest.mark.parametrize("settle", [True, False])
def test_what_the_simulated_robot_was_given_is_heard_before_the_mission_is_started(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, settle: bool
) -> None:
    """On a machine as well where the time is over before anybody was let speak."""
    monkeypatch.setattr(bringup_module, "SETTLE_S", 0.0)
    ready = Ready()
    with begin(monkeypatch, tmp_path, settle=settle) as bringup:
        monkeypatch.setattr(bringup, "_operator", ready)
        bringup.bring_up([], CATALOG)
    assert (ready.told > bringup_module.SETTLE_STATES) is settle


def test_a_topic_that_nobody_publishes_is_told(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """A binding that reads it would stay silent, and nobody would know why."""
    monkeypatch.setattr(bringup_module, "PUBLISHERS_LIMIT_S", 0.0)
    with begin(monkeypatch, tmp_path) as bringup:
        monkeypatch.setattr(bringup, "_operator", Ready())
        bringup.bring_up([], CATALOG, {"/told": "wrist.touched", "/silent": "tank.level, tank.leak"})
        assert isinstance(bringup._observer, Notes)
        silent = [text for text in bringup._observer.told if "nobody" in text]
    assert silent == ["nobody publishes /silent: no tank.level, tank.leak until then"]


def test_every_option_for_a_node_that_runs_already_is_told(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Using the node that is there would ignore the option."""
    insisted = {"reader": "--set", "robot": "--sim"}
    with begin(monkeypatch, tmp_path, insisted=insisted) as bringup, pytest.raises(RunFailed) as caught:
        bringup.bring_up([], CATALOG)
    assert str(caught.value).splitlines() == [
        "--set is for reader, which runs already; stop it or choose another --domain",
        "--sim is for robot, which runs already; stop it or choose another --domain",
    ]


@pytest.mark.parametrize(
    ("lifecycle", "lost"),
    [
        ("READY", []),
        ("", []),
        (
            "INSPECTING",
            [
                "InspectionMission m7 was under way (INSPECTING) and will be held: "
                "look where the robot is, then `lupin resume`"
            ],
        ),
    ],
)
def test_an_orchestrator_that_dies_is_started_again(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, lifecycle: str, lost: list[str]
) -> None:
    """The new one holds the mission, which is told."""
    launches = (NodeLaunch(LaunchableNode("mission_orchestrator", "")),)
    code = f"open({str(tmp_path / 'lives')!r}, 'a').write('x')"
    lives = tmp_path / "lives"
    with begin(monkeypatch, tmp_path, launches, lambda *_: [sys.executable, "-c", code]) as bringup:
        bringup._is_up = True
        bringup._progress = Progress("InspectionMission", "m7", lifecycle)
        bringup._start("mission_orchestrator", launches)

        def has_lived_twice() -> bool:
            bringup._look_at_processes()
            return lives.exists() and len(lives.read_text()) == 2

        until(has_lived_twice, "the orchestrator is started again", 30.0)
        assert isinstance(bringup._observer, Notes)
        told = bringup._observer.told
    assert "mission_orchestrator ended with exit code 0" in told[0]
    assert told[1] == "mission_orchestrator is started again in 1 s (1 of 3)"
    assert told[2 : 2 + len(lost)] == lost


def test_a_run_ends_with_an_orchestrator_that_is_not_started_again(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """With --no-respawn something else is to do that."""
    launches = (NodeLaunch(LaunchableNode("mission_orchestrator", "")),)
    code = [sys.executable, "-c", ""]
    with begin(monkeypatch, tmp_path, launches, lambda *_: code, respawn=False) as bringup:
        bringup._is_up = True
        bringup._start("mission_orchestrator", launches)
        until(lambda: not bringup.supervisor.names, "it has ended", 20.0)
        with pytest.raises(RunFailed, match="mission_orchestrator ended with exit code 0"):
            bringup._look_at_processes()
