"""The driver of plugin `perception`: polls ConfirmTag until a tag is seen, and reports discovered tags.

An attempt polls for `within` seconds, then fails with `visual_confirm_missed`; a failed call ends it at once
(`confirm_failed`). Discovered tags without a pose, or in another frame than `map`, are dropped with a
warning.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

from lupin_engine.errors import shortened
from lupin_engine.plugin import Outlet, seconds_of
from lupin_greenhouse import frame_name
from lupin_msgs.msg import DiscoveredTags
from lupin_msgs.srv import ConfirmTag
from lupin_perception.discovered import records
from lupin_perception.sightings import MAP
from lupin_ros.adapter import (
    CallFailure,
    Done,
    Failed,
    Qos,
    RosNode,
    ServiceDriver,
    ServiceOperation,
    WarnOnce,
)

#: Seconds from an answer "not seen" to the next question, as long as the attempt has time left.
ASK_AGAIN_S = 0.25
#: The reason of an answer that gives none.
NOT_SEEN = "visual_confirm_missed"


class PerceptionClient(ServiceDriver):
    """The driver of plugin `perception`."""

    def __init__(self, ros: RosNode, outlet: Outlet, parameters: Mapping[str, Any]) -> None:
        service = ros.service(ConfirmTag, parameters["visual_confirmation_service"])
        super().__init__("perception", outlet, {"confirm_tag": ServiceOperation(service, _request, _outcome)})
        # A parameter of missions that confirm a tag before they read it; other missions do not wait for this.
        self._required = bool(parameters.get("require_visual_confirmation", False))
        self._ros = ros
        self._began: dict[str, float] = {}
        #: Why the tag of each attempt was not seen, as of its last answer.
        self._reasons: dict[str, str] = {}
        self._values = outlet
        self._warn = WarnOnce(ros.log)
        self._closed = False
        topic = parameters["discovered_tags_topic"]
        ros.subscribe(DiscoveredTags, topic, Qos.LATCHED, self._on_discovered)

    def missing(self) -> list[str]:
        """Return the service while it cannot be reached and a mission requires it."""
        return super().missing() if self._required else []

    def start(self, attempt: str, operation: str, arguments: Mapping[str, Any]) -> None:
        """Ask for the tag."""
        self._began[attempt] = self._ros.elapsed()
        super().start(attempt, operation, arguments)

    def cancel(self, attempt: str) -> None:
        """Stop asking."""
        self._began.pop(attempt, None)
        self._reasons.pop(attempt, None)
        super().cancel(attempt)

    def _answered(
        self,
        attempt: str,
        operation: ServiceOperation,
        arguments: Mapping[str, Any],
        answer: ConfirmTag.Response | CallFailure,
    ) -> None:
        """Take an answer; "not seen" is asked again while the attempt has time left.

        A camera needs some frames, and the robot may still swing. The answer's reason is reported as
        progress, so that a timeout during the next question keeps it.
        """
        left = self._began[attempt] + arguments.get("within", 0.0) - self._ros.elapsed()
        if not isinstance(answer, CallFailure) and not answer.detected and left > ASK_AGAIN_S:
            again = partial(self._ask, attempt, operation, arguments, operation.request(arguments))
            self._calls[attempt] = self._ros.call_later(ASK_AGAIN_S, again)
            self._report(attempt, answer.error_message or NOT_SEEN)
            return
        del self._began[attempt]
        self._reasons.pop(attempt, None)
        super()._answered(attempt, operation, arguments, answer)

    def _report(self, attempt: str, reason: str) -> None:
        """Report a new reason why the tag is not seen."""
        if self._reasons.get(attempt) != reason:
            self._reasons[attempt] = reason
            self._values.progress(attempt, reason)

    def close(self) -> None:
        """Report nothing more."""
        self._closed = True
        super().close()

    def _on_discovered(self, message: DiscoveredTags) -> None:
        """Report the whole list, as of its stamp: it is latched, and may be older than the mission."""
        frame = frame_name(message.header.frame_id)
        if frame not in ("", MAP):
            self._warn(f"tags in frame {shortened(frame)!r} ignored, expected {MAP!r}")
            return
        placed, others = records(message)
        for tag_id in others:
            self._warn(f"tag {shortened(tag_id)!r} left out: it has no pose yet")
        if not self._closed:
            self._values.value("tags.discovered", placed, self._time_of(message))

    def _time_of(self, message: DiscoveredTags) -> float:
        """Return the stamp; without one, the time of receipt."""
        return seconds_of(message.header.stamp) or self._ros.now()


def _request(arguments: Mapping[str, Any]) -> ConfirmTag.Request:
    return ConfirmTag.Request(expected_tag_id=arguments["tag_id"])


def _outcome(_: Mapping[str, Any], answer: ConfirmTag.Response | CallFailure) -> Done | Failed:
    if isinstance(answer, CallFailure):
        return Failed("confirm_failed", f"{answer.code}: {answer.detail}")
    if answer.detected:
        return Done({"confidence": float(answer.detection_confidence)})
    return Failed("visual_confirm_missed", answer.error_message or NOT_SEEN)
