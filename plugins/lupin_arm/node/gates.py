"""Preconditions of some requests: real servos, and no active mission.

A simulation has nothing to calibrate; and an operator's sequences must not move the arm of a robot that
drives by itself.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from mirte_msgs.srv import SetServoOffset

from lupin_arm.node.serving import ArmRequestRefused
from lupin_greenhouse import SILENCE_S, SilenceWatchdog, is_under_way
from lupin_msgs.msg import MissionState
from lupin_ros.adapter import Qos, RosNode

#: Where the vendor's servos have their services and topics.
SERVOS = "/io/servo/hiwonder"
#: A service that only real servos have; the simulated arm has nothing to calibrate.
SIGN = f"{SERVOS}/shoulder_lift/_set_offset"


class HardwareGate:
    """Whether the servos are real."""

    def __init__(self, ros: RosNode, said: str) -> None:
        """`said` is the parameter: real, simulated, or auto (real if the vendor's service `SIGN` exists)."""
        self._said = said
        self._sign = ros.service(SetServoOffset, SIGN) if said == "auto" else None

    @property
    def present(self) -> bool:
        """Whether this is a real robot."""
        return self._said == "real" if self._sign is None else self._sign.ready()

    def require(self, what: str) -> None:
        """Refuse `what` without real servos.

        Raises:
            ArmRequestRefused: this is a simulation, or the robot's drivers are not up.
        """
        if self.present:
            return
        why = f"there is no service {SIGN}" if self._sign else "parameter hardware is simulated"
        raise ArmRequestRefused(f"{what} needs the real servos, and this is a simulation: {why}")


class MissionGate:
    """Whether a mission is active, by the orchestrator's published state."""

    def __init__(self, ros: RosNode, topic: str, watchdog: SilenceWatchdog) -> None:
        """`watchdog` gets every message."""
        self._ros = ros
        self._watchdog = watchdog
        self._state = ""
        self._heard = float("-inf")
        self._listeners: list[Callable[[str], None]] = []
        ros.subscribe(MissionState, topic, Qos.LATCHED, self._on_state)

    def listen(self, began: Callable[[str], None]) -> None:
        """Call `began(reason)` whenever a mission begins."""
        self._listeners.append(began)

    def refusal(self) -> str | None:
        """Return why the arm may not be moved by hand now; None while no mission is active."""
        fresh = self._ros.elapsed() - self._heard <= SILENCE_S
        if fresh and is_under_way(self._state):
            return f"a mission is running ({self._state}); abort it or wait for its end"
        return None

    def _on_state(self, message: MissionState) -> None:
        self._watchdog.heard(is_under_way(message.lifecycle_state))
        before = self.refusal()
        self._state, self._heard = message.lifecycle_state, self._ros.elapsed()
        now = self.refusal()
        if before is None and now is not None:
            for listener in self._listeners:
                listener(now)


class Gates(NamedTuple):
    """The preconditions of a calibration."""

    hardware: HardwareGate
    mission: MissionGate

    def require(self) -> None:
        """Check them.

        Raises:
            ArmRequestRefused: this is a simulation, or a mission is active.
        """
        self.hardware.require("calibration")
        reason = self.mission.refusal()
        if reason is not None:
            raise ArmRequestRefused(reason)
