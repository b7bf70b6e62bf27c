"""Which operations of pages move the robot, and who may let them: levels, without a connection."""

from __future__ import annotations

from typing import Any

import pytest

from lupin_engine.plugin.contract import Access
from lupin_engine.plugin.pages import declared_access
from lupin_engine.plugin.registry import load_catalog
from lupin_gateway import protocol
from lupin_gateway.motion import SILENCE_S, MissionLevel, MotionGate
from lupin_gateway.motion.names import MotionNames

NAMES = MotionNames(declared_access(load_catalog()))
DRIVING = MissionLevel("INSPECTING", under_way=True)
HELD = MissionLevel("INSPECTING", under_way=True, held=True)


def published(topic: str, message: Any) -> protocol.PublishMessage:
    return protocol.PublishMessage(topic, message)


@pytest.mark.parametrize(
    ("operation", "name"),
    [
        (protocol.SendGoal("/navigate_to_pose", {}, "1"), "/navigate_to_pose"),
        (protocol.SendGoal("spin", {}, "1"), "/spin"),  # of any action
        (protocol.CallService("/spin/_action/send_goal"), "/spin/_action/send_goal"),
        (protocol.CallService("/lupin/arm/preset"), "/lupin/arm/preset"),
        (protocol.CallService("lupin/gripper/set_angle_with_speed"), "/lupin/gripper/set_angle_with_speed"),
        (protocol.CallService("/lupin/arm/init"), "/lupin/arm/init"),
        (published("/goal_pose", {}), "/goal_pose"),
        (published("/cmd_vel", {"linear": {"x": 0.1}}), "/cmd_vel"),
        (published("/cmd_vel_joy", {"angular": {"z": -0.1}}), "/cmd_vel_joy"),
        (published("/cmd_vel", {"linear": {"x": None}}), "/cmd_vel"),  # what is not clear is no zero
        (published("/cmd_vel", {"linear": "fast"}), "/cmd_vel"),
        (published("/cmd_vel", []), "/cmd_vel"),
    ],
)
def test_what_moves_the_robot(operation: protocol.Operation, name: str) -> None:
    assert NAMES.moved_by(operation) == name


@pytest.mark.parametrize(
    "operation",
    [
        published("/cmd_vel", {"linear": {"x": 0.0, "y": 0}, "angular": {"z": -0.0}}),
        published("/cmd_vel", {"header": {"stamp": {"sec": 7}}, "twist": {"linear": {"x": 0.0}}}),
        published("/cmd_vel_manual", {}),
        published("/lupin/leds/set", {"red": 255}),
        protocol.CallService("/navigate_to_pose/_action/cancel_goal"),
        protocol.CallService("/lupin/arm/library/stop"),
        protocol.CallService("/lupin/arm/set_torque"),
        protocol.CallService("/lupin/arm/calibrate"),
        protocol.CancelGoalById("/navigate_to_pose", "1"),
    ],
)
def test_what_stops_it_or_moves_nothing(operation: protocol.Operation) -> None:
    assert NAMES.moved_by(operation) == ""


def test_without_declarations_only_goals_move() -> None:
    names = MotionNames([Access()])
    assert names.moved_by(published("", {"x": 1.0})) == ""
    assert names.moved_by(protocol.SendGoal("/spin", {}, "1")) == "/spin"


def test_a_stop_refuses_whoever_tells_it() -> None:
    gate = MotionGate()
    gate.settle(False, 0.0)
    assert gate.refusal("a") == ""
    assert gate.settle(True, 0.0)  # of a page of ours, before ROS has heard of it
    assert gate.refusal("a") == "e-stop engaged: release it, then ask again"
    gate.hear_stops(["robot", "hmi"])
    assert not gate.settle(False, 0.0)  # nobody could drive any more
    assert gate.refusal("a") == "e-stop engaged (robot, hmi): release it, then ask again"
    gate.hear_stops([])
    gate.hear_mission(MissionLevel("READY", stopped=True), 0.0)
    gate.settle(False, 0.0)
    assert gate.hindrance == "stop"
    gate.settle(False, SILENCE_S + 0.1)  # an orchestrator that is gone holds nothing for ever
    assert gate.refusal("a") == ""


def test_the_base_is_the_missions_until_that_is_held_and_a_page_takes_it() -> None:
    gate = MotionGate()
    assert gate.take("a") == "no mission is under way: there is nobody to take the base from"
    gate.hear_mission(DRIVING, 0.0)
    assert gate.settle(False, 0.0)
    assert gate.refusal("a") == "a mission has the base (INSPECTING): pause it first"
    assert gate.take("a") == gate.refusal("a")
    gate.hear_mission(HELD, 1.0)
    gate.settle(False, 1.0)
    assert gate.refusal("a") == "a mission is held (INSPECTING): take the base first"
    assert gate.take("a") == ""
    assert not gate.settle(False, 1.0)
    assert (gate.refusal("a"), gate.refusal("b"), gate.take("b")) == ("", "a has the base", "a has the base")
    assert gate.state()["taken_by"] == "a"
    gate.hear_mission(DRIVING, 2.0)  # somebody resumed
    assert gate.settle(False, 2.0)
    assert gate.state() == {"taken_by": "", "hindrance": "mission", "reason": gate.refusal("a"), "stops": []}


def test_a_stop_ends_the_taking() -> None:
    gate = MotionGate()
    gate.hear_mission(HELD, 0.0)
    gate.settle(False, 0.0)
    assert gate.take("a") == ""
    gate.hear_stops(["hmi"])
    assert gate.settle(False, 0.0)
    gate.hear_stops([])
    gate.settle(False, 0.0)
    assert gate.refusal("a") == "a mission is held (INSPECTING): take the base first"


def test_a_silent_orchestrator_holds_the_base_as_a_pause_does() -> None:
    gate = MotionGate()
    gate.hear_mission(DRIVING, 0.0)
    gate.settle(False, SILENCE_S + 0.1)
    assert gate.refusal("a") == "a mission's orchestrator is silent (INSPECTING): take the base first"
    assert gate.take("a") == ""
    assert gate.refusal("a") == ""
