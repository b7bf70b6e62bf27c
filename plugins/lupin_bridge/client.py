"""The driver of plugin `bridge`: one service call for each attempt to read a tag."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from lupin_bridge.catalog import SCAN_FAILED, UNKNOWN_TAG
from lupin_engine.plugin import Outlet, seconds_of
from lupin_msgs.msg import TagReading
from lupin_msgs.srv import GetTagReading
from lupin_ros.adapter import CallFailure, Done, Failed, RosNode, ServiceDriver, ServiceOperation


class BridgeClient(ServiceDriver):
    """The driver of plugin `bridge`."""

    def __init__(self, ros: RosNode, outlet: Outlet, parameters: Mapping[str, Any]) -> None:
        service = ros.service(GetTagReading, parameters["bridge_service_name"])
        super().__init__("bridge", outlet, {"read_tag": ServiceOperation(service, _request, _outcome)})


def _request(arguments: Mapping[str, Any]) -> GetTagReading.Request:
    return GetTagReading.Request(tag_id=arguments["tag_id"])


def _outcome(arguments: Mapping[str, Any], answer: GetTagReading.Response | CallFailure) -> Done | Failed:
    if isinstance(answer, CallFailure):
        return Failed(SCAN_FAILED.name, answer.detail)
    if answer.status == GetTagReading.Response.STATUS_OK:
        if answer.reading.tag_id not in (
            arguments["tag_id"],
            "",
        ):  # the reading would be attributed to the wrong tag
            return Failed(SCAN_FAILED.name, f"the bridge answered with tag {answer.reading.tag_id!r}")
        answer.reading.tag_id = arguments["tag_id"]
        return Done({"reading": plain_reading(answer.reading)})
    code = UNKNOWN_TAG if answer.status == GetTagReading.Response.STATUS_UNKNOWN_TAG else SCAN_FAILED
    return Failed(code.name, answer.error_message or f"bridge_status_{answer.status}")


def plain_reading(message: TagReading) -> dict[str, Any]:
    """Return a TagReading as plain data of type `reading`; sensors without a finite number are left out."""
    measured = [sensor for sensor in message.readings if math.isfinite(sensor.value)]
    return {
        "tag_id": message.tag_id,
        "stamp": seconds_of(message.stamp),
        "sim_time_of_day_seconds": message.sim_time_of_day_seconds,
        "readings": [{"name": sensor.name, "value": sensor.value} for sensor in measured],
    }
