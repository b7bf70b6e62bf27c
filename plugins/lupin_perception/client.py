"""Visual confirmation over ROS: one call of ConfirmTag for each attempt."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from lupin_engine.middleware.node import Failure, RosNode
from lupin_engine.middleware.service_driver import Done, Failed, ServiceDriver, ServiceOperation
from lupin_engine.plugin.contract import Outlet
from lupin_msgs.srv import ConfirmTag


class PerceptionClient(ServiceDriver):
    """The driver of plugin `perception`."""

    def __init__(self, ros: RosNode, outlet: Outlet, parameters: Mapping[str, Any]) -> None:
        service = ros.service(ConfirmTag, parameters["visual_confirmation_service"])
        super().__init__("perception", outlet, {"confirm_tag": ServiceOperation(service, _request, _outcome)})
        # A parameter of the missions that look before they read; without such a mission nobody waits for us.
        self._required = bool(parameters.get("require_visual_confirmation", False))

    def missing(self) -> list[str]:
        """Name the service while it cannot be reached and a mission insists on it."""
        return super().missing() if self._required else []


def _request(arguments: Mapping[str, Any]) -> ConfirmTag.Request:
    return ConfirmTag.Request(expected_tag_id=arguments["tag_id"])


def _outcome(answer: ConfirmTag.Response | Failure) -> Done | Failed:
    if isinstance(answer, Failure):
        return Failed("confirm_failed", f"{answer.code}: {answer.detail}")
    if answer.detected:
        return Done({"confidence": float(answer.detection_confidence)})
    return Failed("visual_confirm_missed", answer.error_message or "visual_confirm_missed")
