"""What must not happen to an arm, over real DDS: a jump, a motion after a stop, a target that is none."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from std_srvs.srv import SetBool, Trigger

from lupin_arm import simulated as simulated_module
from lupin_arm.node import arm as arm_module
from lupin_arm.node import gripper as gripper_module
from lupin_arm.node import torque as torque_module
from lupin_arm.node.operator_services import MOST_WAITING
from lupin_arm.node.serving import ArmRequestRefused
from lupin_arm.presets import PRESETS
from lupin_greenhouse.stops import ROBOT
from lupin_msgs.srv import SaveArmPose
from tests.lupin_ros.plugins.arm.bench import GATE, LIBRARY, POWER, Bench
from tests.lupin_ros.plugins.arm.scene import MakeNode, Scene, late_jaw, near
from tests.lupin_ros.system.wire.wire import Asked
from tests.lupin_ros.world import PATIENCE

ZERO = PRESETS["zero"]
TORQUE = "/lupin/arm/set_torque"


@pytest.fixture(autouse=True)
def own_library(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The operator's own poses stay out of it."""
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))


@pytest.fixture
def bench(make_node: MakeNode, tmp_path: Path) -> Bench:
    return Bench(make_node, tmp_path / "arm_library.json")


# --- power ---------------------------------------------------------------------------------------------


def test_servos_get_no_power_while_it_is_not_told_where_they_are(bench: Bench) -> None:
    """Their controller still has its old target: what cannot be pinned would jump there."""
    assert bench.call(SetBool, TORQUE, data=False).success
    bench.drivers.telling = False
    here = {"name": "x", "from_current": True, "overwrite": True}
    save = f"{LIBRARY}/save_pose"
    bench.until(lambda: not bench.call(SaveArmPose, save, **here).success, "feedback grows old")
    answer = bench.call(SetBool, TORQUE, data=True)
    assert (answer.success, answer.message) == (False, "the arm might jump: it is not told where it is")
    assert bench.drivers.switched == [(GATE, False), (POWER, False)]
    bench.drivers.telling = True
    bench.until(lambda: bench.call(SetBool, TORQUE, data=True).success, "power")


