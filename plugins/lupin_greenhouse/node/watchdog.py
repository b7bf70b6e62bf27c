"""Who moves the robot for somebody listens whether that one still speaks."""

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
    """Reports that a node has fallen silent while it must speak; once for each silence.

    It was killed, hangs, or is on the far side of a broken link: it would not cancel what it has begun. Real
    time, also where the robot's is simulated, because what is listened to is published by real time.
    """

    def __init__(self, every: Every, timeout: float, lost: Callable[[str], None], node: str) -> None:
        """`every` starts a repeating timer; `lost(reason)` comes after `timeout` s of silence; 0: never."""
        self._timeout = timeout
        self._lost = lost
        self._node = node
        self._missed = 0
        self._looking = Repeater(every, timeout / LOOKS, self._look)

    def heard(self, must_speak: bool) -> None:
        """Take a message; `must_speak`: another one has to follow."""
        self._missed = 0
        if self._timeout and must_speak:
            self._looking.start()
        else:
            self._looking.stop()

    def _look(self) -> None:
        """Count looks and not seconds: a node that was busy itself hears what has waited before the next."""
        self._missed += 1
        if self._missed > LOOKS:
            self._looking.stop()
            self._lost(f"{self._node} is silent for {self._timeout:g} s")
