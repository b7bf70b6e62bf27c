"""Parameters of missions that are set while the node runs: all of it counts, or nothing does."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import pytest
from rcl_interfaces.msg import SetParametersResult
from rclpy.parameter import Parameter as RosParameter

from lupin_engine.machine.event import observed
from lupin_engine.plugin.contract import Parameter
from lupin_engine.plugin.registry import load_catalog
from lupin_ros.adapter.node import RosNode
from lupin_ros.orchestrator.missions import OWN_PARAMETERS
from lupin_ros.orchestrator.node import Orchestrator
from lupin_ros.orchestrator.records import RecordPublisher
from lupin_ros.service.folder import MissionsFolder
from lupin_ros.service.names import NODE

NAME = "battery_low_threshold"


class Running:
    """An orchestrator in this process."""

    def __init__(self, make_node: Callable[..., RosNode]) -> None:
        folders: list[MissionsFolder] = []

        def declared(given: Mapping[str, Any]) -> Mapping[str, Parameter]:
            folders.append(MissionsFolder(given, load_catalog()))
            return {**OWN_PARAMETERS, **folders[0].load().chart.parameters}

        self.ros = make_node(NODE, [], declared)
        self.orchestrator = Orchestrator(self.ros, folders[0].load(), folders[0])
        self.engine = self.orchestrator._engine

    def set(self, value: float) -> SetParametersResult:
        """Set the threshold of the battery, as its service does."""
        return self.ros.node.set_parameters_atomically([RosParameter(NAME, value=value)])

    @property
    def threshold(self) -> tuple[float, float]:
        """What ROS says, and what the machine goes by."""
        parameters = self.engine.machine.world.parameters
        return float(self.ros.parameters()[NAME]), float(parameters[NAME])


@pytest.fixture
def running(ros_domain: int, make_node: Callable[..., RosNode]) -> Running:
    """An orchestrator that waits for its servers, so that missions may be loaded and parameters be set."""
    return Running(make_node)


def test_a_value_that_ros_does_not_store_changes_nothing(running: Running) -> None:
    """Somebody else may refuse it after the orchestrator has found nothing wrong with it."""
    before = running.engine.machine
    refused = SetParametersResult(successful=False, reason="not today")
    running.ros.node._on_set_parameters_callbacks.append(lambda _: refused)
    assert running.set(0.6).reason == "not today"
    assert running.threshold == (0.2, 0.2)
    assert running.engine.machine is before
    running.ros.node._on_set_parameters_callbacks.pop()
    assert running.set(0.5).successful
    assert running.threshold == (0.5, 0.5)


def test_a_machine_that_cannot_go_on_changes_nothing(
    running: Running, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A plugin that breaks with a value is found before anything is taken over."""
    before = running.engine.machine

    def fails(*_: Any) -> Any:
        raise ZeroDivisionError("a plugin")

    monkeypatch.setattr("lupin_ros.orchestrator.missions.make_world", fails)
    assert running.set(0.6).reason == f"{NAME}: a plugin"
    assert running.threshold == (0.2, 0.2)
    assert running.engine.machine is before


def test_a_display_that_cannot_be_told_keeps_no_value_from_counting(
    running: Running, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What ROS has stored is what the machine goes by, whatever happens afterwards."""

    def fails(*_: Any) -> Any:
        raise ZeroDivisionError("telling")

    monkeypatch.setattr(RecordPublisher, "publish_missions", fails)
    assert running.set(0.6).successful
    assert running.threshold == (0.6, 0.6)
    running.engine.post(observed("robot.battery", 0.55, running.engine.clock.now()))
    running.engine.drain()
    assert running.engine.machine.memory.levels["input.battery.low"]
