"""The driver of plugin `arm`: sends presets without waiting for an answer; a failure is logged only."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

from lupin_engine.plugin import Outlet
from lupin_msgs.srv import SetArmPreset
from lupin_ros.adapter import CallFailure, RosNode

#: Timeout of a preset, in seconds. The server answers when it has sent the motion, not when the arm arrives.
CALL_DEADLINE_S = 5.0
#: Period of the warning about a missing server, in seconds.
WARNING_PERIOD_S = 10.0


class ArmClient:
    """The driver; `plugin.contract.Driver` has the contract of each call."""

    def __init__(self, ros: RosNode, outlet: Outlet, parameters: Mapping[str, Any]) -> None:
        self._ros = ros
        self._enabled = bool(parameters["arm_patrol_enabled"])
        self._name = parameters["arm_preset_service"]
        self._service = ros.service(SetArmPreset, self._name)
        self._warned_at: float | None = None

    def missing(self) -> list[str]:
        """Return nothing: a mission runs without an arm."""
        return []

    def start(self, attempt: str, operation: str, arguments: Mapping[str, Any]) -> None:
        """Raise ValueError: this plugin has no operations."""
        raise ValueError(f"arm has no operation {operation!r}")

    def cancel(self, attempt: str) -> None:
        """Do nothing: there are no attempts."""

    def act(self, action: str, arguments: Mapping[str, Any]) -> None:
        """Send the arm to a preset, if missions may move it and the server is available (else warn).

        Raises:
            ValueError: this is not the action `preset`.
        """
        if action != "preset":
            raise ValueError(f"arm has no action {action!r}")
        if not self._enabled:
            return
        name = arguments["name"]
        if not self._service.ready():
            self._warn_unreachable(name)
            return
        request = SetArmPreset.Request(name=name)
        self._service.call(request, CALL_DEADLINE_S, partial(self._on_answer, name))

    def close(self) -> None:
        """Do nothing: answers are only logged."""

    def _on_answer(self, name: str, answer: SetArmPreset.Response | CallFailure) -> None:
        if isinstance(answer, CallFailure):
            reason = f"{answer.code}: {answer.detail}"
            self._ros.log.warning("arm preset not answered", preset=name, reason=reason)
        elif not answer.success:
            self._ros.log.warning("arm preset refused", preset=name, reason=answer.message)

    def _warn_unreachable(self, name: str) -> None:
        """Warn, at most once in `WARNING_PERIOD_S`."""
        now = self._ros.now()
        # A clock that was set back must not silence the warning.
        if self._warned_at is None or not 0.0 <= now - self._warned_at < WARNING_PERIOD_S:
            self._warned_at = now
            self._ros.log.warning("arm preset server not there", service=self._name, preset=name)
