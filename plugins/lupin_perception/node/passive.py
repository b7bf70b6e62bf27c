"""Reads sensors at known tags while no mission is active, so that maps are never empty; see `idle`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from rclpy.publisher import Publisher

from lupin_msgs.srv import GetTagReading
from lupin_perception.idle import Schedule
from lupin_perception.node import messages
from lupin_perception.registry import Registry
from lupin_ros.adapter import CallFailure, RosNode

#: Seconds that the bridge may take to answer.
ANSWER_S = 5.0


class PassiveObserver:
    """Requests readings from the bridge, and publishes them without a mission; stops when one begins."""

    def __init__(
        self,
        ros: RosNode,
        values: Mapping[str, Any],
        tags: Registry,
        observations: Publisher,
        is_idle: Callable[[], bool],
    ) -> None:
        """`observations` publishes readings; `is_idle` returns whether no mission is active."""
        self._ros, self._tags, self._observations, self._is_idle = ros, tags, observations, is_idle
        self._source: str = values["source_name"]
        self._schedule = Schedule(values["refresh_period_s"])
        self._bridge = ros.service(GetTagReading, values["reading_service"])
        self._logged_absent = False
        ros.timer(values["tick_period_s"], self._tick)

    def _tick(self) -> None:
        tags = [known.id for known in self._tags.discovered()]
        if not tags or not self._is_idle():
            return
        if not self._bridge.ready():
            self._log_absent()
            return
        self._logged_absent = False
        for tag_id in self._schedule.due(tags, self._ros.elapsed()):
            request = GetTagReading.Request(tag_id=tag_id)
            self._bridge.call(request, ANSWER_S, partial(self._on_answer, tag_id))

    def _log_absent(self) -> None:
        if not self._logged_absent:
            self._logged_absent = True
            self._ros.log.warning("tags are known but nobody reads them", missing=self._bridge.name)

    def _on_answer(self, tag_id: str, answer: GetTagReading.Response | CallFailure) -> None:
        now, known = self._ros.elapsed(), self._tags.find(tag_id)
        if isinstance(answer, CallFailure) or known is None or not self._is_idle():
            self._schedule.failed(tag_id, now)  # the mission that has begun reads for itself
        elif answer.status == GetTagReading.Response.STATUS_UNKNOWN_TAG:
            self._schedule.done(tag_id, now)
        elif answer.status != GetTagReading.Response.STATUS_OK or answer.reading.tag_id not in (tag_id, ""):
            self._schedule.failed(tag_id, now)
        else:
            self._schedule.done(tag_id, now)
            answer.reading.tag_id = tag_id
            stamp = self._ros.stamp()
            self._observations.publish(
                messages.reading_observation(known, answer.reading, self._source, stamp)
            )
