"""Visual confirmation over ROS: one call of ConfirmTag for each attempt."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

from lupin_engine.plugin.contract import Outlet
from lupin_engine.ros.middleware import Call, Failure, RosNode
from lupin_msgs.srv import ConfirmTag

#: When a call counts as lost, in seconds. The mission's own timeout is shorter and cancels the attempt; this
#: one is for a mission that says `timeout: never`.
CALL_DEADLINE_S = 60.0


class PerceptionClient:
    """The driver of plugin `perception`: see `Driver` for what every call promises."""

    def __init__(self, ros: RosNode, outlet: Outlet, parameters: Mapping[str, Any]) -> None:
        self._outlet = outlet
        self._name = parameters["visual_confirmation_service"]
        # A parameter of the missions that look before they read; without such a mission nobody waits for us.
        self._required = bool(parameters.get("require_visual_confirmation", False))
        self._service = ros.service(ConfirmTag, self._name)
        self._calls: dict[str, Call] = {}

    def missing(self) -> list[str]:
        """Name the service while it cannot be reached and a mission insists on it."""
        return [f"service {self._name}"] if self._required and not self._service.ready() else []

    def start(self, attempt: str, operation: str, arguments: Mapping[str, Any]) -> None:
        """Begin `confirm_tag`."""
        if operation != "confirm_tag":
            raise ValueError(f"perception has no operation {operation!r}")
        request = ConfirmTag.Request(expected_tag_id=arguments["tag_id"])
        self._calls[attempt] = self._service.call(request, CALL_DEADLINE_S, partial(self._on_answer, attempt))
        self._outlet.accepted(attempt)  # a service has no word for it: what was sent is taken

    def cancel(self, attempt: str) -> None:
        """Drop the answer; a service cannot be told to stop."""
        call = self._calls.pop(attempt, None)
        if call is not None:
            call.cancel()
            self._outlet.cancelled(attempt)

    def act(self, action: str, arguments: Mapping[str, Any]) -> None:
        """Nothing: this plugin has no actions."""
        raise ValueError(f"perception has no action {action!r}")

    def close(self) -> None:
        """Drop every answer still to come."""
        for call in self._calls.values():
            call.cancel()
        self._calls.clear()

    def _on_answer(self, attempt: str, answer: ConfirmTag.Response | Failure) -> None:
        del self._calls[attempt]
        if isinstance(answer, Failure):
            self._outlet.failed(attempt, "confirm_failed", f"{answer.code}: {answer.detail}")
        elif answer.detected:
            self._outlet.done(attempt, {"confidence": float(answer.detection_confidence)})
        else:
            self._outlet.failed(
                attempt, "visual_confirm_missed", answer.error_message or "visual_confirm_missed"
            )
