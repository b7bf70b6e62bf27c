"""What nodes declare at their start: each is started in a domain of its own, and ends instead of working."""

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

    Ends that are outside are not told.

    Raises:
        LupinError: a node cannot be started like that.
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
    """Keep this process out of the robot's domain, of SROS2, and of the user's files, for a while."""
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
