"""Polls for a server without blocking."""

from __future__ import annotations

from collections.abc import Callable

from lupin_ros.adapter import RosNode

#: Seconds between two looks.
LOOK_S = 0.05


def when_ready(
    ros: RosNode, ready: Callable[[], bool], patience: float, then: Callable[[bool], None]
) -> None:
    """Call `then(True)` as soon as `ready()`, at once or later; `then(False)` after `patience` seconds."""
    if ready():
        then(True)
        return
    looks = 0

    def look() -> None:
        nonlocal looks
        looks += 1
        there = ready()
        if there or looks * LOOK_S >= patience:
            timer.cancel()
            then(there)

    timer = ros.steady_timer(LOOK_S, look)
