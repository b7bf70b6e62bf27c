"""The arm's services over real DDS, with a simulated arm: what they do, what they refuse, and why."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from control_msgs.action import GripperCommand
from mirte_msgs.srv import SetServoAngleWithSpeed, SetServoOffset
from std_srvs.srv import SetBool

from lupin_arm import simulated as simulated_module
from lupin_arm.client import ArmClient
from lupin_arm.joints import ARM, MAX_RATE, Pose, check_pose
from lupin_arm.node import arm as arm_module
from lupin_arm.node import feedback as feedback_module
from lupin_arm.node import gripper as gripper_module
from lupin_arm.node import torque as torque_module
from lupin_arm.node.gates import HardwareGate
from lupin_arm.node.serving import ArmRequestRefused
from lupin_arm.node.settings import PARAMETERS
from lupin_arm.presets import PRESETS
from lupin_arm.trajectory import VELOCITY_HINT, Point, Trajectory
from lupin_engine.errors import LupinError
from tests.lupin_ros.helpers import PATIENCE, spin_until, work_off
from tests.lupin_ros.plugins.arm.scene import TRAJECTORIES, Bystander, MakeNode, Scene, late_jaw
from tests.plugins.fakes import FakeOutlet

HOME, ZERO = PRESETS["home"], PRESETS["zero"]
STOPPED = "the emergency stop is engaged (/e_stop_state)"
LIMP = "the servos are off; switch them on first (/lupin/arm/set_torque)"
NAMES = "detect_left, home, inspect, pick, pick_closed, pick_open, place, travel, tuck, zero"


@pytest.fixture(autouse=True)
def own_library(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The operator's own poses stay out of it."""
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))


@pytest.fixture
def scene(make_node: MakeNode) -> Scene:
    return Scene(make_node, preset_duration=0.5, init_duration=0.5)


def positions(scene: Scene) -> Pose:
    return scene.command().target


def seconds(scene: Scene) -> float:
    return scene.command().duration


def with_joint(pose: Pose, index: int, angle: float) -> Pose:
    changed = list(pose)
    changed[index] = angle
    return check_pose(changed)


# --- names -------------------------------------------------------------------------------------------


def test_services_have_the_names_and_types_that_displays_call(scene: Scene) -> None:
    offered = dict(scene.node.node.get_service_names_and_types_by_node("lupin_arm", "/"))
    slider = "mirte_msgs/srv/SetServoAngleWithSpeed"
    expected = {
        "/lupin/arm/preset": "lupin_msgs/srv/SetArmPreset",
        **{f"/lupin/arm/{joint.name}/set_angle_with_speed": slider for joint in ARM},
        "/lupin/gripper/set_angle_with_speed": slider,
        "/lupin/arm/init": "std_srvs/srv/Trigger",
        "/lupin/arm/set_torque": "std_srvs/srv/SetBool",
    }
    assert {name: offered.get(name) for name in expected} == {name: [kind] for name, kind in expected.items()}


def test_one_publisher_commands_the_arm(scene: Scene) -> None:
    assert scene.ros.node.count_publishers(TRAJECTORIES) == 1


