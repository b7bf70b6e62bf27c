"""The driver of plugin `twin`: reports the twin's state as a live value; missions order visits by it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from lupin_engine.plugin import Outlet, seconds_of
from lupin_msgs.msg import TwinState, TwinTagState
from lupin_ros.adapter import Qos, RosNode


class TwinClient:
    """Subscribes only; there are no operations and actions."""

    def __init__(self, ros: RosNode, outlet: Outlet, parameters: Mapping[str, Any]) -> None:
        self._ros = ros
        self._outlet = outlet
        self._closed = False
        ros.subscribe(TwinState, parameters["twin_state_topic"], Qos.LATCHED, self._on_state)

    def missing(self) -> list[str]:
        """Return nothing: a mission runs without the twin."""
        return []

    def start(self, attempt: str, operation: str, arguments: Mapping[str, Any]) -> None:
        """Do nothing: there are no operations."""

    def cancel(self, attempt: str) -> None:
        """Do nothing: there are no attempts."""

    def act(self, action: str, arguments: Mapping[str, Any]) -> None:
        """Do nothing: there are no actions."""

    def close(self) -> None:
        """Report nothing more."""
        self._closed = True

    def _on_state(self, message: TwinState) -> None:
        if not self._closed:
            stamp = seconds_of(message.header.stamp) or self._ros.now()
            self._outlet.value("twin.tags", [_record(tag) for tag in message.tags], stamp)


def _record(tag: TwinTagState) -> dict[str, Any]:
    return {
        "id": tag.tag_id,
        "age": float(tag.stale_seconds),
        "species": tag.species,
        "species_confidence": float(tag.species_confidence),
        "anomaly": tag.anomaly,
        "readings": [{"name": reading.name, "value": reading.value} for reading in tag.readings],
    }
