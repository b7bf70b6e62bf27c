"""The node `greenhouse_bridge`: the service `~/get_tag_reading` over the greenhouse simulator."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from lupin_bridge.greenhouse import Greenhouse, ReadingFailed, Settings, UnknownTag
from lupin_engine.middleware.node import RosNode
from lupin_engine.plugin.contract import Parameter
from lupin_engine.plugin.types import INTEGER, NUMBER, TEXT
from lupin_msgs.msg import SensorReading, TagReading
from lupin_msgs.srv import GetTagReading

#: Answered when a known tag cannot be read; the interface has no constant for it, clients read the message.
STATUS_READING_FAILED = 2

#: Requests older than this, in seconds, are not answered: they waited out a broken link, nobody listens.
STALE_AFTER_S = 10.0

PARAMETERS = {
    "tag_file": Parameter(TEXT, "", "layout of the greenhouse, JSON; empty: the simulator's own"),
    "tag_locations_file": Parameter(
        TEXT, "", "the layout under the name that the other nodes know it by; read where tag_file is empty"
    ),
    "sim_config_file": Parameter(TEXT, "", "climate of the greenhouse, YAML; empty: the simulator's own"),
    "debug_time_of_day": Parameter(
        NUMBER, -1.0, "hours; from 0 on the time of day stands still there", minimum=-1.0, maximum=24.0
    ),
    "debug_seed": Parameter(
        INTEGER, -1, "from 0 on the noise is repeatable and the time of day stands still", minimum=-1
    ),
    "speedup_factor": Parameter(
        NUMBER, 0.0, "above 0: greenhouse seconds in a second, instead of the climate file's", minimum=0.0
    ),
}


def _settings(parameters: dict[str, Any]) -> Settings:
    """Return what the greenhouse is made of: every node must load the same layout, whatever it is called."""
    layout = parameters.pop("tag_locations_file")
    return Settings(**{**parameters, "tag_file": parameters["tag_file"] or layout})


class BridgeNode:
    """Answers requests for readings; a failing simulator is an answer too, never the end of the node."""

    def __init__(self, ros: RosNode) -> None:
        self._ros = ros
        self._greenhouse = Greenhouse(_settings(ros.parameters()))
        ros.serve(GetTagReading, "~/get_tag_reading", self._read, stale_after=STALE_AFTER_S)
        ros.log.info("greenhouse ready", tags=len(self._greenhouse.tags))
        for tag, sensors in self._greenhouse.unmeasurable().items():
            ros.log.warning("tag cannot be read: no climate for its sensors", tag=tag, sensors=sensors)

    def _read(
        self, request: GetTagReading.Request, response: GetTagReading.Response
    ) -> GetTagReading.Response:
        try:
            values = self._greenhouse.read(request.tag_id)
        except UnknownTag as error:
            response.status = GetTagReading.Response.STATUS_UNKNOWN_TAG
            response.error_message = str(error)
        except ReadingFailed as error:
            self._ros.log.error(str(error))
            response.status = STATUS_READING_FAILED
            response.error_message = str(error)
        else:
            response.status = GetTagReading.Response.STATUS_OK
            response.reading = TagReading(
                tag_id=request.tag_id,
                stamp=self._ros.stamp(),
                sim_time_of_day_seconds=values.time_of_day,
                readings=[SensorReading(name=name, value=value) for name, value in values.sensors],
            )
        return response


def main(arguments: Sequence[str]) -> int:
    """Run the node until it is told to stop; `arguments` are the ROS arguments."""
    ros = RosNode("greenhouse_bridge", arguments, PARAMETERS)
    try:
        BridgeNode(ros)
        ros.spin()
    finally:
        ros.close()
    return 0
