"""Presets of the arm: sent when missions may move it, and never in the way of a mission."""

from __future__ import annotations

from typing import Any

import pytest

pytest.importorskip("rclpy", reason="ROS 2 is not installed here")

from lupin_arm.catalog import PLUGIN
from lupin_arm.client import WARNING_PERIOD_S, ArmClient
from lupin_msgs.srv import SetArmPreset
from lupin_ros.adapter.node import CallFailure
from tests.plugins.fakes import FakeOutlet, FakeRos, defaults


def bench(**changed: Any) -> tuple[FakeRos, ArmClient]:
    ros = FakeRos()
    parameters = defaults(PLUGIN, **{"arm_patrol_enabled": True, **changed})
    return ros, ArmClient(ros, FakeOutlet(), parameters)  # type: ignore[arg-type]


def test_a_preset_is_sent_by_name() -> None:
    ros, client = bench()
    client.act("preset", {"name": "inspect"})
    assert [call.request.name for call in ros.remote.calls] == ["inspect"]


def test_by_default_missions_do_not_move_the_arm() -> None:
    assert PLUGIN.parameters["arm_patrol_enabled"].default is False
    ros, client = bench(arm_patrol_enabled=False)
    client.act("preset", {"name": "inspect"})
    assert ros.remote.calls == []
    assert ros.log.warnings == []


def test_a_server_that_is_not_there_is_warned_about_now_and_then() -> None:
    ros, client = bench()
    ros.remote.up = False
    for _ in range(3):
        client.act("preset", {"name": "home"})
        ros.pass_time(WARNING_PERIOD_S / 2)
    assert len(ros.log.warnings) == 2
    assert ros.remote.calls == []
    ros.time -= 1000.0  # a clock that was set back
    client.act("preset", {"name": "home"})
    assert len(ros.log.warnings) == 3


@pytest.mark.parametrize(
    ("answer", "reason"),
    [
        (SetArmPreset.Response(success=False, message="unknown preset"), "unknown preset"),
        (CallFailure("timeout", "no answer"), "timeout: no answer"),
    ],
)
def test_a_preset_that_fails_is_only_a_warning(answer: Any, reason: str) -> None:
    ros, client = bench()
    client.act("preset", {"name": "fold"})
    ros.remote.calls[0].done(answer)
    assert [(d["preset"], d["reason"]) for _, d in ros.log.warnings] == [("fold", reason)]


def test_a_preset_that_is_taken_needs_no_word() -> None:
    ros, client = bench()
    client.act("preset", {"name": "home"})
    ros.remote.calls[0].done(SetArmPreset.Response(success=True))
    assert ros.log.warnings == []


def test_no_mission_waits_for_the_arm() -> None:
    ros, client = bench()
    ros.remote.up = False
    assert client.missing() == []


def test_other_words_are_refused() -> None:
    _, client = bench()
    with pytest.raises(ValueError, match="no action 'wave'"):
        client.act("wave", {})
    with pytest.raises(ValueError, match="no operation 'wave'"):
        client.start("a1", "wave", {})
