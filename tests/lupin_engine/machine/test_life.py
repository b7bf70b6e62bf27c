"""The life of an attempt: every line of `operations.LIFE`, what is lost, and who waits for whom."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from lupin_engine.machine import event as events
from lupin_engine.machine.event import Event
from lupin_engine.machine.memory import Attempt, Phase
from lupin_engine.machine.operations import CANCEL_DEADLINE, LIFE, MAX_LOST
from tests.lupin_engine.machine.charts import PAUSE, Bench, chart
from tests.tools import load_tool

STATES: dict[str, Any] = {
    "A": {"invoke": "nav.go", "on_done": "B", "on_error": "C", "on": {"away": "C", "dock": "D"}},
    "B": {"on": {"again": "A"}},
    "C": {"on": {"again": "A", "dock": "D"}},
    "U": {
        "invoke": {"do": "nav.follow", "update": 1.0, "with": {"path": lambda env: env["context"]["n"]}},
        "on": {"away": "C", "more": {"do": [("set", {"n": 2.0})]}},
    },
    "D": {"invoke": "nav.dock", "on_done": "B", "on_error": "C", "on": {"away": "C", "again": "A"}},
}
REPORTS = ("accepted", "done", "failed", "cancelled", "cancel_refused")


def said_of(word: str, attempt: str) -> Event:
    """Return what a server says of an attempt."""
    made = {
        "done": events.done(attempt, {}),
        "failed": events.failed(attempt, "blocked"),
        "cancel_refused": events.cancel_refused(attempt, "it goes on"),
    }
    return made.get(word) or Event(f"attempt.{word}", {"attempt": attempt})


def newest(bench: Bench) -> Attempt:
    """Return the attempt that was made last."""
    return list(bench.machine.memory.attempts.values())[-1]


def reach(phase: Phase) -> tuple[Bench, str]:
    """Return a bench with an attempt in a phase."""
    bench = Bench(chart(STATES, context={"n": 1.0}, initial="U" if phase is Phase.REPLACED else "A"))
    if phase is Phase.REPLACED:
        old = bench.attempt
        bench.send(events.accepted(old))
        bench.send("more")
        bench.wait(1.0)
        bench.send(events.accepted(bench.attempt))
        assert bench.machine.memory.attempts[old].phase is phase
        return bench, old
    if phase is Phase.WAITING:
        bench.send("dock")
    if phase is Phase.ACCEPTED:
        bench.send(events.accepted(bench.attempt))
    if phase in (Phase.CANCELLING, Phase.LOST, Phase.REFUSED):
        bench.send("away")
    if phase is Phase.LOST:
        bench.wait(CANCEL_DEADLINE)
    if phase is Phase.REFUSED:
        bench.send(said_of("cancel_refused", bench.attempt))
    attempt = newest(bench)
    assert attempt.phase is phase
    return bench, attempt.id


def let(word: str, bench: Bench, attempt: str) -> None:
    """Let happen to an attempt what a word of the table means."""
    if word == "resource free":
        bench.send(events.cancelled(bench.started[0].attempt))
    elif word == "not wanted":
        bench.send("away")
    elif word == "no answer in time":
        is_replaced = bench.machine.memory.attempts[attempt].phase is Phase.REPLACED
        bench.wait(2 * CANCEL_DEADLINE if is_replaced else CANCEL_DEADLINE)
    elif word == "updated":
        pass  # `reach` has done that
    elif word == "not ended in time":
        bench.wait(CANCEL_DEADLINE)
    else:
        bench.send(said_of(word, attempt))


@pytest.mark.parametrize(("phase", "word"), LIFE, ids=lambda given: getattr(given, "value", given))
def test_an_attempt_lives_as_the_table_says(phase: Phase, word: str) -> None:
    """From its phase, by that word, to the next phase or its end."""
    bench, attempt = reach(Phase.REPLACED if word == "updated" else phase)
    let(word, bench, attempt)
    found = bench.machine.memory.attempts.get(attempt)
    assert (found and found.phase) == LIFE[phase, word]


@pytest.mark.parametrize(
    ("phase", "word"),
    [(phase, word) for phase in Phase for word in REPORTS if (phase, word) not in LIFE],
    ids=lambda given: getattr(given, "value", given),
)
def test_what_the_table_does_not_hold_changes_nothing(phase: Phase, word: str) -> None:
    """A server that speaks of what it cannot know, or twice, is not believed; the step says so."""
    bench, attempt = reach(phase)
    step = bench.send(said_of(word, attempt))
    assert bench.machine.memory.attempts[attempt].phase is phase
    assert step.notes == (f"dropped: {word} of attempt {attempt}, which is {phase.value}",)
    assert not step.changed


def test_progress_is_no_word_of_the_table() -> None:
    """It is remembered of an attempt that somebody waits for, and nothing of any other."""
    for phase, detail in (
        (Phase.WAITING, "x"),
        (Phase.ACCEPTED, "x"),
        (Phase.CANCELLING, ""),
        (Phase.LOST, ""),
    ):
        bench, attempt = reach(phase)
        assert bench.send(events.progress(attempt, "x")).notes == ()
        assert bench.machine.memory.attempts[attempt].detail == detail


@pytest.mark.parametrize("word", REPORTS)
def test_reports_of_unknown_attempts_are_dropped(word: str) -> None:
    """Results are counted and told; what says nothing that could have been wanted is not."""
    bench = Bench(chart(STATES))
    counted = word in ("done", "failed")
    step = bench.send(said_of(word, "a99"))
    note = f"dropped: {word} of attempt a99, which nobody waits for"
    assert (step.notes, bench.machine.view.dropped) == ((note,) if counted else (), int(counted))


def test_a_report_that_comes_twice_counts_once() -> None:
    """Also one that waits for a release: its second copy is dropped."""
    reading = {"invoke": "bridge.read", "on_done": "B"}
    bench = Bench(chart({"A": reading, "B": {}}, holds={"pause": PAUSE}))
    bench.send("operator.pause")
    for _ in range(2):
        step = bench.send(events.done(bench.attempt, {}))
    note = f"dropped: done of attempt {bench.attempt}, which is over: its answer waits for the release"
    assert step.notes == (note,)
    assert len(bench.machine.memory.deferred) == 1
    bench.send("operator.resume")
    assert bench.leaves == ["B"]


# -- lost attempts ----------------------------------------------------------------------------------------


def lose(bench: Bench, number: int) -> list[str]:
    """Start and abandon that many attempts whose cancel nobody confirms."""
    lost = []
    for _ in range(number):
        lost.append(bench.attempt)
        bench.send("away")
        bench.wait(CANCEL_DEADLINE)
        bench.send("again")
    return lost


def test_a_lost_attempt_is_cancelled_whenever_it_is_accepted() -> None:
    """However late, and every time; its end is forgotten quietly."""
    bench = Bench(chart(STATES))
    (lost,) = lose(bench, 1)
    bench.wait(1000.0)
    for _ in range(2):
        step = bench.send(events.accepted(lost))
        assert bench.commands == [f"cancel {lost}"]
        assert step.notes == ("nav.go was accepted after its cancel: cancelled again",)
    bench.send(events.cancelled(lost))
    assert lost not in bench.machine.memory.attempts


def test_lost_attempts_are_remembered_up_to_a_number() -> None:
    """Then the oldest is forgotten: a server that never answers fills no memory."""
    bench = Bench(chart(STATES))
    lost = lose(bench, MAX_LOST + 3)
    kept = [found.id for found in bench.machine.memory.attempts.values() if found.phase is Phase.LOST]
    assert kept == lost[3:]
    assert bench.send(events.accepted(lost[0])).commands == ()


# -- one resource -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("word", ["done", "failed", "cancelled"])
def test_the_next_user_starts_when_the_resource_is_free(word: str) -> None:
    """Whatever the end of the one before; its result is nobody's any more."""
    bench, waiting = reach(Phase.WAITING)
    assert bench.commands == [f"cancel {bench.started[0].attempt}"]
    bench.send(said_of(word, bench.started[0].attempt))
    assert (bench.commands, bench.leaves) == ([f"start {waiting}"], ["D"])


