"""The services of the library over real DDS: recordings, replays, hostile requests, and servos that fail."""

from __future__ import annotations

import errno
import json
import math
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from std_srvs.srv import SetBool, Trigger

from lupin_arm.library import Library, Sequence, Waypoint
from lupin_arm.node import feedback as feedback_module
from lupin_arm.node import library as library_module
from lupin_arm.node import torque as torque_module
from lupin_arm.presets import PRESETS
from lupin_msgs.srv import (
    ArmLibraryEdit,
    ArmRecord,
    GetArmLibrary,
    PlayArmSequence,
    SaveArmPose,
    SetArmPreset,
)
from lupin_ros.adapter.node import RosNode
from tests.lupin_ros.helpers import PATIENCE, spin_for, work_off
from tests.lupin_ros.plugins.arm.bench import GATE, LIBRARY, POWER, Bench, refuse
from tests.lupin_ros.plugins.arm.scene import near
from tests.lupin_ros.system.wire.wire import Asked, leave_open
from tests.lupin_ros.world import World

pytestmark = pytest.mark.timeout(300)

OFF, ON = [(GATE, False), (POWER, False)], [(POWER, True), (GATE, True)]
SWEEP = [[0.0, 0.0, 0.0, 0.0], [0.1, 0.0, 0.0, 0.0], [0.2, 0.1, 0.0, 0.0]]
AWAY = [1.5, 1.0, 0.0, 0.0]
BAD_NAMES = [
    "",
    " ",
    "../../etc/passwd",
    "a/b",
    "..",
    "ä",
    "a" * 33,
    "_a",
    "-a",
    "a b",
    "a" * 100_000,
]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """Where the library is."""
    return tmp_path / "settings" / "arm_library.json"


@pytest.fixture(autouse=True)
def patience(monkeypatch: pytest.MonkeyPatch) -> None:
    """Wait long for switches that a test answers when it has looked at what happens meanwhile."""
    monkeypatch.setattr(torque_module, "ANSWER_S", PATIENCE)


@pytest.fixture
def bench(make_node: Callable[..., RosNode], path: Path) -> Bench:
    """An arm with its drivers."""
    return Bench(make_node, path)


def listing(bench: Bench) -> dict[str, Any]:
    answer = bench.call(GetArmLibrary, f"{LIBRARY}/list")
    assert answer.success
    return dict(json.loads(answer.json))


def save(bench: Bench, name: str, **fields: Any) -> Any:
    return bench.call(SaveArmPose, f"{LIBRARY}/save_pose", name=name, **fields)


def play(bench: Bench, name: str, speed: float = 1.0) -> Any:
    return bench.call(PlayArmSequence, f"{LIBRARY}/play", name=name, speed=speed)


def keep_long_one(path: Path) -> None:
    """Have a sequence in the library that plays longer than anybody needs to look at it.

    Its first minute the arm stands still: where it should be is where the drivers say that it is.
    """
    waypoints = [Waypoint(t=time, arm=pose) for time, pose in ((0.0, AWAY), (60.0, AWAY), (62.0, SWEEP[0]))]
    Library(path).save_sequence("long", Sequence(duration_s=62.0, waypoints=waypoints), overwrite=False)


def play_long_one(bench: Bench, path: Path) -> None:
    """Have the arm play for a minute."""
    keep_long_one(path)
    bench.move_by_hand(AWAY)
    answer = play(bench, "long")
    assert answer.success, answer.message
    bench.until(lambda: len(bench.points) > 1, "the motion")


def steered(bench: Bench) -> None:
    """Have the arm in each pose of the sweep until the recorder has taken it."""
    for number, pose in enumerate(SWEEP, start=1):
        bench.drivers.pose = pose
        bench.until(lambda number=number: bench.told[-1]["n_waypoints"] == number, "a waypoint")


def recorded(bench: Bench, name: str = "sweep", mode: str = "teleop", **fields: Any) -> Any:
    """Record a sweep and save it."""
    assert bench.record("start", mode=mode, **fields).success
    bench.move_by_hand(*SWEEP)
    answer = bench.record("save", name=name)
    assert answer.success, answer.message
    return answer


