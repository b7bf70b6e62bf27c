"""A DDS domain of its own for every worker, and nodes that are closed after each test."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="ROS 2 is not installed here")

from lupin_harness.domains import claimed_domain
from lupin_ros.adapter.dds.profile import use_profile
from lupin_ros.adapter.node import RosNode
from tests.lupin_ros.world import Operator, World

#: Fixtures that start processes for one test: three to thirty seconds of processor each.
OWN_PROCESSES = {"world", "lupin"}


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark all of this folder as `ros`; what starts processes of its own and is not `core` as `long`."""
    here = Path(__file__).parent
    for item in items:
        if here in item.path.parents:
            item.add_marker("ros")
            starts = OWN_PROCESSES.intersection(getattr(item, "fixturenames", ()))
            if starts and not item.get_closest_marker("core"):
                item.add_marker("long")


@pytest.fixture(scope="session", autouse=True)
def ros_domain(tmp_path_factory: pytest.TempPathFactory) -> Iterator[int]:
    """Keep this worker, and the processes it starts, apart from everything else on the machine."""
    with claimed_domain() as domain, pytest.MonkeyPatch.context() as patch:
        patch.setenv("ROS_DOMAIN_ID", str(domain))
        patch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        use_profile()  # a process reads it with its first node only, and that may be one of rclpy's own
        yield domain


def stays_on_its_domain(patch: pytest.MonkeyPatch) -> None:
    """Restore the domain at the end: a command's `--domain` sets it for good, and others claim that one."""
    patch.setenv("ROS_DOMAIN_ID", os.environ["ROS_DOMAIN_ID"])


@pytest.fixture(scope="module", autouse=True)
def state_of_a_module(ros_domain: int, tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Keep the journals of what several tests share apart from those of other files."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_STATE_HOME", str(tmp_path_factory.mktemp("state")))
        stays_on_its_domain(patch)
        yield


@pytest.fixture(autouse=True)
def own_state(ros_domain: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Keep the journals of tests apart: who finds a mission under way goes on with it."""
    stays_on_its_domain(monkeypatch)
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    return tmp_path / "state" / "lupin" / "journal" / f"domain-{ros_domain}"


@pytest.fixture
def make_node() -> Iterator[Callable[..., RosNode]]:
    """Make nodes (arguments as for `RosNode`); each has its own context and is closed after the test."""
    nodes: list[RosNode] = []

    def make(*arguments: Any, **named: Any) -> RosNode:
        nodes.append(RosNode(*arguments, **named))
        return nodes[-1]

    yield make
    for node in nodes:
        node.close()


@pytest.fixture
def world(ros_domain: int, tmp_path: Path) -> Iterator[World]:
    """Nodes on a domain of their own; the test fails if one does not end when asked."""
    world = World(tmp_path)
    yield world
    assert world.stop() == []


@pytest.fixture
def operator(ros_domain: int) -> Iterator[Operator]:
    """An operator on the same domain."""
    operator = Operator()
    yield operator
    operator.ros.close()
