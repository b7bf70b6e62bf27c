"""Takes a snapshot of a ROS domain's graph with a temporary node."""

from __future__ import annotations

import os
from contextlib import closing

from lupin_ros.adapter.network import Interface, interfaces, other_participants
from lupin_ros.adapter.node import RosNode
from lupin_ros.launch.dds_discovery import settled

#: Seconds between two queries.
TICK_S = 0.05


class _Onlooker:
    """A node that only discovers others."""

    def __init__(self) -> None:
        self._ros = RosNode(f"lupin_graph_{os.getpid()}")

    def spin(self) -> None:
        self._ros.spin_once(TICK_S)

    def look(self) -> tuple[Interface, ...]:
        node = self._ros.node
        return tuple(interfaces(node, without=[node.get_fully_qualified_name()]))

    def strangers(self) -> int:
        return other_participants(self._ros.node)

    def close(self) -> None:
        self._ros.leave()


def network() -> tuple[Interface, ...]:
    """Return the graph after discovery of all participants on this machine: a second or two, 6 s at most."""
    with closing(_Onlooker()) as onlooker:
        return settled(onlooker)