def test_the_next_user_starts_after_the_cancel_deadline() -> None:
    """Three seconds, no more and no less."""
    bench, waiting = reach(Phase.WAITING)
    assert bench.wait(2.9) == []
    bench.wait(0.2)
    assert bench.commands == [f"start {waiting}"]


def test_users_start_in_the_order_in_which_they_came() -> None:
    """Of three, the second waits for the first and the third for the second."""
    regions = {name: {"states": {"x": {"invoke": "nav.go", "on_done": "y"}, "y": {}}} for name in "RST"}
    bench = Bench(chart({"P": {"kind": "parallel", "states": regions}}))
    ended = []
    for _ in regions:
        ended.append(bench.attempt)
        bench.send(events.done(bench.attempt, {}))
    assert ended == [start.attempt for start in bench.started] == ["a4", "a5", "a6"]
    assert bench.leaves == ["P.R.y", "P.S.y", "P.T.y"]


def test_nothing_is_started_for_a_state_that_is_being_left() -> None:
    """The arm becomes free in the very step in which the one who waits for it goes: it is not moved."""
    regions: dict[str, Any] = {
        "R": {"states": {"idle": {"on": {"go": "look"}}, "look": {"invoke": "arm.look"}}},
        "S": {"states": {"carry": {"invoke": "arm.carry"}}},
    }
    states = {
        "A": {"invoke": "nav.go", "on": {"go": "P"}},
        "P": {"kind": "parallel", "states": regions, "on": {"out": "Z"}},
        "Z": {},
    }
    bench = Bench(chart(states))
    bench.send("go")
    assert bench.send("go").notes == ("arm.look waits until arm.carry has ended",)
    assert (bench.send("out").commands, bench.leaves) == ((), ["Z"])


