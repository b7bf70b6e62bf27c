"""Whether a mission runs: an operator's sequences must not move the arm of a robot that drives by itself."""

from __future__ import annotations

from collections.abc import Callable

from lupin_engine.ros.adapter.node import Qos, RosNode
from lupin_greenhouse.mission import SILENCE_S, is_under_way
from lupin_msgs.msg import MissionState


class Mission:
    """Listens to the orchestrator; `began(reason)` is called when a mission has begun."""

    def __init__(self, ros: RosNode, topic: str) -> None:
        self._ros = ros
        self._state = ""
        self._heard = float("-inf")
        self._listeners: list[Callable[[str], None]] = []
        ros.subscribe(MissionState, topic, Qos.LATCHED, self._on_state)

    def listen(self, began: Callable[[str], None]) -> None:
        """Call `began(reason)` whenever a mission begins."""
        self._listeners.append(began)

    def refusal(self) -> str | None:
        """Say why the arm is not to be moved by hand now; None while no mission runs."""
        fresh = self._ros.elapsed() - self._heard <= SILENCE_S
        if fresh and is_under_way(self._state):
            return f"a mission is running ({self._state}); abort it or wait for its end"
        return None

    def _on_state(self, message: MissionState) -> None:
        before = self.refusal()
        self._state, self._heard = message.lifecycle_state, self._ros.elapsed()
        now = self.refusal()
        if before is None and now is not None:
            for listener in self._listeners:
                listener(now)
