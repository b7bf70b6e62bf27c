"""Holds: the chart stands still and nothing is lost."""

from __future__ import annotations

import copy
from typing import Any

import pytest

from lupin_engine.machine import event as events
from lupin_engine.machine.step import Refusal
from tests.lupin_engine.machine.charts import PAUSE, Bench, chart

ESTOP: dict[str, Any] = {
    "engage": "input.estop",
    "release": ("operator.resume",),
    "release_guard": lambda env: not env["input"]["estop"],
    "code": "estop_engaged",
}
INPUTS = {"estop": {"value": "robot.estop", "initial": False}}
CODES = {"estop_engaged": "e-stop engaged", "not_running": "no mission is running"}

STATES: dict[str, Any] = {
    "DRIVE": {
        "invoke": {"do": "nav.go", "timeout": 10.0, "timeout_code": "late", "attempts": 2, "backoff": 4.0},
        "on_done": "READ",
        "on_error": "END",
        "on": {
            "operator.skip_current": {"target": "SKIPPED", "during": ["pause"]},
            "operator.abort": {"target": "HOME", "releases": ["pause"], "during": ["estop"]},
            "operator.dock": "HOME",
        },
    },
    "READ": {"invoke": {"do": "bridge.read", "timeout": 5.0}, "on_done": "DWELL", "on_error": "END"},
    "DWELL": {"after": {3.0: "END"}},
    "SKIPPED": {"always": "DRIVE"},
    "HOME": {
        "entry": ["!arm.preset", "log.line"],
        "invoke": "nav.dock",
        "on_done": "END",
        "on_error": "END",
        "on": {"operator.reset": {"target": "DRIVE", "during": ["pause", "estop"]}},
    },
    "END": {},
}


def held(initial: str = "DRIVE", **more: Any) -> Bench:
    """Return a bench with a pause and an e-stop."""
    holds = {"pause": PAUSE, "estop": ESTOP}
    return Bench(chart({**STATES, **more}, initial=initial, holds=holds, inputs=INPUTS, codes=CODES))


def press(bench: Bench, engaged: bool) -> list[str]:
    """Press or release the emergency stop; return what is commanded."""
    bench.send(events.observed("robot.estop", engaged, bench.now))
    return bench.commands


def test_a_pause_cancels_what_moves_and_sends_it_again() -> None:
    """The drive is cancelled, and issued again on release as a new attempt when the old one has ended."""
    bench = held()
    first = bench.attempt
    step = bench.send("operator.pause")
    assert (step.accepted, bench.commands) == (True, [f"cancel {first}"])
    bench.send(events.cancelled(first))
    assert bench.send("operator.resume").accepted
    assert bench.commands == [f"start {bench.attempt}"]
    assert bench.attempt != first


def test_a_pause_costs_no_try() -> None:
    """An attempt that a hold ended is refunded, however often."""
    bench = held()
    for _ in range(3):
        attempt = bench.attempt
        bench.send("operator.pause")
        bench.send(events.cancelled(attempt))
        bench.send("operator.resume")
    assert bench.machine.memory.invocations["DRIVE"].tries == 1


def test_a_quick_resume_waits_for_the_cancel() -> None:
    """The new goal is not sent while the server may still act on the old one."""
    bench = held()
    first = bench.attempt
    bench.send("operator.pause")
    step = bench.send("operator.resume")
    assert bench.commands == []
    assert "nav.go waits until nav.go has ended" in step.notes
    bench.send(events.cancelled(first))
    assert bench.commands == [f"start {bench.attempt}"]


def test_success_that_crosses_the_pause_is_not_success() -> None:
    """A drive that ended while it was cancelled is driven again: the robot may have been moved since."""
    bench = held()
    first = bench.attempt
    bench.send("operator.pause")
    bench.send(events.done(first, {}))
    assert bench.leaves == ["DRIVE"]
    bench.send("operator.resume")
    assert bench.commands == [f"start {bench.attempt}"]


def test_a_one_shot_call_finishes_and_its_answer_waits() -> None:
    """A reading is not asked for twice; what it said counts after the release."""
    bench = held("READ")
    bench.send("operator.pause")
    assert bench.commands == []
    step = bench.send(events.done(bench.attempt, {}))
    assert step.notes == ("the answer of bridge.read waits for the release",)
    assert bench.leaves == ["READ"]
    bench.wait(60.0)
    bench.send("operator.resume")
    assert bench.leaves == ["DWELL"]
    assert bench.machine.view.dropped == 0


def test_an_answer_that_waits_is_dropped_when_its_state_is_left() -> None:
    """A call that has ended is not cancelled, and its answer cannot come back later."""
    reading = {**STATES["READ"], "on": {"operator.abort": {"target": "END", "releases": ["pause"]}}}
    bench = held("READ", READ=reading)
    bench.send("operator.pause")
    bench.send(events.done(bench.attempt, {}))
    bench.send("operator.abort")
    assert (bench.leaves, bench.commands, bench.machine.view.dropped) == (["END"], [], 1)
    assert (bench.machine.memory.deferred, bench.machine.memory.attempts) == ([], {})


