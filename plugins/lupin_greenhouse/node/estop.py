"""The emergency stop as received by a node: engaged, released, or silent after periodic messages."""

from __future__ import annotations

from collections.abc import Callable

from std_msgs.msg import Bool

from lupin_engine.ros.adapter.host import Repeater
from lupin_engine.ros.adapter.node import Qos, RosNode

#: What `told` is called with.
ENGAGED, RELEASED, SILENT = "engaged", "", "silent"
#: Looks for a message within the timeout, and looks in a row with one after which silence is a fault: a
#: bridge tells steadily, a panel or a person now and then.
LOOKS, STEADY = 4, 8


class EmergencyStop:
    """Listens to the emergency stop of a robot.

    An emergency stop that was told steadily (in each quarter of the timeout, for twice the timeout) and falls
    silent has lost its bridge: who presses the button now is not heard, and silence is a stop. One that
    speaks only when it is pressed or released is taken at its word. Real time, also where the robot's is
    simulated.
    """

    def __init__(self, ros: RosNode, topic: str, timeout: float, told: Callable[[str], None]) -> None:
        """Call `told` with each message's meaning, and with `SILENT` after `timeout` s of it; 0: never."""
        self._period = timeout / LOOKS
        self._told = told
        self._heard = False
        self._in_a_row = self._missed = 0
        self._looking = Repeater(ros.steady_timer, self._period, self._look)
        ros.subscribe(Bool, topic, Qos.EVENT, self._on_message)

    @property
    def watched(self) -> bool:
        """Whether it was told steadily, so that silence would be a stop."""
        return self._in_a_row >= STEADY

    def close(self) -> None:
        """Wait for nothing any more."""
        self._in_a_row = 0
        self._looking.stop()

    def _on_message(self, message: Bool) -> None:
        self._heard = True
        if self._period:
            self._looking.start()
        self._told(ENGAGED if message.data else RELEASED)

    def _look(self) -> None:
        """Count looks and not seconds: a node that was busy itself hears what has waited before the next."""
        if self._heard:
            self._heard, self._missed = False, 0
            self._in_a_row += 1
            return
        self._missed += 1
        if not self.watched:
            self.close()
        elif self._missed == LOOKS:
            self.close()
            self._told(SILENT)
