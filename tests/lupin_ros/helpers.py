"""Waiting for the world without sleeping."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any

from builtin_interfaces.msg import Time

from lupin_ros.adapter.node import RosNode

#: Seconds that a condition may take on a busy machine.
PATIENCE = 30.0


def spin_until(
    nodes: Sequence[RosNode], condition: Callable[[], Any], timeout: float = PATIENCE, what: str = ""
) -> None:
    """Let `nodes` work in turn until `condition` holds; fail after `timeout` seconds."""
    end = time.monotonic() + timeout
    while not condition():
        assert time.monotonic() < end, f"not reached within {timeout:g} s: {what or condition}"
        for node in nodes:
            node.spin_once(0.005)


def work_off(nodes: Sequence[RosNode], rounds: int = 100) -> None:
    """Let `nodes` deal with whatever was under way: in so many turns a full queue is worked off."""
    for _ in range(rounds):
        for node in nodes:
            node.spin_once(0.005)


def spin_for(nodes: Sequence[RosNode], seconds: float) -> None:
    """Let `nodes` work for a while: only to show that something does not happen."""
    end = time.monotonic() + seconds
    spin_until(nodes, lambda: time.monotonic() >= end, seconds + PATIENCE)


def to_time(seconds: float) -> Time:
    """Return a stamp of ROS."""
    whole, rest = divmod(round(seconds * 1e9), 1_000_000_000)
    return Time(sec=whole, nanosec=rest)