def test_an_answer_that_says_during_does_not_wait() -> None:
    """A transition that says `during` is taken for an answer as well."""
    reading = {**STATES["READ"], "on_done": {"target": "DWELL", "during": ["pause"]}}
    bench = held("READ", READ=reading)
    bench.send("operator.pause")
    bench.send(events.done(bench.attempt, {}))
    assert bench.leaves == ["DWELL"]
    assert bench.machine.view.held == ("pause",)


@pytest.mark.parametrize(("state", "waited", "left"), [("DWELL", 1.0, 2.0), ("READ", 4.0, 1.0)])
def test_clocks_stand_still(state: str, waited: float, left: float) -> None:
    """Timers and timeouts go on after the release where they stopped."""
    bench = held(state)
    bench.wait(waited)
    bench.send("operator.pause")
    assert bench.wait(1000.0) == []
    bench.send("operator.resume")
    assert bench.machine.next_deadline == bench.now + left


def test_a_back_off_stands_still() -> None:
    """The pause between two tries does not pass while held."""
    bench = held()
    bench.send(events.failed(bench.attempt, "nav_status_6"))
    bench.wait(1.0)
    bench.send("operator.pause")
    bench.wait(100.0)
    bench.send("operator.resume")
    assert bench.commands == []
    assert bench.machine.next_deadline == bench.now + 3.0


def test_a_timer_set_while_held_begins_on_release() -> None:
    """The dwell of a state entered during a pause has its whole time."""
    reading = {**STATES["READ"], "on_done": {"target": "DWELL", "during": ["pause"]}}
    bench = held("READ", READ=reading)
    bench.send("operator.pause")
    bench.send(events.done(bench.attempt, {}))
    assert bench.machine.next_deadline is None
    bench.wait(50.0)
    bench.send("operator.resume")
    assert bench.machine.next_deadline == 53.0


def test_the_cancel_deadline_does_not_stand_still() -> None:
    """A server answers or it does not, whatever the chart does."""
    bench = held()
    bench.send("operator.pause")
    (step,) = bench.wait(3.0)
    assert step.event.name == "timer.cancel"


def test_always_waits() -> None:
    """An eventless transition of a state entered during a pause is taken on release."""
    bench = held()
    bench.send("operator.pause")
    bench.send("operator.skip_current")
    assert bench.leaves == ["SKIPPED"]
    bench.send("operator.resume")
    assert bench.leaves == ["DRIVE"]


def test_during_takes_the_transition_and_keeps_the_hold() -> None:
    """A request that says `during` is served, and the chart stays held."""
    bench = held()
    bench.send("operator.pause")
    assert bench.send("operator.skip_current").accepted
    assert bench.machine.view.held == ("pause",)


def test_releases_ends_the_hold() -> None:
    """A request that says `releases` goes on at once: actions that move, then the operation."""
    bench = held()
    first = bench.attempt
    bench.send("operator.pause")
    bench.send(events.cancelled(first))
    bench.send("operator.abort")
    assert bench.machine.view.held == ()
    assert bench.commands == ["act log.line", "act arm.preset", f"start {bench.attempt}"]


def test_a_request_that_is_not_allowed_while_held_says_why() -> None:
    """Refused with the reason that the hold gives, and nothing changes."""
    bench = held()
    bench.send("operator.pause")
    before = copy.deepcopy(bench.machine.memory)
    step = bench.send("operator.dock")
    assert step.refusal == Refusal("paused", "dock refused: paused by the operator")
    before.sequence += 1
    assert bench.machine.memory == before


def test_what_moves_waits_for_the_release() -> None:
    """Actions and operations that move are carried out on release, in the order in which they were due."""
    bench = held()
    first = bench.attempt
    press(bench, True)
    bench.send(events.cancelled(first))
    bench.send("operator.abort")
    assert bench.leaves == ["HOME"]
    assert bench.commands == ["act log.line"]
    press(bench, False)
    assert bench.commands == []
    bench.send("operator.resume")
    assert bench.commands == ["act arm.preset", f"start {bench.attempt}"]


def test_a_level_engages_and_a_person_releases() -> None:
    """The e-stop engages with its input; when the input goes away the hold stays."""
    bench = held()
    first = bench.attempt
    assert press(bench, True) == [f"cancel {first}"]
    assert bench.send("operator.resume").refusal == Refusal("estop_engaged", "resume refused: e-stop engaged")
    press(bench, False)
    assert bench.machine.view.held == ("estop",)
    assert bench.send("operator.resume").accepted
    assert bench.machine.view.held == ()


def test_a_level_engages_again() -> None:
    """A second press after a release holds again."""
    bench = held()
    for _ in range(2):
        press(bench, True)
        assert bench.machine.view.held == ("estop",)
        press(bench, False)
        bench.send("operator.resume")


def test_two_holds_are_released_together_or_not_at_all() -> None:
    """A resume that one hold refuses releases none."""
    bench = held()
    bench.send("operator.pause")
    press(bench, True)
    bench.send("operator.resume")
    assert bench.machine.view.held == ("pause", "estop")
    press(bench, False)
    bench.send("operator.resume")
    assert bench.machine.view.held == ()


