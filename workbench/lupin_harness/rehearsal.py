"""Collects the interfaces that nodes declare: each is started on an isolated domain, and ends before it
works."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from lupin_engine.errors import LupinError
from lupin_harness.domains import claimed_domain
from lupin_ros.adapter import Interface, RosNode, interfaces
from lupin_ros.launch import NodeLaunch, command


def declared_by(launches: Iterable[NodeLaunch]) -> list[Interface]:
    """Return all interfaces that nodes declare with these parameters, with the parts of actions.

    Peers outside of these nodes are unknown.

    Raises:
        LupinError: a node cannot be started with them.
    """
    found: list[Interface] = []
    with tempfile.TemporaryDirectory() as folder, _apart(Path(folder)):
        for launch in launches:
            seen: list[Interface] = []
            RosNode.rehearsed = lambda ros, seen=seen: seen.extend(interfaces(ros.node, parts=True))
            try:
                launch.node.run(command([launch], Path(folder))[5:])
            except LupinError as problem:
                raise LupinError(f"{launch.node.name} cannot be started: {problem}") from None
            finally:
                RosNode.rehearsed = None
            found += seen
    return found


@contextmanager
def _apart(folder: Path) -> Iterator[None]:
    """Isolate this process from the robot's domain, from SROS2, and from the user's files."""
    before = dict(os.environ)
    with claimed_domain() as domain:
        os.environ.update(
            ROS_DOMAIN_ID=str(domain),
            ROS_AUTOMATIC_DISCOVERY_RANGE="LOCALHOST",
            ROS_SECURITY_ENABLE="false",
            XDG_STATE_HOME=str(folder),
            XDG_CONFIG_HOME=str(folder),
        )
        try:
            yield
        finally:
            os.environ.clear()
            os.environ.update(before)