def test_a_switch_that_waited_is_not_turned_on_after_a_stop(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The request was fine when it came; the emergency stop was pressed while the servos were switched."""
    monkeypatch.setattr(torque_module, "ANSWER_S", PATIENCE)
    open_ones: list[Asked] = []
    bench.drivers.plan.append(open_ones.append)
    off = bench.ask(SetBool, TORQUE, data=False)
    bench.until(lambda: open_ones, "the gate is asked")
    on = bench.ask(SetBool, TORQUE, data=True)
    switching = bench.call(Trigger, "/lupin/arm/init").message  # and the request waits
    assert switching == "the servos are being switched on or off"
    bench.stop()
    bench.until(lambda: "emergency" in bench.call(Trigger, "/lupin/arm/init").message, "the stop")
    open_ones[0].answer(SetBool.Response(success=True))
    bench.until(lambda: off and on, "both answers")
    assert off[0].success
    assert (on[0].success, on[0].message) == (False, "the emergency stop is engaged (/e_stop_state)")
    assert bench.drivers.switched == [(GATE, False), (POWER, False)]


def test_only_so_many_requests_to_switch_wait(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    """The drivers are slow, and somebody asks again and again: what is refused switches nothing, ever."""
    monkeypatch.setattr(torque_module, "ANSWER_S", PATIENCE)
    open_ones: list[Asked] = []
    bench.drivers.plan.append(open_ones.append)
    waiting = [bench.ask(SetBool, TORQUE, data=False) for _ in range(MOST_WAITING)]
    refused = bench.call(SetBool, TORQUE, data=False)
    full = "8 torque requests wait already; try again when they are answered"
    assert (refused.success, refused.message, any(waiting)) == (False, full, False)
    bench.until(lambda: open_ones, "the gate is asked")
    open_ones[0].answer(SetBool.Response(success=True))
    bench.until(lambda: all(waiting), "all other answers")
    assert [answers[0].success for answers in waiting] == [True] * MOST_WAITING
    assert bench.drivers.switched == [(GATE, False), (POWER, False)] * MOST_WAITING
    assert bench.call(SetBool, TORQUE, data=True).success


# --- feedback that is wrong ------------------------------------------------------------------------------


def test_an_angle_that_no_joint_reaches_is_no_feedback(make_node: MakeNode) -> None:
    """A driver that tells degrees, or garbage: it never becomes a target, and is told once."""
    scene = Scene(make_node, simulated=False)
    for _ in range(3):
        scene.tell((0.1, 57.3, 0.2, -1e30))
    scene.until(lambda: len(scene.warnings) == 2, "two warnings")
    assert scene.warnings[0] == (
        "/joint_states: shoulder_lift_joint at 57.3 rad is left out: no joint of this arm gets there; "
        "angles are radians"
    )
    assert scene.preset("home").message.startswith("it is not known where the arm is")
    assert scene.sent == []
    scene.tell(ZERO)
    scene.until(lambda: scene.sent, "the arm is pinned")
    assert len(scene.warnings) == 2


def test_a_pose_a_little_beyond_the_servos_is_kept_at_their_range(make_node: MakeNode) -> None:
    """What a servo does not reach it ignores: the pin must be something that it takes."""
    scene = Scene(make_node, simulated=False)
    scene.tell((0.1, 0.2, math.radians(-120.0), 0.4))
    scene.until(lambda: scene.sent, "the arm is pinned")
    assert scene.command().target == pytest.approx((0.1, 0.2, math.radians(-116.3), 0.4))


def test_an_arm_that_was_lost_and_is_back_interrupts_whoever_has_it(
    make_node: MakeNode, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It was pinned, so a sequence that plays has ended; its jaw must not go on alone."""
    monkeypatch.setattr(arm_module, "LOST_S", 0.3)
    scene = Scene(make_node, simulated=False)
    scene.tell(ZERO)
    scene.until(lambda: len(scene.sent) == 1, "the arm is pinned")
    reasons: list[str] = []
    scene.arm.claim("player", "wave is playing", reasons.append)
    scene.until(lambda: _nowhere(scene, "player"), "the arm is lost")
    assert (scene.arm.refusal("player"), reasons) == (None, [])
    scene.tell(ZERO)
    scene.until(lambda: reasons, "an interruption")
    assert reasons == ["for more than 0.3 s it was not known where the arm is"]


def _nowhere(scene: Scene, owner: str) -> bool:
    try:
        scene.arm.here(owner)
    except ArmRequestRefused as reason:
        return "for more than 0.3 s" in str(reason)
    return False


# --- the jaw ---------------------------------------------------------------------------------------------


def test_an_arm_that_is_held_holds_its_jaw(make_node: MakeNode, monkeypatch: pytest.MonkeyPatch) -> None:
    """The operator's stop is for all of it."""
    monkeypatch.setattr(simulated_module, "JAW_RATE", 0.05)
    scene = Scene(make_node)
    assert scene.turn("gripper", 30.0)
    scene.until(lambda: scene.jaw > -0.19, "the jaw moves")
    scene.arm.hold()
    assert scene.sim is not None
    scene.until(lambda: scene.sim._goal is None, "the end of the jaw's motion")
    assert scene.jaw < 0.2


def test_a_jaw_that_waits_for_its_controller_can_be_stopped(
    make_node: MakeNode, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The controller comes after the stop: the jaw does not move then."""
    monkeypatch.setattr(gripper_module, "PATIENCE_S", PATIENCE)
    scene = Scene(make_node, simulated=False)
    problems: list[str | None] = []
    scene.arm.move_jaw(0.1, "slider", problems.append)
    scene.estop(True)
    scene.until(lambda: scene.arm.stopped, "the stop")
    scene.estop(False)
    scene.until(lambda: not scene.arm.stopped, "the release")
    goals = late_jaw(scene, make_node)
    scene.until(lambda: problems, "the controller is found")
    assert problems == ["stopped meanwhile"]
    assert goals == []


# --- the emergency stop ----------------------------------------------------------------------------------


def _is_steady(scene: Scene) -> bool:
    return scene.arm._estop._fold._sources[ROBOT].steady


def test_an_emergency_stop_that_falls_silent_counts_as_engaged(make_node: MakeNode) -> None:
    """Its bridge has died: who presses the button now is not heard. Heard again, it is what it says."""
    scene = Scene(make_node, preset_duration=30.0, estop_timeout=1.0)
    assert scene.preset("inspect").success  # no emergency stop was ever heard of: there is none
    scene.estop(False)
    scene.until(lambda: _is_steady(scene), "an emergency stop that is told steadily")
    reasons: list[str] = []
    scene.arm.claim("player", "wave is playing", reasons.append)
    scene.silence()
    scene.until(lambda: scene.arm.stopped, "the stop")
    assert reasons == ["the emergency stop was silent"]
    assert not near(scene.command().target, PRESETS["inspect"])
    scene.arm.release("player")
    silent = "the emergency stop is silent (/e_stop_state)"
    assert (scene.preset("home").success, scene.preset("home").message) == (False, silent)
    scene.estop(False)
    scene.until(lambda: scene.preset("home").success, "the emergency stop is heard again")


def test_a_silent_stop_that_was_engaged_stays_engaged(make_node: MakeNode) -> None:
    scene = Scene(make_node, estop_timeout=1.0)
    scene.estop(True)
    scene.until(lambda: _is_steady(scene), "an emergency stop that is told steadily")
    assert scene.arm.stopped
    scene.silence()
    scene.until(lambda: "silent" in scene.preset("home").message, "the silence")
    assert scene.arm.stopped


def test_silence_can_be_taken_for_released(make_node: MakeNode) -> None:
    scene = Scene(make_node, estop_timeout=0.0)
    scene.estop(True)
    scene.until(lambda: scene.arm.stopped, "the stop")
    scene.estop(False)
    scene.until(lambda: not scene.arm.stopped, "its release")
    scene.silence()
    scene.wait(0.3)
    assert not scene.arm.stopped
