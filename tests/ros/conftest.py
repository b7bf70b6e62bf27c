"""A DDS domain of its own for every worker, and nodes that are closed after each test."""

from __future__ import annotations

import os
import zlib
from collections.abc import Callable, Iterator
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="ROS 2 is not installed here")

from lupin_engine.ros.middleware import RosNode

#: DDS derives ports from the domain; on Linux they are free for domains up to 101.
FIRST_DOMAIN, DOMAINS = 20, 80


def pytest_configure(config: pytest.Config) -> None:
    """Tolerate two warnings of the ROS wheels themselves; everything else stays an error."""
    config.addinivalue_line("filterwarnings", "ignore:module 'sre_.*' is deprecated:DeprecationWarning")
    # rclpy leaves the coroutine of a goal behind when its server is destroyed before the goal has ended.
    abandoned = "coroutine object ActionServer._execute_goal"
    config.addinivalue_line(
        "filterwarnings", f"ignore:Exception ignored in. <{abandoned}:pytest.PytestUnraisableExceptionWarning"
    )
    config.addinivalue_line(
        "filterwarnings", "ignore:coroutine 'ActionServer._execute_goal' was never awaited:RuntimeWarning"
    )


@pytest.fixture(scope="session", autouse=True)
def ros_domain() -> Iterator[int]:
    """Keep this worker, and the processes it starts, apart from everything else on the machine."""
    run = os.environ.get("PYTEST_XDIST_TESTRUNUID", str(os.getpid()))
    worker = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0").removeprefix("gw"))
    given = os.environ.get("ROS_DOMAIN_ID")
    start = int(given) - FIRST_DOMAIN if given else zlib.crc32(run.encode())
    domain = FIRST_DOMAIN + (start + worker) % DOMAINS
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ROS_DOMAIN_ID", str(domain))
        patch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        yield domain


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
