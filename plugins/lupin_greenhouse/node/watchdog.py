"""A watchdog for nodes that move something on behalf of another node, such as the orchestrator."""

from __future__ import annotations

from collections.abc import Callable

from lupin_engine.plugin import Parameter, number_in
from lupin_ros.adapter import Every, Repeater

#: Looks for a state within the timeout: silence is noticed at most one of them later.
LOOKS = 8

#: What the node is called that a mission's movers listen to.
WATCHED = "the orchestrator"

#: The parameter of every node that has a watchdog.
WATCHDOG_TIMEOUT = "orchestrator_timeout_s"
WATCHDOG_PARAMETERS = {
    WATCHDOG_TIMEOUT: Parameter(
        number_in("s"),
        2.0,
        "what a mission moves is stopped when the orchestrator is silent for so long; 0: never",
        minimum=0.0,
        maximum=60.0,
    )
}


class SilenceWatchdog:
    """Calls `lost` when a node falls silent while it must speak, once for each silence.

    Such a node was killed, hangs, or its link is broken, so it will not cancel its own motions. Real time,
    also in simulation: the watched node publishes by real time.
    """

    def __init__(self, every: Every, timeout: float, lost: Callable[[str], None], node: str) -> None:
        """`every` starts a repeating timer; `lost(reason)` comes after `timeout` s of silence; 0: never."""
        self._timeout = timeout
        self._lost = lost
        self._node = node
        self._missed = 0
        self._looking = Repeater(every, timeout / LOOKS, self._look)

    def heard(self, must_speak: bool) -> None:
        """Restart the timeout; `must_speak`: another message has to follow, else the watchdog is off."""
        self._missed = 0
        if self._timeout and must_speak:
            self._looking.start()
        else:
            self._looking.stop()

    def _look(self) -> None:
        """Count ticks instead of seconds: after a block of its own the node reads waiting messages first."""
        self._missed += 1
        if self._missed > LOOKS:
            self._looking.stop()
            self._lost(f"{self._node} is silent for {self._timeout:g} s")
