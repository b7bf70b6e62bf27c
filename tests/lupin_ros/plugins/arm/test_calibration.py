"""`/lupin/arm/calibrate` over real DDS, with servos that are fakes: its table, and its hazards."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from std_srvs.srv import SetBool

from lupin_arm.calibration.offsets import HOMES
from lupin_arm.node import torque as torque_module
from lupin_arm.node.calibration import servos as servos_module
from lupin_arm.node.calibration.servos import CUT_OFF, LIMP
from lupin_arm.node.gates import SERVOS
from lupin_msgs.srv import CalibrateArm, SetArmPreset
from lupin_ros.adapter.node import RosNode
from tests.lupin_ros.helpers import PATIENCE, spin_for, work_off
from tests.lupin_ros.plugins.arm.bench import CALIBRATE, GATE, POWER, Bench, refuse
from tests.lupin_ros.system.wire.wire import Asked
from tests.lupin_ros.world import World

pytestmark = pytest.mark.timeout(300)

JOINTS = list(HOMES)
QUICK: dict[str, Any] = {"calibration_settle_s": "0.05", "calibration_window_s": "1.0"}
#: Who looks for so long can be disturbed meanwhile.
THOROUGH = {**QUICK, "calibration_window_s": "30.0"}
#: What the node says as soon as it knows where the arm is.
PINNED = "the arm is there"
MakeNode = Callable[..., RosNode]


@pytest.fixture(autouse=True)
def patience(monkeypatch: pytest.MonkeyPatch) -> None:
    """Wait long for switches that a test answers when it has looked at what happens meanwhile."""
    monkeypatch.setattr(torque_module, "ANSWER_S", PATIENCE)


@pytest.fixture
def bench(make_node: MakeNode, tmp_path: Path) -> Bench:
    """An arm with servos that can be calibrated."""
    return Bench(make_node, tmp_path / "arm.json", servos=True, hardware="real", **QUICK)


def calibrate(bench: Bench, action: str) -> Any:
    return bench.call(CalibrateArm, CALIBRATE, action=action)


def posing(bench: Bench) -> None:
    """Start, so that the arm waits for a person."""
    answer = calibrate(bench, "start")
    assert answer.success, answer.message
    assert answer.state == "AWAITING_POSE"


def usable(bench: Bench) -> None:
    """See that the arm has its torque and takes commands."""
    assert bench.drivers.switched[-2:] == [(POWER, True), (GATE, True)]
    assert bench.call(SetArmPreset, "/lupin/arm/preset", name="home").success


def test_the_servos_get_their_zero_from_the_pose_that_a_person_gives_them(bench: Bench) -> None:
    """The whole way: offset and angle zero, no torque, the pose, the new offsets, torque."""
    bench.drivers.offsets = {"shoulder_lift": 50, "elbow": -300, "wrist": 0, "gripper": 0}
    posing(bench)
    assert bench.drivers.offsets == dict.fromkeys(JOINTS, 0)
    assert [call for call in bench.drivers.calls if call[0] == "turn"] == [("turn", j, 0.0) for j in JOINTS]
    assert bench.drivers.switched == [(GATE, False), (GATE, False), (POWER, False)]
    moved = {"shoulder_lift": 500, "elbow": -1200, "wrist": 150, "gripper": 0}
    bench.drivers.counts = {joint: HOMES[joint] + by for joint, by in moved.items()}
    answer = calibrate(bench, "commit")
    assert (answer.success, answer.state) == (True, "IDLE")
    assert answer.message == "calibrated; the arm keeps its pose, with torque"
    assert list(answer.joint_names) == JOINTS
    assert list(answer.diffs_observed) == [500, -1200, 150, 0]
    assert list(answer.offsets_applied) == [500, -1200, 0, 0]  # less than 2 degrees is not worth it
    assert bench.drivers.offsets == {"shoulder_lift": 500, "elbow": -1200, "wrist": 0, "gripper": 0}
    usable(bench)


def test_what_callers_may_do_when(bench: Bench) -> None:
    """Status has no effects, a commit needs a start, a start happens once, cancel is always right."""
    status = calibrate(bench, " Status ")
    assert (status.success, status.state, status.message) == (True, "IDLE", "ready")
    commit = calibrate(bench, "commit")
    assert (commit.success, commit.state) == (False, "IDLE")
    assert commit.message.startswith("there is nothing to commit; start a calibration")
    cancel = calibrate(bench, "cancel")
    assert (cancel.success, cancel.state, cancel.message) == (True, "IDLE", "nothing to cancel")
    for action in ("", "comit", "../start", "x" * 10_000):
        other = calibrate(bench, action)
        assert (other.success, other.state) == (False, "IDLE")
        assert other.message.startswith("unknown action")
        assert len(other.message) < 200
    assert bench.drivers.switched == []
    posing(bench)
    again = calibrate(bench, "start")
    assert (again.success, again.state) == (False, "AWAITING_POSE")
    assert again.message == "a calibration is under way; commit or cancel it"
    status = calibrate(bench, "status")
    assert status.message == "the arm has no torque: bring it into its zero pose by hand, then commit"


def test_a_simulation_refuses_at_once(make_node: MakeNode, tmp_path: Path) -> None:
    """The gate: nothing is switched, nothing is waited for."""
    bench = Bench(make_node, tmp_path / "arm.json")
    answer = calibrate(bench, "start")
    assert (answer.success, answer.state) == (False, "IDLE")
    assert answer.message.startswith("calibration needs the real servos, and this is a simulation: ")
    assert bench.drivers.switched == []


def test_cancel_gives_the_offsets_back(bench: Bench) -> None:
    """War story of section 7: the message said unchanged, and the offsets stayed zero."""
    before = {"shoulder_lift": 50, "elbow": -300, "wrist": 700, "gripper": 0}
    bench.drivers.offsets = dict(before)
    posing(bench)
    answer = calibrate(bench, "cancel")
    assert (answer.success, answer.state) == (True, "IDLE")
    assert answer.message == "cancelled, the offsets are what they were"
    assert bench.drivers.offsets == before
    assert list(answer.joint_names) == []
    usable(bench)
    posing(bench)  # and it can be started again


def test_skipped_servos_are_no_success(bench: Bench) -> None:
    """War story of section 7: success was true even when every servo was skipped."""
    bench.drivers.offsets = dict.fromkeys(JOINTS, 240)
    posing(bench)
    bench.drivers.counts = {joint: home + 3001 for joint, home in HOMES.items()}
    answer = calibrate(bench, "commit")
    assert (answer.success, answer.state) == (False, "IDLE")
    assert answer.message.startswith(
        "shoulder_lift: it is off by 30.0 deg, more than 30.0 deg: mount its horn anew; elbow: "
    )
    assert list(answer.offsets_applied) == [0, 0, 0, 0]
    assert list(answer.diffs_observed) == [3001] * 4
    assert bench.drivers.offsets == dict.fromkeys(JOINTS, 240)
    usable(bench)


def test_a_servo_whose_offset_cannot_be_read_is_skipped_and_named(bench: Bench) -> None:
    """The others are calibrated."""
    posing(bench)
    bench.drivers.deaf.add(("read", "wrist"))
    bench.drivers.counts = {joint: home + 500 for joint, home in HOMES.items()}
    answer = calibrate(bench, "commit")
    assert (answer.success, answer.message) == (False, "wrist: its offset could not be read")
    assert list(answer.offsets_applied) == [500, 500, 0, 500]
    usable(bench)


def test_a_servo_that_tells_no_position_ends_a_commit(bench: Bench) -> None:
    """Only what is told after the commit counts; the offsets come back."""
    bench.drivers.offsets = dict.fromkeys(JOINTS, 240)
    posing(bench)
    bench.drivers.mute = {"elbow", "gripper"}
    work_off(bench.nodes)  # what was under way arrives
    answer = calibrate(bench, "commit")
    assert (answer.success, answer.state) == (False, "IDLE")
    assert answer.message == ("a servo does not tell where it is: nothing was heard of elbow, gripper")
    assert bench.drivers.offsets == dict.fromkeys(JOINTS, 240)
    assert list(answer.joint_names) == []
    usable(bench)


@pytest.mark.parametrize(
    ("service", "detail"),
    [
        ("read", "/io/servo/hiwonder/elbow/_offset: no answer within 3 s"),
        ("write", "/io/servo/hiwonder/elbow/_set_offset: no answer within 3 s"),
        ("turn", "/io/servo/hiwonder/elbow/set_angle refused: no reason given"),
    ],
)
def test_a_start_that_fails_gives_the_arm_its_torque_back(bench: Bench, service: str, detail: str) -> None:
    """War story of section 7: servos were switched on again on the way of success only."""
    bench.drivers.offsets = dict.fromkeys(JOINTS, 240)
    bench.drivers.deaf.add((service, "elbow"))
    answer = calibrate(bench, "start")
    assert (answer.success, answer.state) == (False, "IDLE")
    assert answer.message.startswith("a servo did not do what it was asked for: ")
    assert answer.message.endswith(detail)
    assert bench.drivers.offsets == dict.fromkeys(JOINTS, 240)
    usable(bench)


def test_a_gate_that_refuses_is_no_start(bench: Bench) -> None:
    """Nothing was changed, and the arm is free again."""
    bench.drivers.plan.append(refuse)
    answer = calibrate(bench, "start")
    assert (answer.success, answer.state) == (False, "IDLE")
    assert answer.message == (
        "a servo did not do what it was asked for: /enable_arm_control refused: the bus is silent"
    )
    usable(bench)


def test_an_arm_that_does_not_get_its_torque_back_is_told(bench: Bench) -> None:
    """Three tries, then a person must see to it."""
    posing(bench)
    bench.drivers.plan.extend([lambda a: a.answer(SetBool.Response(success=True))] * 2 + [refuse] * 3)
    answer = calibrate(bench, "cancel")
    assert (answer.success, answer.state) == (False, "IDLE")
    assert answer.message.startswith("the arm is still without torque; support it, and switch torque on: ")
    preset = bench.call(SetArmPreset, "/lupin/arm/preset", name="home")
    assert not preset.success
    assert calibrate(bench, "status").message == LIMP
    assert bench.call(SetBool, "/lupin/arm/set_torque", data=True).success
    assert calibrate(bench, "status").message == "ready"
    usable(bench)


def test_nobody_else_moves_an_arm_that_is_calibrated(bench: Bench) -> None:
    """Presets and the switch of the torque are refused, also by hand."""
    posing(bench)
    preset = bench.call(SetArmPreset, "/lupin/arm/preset", name="home")
    assert (preset.success, preset.message) == (False, "the arm is busy: it is being calibrated")
    assert not bench.call(SetBool, "/lupin/arm/set_torque", data=True).success


def test_the_emergency_stop_and_a_calibration(bench: Bench) -> None:
    """Nothing begins and nothing is committed while it is engaged; a limp arm waits for its release."""
    bench.until_stopped()
    refused = calibrate(bench, "start")
    assert (refused.success, refused.message) == (False, "the e-stop is engaged")
    bench.stop(False)
    bench.until(lambda: calibrate(bench, "start").success, "released")
    bench.until_stopped()
    assert calibrate(bench, "commit").message == "the e-stop is engaged"
    assert calibrate(bench, "status").state == "AWAITING_POSE"
    bench.stop(False)
    bench.until(lambda: calibrate(bench, "commit").success, "released")


def test_the_emergency_stop_ends_a_commit(make_node: MakeNode, tmp_path: Path) -> None:
    """Servos that would move to zero do not; the torque waits for the release."""
    bench = Bench(make_node, tmp_path / "arm.json", servos=True, hardware="real", **THOROUGH)
    bench.drivers.offsets = dict.fromkeys(JOINTS, 240)
    posing(bench)
    answers = bench.ask(CalibrateArm, CALIBRATE, action="commit")
    bench.until(lambda: calibrate(bench, "status").message == "under way: measuring", "measuring")
    bench.stop()
    bench.until(lambda: answers, "an answer")
    assert not answers[0].success
    assert answers[0].message.startswith("the arm is still without torque")
    assert bench.drivers.offsets == dict.fromkeys(JOINTS, 240)
    assert [call for call in bench.drivers.calls if call[0] == "turn"] == [("turn", j, 0.0) for j in JOINTS]


def test_a_measurement_that_was_cut_short_listens_to_no_servo_afterwards(
    make_node: MakeNode, tmp_path: Path
) -> None:
    window = {**QUICK, "calibration_window_s": "3.0"}
    bench = Bench(make_node, tmp_path / "arm.json", servos=True, hardware="real", **window)
    listeners = [f"{SERVOS}/{joint}/position" for joint in HOMES]

    def listening() -> int:
        return sum(map(bench.nodes[0].node.count_subscribers, listeners))

    posing(bench)
    answers = bench.ask(CalibrateArm, CALIBRATE, action="commit")
    bench.until(lambda: calibrate(bench, "status").message == "under way: measuring", "measuring")
    assert listening() == len(HOMES)
    bench.stop()
    bench.until(lambda: answers, "an answer")
    bench.stop(False)
    bench.until(lambda: listening() == 0, "the end")
    spin_for(bench.nodes, 3.5)
    assert listening() == 0


def test_a_calibration_does_not_begin_while_servos_are_switched(bench: Bench) -> None:
    """The gate that it closes would be opened again behind its back."""
    open_ones: list[Asked] = []
    bench.drivers.plan.append(open_ones.append)
    switched = bench.ask(SetBool, "/lupin/arm/set_torque", data=True)
    bench.until(lambda: open_ones, "the power is asked")
    answer = calibrate(bench, "start")
    why = "the arm cannot be had: the servos are being switched on or off"
    assert (answer.success, answer.state, answer.message) == (False, "IDLE", why)
    open_ones[0].answer(SetBool.Response(success=True))
    bench.until(lambda: switched, "the servos are on")
    assert bench.drivers.switched == [(POWER, True), (GATE, True)]
    posing(bench)


def test_an_arm_of_which_nothing_is_known_is_not_calibrated(bench: Bench) -> None:
    """It would lose its torque, and could not get it back where it is."""
    bench.drivers.telling = False
    why = "it is not known where the arm is: no /joint_states for more than 2 s"
    refused = lambda: bench.call(SetArmPreset, "/lupin/arm/preset", name="home").message == why  # noqa: E731
    bench.until(refused, "feedback grows old")
    answer = calibrate(bench, "start")
    assert (answer.success, answer.message) == (False, f"the arm cannot be had: {why}")
    assert bench.drivers.switched == []
    bench.drivers.telling = True
    bench.until(lambda: calibrate(bench, "start").success, "the arm is back")


def test_what_is_told_counts_what_a_servo_has_for_an_offset(bench: Bench) -> None:
    """Cleared at the start, and yet it says 150: both are off, and both are written."""
    posing(bench)
    bench.drivers.offsets["wrist"] = 150
    bench.drivers.counts = {joint: home + 300 for joint, home in HOMES.items()}
    answer = calibrate(bench, "commit")
    assert (list(answer.diffs_observed), list(answer.offsets_applied)) == ([300, 300, 450, 300],) * 2


def test_the_library_and_a_calibration_do_not_meet(bench: Bench) -> None:
    """A recording by hand has the arm, then the calibration does."""
    assert bench.record("start", mode="kinesthetic").success
    answer = calibrate(bench, "start")
    assert answer.message == "the arm cannot be had: the arm is busy: a recording by hand"
    assert bench.record("cancel").success
    posing(bench)
    answer = bench.record("start", mode="kinesthetic")
    assert answer.message == "the arm is busy: it is being calibrated"


def test_a_mission_refuses_a_calibration_and_ends_one(bench: Bench) -> None:
    """A robot does not drive off with a limp arm."""
    bench.drivers.offsets = dict.fromkeys(JOINTS, 240)
    posing(bench)
    bench.mission_is("PREPARE")
    bench.until(lambda: calibrate(bench, "status").message == "ready", "called off")
    assert bench.drivers.offsets == dict.fromkeys(JOINTS, 240)
    answer = calibrate(bench, "start")
    assert answer.message == "a mission is running (PREPARE); abort it or wait for its end"


def test_cancel_does_not_wait_for_servos_that_are_not_there(
    make_node: MakeNode, tmp_path: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """They are being looked for when the operator thinks again; nothing of that is left behind."""
    monkeypatch.setattr(servos_module, "LOOK_UP_S", PATIENCE)
    bench = Bench(make_node, tmp_path / "arm.json", hardware="real", **QUICK)
    started = bench.ask(CalibrateArm, CALIBRATE, action="start")
    bench.until(lambda: calibrate(bench, "status").message == "under way: reading", "looking for them")
    answer = calibrate(bench, "cancel")
    assert (answer.success, answer.state) == (True, "IDLE")
    assert (started[0].success, started[0].message) == (False, "cancelled, the offsets are what they were")
    spin_for(bench.nodes, 0.3)
    assert "callback failed" not in "".join(capfd.readouterr())
    usable(bench)


def hold(_: Asked) -> None:
    """Do not answer; somebody is killed while he waits."""


def pass_on(asked: Asked) -> None:
    """Switch."""
    asked.answer(SetBool.Response(success=True))


#: Step: what is asked for, whether a person poses the arm before, what the drivers do with the switches or
#: which servo's service is deaf from then on, and what is told afterwards.
KILLED_WHILE: dict[str, tuple[str, bool, list[Any] | tuple[str, str], str]] = {
    "the gate closes": ("start", False, [hold], LIMP),
    "offsets are read": ("start", False, ("read", "wrist"), LIMP),
    "offsets are cleared": ("start", False, ("write", "wrist"), CUT_OFF),
    "the torque goes": ("start", False, [pass_on, pass_on, hold], CUT_OFF),
    "a person poses it": ("status", True, [], CUT_OFF),
    "new offsets are written": ("commit", True, ("write", "elbow"), CUT_OFF),
    "the torque comes": ("commit", True, [hold], LIMP),
    "old offsets are written back": ("cancel", True, ("write", "elbow"), CUT_OFF),
    "the torque comes back": ("cancel", True, [pass_on, pass_on, hold], LIMP),
}


@pytest.mark.parametrize("step", KILLED_WHILE)
def test_a_kill_at_any_step_is_told_and_mended(
    make_node: MakeNode, world: World, tmp_path: Path, step: str
) -> None:
    """Servos end with offsets, old or new and nothing between, and with torque; until then it is told."""
    action, posed, obstacle, told = KILLED_WHILE[step]
    old = {"shoulder_lift": 50, "elbow": -300, "wrist": 700, "gripper": 0}
    moved = {"shoulder_lift": 500, "elbow": -1200, "wrist": 400, "gripper": 600}
    bench = Bench(make_node, tmp_path / "arm.json", world=world, servos=True, hardware="real", **QUICK)
    drivers = bench.drivers
    drivers.offsets = dict(old)
    if posed:
        posing(bench)
        drivers.counts = {joint: HOMES[joint] + by for joint, by in moved.items()}
    asked = len(drivers.switched), len(drivers.calls)
    if isinstance(obstacle, list):
        drivers.plan.extend(obstacle)
        reached = lambda: len(drivers.switched) == asked[0] + len(obstacle)  # noqa: E731
    else:
        drivers.deaf.add(obstacle)
        reached = lambda: obstacle in [call[:2] for call in drivers.calls[asked[1] :]]  # noqa: E731
    bench.ask(CalibrateArm, CALIBRATE, action=action)
    bench.until(reached, step)
    bench.dies(world.processes.pop("lupin_arm"))
    drivers.deaf.clear()
    log = world.log("lupin_arm")
    pinned = log.read_text(encoding="utf-8").count(PINNED)
    world.start("lupin_arm", library_path=tmp_path / "arm.json", hardware="real", **QUICK)
    assert calibrate(bench, "status").message == told
    bench.until(lambda: log.read_text(encoding="utf-8").count(PINNED) > pinned, "it knows where the arm is")
    if told == CUT_OFF:
        posing(bench)
        assert calibrate(bench, "cancel").success
    else:
        assert bench.call(SetBool, "/lupin/arm/set_torque", data=True).success
    assert drivers.offsets == (moved if step == "the torque comes" else old)
    usable(bench)
    again = world.processes["lupin_arm"]
    again.terminate()
    bench.until(lambda: again.poll() is not None, "the end of the process")
    assert not (tmp_path / "arm.offsets").exists()


def test_offsets_that_could_not_be_written_back_are_not_lost(bench: Bench) -> None:
    """A servo that is deaf for a while: the next calibration knows what it had, whatever it says then."""
    bench.drivers.offsets = dict.fromkeys(JOINTS, 240)
    posing(bench)
    bench.drivers.deaf.add(("write", "elbow"))
    calibrate(bench, "cancel")
    assert bench.drivers.offsets == {**dict.fromkeys(JOINTS, 240), "elbow": 0}
    assert calibrate(bench, "status").message.endswith("start, then cancel writes the offsets back")
    bench.drivers.deaf.clear()
    posing(bench)
    assert calibrate(bench, "cancel").success
    assert bench.drivers.offsets == dict.fromkeys(JOINTS, 240)


@pytest.mark.parametrize(
    "text", ["", "{", "[1]", '{"elbow": "x", "wrist": 90000, "tail": 1, "gripper": true}']
)
def test_a_mark_that_says_nothing_sensible_is_no_offset(
    make_node: MakeNode, tmp_path: Path, text: str
) -> None:
    """A disk that was full, or an editor: what the servos say counts."""
    (tmp_path / "arm.offsets").write_text(text)
    bench = Bench(make_node, tmp_path / "arm.json", servos=True, hardware="real", **QUICK)
    bench.drivers.offsets = dict.fromkeys(JOINTS, 240)
    posing(bench)
    assert calibrate(bench, "cancel").success
    assert bench.drivers.offsets == dict.fromkeys(JOINTS, 240)
    assert not (tmp_path / "arm.offsets").exists()


def test_servos_that_are_not_there_are_no_start(make_node: MakeNode, tmp_path: Path) -> None:
    """After two seconds."""
    bench = Bench(make_node, tmp_path / "arm.json", hardware="real", **QUICK)
    answer = calibrate(bench, "start")
    missing = "/io/servo/hiwonder/shoulder_lift/_offset: no server"
    assert answer.message == f"a servo did not do what it was asked for: {missing}"
    usable(bench)