def test_what_may_run_while_held_starts_when_its_resource_is_free() -> None:
    """A call that does not move the robot waits for another one's end, not for the release."""
    call = {"do": "arm.look", "timeout": 9.0}
    states: dict[str, Any] = {
        "A": {
            "invoke": "arm.look",
            "on_done": "B",
            "on": {"operator.dock": {"target": "B", "during": ["pause"]}},
        },
        "B": {"invoke": call, "on_done": "A", "on_error": "A"},
    }
    bench = Bench(chart(states, holds={"pause": PAUSE}))
    first = bench.attempt
    bench.send("operator.pause")
    step = bench.send("operator.dock")
    assert (bench.commands, step.notes) == ([f"cancel {first}"], ("arm.look waits until arm.look has ended",))
    bench.send(events.cancelled(first))
    assert bench.commands == [f"start {bench.attempt}"]
    assert bench.machine.memory.frozen[0][0] == 9.0


def test_waiting_is_told_once() -> None:
    """In the step in which it begins, not in every step after it."""
    bench, _ = reach(Phase.WAITING)
    assert bench.send("anything").notes == ("nobody listens to anything",)


# -- operations around other states -----------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["compound", "parallel"])
def test_an_operation_of_a_state_with_children_lives_while_they_move(kind: str) -> None:
    """It is the state's: begun once, cancelled when the state is left, ended by its server."""
    region = {"states": {"x": {"on": {"go": "y"}}, "y": {"on": {"go": "x"}}}}
    around = {
        "kind": kind,
        "states": {"R": region, "S": region},
        "invoke": "nav.go",
        "on_done": "B",
        "on": {"out": "C"},
    }
    states = {"A": around, "B": {}, "C": {"on": {"back": "A"}}}
    bench = Bench(chart(states))
    first = bench.attempt
    for _ in range(3):
        bench.send("go")
    assert [start.attempt for start in bench.started] == [first]
    bench.send("out")
    assert bench.commands == [f"cancel {first}"]
    bench.send("back")
    bench.send(events.cancelled(first))
    bench.send(events.done(bench.attempt, {}))
    assert (bench.leaves, bench.machine.memory.invocations) == (["B"], {})


def test_operations_of_a_state_and_its_child_run_side_by_side() -> None:
    """Parents begin first; each answer is for its own state."""
    inner = {"x": {"invoke": "bridge.read", "on_done": "y"}, "y": {}}
    bench = Bench(chart({"A": {"invoke": "nav.go", "states": inner, "on_done": "B"}, "B": {}}))
    outer, inside = (start.attempt for start in bench.started)
    assert [start.operation for start in bench.started] == ["nav.go", "bridge.read"]
    bench.send(events.done(inside, {}))
    assert bench.leaves == ["A.y"]
    bench.send(events.done(outer, {}))
    assert bench.leaves == ["B"]


def test_the_view_tells_what_is_being_cancelled() -> None:
    """By the operation's name, until its end or the deadline."""
    bench, _ = reach(Phase.CANCELLING)
    assert (bench.machine.view.cancelling, bench.machine.view.attempts) == (("nav.go",), ())
    bench.wait(CANCEL_DEADLINE)
    assert bench.machine.view.cancelling == ()


# -- the picture ------------------------------------------------------------------------------------------

ROOT = Path(__file__).parents[3]


def test_the_picture_is_drawn_from_the_table() -> None:
    """A picture that is out of date is worse than none."""
    name = "docs/diagrams/attempt.mmd"
    if (ROOT / name).read_text(encoding="utf-8") != load_tool("attempt_life").picture():
        command = f".venv/bin/python tools/attempt_life.py > {name}"
        pytest.fail(f"{name} is out of date; write it anew: {command}", pytrace=False)