def test_a_pose_is_saved_listed_moved_to_renamed_and_deleted(
    bench: Bench, path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What an operator does with a pose; a pose from now has the jaw, too."""
    monkeypatch.setattr(feedback_module, "FRESH_S", PATIENCE)
    bench.drivers.jaw = 0.1
    bench.move_by_hand([0.1, 0.2, 0.3, 0.4])
    assert save(bench, " Over_Pot ", from_current=True).message == "saved 'over_pot'"
    found = listing(bench)
    assert found["poses"] == [{"name": "over_pot", "note": "", "has_gripper": True}]
    assert found["sequences"] == []
    assert found["presets"] == sorted(PRESETS)
    assert found["joints"][2] == {"name": "elbow", "state": "elbow_joint", "low": -90, "high": 90}
    assert found["jaw"]["state"] == "gripper_joint"
    bench.move_by_hand([0.0, 0.0, 0.0, 0.0])
    answer = bench.call(SetArmPreset, f"{LIBRARY}/goto_pose", name="over_pot")
    assert answer.success, answer.message
    assert answer.message.startswith("over_pot: sent, there in 3.0 s")
    bench.until(lambda: bench.is_sent_to([0.1, 0.2, 0.3, 0.4]), "the trajectory, after the pin")
    edit = lambda **f: bench.call(ArmLibraryEdit, f"{LIBRARY}/delete", **f)  # noqa: E731
    renamed = edit(kind="pose", name="over_pot", new_name="pot")
    assert (renamed.success, renamed.message) == (True, "renamed pose 'over_pot' to 'pot'")
    assert Library(path).pose("pot").arm == pytest.approx([0.1, 0.2, 0.3, 0.4])
    assert edit(kind="pose", name="pot").message == "deleted pose 'pot'"
    assert listing(bench)["poses"] == []


def test_a_pose_of_numbers_is_kept_within_the_limits(bench: Bench) -> None:
    """Values beyond a limit are kept at it, and that is said."""
    answer = save(bench, "far", arm_rad=[9.0, 0.0, 0.0, 0.0], gripper_rad=9.0, has_gripper=True)
    assert answer.success
    assert answer.message == (
        "saved 'far'; shoulder_pan 515.7 deg is beyond its limit, kept as 90 deg; "
        "the gripper is beyond its limit, kept as 30 deg"
    )


@pytest.mark.parametrize("name", BAD_NAMES)
def test_no_name_leads_out_of_the_library(bench: Bench, path: Path, name: str) -> None:
    """Every service refuses it, and nothing is written."""
    pose = [0.0] * 4
    answers = [
        save(bench, name, arm_rad=pose),
        bench.call(SetArmPreset, f"{LIBRARY}/goto_pose", name=name),
        play(bench, name),
        bench.call(ArmLibraryEdit, f"{LIBRARY}/delete", kind="pose", name=name),
    ]
    for answer in answers:
        assert not answer.success
        assert answer.message.startswith("invalid name"), answer.message
        assert len(answer.message) < 200
    assert not path.parent.exists()


@pytest.mark.parametrize(
    ("values", "why"),
    [
        ([], "expected 4 angles (shoulder_pan, shoulder_lift, elbow, wrist), got 0"),
        ([0.0] * 3, "got 3"),
        ([0.0] * 5, "got 5"),
        ([0.0] * 100_000, "got 100000"),
        ([math.nan, 0.0, 0.0, 0.0], "finite numbers"),
        ([math.inf, 0.0, 0.0, 0.0], "finite numbers"),
    ],
)
def test_five_values_are_not_four(bench: Bench, path: Path, values: list[float], why: str) -> None:
    """War story of section 6: five values silently became four."""
    answer = save(bench, "x", arm_rad=values)
    assert not answer.success
    assert why in answer.message
    assert not path.exists()


def test_other_hostile_requests_are_answered(bench: Bench) -> None:
    """Unknown kinds, actions, modes and entries, speeds that are none."""
    recorded(bench)
    edit = f"{LIBRARY}/delete"
    answers = {
        "unknown kind": bench.call(ArmLibraryEdit, edit, kind="poses", name="x"),
        "unknown pose 'x'": bench.call(ArmLibraryEdit, edit, kind="pose", name="x"),
        "invalid name": bench.call(ArmLibraryEdit, edit, kind="sequence", name="sweep", new_name="../x"),
        "unknown sequence 'sweeep'": play(bench, "sweeep"),
        "the speed nan is not a number": play(bench, "sweep", math.nan),
        "unknown action": bench.record("stop" * 1000),
        "unknown mode": bench.record("start", mode="magic"),
        "nothing is being recorded": bench.record("save", name="x"),
    }
    for why, answer in answers.items():
        assert not answer.success, why
        assert why in answer.message
        assert len(answer.message) < 300
    assert not bench.record("cancel").success


def test_it_must_be_known_where_the_arm_is(bench: Bench) -> None:
    """A pose of an arm that tells nothing cannot be saved from now."""
    bench.drivers.telling = False
    bench.until(lambda: not save(bench, "x", from_current=True, overwrite=True).success, "feedback grows old")
    answer = save(bench, "x", from_current=True, overwrite=True)
    assert answer.message == "it is not known where the arm is: no joint states with all its joints just now"


def test_teleop_never_touches_torque(bench: Bench) -> None:
    """A recording of an arm that is steered leaves the servos alone."""
    answer = recorded(bench)
    assert answer.n_waypoints >= 3
    assert answer.duration_s > 0.2
    assert bench.drivers.switched == []


def test_a_recording_by_hand_asks_for_off_once_and_gives_it_back(bench: Bench, path: Path) -> None:
    """Off is confirmed before the answer; saving switches on again, and the sequence is in the file."""
    answer = bench.record("start", mode="kinesthetic")
    assert answer.message == "recording; the arm has no torque: move it by hand, then save"
    assert bench.drivers.switched == OFF
    state = bench.state(recording=True)
    assert (state["mode"], state["torque"], state["playing"]) == ("kinesthetic", False, False)
    assert path.with_name("arm_library.limp").exists()
    bench.move_by_hand(*SWEEP)
    answer = bench.record("save", name="sweep")
    assert (answer.success, answer.message) == (True, "saved 'sweep'")
    assert bench.drivers.switched == OFF + ON
    bench.state(torque=True, recording=False)
    assert not path.with_name("arm_library.limp").exists()
    found = Library(path).sequence("sweep")
    assert (found.mode, len(found.waypoints)) == ("kinesthetic", answer.n_waypoints)


def test_a_start_by_hand_that_is_not_confirmed_is_rolled_back(bench: Bench) -> None:
    """The servos refuse to be switched off: nothing is recorded, and they are on."""
    bench.drivers.plan.extend([succeed_gate, refuse])
    answer = bench.record("start", mode="kinesthetic")
    assert not answer.success
    assert answer.message.startswith("not recording: ")
    assert "the bus is silent" in answer.message
    assert answer.message.endswith("; the servos are on")
    assert bench.drivers.switched[-2:] == ON
    state = bench.state(recording=False)
    assert state["torque"] is True
    assert bench.record("start").success  # and the next one may begin


def succeed_gate(asked: Asked) -> None:
    """Let the first switch pass."""
    asked.answer(SetBool.Response(success=True))


def test_a_recording_by_hand_is_cancelled_by_switching_off_and_on(bench: Bench) -> None:
    """Cancel restores."""
    assert bench.record("start", mode="kinesthetic").success
    answer = bench.record("cancel")
    assert (answer.success, answer.message) == (True, "the recording is discarded")
    assert bench.drivers.switched == OFF + ON


def test_calls_of_torque_do_not_overlap(bench: Bench) -> None:
    """While the servos are being switched everything else is told to wait, and nothing is asked twice."""
    open_ones: list[Asked] = []
    bench.drivers.plan.append(open_ones.append)
    first = bench.ask(ArmRecord, f"{LIBRARY}/record", action="start", mode="kinesthetic")
    bench.until(lambda: open_ones, "the gate is asked")
    for action in ("start", "save", "cancel"):
        answer = bench.record(action, name="x")
        assert answer.message == "the servos are being switched for a recording; try again in a moment"
    refused = bench.call(SetBool, "/lupin/arm/set_torque", data=True)
    assert (refused.success, refused.message) == (False, "the arm is busy: a recording by hand")
    open_ones[0].answer(SetBool.Response(success=True))
    bench.until(lambda: first, "the recording begins")
    assert first[0].success
    assert bench.drivers.switched == OFF


def test_others_may_not_move_an_arm_that_is_held_by_hand(bench: Bench) -> None:
    """Presets, saved poses and replays are refused while a person holds the arm."""
    save(bench, "here", arm_rad=[0.0] * 4)
    assert bench.record("start", mode="kinesthetic").success
    preset = bench.call(SetArmPreset, "/lupin/arm/preset", name="home")
    assert (preset.success, preset.message) == (False, "the arm is busy: a recording by hand")
    went = bench.call(SetArmPreset, f"{LIBRARY}/goto_pose", name="here")
    assert went.message == "a recording by hand is under way; save or cancel it first"


@pytest.mark.parametrize(("mode", "problem"), [("teleop", errno.ENOSPC), ("kinesthetic", errno.EROFS)])
def test_a_failed_save_loses_nothing(
    bench: Bench, monkeypatch: pytest.MonkeyPatch, mode: str, problem: int
) -> None:
    """A disk that is full or read-only: the recording waits for another save, the arm has its torque."""

    def fail(*_: object) -> None:
        raise OSError(problem, os.strerror(problem))

    assert bench.record("start", mode=mode).success
    bench.move_by_hand(*SWEEP)
    with monkeypatch.context() as patch:
        patch.setattr("lupin_arm.library.write_atomically", fail)
        answer = bench.record("save", name="sweep")
        assert not answer.success
        assert os.strerror(problem) in answer.message
        assert answer.message.endswith("the recording is kept: save it again, or cancel it")
        assert answer.n_waypoints >= 3
        state = bench.state(unsaved=True)
        assert (state["recording"], state["torque"], state["n_waypoints"]) == (
            False,
            True,
            answer.n_waypoints,
        )
        again = bench.record("start")
        assert again.message == "a recording is not saved yet; save it under a name, or cancel it"
    saved = bench.record("save", name="sweep")
    assert saved.success, saved.message
    assert saved.n_waypoints == answer.n_waypoints
    assert bench.state(unsaved=False)["n_waypoints"] == 0


def test_a_name_that_is_taken_does_not_end_a_recording(bench: Bench) -> None:
    """War story of section 6: a name clash lost the recording."""
    recorded(bench, "sweep")
    assert bench.record("start").success
    bench.move_by_hand(*SWEEP)
    clash = bench.record("save", name="sweep")
    assert clash.message == (
        "sequence 'sweep' exists; choose another name or overwrite it; the recording is not lost"
    )
    assert bench.record("save", name="../x").message.startswith("invalid name")
    assert bench.state(recording=True)["n_waypoints"] >= 3
    assert bench.record("save", name="sweep", overwrite=True).success


def test_an_arm_of_which_nothing_is_known_keeps_its_torque(bench: Bench) -> None:
    """Nothing could be recorded, and the servos could not be switched on again."""
    bench.drivers.telling = False
    why = "it is not known where the arm is: no /joint_states for more than 2 s"
    refused = lambda: bench.call(SetArmPreset, "/lupin/arm/preset", name="home").message == why  # noqa: E731
    bench.until(refused, "feedback grows old")
    answer = bench.record("start", mode="kinesthetic")
    assert (answer.success, answer.message) == (False, why)
    assert bench.drivers.switched == []
    bench.drivers.telling = True
    bench.until(lambda: bench.record("start", mode="kinesthetic").success, "the arm is back")


def test_nothing_recorded_is_no_sequence(make_node: Callable[..., RosNode], bench: Bench) -> None:
    """Without joint states there is nothing to save, and the recording goes on."""
    bench.drivers.telling = False
    bench.until(lambda: not save(bench, "x", from_current=True).success, "feedback grows old")
    assert bench.record("start").success
    answer = bench.record("save", name="x")
    assert answer.message.startswith("nothing was recorded: no joint states")
    bench.drivers.telling = True
    bench.move_by_hand(*SWEEP)
    assert bench.record("save", name="x").success


def test_a_replay_moves_to_its_beginning_first(bench: Bench) -> None:
    """The arm stands elsewhere: it goes to the first pose at an ordinary pace, then along the recording."""
    answer = recorded(bench)
    bench.move_by_hand([1.2, 0.0, 0.0, 0.0])
    sent = len(bench.drivers.trajectories)
    told = play(bench, "SWEEP", 2.0)
    assert told.success, told.message
    assert bench.drivers.switched == ON  # the torque is confirmed
    bench.until(lambda: len(bench.drivers.trajectories) >= sent + 2, "the motion, after the pin")
    points = bench.drivers.trajectories[-1].points
    times = [p.time_from_start.sec + p.time_from_start.nanosec * 1e-9 for p in points]
    assert times[0] == pytest.approx(1.2 / math.radians(60.0), abs=0.01)
    assert times[-1] - times[0] == pytest.approx(answer.duration_s / 2.0, abs=0.05)
    assert times == sorted(set(times))
    assert list(points[0].positions) == pytest.approx(SWEEP[0])
    state = bench.state(playing=True)
    assert (state["name"], state["n_waypoints"], state["recording"]) == ("sweep", answer.n_waypoints, False)
    done = bench.state(playing=False)
    assert (done["name"], done["progress"]) == ("", 0.0)
    assert max(told["progress"] for told in bench.told) > 0.5


def test_nobody_else_moves_the_arm_during_a_replay(bench: Bench, path: Path) -> None:
    """Presets, saved poses, a second replay and recordings are refused, each with the reason."""
    play_long_one(bench, path)
    preset = bench.call(SetArmPreset, "/lupin/arm/preset", name="home")
    assert (preset.success, preset.message) == (False, "the arm is busy: playing 'long'")
    busy = "'long' is being played; stop it first"
    assert play(bench, "long").message == busy
    assert bench.record("start").message == busy
    stopped = bench.call(Trigger, f"{LIBRARY}/stop")
    assert (stopped.success, stopped.message) == (True, "stopped; the arm stays where it is")
    bench.until(lambda: bench.is_sent_to(AWAY), "the arm is held")
    assert bench.state(playing=False)["name"] == ""
    assert bench.call(Trigger, f"{LIBRARY}/stop").message == "there was nothing to stop"


def test_the_emergency_stop_ends_a_replay_and_refuses_another(bench: Bench, path: Path) -> None:
    """War story A30: a playing arm ignored the e-stop."""
    play_long_one(bench, path)
    bench.stop()
    assert bench.state(playing=False)["name"] == ""
    bench.until(lambda: bench.is_sent_to(AWAY), "the arm is held")
    answer = play(bench, "long")
    assert (answer.success, answer.message) == (False, "the emergency stop is engaged (/e_stop_state)")
    bench.stop(False)
    bench.until(lambda: play(bench, "long").success, "released")


def test_the_emergency_stop_does_not_end_a_recording_by_hand(bench: Bench, path: Path) -> None:
    """Nothing moves by itself; but the torque comes back only when the stop is released, and that is said."""
    assert bench.record("start", mode="kinesthetic").success
    bench.until_stopped()
    bench.move_by_hand(*SWEEP)
    answer = bench.record("save", name="sweep")
    assert answer.success
    assert answer.message == (
        "saved 'sweep'; the servos are still off: the emergency stop is engaged (/e_stop_state)"
    )
    assert bench.state(recording=False)["torque"] is False
    (notice,) = bench.state(recording=False)["notices"]
    assert notice.startswith("a recording by hand has ended, and the arm may still be without torque")
    bench.stop(False)
    bench.until(lambda: bench.call(SetBool, "/lupin/arm/set_torque", data=True).success, "the release")
    bench.until(lambda: "notices" not in bench.told[-1], "the notice is gone")
    assert not path.with_name("arm_library.limp").exists()


@pytest.mark.parametrize("state", ["PREPARE", "SPRAYING", "PRUNING_BY_NIGHT", "RETURNING"])
def test_the_library_does_not_fight_a_mission(bench: Bench, path: Path, state: str) -> None:
    """War story A30: while a mission runs nothing is begun, and one that begins ends what is under way.

    Also a mission whose states nobody here has seen before.
    """
    play_long_one(bench, path)
    bench.mission_is(state)
    assert bench.state(playing=False)["name"] == ""
    reason = f"a mission is running ({state}); abort it or wait for its end"
    assert play(bench, "long").message == reason
    assert bench.record("start", mode="kinesthetic").message == reason
    bench.mission_is("DONE")
    bench.until(lambda: play(bench, "long").success, "the mission has ended")


def test_a_mission_that_begins_ends_a_recording_by_hand_and_keeps_it(bench: Bench) -> None:
    """A robot does not drive off with a limp arm; what was recorded can still be saved."""
    assert bench.record("start", mode="kinesthetic").success
    bench.move_by_hand(*SWEEP)
    bench.mission_is("PREPARE")
    state = bench.state(unsaved=True)
    assert (state["recording"], state["torque"]) == (False, True)
    assert bench.drivers.switched == OFF + ON
    assert bench.record("save", name="sweep").success


def test_a_recording_that_is_saved_later_is_told_with_what_was_cut_from_it(bench: Bench) -> None:
    """What a hand has pushed beyond a limit was kept at it; that is said whenever it is saved."""
    assert bench.record("start", mode="kinesthetic").success
    bench.move_by_hand(*SWEEP, [0.2, 0.1, 1.6, 0.0])
    bench.mission_is("PREPARE")
    bench.state(unsaved=True)
    answer = bench.record("save", name="sweep")
    assert answer.message == "saved 'sweep', 1 waypoints beyond the limits were kept at them"


def test_stop_discards_a_recording_by_hand_and_lets_another_one_be(bench: Bench) -> None:
    """The torque comes back; a recording of a steered arm goes on."""
    assert bench.record("start", mode="kinesthetic").success
    stopped = bench.call(Trigger, f"{LIBRARY}/stop")
    assert stopped.message == "stopped; the recording by hand is discarded, the servos are on"
    bench.state(recording=False, torque=True)
    assert bench.drivers.switched == OFF + ON
    assert bench.record("start").success
    assert bench.call(Trigger, f"{LIBRARY}/stop").message == "there was nothing to stop"
    assert bench.state(recording=True)["mode"] == "teleop"


def test_stop_does_not_claim_torque_that_there_is_not(bench: Bench) -> None:
    """The emergency stop keeps the servos off; the answer says so rather than the contrary."""
    assert bench.record("start", mode="kinesthetic").success
    bench.stop()
    reason = "the emergency stop is engaged (/e_stop_state)"
    preset = lambda: bench.call(SetArmPreset, "/lupin/arm/preset", name="home").message  # noqa: E731
    bench.until(lambda: preset() == reason, "the stop is heard")
    stopped = bench.call(Trigger, f"{LIBRARY}/stop")
    still_off = f"stopped; the recording by hand is discarded; the servos are still off: {reason}"
    assert (stopped.success, stopped.message) == (True, still_off)
    assert bench.state(recording=False)["torque"] is False


def test_stop_calls_off_a_recording_that_is_about_to_begin(bench: Bench) -> None:
    """The servos are being switched off when the operator thinks again."""
    open_ones: list[Asked] = []
    bench.drivers.plan.append(open_ones.append)
    answers = bench.ask(ArmRecord, f"{LIBRARY}/record", action="start", mode="kinesthetic")
    bench.until(lambda: open_ones, "the gate is asked")
    stopped = bench.call(Trigger, f"{LIBRARY}/stop")
    assert stopped.message == "stopped; nothing is recorded, the servos are being switched on again"
    open_ones[0].answer(SetBool.Response(success=True))
    bench.until(lambda: answers, "an answer")
    assert answers[0].message == "not recording: stopped by the operator; the servos are on"
    assert bench.drivers.switched == OFF + ON


def test_stop_calls_off_a_replay_that_waits_for_torque(bench: Bench) -> None:
    """Nothing is sent when the torque comes."""
    recorded(bench)
    bench.drivers.plan.append(leave_open)
    answers = bench.ask(PlayArmSequence, f"{LIBRARY}/play", name="sweep", speed=1.0)
    bench.until(lambda: bench.drivers.switched, "the power is asked")
    assert bench.call(Trigger, f"{LIBRARY}/stop").success
    bench.until(lambda: answers, "an answer")
    assert (answers[0].success, answers[0].message) == (False, "stopped by the operator")
    assert {len(trajectory.points) for trajectory in bench.drivers.trajectories} == {1}  # pins


@pytest.mark.parametrize("mission", [False, True])
def test_a_move_to_a_pose_that_waits_for_torque_is_called_off(bench: Bench, mission: bool) -> None:
    """By a stop, and by a mission that begins: nothing is sent when the torque comes."""
    save(bench, "far", arm_rad=[1.0, 0.0, 0.0, 0.0])
    open_ones: list[Asked] = []
    bench.drivers.plan.append(open_ones.append)
    answers = bench.ask(SetArmPreset, f"{LIBRARY}/goto_pose", name="far")
    bench.until(lambda: open_ones, "the power is asked")
    if mission:
        bench.mission_is("PREPARE")
        bench.until(lambda: "a mission" in play(bench, "far").message, "the mission is heard of")
    else:
        stopped = bench.call(Trigger, f"{LIBRARY}/stop")
        assert (stopped.success, stopped.message) == (True, "stopped; the arm stays where it is")
    open_ones[0].answer(SetBool.Response(success=True))
    bench.until(lambda: answers, "an answer")
    reason = "a mission is running (PREPARE); abort it or wait for its end"
    assert (answers[0].success, answers[0].message) == (
        False,
        reason if mission else "stopped by the operator",
    )
    assert all(near(sent.points[-1].positions, SWEEP[0]) for sent in bench.drivers.trajectories)


def test_a_replay_without_torque_is_refused(bench: Bench) -> None:
    """War stories 41 and 75: servos that somebody has switched off stay off; silent ones are no servos."""
    recorded(bench)
    bench.drivers.plan.append(refuse)
    answer = play(bench, "sweep")
    assert not answer.success
    assert "the bus is silent" in answer.message
    assert bench.state(playing=False)["name"] == ""
    assert bench.call(SetBool, "/lupin/arm/set_torque", data=False).success
    off = "the servos are off; switch them on first (/lupin/arm/set_torque)"
    assert play(bench, "sweep").message == off
    save(bench, "here", arm_rad=[0.0] * 4)
    assert bench.call(SetArmPreset, f"{LIBRARY}/goto_pose", name="here").message == off


def go_far(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    """Have the arm on its way to a saved pose, so slowly that it is still where it was."""
    monkeypatch.setattr(library_module, "MOVE_S", 3600.0)
    save(bench, "far", arm_rad=[1.0, 0.0, 0.0, 0.0])
    assert bench.call(SetArmPreset, f"{LIBRARY}/goto_pose", name="far").success
    bench.until(lambda: bench.is_sent_to([1.0, 0.0, 0.0, 0.0]), "the motion")


def test_stop_holds_an_arm_on_its_way_to_a_pose(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    """A saved pose takes seconds."""
    go_far(bench, monkeypatch)
    assert bench.call(Trigger, f"{LIBRARY}/stop").message == "stopped; the arm stays where it is"
    bench.until(lambda: bench.is_sent_to([0.0] * 4), "the arm is held")


def test_a_mission_that_begins_holds_an_arm_on_its_way_to_a_pose(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    """While a mission runs the library moves nothing."""
    go_far(bench, monkeypatch)
    bench.mission_is("PREPARE")
    bench.until(lambda: bench.is_sent_to([0.0] * 4), "the arm is held")


def test_what_somebody_else_has_sent_since_is_not_stopped(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A mission that begins sends the arm, and then its state is heard: the preset goes on."""
    go_far(bench, monkeypatch)
    answer = bench.call(SetArmPreset, "/lupin/arm/preset", name="travel")
    assert (answer.success, answer.message) == (True, "travel: sent, there in 3.0 s")
    bench.until(lambda: bench.is_sent_to(PRESETS["travel"]), "the preset")
    assert bench.call(Trigger, f"{LIBRARY}/stop").message == "there was nothing to stop"
    bench.mission_is("PREPARE")
    bench.until(lambda: "a mission" in play(bench, "far").message, "the mission is heard of")
    work_off(bench.nodes)
    assert bench.is_sent_to(PRESETS["travel"])


def test_a_sequence_that_was_written_by_hand_is_checked_before_it_is_played(bench: Bench, path: Path) -> None:
    """Degrees instead of radians, say: nothing is sent."""
    recorded(bench)
    data = json.loads(path.read_text())
    data["sequences"]["sweep"]["waypoints"][1]["arm"][2] = 57.3
    path.write_text(json.dumps(data))
    sent = len(bench.drivers.trajectories)
    answer = play(bench, "sweep")
    assert answer.message == (
        "sequence 'sweep' is beyond the limits: waypoint 2: elbow: 3283.0 deg is not within -90 to 90; "
        "record it again or delete it"
    )
    assert len(bench.drivers.trajectories) == sent


def test_a_corrupt_file_is_kept_aside_and_reported(make_node: Callable[..., RosNode], path: Path) -> None:
    """In the answer of list, and in the state."""
    path.parent.mkdir()
    path.write_text("{ this is no JSON")
    bench = Bench(make_node, path)
    (notice,) = listing(bench)["notices"]
    assert notice.startswith("arm_library.json cannot be read (no JSON:")
    assert notice.endswith("is kept as arm_library.corrupt-1.json; the library is empty")
    assert bench.told[0]["notices"] == [notice]
    assert path.with_name("arm_library.corrupt-1.json").read_text() == "{ this is no JSON"
    recorded(bench)


def test_a_later_version_is_left_alone(make_node: Callable[..., RosNode], path: Path) -> None:
    """Nothing is written over it, and everybody is told why."""
    path.parent.mkdir()
    path.write_text(later := '{"version": 2, "poses": {}, "sequences": {}, "tools": []}')
    bench = Bench(make_node, path)
    answer = bench.call(GetArmLibrary, f"{LIBRARY}/list")
    assert not answer.success
    assert "was written by a later version" in json.loads(answer.json)["notices"][0]
    assert "was written by a later version" in save(bench, "x", arm_rad=[0.0] * 4).message
    assert path.read_text() == later


def test_what_a_kill_has_left_is_told_until_the_torque_is_back(
    make_node: Callable[..., RosNode], path: Path
) -> None:
    """A process that was killed during a recording by hand cannot switch on; the next one says so."""
    path.parent.mkdir()
    path.with_name("arm_library.limp").touch()
    bench = Bench(make_node, path)
    (notice,) = bench.told[0]["notices"]
    assert notice.startswith("a recording by hand has ended, and the arm may still be without torque")
    assert bench.drivers.switched == []  # nobody is surprised by an arm that stiffens by itself
    assert bench.call(SetBool, "/lupin/arm/set_torque", data=True).success
    bench.until(lambda: "notices" not in bench.told[-1], "the notice is gone")
    assert not path.with_name("arm_library.limp").exists()


def test_the_jaw_of_a_recording_is_played_where_a_gripper_is(bench: Bench) -> None:
    """Without the jaw's controller the arm plays all the same."""
    bench.drivers.jaw = 0.2
    answer = recorded(bench, include_gripper=True)
    assert answer.success
    assert listing(bench)["sequences"][0]["include_gripper"] is True
    assert play(bench, "sweep").success
    bench.state(playing=False)


def test_joint_states_without_a_stamp_are_recorded_by_their_arrival(bench: Bench) -> None:
    """War story of section 6: they had zero times."""
    bench.drivers.stamped = False
    bench.move_by_hand(SWEEP[0])
    assert bench.record("start").success
    steered(bench)
    answer = bench.record("save", name="sweep")
    assert answer.n_waypoints == len(SWEEP) + 1  # and where it ended
    assert answer.duration_s > 0.1


@pytest.mark.core
def test_a_process_that_ends_gives_the_arm_its_torque_back(
    make_node: Callable[..., RosNode], world: World, path: Path
) -> None:
    """Told to stop during a recording by hand: no limp arm is left behind."""
    bench = Bench(make_node, path, world=world)
    assert bench.record("start", mode="kinesthetic").success
    process = world.processes["lupin_arm"]
    process.terminate()
    bench.until(lambda: process.poll() is not None, "the end of the process")
    assert process.returncode == 0
    assert bench.drivers.switched == OFF + ON
    assert not path.with_name("arm_library.limp").exists()


def test_a_process_that_is_killed_leaves_a_mark(
    make_node: Callable[..., RosNode], world: World, path: Path
) -> None:
    """Killed, it can do nothing; the mark is what the next one finds."""
    bench = Bench(make_node, path, world=world)
    assert bench.record("start", mode="kinesthetic").success
    process = world.processes.pop("lupin_arm")
    process.kill()
    process.wait()
    assert bench.drivers.switched == OFF
    assert path.with_name("arm_library.limp").exists()


def test_a_process_that_ends_while_it_saves_waits_for_the_torque(
    make_node: Callable[..., RosNode], world: World, path: Path
) -> None:
    """Told to stop between the two switches: both are turned."""
    bench = Bench(make_node, path, world=world)
    assert bench.record("start", mode="kinesthetic").success
    steered(bench)
    open_ones: list[Asked] = []
    bench.drivers.plan.append(open_ones.append)
    bench.ask(ArmRecord, f"{LIBRARY}/record", action="save", name="sweep")
    bench.until(lambda: open_ones, "the power is asked")
    process = world.processes["lupin_arm"]
    process.terminate()
    spin_for(bench.nodes, 0.2)
    assert process.poll() is None
    open_ones[0].answer(SetBool.Response(success=True))
    bench.until(lambda: process.poll() is not None, "the end of the process")
    assert bench.drivers.switched == OFF + ON
    assert not path.with_name("arm_library.limp").exists()
    assert len(Library(path).sequence("sweep").waypoints) >= 3


@pytest.mark.parametrize("killed", [False, True])
def test_a_replay_does_not_outlive_its_process(
    make_node: Callable[..., RosNode], world: World, path: Path, killed: bool
) -> None:
    """The controller has the whole motion: one who ends holds the arm, and the next one after a kill does."""
    bench = Bench(make_node, path, world=world)
    play_long_one(bench, path)
    process = world.processes.pop("lupin_arm") if killed else world.processes["lupin_arm"]
    if killed:
        process.kill()
        process.wait()
        world.start("lupin_arm", library_path=path)
    else:
        process.terminate()
    bench.until(lambda: bench.is_sent_to(AWAY), "the arm is held")
