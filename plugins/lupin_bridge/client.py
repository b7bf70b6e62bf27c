"""The engine's side of the bridge: one service call for each attempt to read a tag."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from lupin_bridge.catalog import SCAN_FAILED, UNKNOWN_TAG
from lupin_engine.plugin.contract import Outlet
from lupin_engine.ros.middleware import Call, Failure, RosNode
from lupin_msgs.msg import TagReading
from lupin_msgs.srv import GetTagReading

#: Seconds after which a call is given up. Missions set their own, shorter timeouts.
CALL_DEADLINE_S = 30.0


class BridgeClient:
    """The driver of plugin `bridge`: see `Driver` for what every call promises."""

    def __init__(self, ros: RosNode, outlet: Outlet, parameters: Mapping[str, Any]) -> None:
        self._outlet = outlet
        self._service = ros.service(GetTagReading, parameters["bridge_service_name"])
        self._calls: dict[str, Call] = {}

    def missing(self) -> list[str]:
        """Name the service while it cannot be reached."""
        return [] if self._service.ready() else [f"service {self._service.name}"]

    def start(self, attempt: str, operation: str, arguments: Mapping[str, Any]) -> None:
        """Begin `read_tag`."""
        if operation != "read_tag":
            raise ValueError(f"bridge has no operation {operation!r}")
        request = GetTagReading.Request(tag_id=arguments["tag_id"])
        self._outlet.accepted(attempt)  # a service has no acceptance of its own
        self._calls[attempt] = self._service.call(
            request, CALL_DEADLINE_S, lambda answer: self._answered(attempt, answer)
        )

    def cancel(self, attempt: str) -> None:
        """End the attempt here; a service call cannot be recalled, its answer is dropped."""
        call = self._calls.pop(attempt, None)
        if call is not None:
            call.cancel()
            self._outlet.cancelled(attempt)

    def act(self, action: str, arguments: Mapping[str, Any]) -> None:
        """Refuse: this plugin has no actions."""
        raise ValueError(f"bridge has no action {action!r}")

    def close(self) -> None:
        """Drop every answer that is still to come."""
        for call in self._calls.values():
            call.cancel()
        self._calls.clear()

    def _answered(self, attempt: str, answer: GetTagReading.Response | Failure) -> None:
        del self._calls[attempt]
        if isinstance(answer, Failure):
            self._outlet.failed(attempt, SCAN_FAILED.name, answer.detail)
        elif answer.status == GetTagReading.Response.STATUS_OK:
            self._outlet.done(attempt, {"reading": plain_reading(answer.reading)})
        else:
            code = UNKNOWN_TAG if answer.status == GetTagReading.Response.STATUS_UNKNOWN_TAG else SCAN_FAILED
            self._outlet.failed(attempt, code.name, answer.error_message or f"bridge_status_{answer.status}")


def plain_reading(message: TagReading) -> dict[str, Any]:
    """Return a TagReading as plain data of type `reading`."""
    return {
        "tag_id": message.tag_id,
        "stamp": message.stamp.sec + message.stamp.nanosec * 1e-9,
        "sim_time_of_day_seconds": message.sim_time_of_day_seconds,
        "readings": [{"name": sensor.name, "value": sensor.value} for sensor in message.readings],
    }