# --- presets -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("said", ["inspect", "  INSPECT "])
def test_a_preset_is_sent_at_once_and_reached(
    scene: Scene, said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(arm_module, "LOST_S", PATIENCE)
    robot = scene.nodes.pop(1)  # it stands still until the answer is there: nobody waits for the arm
    answer = scene.preset(said)
    assert (answer.success, answer.message) == (True, "inspect: sent, there in 0.5 s")
    scene.nodes.append(robot)
    scene.arrives(PRESETS["inspect"])
    scene.command()
    assert list(scene.sent[-1].joint_names) == [joint.state_name for joint in ARM]
    assert list(scene.sent[-1].points[0].velocities) == [VELOCITY_HINT] * 4


def test_a_mission_sends_the_arm(scene: Scene) -> None:
    parameters = {"arm_patrol_enabled": True, "arm_preset_service": "/lupin/arm/preset"}
    client = ArmClient(scene.ros, FakeOutlet(), parameters)
    scene.until(client._service.ready)
    client.act("preset", {"name": "travel"})
    client.act("preset", {"name": "inspect"})
    scene.arrives(PRESETS["inspect"])


def test_a_preset_that_is_far_takes_longer(scene: Scene) -> None:
    scene.preset("tuck")
    scene.arrives(PRESETS["tuck"])
    way = max(abs(a - b) for a, b in zip(PRESETS["tuck"], PRESETS["pick"], strict=True))
    answer = scene.preset("pick")
    assert answer.message == f"pick: sent, there in {way / MAX_RATE:.1f} s"
    assert seconds(scene) == pytest.approx(way / MAX_RATE, abs=0.01)


@pytest.mark.parametrize(
    ("said", "shown"),
    [
        ("", ""),
        ("fold", "fold"),
        ("../home", "../home"),
        ("x" * 100_000, "x" * 40 + "..."),
        ("\u00e9", "\u00e9"),
    ],
    ids=["empty", "unknown", "a path", "huge", "not ASCII"],
)
def test_an_unknown_preset_moves_nothing(scene: Scene, said: str, shown: str) -> None:
    before = len(scene.sent)
    answer = scene.preset(said)
    assert (answer.success, answer.message) == (False, f"unknown preset {shown!r}; allowed: {NAMES}")
    assert len(scene.sent) == before


# --- sliders -----------------------------------------------------------------------------------------


def test_a_slider_turns_one_joint_at_its_rate(scene: Scene) -> None:
    assert scene.turn("elbow", 30.0, rate=60.0)
    scene.arrives(with_joint(HOME, 2, math.radians(30.0)))
    assert seconds(scene) == pytest.approx((math.radians(30.0) - HOME[2]) / math.radians(60.0), abs=0.01)


def test_a_slider_takes_radians_too(scene: Scene) -> None:
    assert scene.turn("shoulder_pan", 0.5, rate=2.0, degrees=False)
    assert positions(scene) == pytest.approx(with_joint(HOME, 0, 0.5))
    assert seconds(scene) == pytest.approx((0.5 - HOME[0]) / 2.0, abs=0.01)


@pytest.mark.parametrize("rate", [0.0, -5.0])
def test_without_a_rate_it_is_sixty_degrees_a_second(scene: Scene, rate: float) -> None:
    scene.turn("elbow", 60.0, rate)
    assert seconds(scene) == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize(
    ("joint", "angle", "limit"),
    [
        ("shoulder_pan", -1e30, -86.0),
        ("shoulder_lift", 500.0, 85.0),
        ("elbow", 90.5, 90.0),
        ("wrist", 89.0, 88.0),
    ],
)
def test_an_angle_is_brought_inside_the_window(scene: Scene, joint: str, angle: float, limit: float) -> None:
    index = [known.name for known in ARM].index(joint)
    assert scene.turn(joint, angle, rate=1e9)
    assert positions(scene) == pytest.approx(with_joint(HOME, index, math.radians(limit)))
    assert seconds(scene) >= abs(math.radians(limit) - HOME[index]) / MAX_RATE - 0.01


@pytest.mark.parametrize(
    ("angle", "rate", "reason"),
    [
        (math.nan, 10.0, "elbow: nan is not an angle"),
        (math.inf, 10.0, "elbow: inf is not an angle"),
        (10.0, math.nan, "the rate nan is not a number"),
        (10.0, math.inf, "the rate inf is not a number"),
        (10.0, 1e-9, "the motion would take longer than 3600 s"),
    ],
)
def test_a_slider_that_makes_no_sense_moves_nothing(
    scene: Scene, angle: float, rate: float, reason: str
) -> None:
    before = len(scene.sent)
    assert not scene.turn("elbow", angle, rate)
    scene.until(lambda: f"elbow not moved: {reason}" in scene.warnings)
    assert len(scene.sent) == before
    assert scene.turn("elbow", 5.0)


def test_a_slider_leaves_the_others_on_their_way(scene: Scene) -> None:
    """The arm is half way when another joint is turned: the first still gets where it was sent."""
    scene.turn("elbow", 60.0, rate=10.0)
    scene.until(lambda: scene.pose[2] > math.radians(5.0))
    scene.turn("shoulder_pan", 20.0, rate=20.0)
    assert seconds(scene) > 1.2  # the elbow keeps to the rate, though the pan has a short way, of 1 s
    scene.arrives((math.radians(20.0), HOME[1], math.radians(60.0), HOME[3]))


def test_what_was_bent_by_hand_stays_bent(make_node: MakeNode, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its target is elsewhere; without a look at where it is, the next slider would let it jump."""
    monkeypatch.setattr(arm_module, "SETTLE_S", 0.0)
    monkeypatch.setattr(feedback_module, "FRESH_S", PATIENCE)
    scene = Scene(make_node, simulated=False)
    scene.stays(ZERO)
    scene.until(lambda: scene.sent)
    scene.wait(0.15)  # the pin's own motion is over
    scene.stays((0.0, 0.3, 0.05, 0.0))  # lifted by hand; the elbow only sags
    assert scene.turn("wrist", 10.0)
    assert positions(scene) == pytest.approx((0.0, 0.3, 0.0, math.radians(10.0)))


def test_init_goes_to_zero(scene: Scene) -> None:
    answer = scene.init()
    assert (answer.success, answer.message) == (True, "zero pose: sent, there in 0.5 s")
    scene.arrives(ZERO)


# --- the jaw -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(("said", "angle"), [(30.0, 0.25), (-30.0, -0.20), (500.0, 0.25), (0.0, 0.025)])
def test_the_jaw_opens_and_closes(scene: Scene, said: float, angle: float) -> None:
    assert scene.turn("gripper", said)
    scene.until(lambda: scene.jaw == pytest.approx(angle, abs=1e-3))


def test_the_jaw_takes_radians_as_what_operators_mean(scene: Scene) -> None:
    assert scene.turn("gripper", math.radians(30.0), degrees=False)
    scene.until(lambda: scene.jaw == pytest.approx(0.25, abs=1e-3))


def test_a_jaw_command_that_is_no_number_moves_nothing(scene: Scene) -> None:
    assert not scene.turn("gripper", math.nan)
    assert not scene.turn("gripper", math.inf)
    scene.until(lambda: "jaw not moved: gripper: nan is not an angle" in scene.warnings)
    assert scene.jaw == pytest.approx(-0.20)


def test_without_a_controller_the_jaw_is_not_moved(
    make_node: MakeNode, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(gripper_module, "PATIENCE_S", 0.2)
    scene = Scene(make_node, simulated=False)
    assert not scene.turn("gripper", 10.0)
    expected = "/mirte_master_gripper_controller/gripper_cmd: no action server within 0.2 s"
    scene.until(lambda: f"jaw not moved: {expected}" in scene.warnings, "a warning")


def test_a_controller_that_comes_a_little_late_is_waited_for(
    make_node: MakeNode, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(gripper_module, "PATIENCE_S", PATIENCE)
    scene = Scene(make_node, simulated=False)
    name = "/lupin/gripper/set_angle_with_speed"
    request = scene.call_later(SetServoAngleWithSpeed, name, SetServoAngleWithSpeed.Request(angle=12.0))
    work_off(scene.nodes)  # it is taken: making a node takes long enough for requests to grow stale
    goals = late_jaw(scene, make_node)
    assert request().status
    scene.until(lambda: goals)
    command = goals[0].request.command
    assert (command.position, command.max_effort) == (pytest.approx(0.115), 2.0)
    goals[0].abort(GripperCommand.Result(stalled=True))
    scene.until(
        lambda: "the jaw may not be where it was sent: ended as 6 (degrees=12.0)" in scene.warnings,
        "a warning",
    )


# --- before the arm is known -------------------------------------------------------------------------


def test_nothing_moves_before_it_is_known_where_the_arm_is(make_node: MakeNode) -> None:
    scene = Scene(make_node, simulated=False)
    unknown = "it is not known where the arm is: no /joint_states with its joints yet"
    answer = scene.preset("home")
    assert (answer.success, answer.message) == (False, unknown)
    assert not scene.turn("elbow", 10.0)
    assert scene.init().message == unknown
    assert scene.torque(True).message == unknown
    scene.tell((0.1, 0.2, math.nan, 0.4))
    scene.tell(ZERO, name=["wheel_left_joint"])
    scene.wait(0.1)
    assert scene.preset("home").message == unknown
    assert scene.sent == []
    scene.estop(True)  # which is the reason then, for everybody
    scene.until(lambda: scene.preset("home").message == STOPPED)
    assert (scene.init().message, scene.torque(True).message) == (STOPPED, STOPPED)
    assert not scene.turn("elbow", 20.0)
    scene.until(lambda: f"elbow not moved: {STOPPED}" in scene.warnings)


def test_the_first_feedback_pins_the_arm_where_it_is(make_node: MakeNode) -> None:
    """Also where it may not be commanded to go: holding it there is no motion."""
    scene = Scene(make_node, simulated=False)
    hanging = (0.1, 0.2, -1.9, 0.4)
    for _ in range(5):
        scene.tell(hanging)
    scene.until(lambda: scene.sent)
    scene.wait(0.1)
    assert (len(scene.sent), positions(scene), seconds(scene)) == (1, hanging, 0.1)


def test_feedback_that_was_lost_pins_the_arm_again(
    make_node: MakeNode, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(arm_module, "LOST_S", 0.3)
    scene = Scene(make_node, simulated=False)
    scene.tell(ZERO)
    scene.until(lambda: len(scene.sent) == 1)
    scene.wait(0.5)
    lost = "it is not known where the arm is: no /joint_states for more than 0.3 s"
    assert scene.preset("home").message == lost
    elsewhere = (0.5, 0.5, 0.5, 0.5)
    scene.tell(elsewhere)
    scene.until(lambda: len(scene.sent) == 2)
    assert positions(scene) == elsewhere


# --- the emergency stop ------------------------------------------------------------------------------


def test_while_stopped_everything_is_refused(scene: Scene) -> None:
    scene.estop(True)
    scene.until(lambda: scene.arm.stopped)
    scene.command()  # which holds it
    before = len(scene.sent)
    answer = scene.preset("inspect")
    assert (answer.success, answer.message) == (False, STOPPED)
    assert not scene.turn("elbow", 10.0)
    assert not scene.turn("gripper", 10.0)
    assert (scene.init().success, scene.init().message) == (False, STOPPED)
    assert (scene.torque(True).success, scene.torque(True).message) == (False, STOPPED)
    assert len(scene.sent) == before
    scene.until(lambda: f"elbow not moved: {STOPPED}" in scene.warnings)
    scene.estop(False)
    scene.until(lambda: scene.preset("inspect").success)


def test_a_stop_in_the_middle_of_a_motion_holds_arm_and_jaw(
    scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(simulated_module, "JAW_RATE", 0.05)
    scene.turn("elbow", 80.0, rate=10.0)
    scene.turn("gripper", 30.0)
    scene.until(lambda: scene.pose[2] > math.radians(5.0) and scene.jaw > -0.19)
    scene.estop(True)
    scene.until(lambda: scene.arm.stopped)
    held = positions(scene)
    assert held[2] < math.radians(60.0)
    scene.arrives(held)
    assert scene.sim is not None
    scene.until(lambda: scene.sim._goal is None, "the end of the jaw's motion")
    jaw = scene.jaw
    assert jaw < 0.2
    scene.estop(False)
    scene.until(lambda: not scene.arm.stopped)
    scene.wait(0.3)
    assert scene.is_at(held)
    assert scene.jaw == pytest.approx(jaw, abs=0.02)


def test_a_stop_can_release_the_servos_but_not_energise_them(scene: Scene) -> None:
    scene.estop(True)
    scene.until(lambda: scene.preset("home").message == STOPPED)
    assert scene.torque(False).success
    assert scene.torque(True).message == STOPPED


# --- who has the arm ---------------------------------------------------------------------------------


def test_an_arm_that_is_claimed_obeys_its_owner_only(scene: Scene) -> None:
    arm = scene.arm
    arm.claim("player", "wave is playing", lambda reason: None)
    near = Trajectory((Point(with_joint(HOME, 2, 0.1), 1.0),))
    busy = "the arm is busy: wave is playing"
    for refused in (
        lambda: arm.send(near, "preset"),
        lambda: arm.move_jaw(0.0, "slider"),
        lambda: arm.set_torque(False, "operator", lambda problem: None),
        lambda: arm.claim("recorder", "a recording", lambda reason: None),
    ):
        with pytest.raises(ArmRequestRefused) as reason:
            refused()
        assert str(reason.value) == busy
    arm.send(near, "player")
    arm.release("preset")
    assert arm.refusal("preset") == busy
    arm.release("player")
    arm.send(near, "preset")


def test_a_stop_tells_whoever_has_the_arm(scene: Scene) -> None:
    arm = scene.arm
    reasons: list[str] = []
    arm.claim("player", "wave is playing", reasons.append)
    scene.estop(True)
    scene.estop(True)
    scene.until(lambda: arm.stopped)
    scene.wait(0.1)
    assert reasons == ["the emergency stop was engaged"]
    with pytest.raises(ArmRequestRefused, match=r"^the emergency stop is engaged \(/e_stop_state\)$"):
        arm.claim("recorder", "a recording", reasons.append)


@pytest.mark.parametrize(
    ("trajectory", "reason"),
    [
        (Trajectory(()), "the motion has no points"),
        (Trajectory((Point((0.0, 0.0, 2.0, 0.0), 9.0),)), "elbow: 114.6 deg is not within -90 to 90"),
        (Trajectory((Point((0.0, 0.0, 1.5, 0.0), 0.1),)), "a joint would be faster than 180 deg/s"),
    ],
)
def test_what_is_outside_the_limits_is_not_sent(scene: Scene, trajectory: Trajectory, reason: str) -> None:
    arm = scene.arm
    before = len(scene.sent)
    with pytest.raises(ArmRequestRefused) as refused:
        arm.send(trajectory, "preset")
    assert str(refused.value) == reason
    with pytest.raises(ArmRequestRefused, match=r"^gripper: 0\.30 rad is not within -0\.2 to 0\.25$"):
        arm.move_jaw(0.3, "preset")
    scene.wait(0.05)
    assert len(scene.sent) == before


def test_who_listens_gets_every_pose_with_a_time(make_node: MakeNode) -> None:
    scene = Scene(make_node, simulated=False)
    heard: list[tuple[float, Pose, float | None]] = []
    scene.arm.listen(lambda stamp, pose, jaw: heard.append((stamp, pose, jaw)))
    scene.tell(HOME)
    scene.until(lambda: heard)
    assert heard[0][1:] == (HOME, None)
    assert heard[0][0] == pytest.approx(scene.ros.now(), abs=5.0)  # a message without a stamp has none


# --- torque ------------------------------------------------------------------------------------------


def test_limp_servos_are_not_commanded(scene: Scene) -> None:
    answer = scene.torque(False)
    assert (answer.success, answer.message) == (True, "the servos are off: support the arm")
    before = len(scene.sent)
    assert scene.preset("inspect").message == LIMP
    assert not scene.turn("elbow", 10.0)
    assert scene.init().message == LIMP
    assert len(scene.sent) == before
    answer = scene.torque(True)
    assert (answer.success, answer.message) == (True, "the servos are on")
    assert scene.preset("inspect").success


def test_servos_that_are_switched_on_again_do_not_jump(scene: Scene) -> None:
    """A person has bent the limp arm; its controller still had its old target."""
    scene.torque(False)
    bent = (0.3, -0.2, 0.2, -1.2)
    assert scene.set_parameter("lupin_arm_sim", "hand", list(bent)) == ""
    scene.arrives(bent)
    assert scene.torque(True).success
    scene.wait(0.3)
    assert scene.pose == pytest.approx(bent, abs=0.01)


POWER, GATE = "/io/servo/hiwonder/enable_all_servos", "/enable_arm_control"


class Vendor:
    """The vendor's two switches, as bad as a test wants them: True, False (refuses), None (no answer)."""

    def __init__(self, scene: Bystander, make_node: MakeNode) -> None:
        self.calls: list[tuple[str, bool]] = []
        self.answers: dict[tuple[str, bool], bool | None] = {}
        self.ros = make_node("vendor")
        self._serve("power", POWER)
        self._serve("gate", GATE)
        scene.nodes.append(self.ros)

    def _serve(self, switch: str, name: str) -> None:
        def asked(request: Any, response: Any, answer: Callable[[Any], None]) -> None:
            call = switch, bool(request.data)
            self.calls.append(call)
            said = self.answers.get(call, True)
            if said is not None:
                response.success, response.message = said, "bus error"
                answer(response)

        self.ros.serve_later(SetBool, name, asked)


@pytest.fixture
def vendor(make_node: MakeNode, monkeypatch: pytest.MonkeyPatch) -> tuple[Scene, Vendor]:
    monkeypatch.setattr(torque_module, "ANSWER_S", 2.5)
    monkeypatch.setattr(torque_module, "LOOK_UP_S", PATIENCE)
    scene = Scene(make_node, simulated=False)
    vendor = Vendor(scene, make_node)
    services = {name for name, _ in scene.node.node.get_service_names_and_types()}
    scene.until(
        lambda: (
            "/enable_arm_control" in services
            or services.update(name for name, _ in scene.node.node.get_service_names_and_types())
        )
    )
    scene.stays(ZERO)
    scene.until(lambda: scene.sent)
    return scene, vendor


OFF = [("gate", False), ("power", False)]
ON = [("power", True), ("gate", True)]


def test_both_switches_in_order(vendor: tuple[Scene, Vendor]) -> None:
    scene, switches = vendor
    assert scene.torque(False).success
    assert switches.calls == OFF
    scene.stays(HOME)
    before = len(scene.sent)
    assert scene.torque(True).success
    assert switches.calls == OFF + ON
    scene.until(lambda: len(scene.sent) == before + 1)
    assert positions(scene) == HOME  # where it is becomes its target first


@pytest.mark.parametrize(
    ("on", "bad", "calls", "message"),
    [
        (
            False,
            {("power", False): False},
            [*OFF, ("gate", True)],
            f"{POWER} refused: bus error; commands are taken again",
        ),
        (
            False,
            {("power", False): None},
            [*OFF, ("gate", True)],
            f"{POWER}: no answer within 2.5 s; commands are taken again",
        ),
        (
            False,
            {("power", False): False, ("gate", True): False},
            [*OFF, ("gate", True)],
            f"{POWER} refused: bus error; and commands are not taken any more: {GATE} refused: bus error",
        ),
        (False, {("power", False): False, ("gate", False): False}, OFF, f"{POWER} refused: bus error"),
        (True, {("power", True): False}, [("power", True)], f"{POWER} refused: bus error"),
        (
            True,
            {("gate", True): False},
            [*ON, ("power", False)],
            f"{GATE} refused: bus error; the servos are off again",
        ),
        (
            True,
            {("gate", True): None, ("power", False): False},
            [*ON, ("power", False)],
            f"{GATE}: no answer within 2.5 s; and the servos could not be switched off again: "
            f"{POWER} refused: bus error",
        ),
    ],
)
def test_a_switch_that_fails_is_turned_back(
    vendor: tuple[Scene, Vendor],
    on: bool,
    bad: dict[tuple[str, bool], bool | None],
    calls: list[tuple[str, bool]],
    message: str,
) -> None:
    scene, switches = vendor
    switches.answers = bad
    answer = scene.torque(on)
    assert (answer.success, answer.message) == (False, message)
    assert switches.calls == calls


def test_a_gate_that_does_not_close_keeps_nobody_from_switching_off(vendor: tuple[Scene, Vendor]) -> None:
    scene, switches = vendor
    switches.answers = {("gate", False): False}
    assert scene.torque(False).success
    scene.until(
        lambda: f"the gate of commands stays open: {GATE} refused: bus error" in scene.warnings, "a warning"
    )


def test_requests_at_once_never_overlap(vendor: tuple[Scene, Vendor]) -> None:
    scene, switches = vendor
    answers = [
        scene.call_later(SetBool, "/lupin/arm/set_torque", SetBool.Request(data=on))
        for on in (False, True, False, True)
    ]
    assert [answer().success for answer in answers] == [True] * 4
    assert switches.calls == OFF + ON + OFF + ON


def test_without_servos_nothing_can_be_switched(make_node: MakeNode, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(torque_module, "LOOK_UP_S", 0.1)
    scene = Scene(make_node, simulated=False)
    answer = scene.torque(False)
    assert (answer.success, answer.message) == (False, f"{POWER}: no server within 0.1 s")


# --- hardware ----------------------------------------------------------------------------------------


def test_what_needs_real_servos_is_refused_in_a_simulation(make_node: MakeNode) -> None:
    ros = make_node("lupin_arm")
    with pytest.raises(ArmRequestRefused) as refused:
        HardwareGate(ros, "auto").require("calibration")
    sign = "/io/servo/hiwonder/shoulder_lift/_set_offset"
    assert str(refused.value) == (
        f"calibration needs the real servos, and this is a simulation: there is no service {sign}"
    )
    with pytest.raises(ArmRequestRefused, match=r"parameter hardware is simulated$"):
        HardwareGate(ros, "simulated").require("calibration")
    HardwareGate(ros, "real").require("calibration")


def test_hardware_is_there_when_its_services_are(make_node: MakeNode) -> None:
    ros, vendor = make_node("lupin_arm"), make_node("vendor")
    hardware = HardwareGate(ros, "auto")
    sign = "/io/servo/hiwonder/shoulder_lift/_set_offset"
    with pytest.raises(ArmRequestRefused, match="there is no service"):
        hardware.require("calibration")
    vendor.serve(SetServoOffset, sign, lambda request, response: response)
    spin_until([ros, vendor], lambda: hardware.present)
    hardware.require("calibration")


def test_a_wrong_word_for_the_hardware_is_named(make_node: MakeNode) -> None:
    with pytest.raises(LupinError) as refused:
        make_node("lupin_arm", ["--ros-args", "-p", "hardware:=reel"], PARAMETERS)
    assert str(refused.value) == (
        "parameter 'hardware': expected one of auto, real, simulated, got 'reel'; did you mean 'real'?"
    )
