"""The orchestrator as heard by who moves the robot for it: while a mission is under way it must speak."""

from __future__ import annotations

from collections.abc import Callable

from lupin_engine.plugin.contract import Parameter
from lupin_engine.plugin.types import number_in
from lupin_engine.ros.adapter.host import Every, Repeater
from lupin_greenhouse.mission import is_under_way

#: Looks for a state within the timeout: silence is noticed at most one of them later.
LOOKS = 8

#: The parameter of every node that has a watchdog.
TIMEOUT = "orchestrator_timeout_s"
PARAMETERS = {
    TIMEOUT: Parameter(
        number_in("s"),
        2.0,
        "what a mission moves is stopped when the orchestrator is silent for so long; 0: never",
        minimum=0.0,
        maximum=60.0,
    )
}


class OrchestratorWatchdog:
    """Tells that the orchestrator has fallen silent with a mission under way; once for each silence.

    It is killed, hung, or on the far side of a broken link: nobody would cancel what it has begun. Real
    time, also where the robot's is simulated, because the state is told by real time.
    """

    def __init__(self, every: Every, timeout: float, lost: Callable[[str], None]) -> None:
        """`every` starts a repeating timer; `lost(reason)` comes after `timeout` s of silence; 0: never."""
        self._timeout = timeout
        self._lost = lost
        self._missed = 0
        self._looking = Repeater(every, timeout / LOOKS, self._look)

    def heard(self, lifecycle_state: str) -> None:
        """Take a published state."""
        self._missed = 0
        if self._timeout and is_under_way(lifecycle_state):
            self._looking.start()
        else:
            self._looking.stop()

    def _look(self) -> None:
        """Count looks and not seconds: a node that was busy itself hears what has waited before the next."""
        self._missed += 1
        if self._missed > LOOKS:
            self._looking.stop()
            self._lost(f"the orchestrator is silent for {self._timeout:g} s")