def test_a_second_hold_freezes_nothing_twice() -> None:
    """Time left is counted from the first hold to the last release."""
    bench = held("DWELL")
    bench.wait(1.0)
    bench.send("operator.pause")
    bench.wait(5.0)
    press(bench, True)
    bench.wait(5.0)
    press(bench, False)
    bench.send("operator.resume")
    assert bench.machine.next_deadline == bench.now + 2.0


def test_a_level_does_not_interrupt_a_step() -> None:
    """The e-stop of a chart that is at rest is engaged in its own step, before anything else of it."""
    moves = {
        "A": {"on": {"input.estop": {"target": "B", "during": ["estop"]}}},
        "B": {"invoke": "nav.go", "on_done": "A"},
    }
    bench = Bench(chart(moves, holds={"estop": ESTOP}, inputs=INPUTS, codes=CODES))
    assert press(bench, True) == []
    assert (bench.leaves, bench.machine.view.held) == (["B"], ("estop",))


def test_a_pause_twice_is_refused() -> None:
    """What is paused already cannot be paused."""
    bench = held()
    bench.send("operator.pause")
    assert bench.send("operator.pause").refusal == Refusal("paused", "pause refused: paused by the operator")


def test_a_hold_may_be_engaged_only_where_its_guard_holds() -> None:
    """`engage_guard` refuses with `engage_code`."""
    pause = {**PAUSE, "engage_guard": lambda env: env["in_state"](("B",)), "engage_code": "not_running"}
    bench = Bench(chart({"A": {}, "B": {}}, holds={"pause": pause}, codes=CODES))
    assert bench.send("operator.pause").refusal == Refusal(
        "not_running", "pause refused: no mission is running"
    )


def test_resume_without_a_hold_says_that_nothing_is_paused() -> None:
    """The text is for an operator who pressed the wrong button."""
    step = held().send("operator.resume")
    assert step.refusal == Refusal(
        "not_possible", "resume is not possible in DRIVE because nothing is paused"
    )


def test_a_pause_is_no_error() -> None:
    """A code that is information only does not replace a warning in `last_error`."""
    bench = held()
    bench.send(events.failed(bench.attempt, "nav_status_6"))
    bench.send("operator.pause")
    assert bench.machine.view.code == "nav_status_6"
    press(bench, True)
    assert bench.machine.view.code == "estop_engaged"


def test_in_fault_an_emergency_stop_does_not_hide_what_failed() -> None:
    """Nothing less severe replaces the reason until that is cleared."""
    on = {"operator.abort": {"target": "FAULT", "code": "crashed"}}
    bench = held(
        "READY", READY={"on": on}, FAULT={"on": {"operator.reset": {"target": "READY", "do": "report.clear"}}}
    )
    press(bench, True)
    press(bench, False)
    bench.send("operator.resume")
    bench.send("operator.abort")
    assert bench.machine.view.code == "crashed"
    press(bench, True)
    assert (bench.machine.view.code, bench.machine.view.held) == ("crashed", ("estop",))
    press(bench, False)
    bench.send("operator.resume")
    bench.send("operator.reset")
    press(bench, True)
    assert bench.machine.view.code == "estop_engaged"


def test_an_answer_waits_unless_everything_that_may_follow_goes_through_the_hold() -> None:
    """One transition with `during` does not take another one, without it, through an e-stop."""
    read = {
        "invoke": "bridge.read",
        "on_done": [{"target": "END", "during": ["estop"], "guard": lambda env: False}, "DRIVE"],
        "on_error": "END",
    }
    bench = held("READ", READ=read)
    press(bench, True)
    bench.send(events.done(bench.attempt, {}))
    assert bench.leaves == ["READ"]
    press(bench, False)
    bench.send("operator.resume")
    assert bench.leaves == ["DRIVE"]


def test_an_action_that_waits_is_forgotten_with_its_state() -> None:
    """What was meant for a state that is left does not move the arm later, or in the next mission."""
    bench = held()
    press(bench, True)
    bench.send("operator.abort")
    bench.send("operator.reset")
    assert bench.leaves == ["DRIVE"]
    press(bench, False)
    bench.send("operator.resume")
    assert "act arm.preset" not in bench.commands


def test_a_release_begins_nothing_in_a_state_that_it_leaves() -> None:
    """What became true while held is looked at first; only then operations begin, in what is active then."""
    level = {**INPUTS, "low": {"value": "robot.low", "initial": False}}
    drive = {"invoke": "nav.go", "on_done": "END", "on_error": "END"}
    states = {"DRIVE": {**drive, "on": {"input.low": "HOME"}}, "HOME": STATES["HOME"], "END": {}}
    bench = Bench(chart(states, holds={"pause": PAUSE}, inputs=level, codes=CODES))
    first = bench.attempt
    bench.send("operator.pause")
    bench.send(events.cancelled(first))
    bench.send(events.observed("robot.low", True, bench.now))
    bench.send("operator.resume")
    assert bench.commands == ["act arm.preset", "act log.line", f"start {bench.attempt}"]
    assert bench.machine.memory.attempts[bench.attempt].operation == "nav.dock"
