"""The node `greenhouse_bridge`: serves `~/get_tag_reading`, the only source of sensor data for missions."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence

from lupin_bridge.backend import Clocks, ReadingFailed, UnknownTag
from lupin_bridge.catalog import NODE_PARAMETERS as PARAMETERS
from lupin_bridge.choice import check, make_backend
from lupin_engine.errors import Severity
from lupin_msgs.msg import SensorReading, TagReading
from lupin_msgs.srv import GetTagReading
from lupin_ros.adapter import RosNode

__all__ = ["PARAMETERS", "BridgeNode", "check", "main"]

#: As in GetTagReading.srv: interfaces that were generated from an earlier one lack the constant.
STATUS_READING_FAILED = 2

#: Requests older than this, in seconds, get no reading: they waited out a broken link, nobody needs it.
STALE_AFTER_S = 10.0


class BridgeNode:
    """Answers requests for readings; a failing backend gives an error status and never ends the node."""

    def __init__(self, ros: RosNode) -> None:
        self._ros = ros
        self._thread = threading.get_ident()
        parameters = ros.parameters()
        self._backend = make_backend(parameters, Clocks(ros.now, ros.elapsed), self._report)
        name = "~/get_tag_reading"
        ros.serve(GetTagReading, name, self._read, stale_after=STALE_AFTER_S, refuse=_refuse)
        ros.log.info("greenhouse ready", backend=parameters["backend"], tags=len(self._backend.tags))

    def close(self) -> None:
        """Close the backend."""
        self._backend.close()

    def _report(self, severity: Severity, text: str) -> None:
        """Log on the node's thread; backends have threads of their own."""
        log = self._ros.log
        say: Callable[[str], None] = {Severity.INFO: log.info, Severity.WARN: log.warning}.get(
            severity, log.error
        )
        if threading.get_ident() == self._thread:
            say(text)
        else:
            self._ros.post(lambda: say(text))

    def _read(
        self, request: GetTagReading.Request, response: GetTagReading.Response
    ) -> GetTagReading.Response:
        try:
            values = self._backend.read(request.tag_id)
        except UnknownTag as error:
            response.status = GetTagReading.Response.STATUS_UNKNOWN_TAG
            response.error_message = str(error)
        except ReadingFailed as error:
            self._ros.log.warning(str(error))
            response.status = STATUS_READING_FAILED
            response.error_message = str(error)
        else:
            response.status = GetTagReading.Response.STATUS_OK
            response.reading = TagReading(
                tag_id=request.tag_id,
                stamp=self._ros.stamp(),
                sim_time_of_day_seconds=values.time_of_day,
                readings=[SensorReading(name=one.sensor, value=one.value) for one in values.sensors],
            )
        return response


def _refuse(response: GetTagReading.Response, reason: str) -> GetTagReading.Response:
    response.status, response.error_message = STATUS_READING_FAILED, reason
    return response


def main(arguments: Sequence[str]) -> int:
    """Run the node until it is stopped; `arguments` are the ROS arguments."""
    with RosNode("greenhouse_bridge", arguments, PARAMETERS, managed=True) as ros:
        bridge = BridgeNode(ros)
        ros.on_stop(bridge.close)
        ros.spin()
    return 0
