"""Whether there is a real arm: what only makes sense with one is refused in a simulation."""

from __future__ import annotations

from mirte_msgs.srv import SetServoOffset

from lupin_arm.node.refused import Refused
from lupin_engine.ros.adapter.node import RosNode

#: Where the vendor's servos have their services and topics.
SERVOS = "/io/servo/hiwonder"
#: A service that only real servos have; the simulated arm has nothing to calibrate.
SIGN = f"{SERVOS}/shoulder_lift/_set_offset"


class Hardware:
    """The gate of what needs real servos."""

    def __init__(self, ros: RosNode, said: str) -> None:
        """`said` is the parameter: real, simulated, or auto: real where the servos' own services are."""
        self._said = said
        self._sign = ros.service(SetServoOffset, SIGN) if said == "auto" else None

    @property
    def present(self) -> bool:
        """Whether this is a real robot."""
        return self._said == "real" if self._sign is None else self._sign.ready()

    def require(self, what: str) -> None:
        """Refuse `what` where there are no real servos.

        Raises:
            Refused: this is a simulation, or the robot's drivers are not up.
        """
        if self.present:
            return
        why = f"there is no service {SIGN}" if self._sign else "parameter hardware is simulated"
        raise Refused(f"{what} needs the real servos, and this is a simulation: {why}")
