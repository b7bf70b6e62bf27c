"""A robot is a ROS namespace: what it may be called, and what follows from it."""

from __future__ import annotations

from pathlib import Path

import pytest

from lupin_engine.errors import UsageError
from lupin_engine.plugin import COMMON_NAMES, name_of, read_robot, robot_namespace, state_key
from lupin_engine.runtime import journal_folder


@pytest.mark.parametrize("text", ["robot2", "/robot2"])
def test_a_slash_before_it_changes_nothing(text: str) -> None:
    assert read_robot(text) == robot_namespace({"LUPIN_ROBOT": text}) == "/robot2"


@pytest.mark.parametrize(
    "text", ["", "/", "2robot", "robot-2", "robot 2", "robot2/", "a//b", "é", "~/a", "r" * 101, "a\n"]
)
def test_what_is_no_namespace_is_told(text: str) -> None:
    advice = "use words of ASCII letters, digits and _ that begin with no digit, joined by /, such as robot2"
    with pytest.raises(UsageError) as refused:
        read_robot(text)
    assert str(refused.value) == f"--robot {text!r} is no ROS namespace: {advice}"
    if text:
        with pytest.raises(UsageError) as refused:
            robot_namespace({"LUPIN_ROBOT": text})
        assert str(refused.value) == f"LUPIN_ROBOT {text!r} is no ROS namespace: {advice}"


def test_only_the_common_names_are_shared() -> None:
    """Without a robot every name is as it was written."""
    assert [name_of("", name) for name in ("/mission/start", "map")] == ["/mission/start", "map"]
    for name in ("/navigate_to_pose", "navigate_to_pose"):
        assert name_of("/fleet/robot2", name) == "/fleet/robot2/navigate_to_pose"
    assert [name_of("/robot2", name) for name in COMMON_NAMES] == ["/clock", "/parameter_events", "/rosout"]


def test_each_robot_of_a_domain_keeps_its_own_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    monkeypatch.setenv("ROS_DOMAIN_ID", "7")
    monkeypatch.delenv("LUPIN_ROBOT", raising=False)
    assert state_key() == "7"
    assert journal_folder().name == "domain-7"
    assert journal_folder(robot="/fleet/robot2").name == "domain-7-fleet-robot2"
    monkeypatch.setenv("LUPIN_ROBOT", "robot2")
    assert journal_folder().name == "domain-7-robot2"
    assert journal_folder(domain=8, robot="").name == "domain-8"
