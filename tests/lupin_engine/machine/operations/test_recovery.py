"""Another process goes on: what the old one began is ended, nothing begins before somebody says so."""

from __future__ import annotations

from typing import Any

import pytest

from lupin_engine.machine import event as events
from lupin_engine.machine.event import CODE_REPORTED, HELD_BACK, RELEASED, RESUMED, Event
from lupin_engine.machine.memory import Phase
from lupin_engine.machine.operations import RECOVERY_DEADLINE
from lupin_engine.machine.step import Step
from lupin_engine.plugin.contract import RESTARTED, UNRECORDED
from tests.lupin_engine.machine.charts import PAUSE, Bench, chart

GONE = Event(RESUMED, {"detail": "for 3 s", "held": True, "away": 3.0})
STATES: dict[str, Any] = {
    "A": {
        "invoke": "nav.go",
        "on_done": "B",
        "on": {
            "operator.abort": {"target": "C", "releases": ["pause"]},
            "operator.skip": "C",
            "input.charge.low": {"target": "C", "releases": ["pause"]},
        },
        "after": {10.0: "C"},
    },
    "B": {"invoke": "bridge.read", "on_done": "C"},
    "C": {"invoke": "nav.dock"},
}


def bench() -> Bench:
    """Return a bench that drives."""
    made = Bench(chart(STATES, holds={"pause": PAUSE}, inputs={"charge": {"levels": {"low": (0.2, 0.05)}}}))
    made.send(events.accepted(made.attempt))
    return made


def restarted(made: Bench) -> Step:
    """Go on in another process."""
    made.restart()
    return made.send(GONE)


def test_what_was_under_way_is_ended_and_begun_again_on_release() -> None:
    """Held with a reason; the end of the old drive comes before the new one, whoever resumes when."""
    made = bench()
    old = made.attempt
    step = restarted(made)
    assert (made.machine.memory.held, [c.code for c in step.codes]) == ([RESTARTED], ["restarted"])
    assert step.codes[0].detail == "for 3 s"
    assert made.machine.memory.attempts[old].phase is Phase.CANCELLING
    assert made.send("operator.resume").accepted
    assert made.attempt == old  # nothing new is sent yet
    made.send(events.cancelled(old))
    assert made.attempt != old
    assert (made.leaves, made.machine.memory.held) == (["A"], [])


def test_what_does_not_end_is_waited_for_so_long() -> None:
    """A server that is gone for good must not keep the robot for ever."""
    made = bench()
    old = made.attempt
    restarted(made)
    made.send("operator.resume")
    made.wait(RECOVERY_DEADLINE - 0.1)
    assert made.attempt == old
    (step,) = made.wait(0.2)
    assert step.notes == (f"nav.go did not confirm its cancel in {RECOVERY_DEADLINE:g} s",)
    assert made.attempt != old


def test_a_call_is_not_begun_again_while_held() -> None:
    """An operation that goes on during a pause begins again only when somebody resumes."""
    made = bench()
    made.send(events.done(made.attempt, {}))
    read = made.attempt
    restarted(made)
    made.send(events.cancelled(read))
    assert made.attempt == read
    made.send("operator.resume")
    assert made.attempt != read


def test_only_somebody_releases_it() -> None:
    """A low battery, which diverts a paused robot, waits; an abort, which does so too, is taken."""
    made = bench()
    restarted(made)
    made.observe("charge", 0.1)
    assert (made.leaves, made.machine.memory.held) == (["A"], [RESTARTED])
    assert made.send("operator.skip").accepted is False
    assert made.send("operator.abort").accepted
    assert (made.leaves, made.machine.memory.held) == (["C"], [])


def test_a_pause_from_before_is_released_with_it() -> None:
    """One resume for both: who looks at the robot knows of both."""
    made = bench()
    made.send("operator.pause")
    restarted(made)
    assert made.machine.memory.held == ["pause", RESTARTED]
    assert made.send("operator.resume").accepted
    assert made.machine.memory.held == []


def test_a_deadline_that_has_passed_is_told_and_waits_due_at_once() -> None:
    """Clocks went on meanwhile."""
    made = bench()
    made.now += 12.0
    step = restarted(made)
    assert step.notes[:2] == (
        "the time of A has passed meanwhile, 2.0 s ago",
        "hold restarted engaged",
    )
    made.send("operator.resume")
    made.wait(0.0)
    assert made.leaves == ["C"]


def test_deadlines_that_have_passed_come_in_their_order() -> None:
    """Not in the order in which they were set."""
    inside = {"B": {"after": {2.0: "C"}}, "C": {}}
    made = Bench(chart({"A": {"after": {10.0: "D"}, "states": inside}, "D": {}}))
    made.now += 12.0
    restarted(made)
    made.send("operator.resume")
    assert [step.event.data["owner"] for step in made.wait(0.001)] == ["A.B", "A"]


@pytest.mark.parametrize("held", [True, False])
def test_what_a_passed_deadline_leads_to_at_once_comes_before_the_next(held: bool) -> None:
    """As it would have come if somebody had watched."""
    regions = {
        "P": {"states": {"P0": {"after": {5.0: "P1"}}, "P1": {"after": {0.0: "P2"}}, "P2": {}}},
        "Q": {"states": {"Q0": {"after": {6.0: "Q1"}}, "Q1": {}}},
    }
    made = Bench(chart({"A": {"kind": "parallel", "states": regions}}))
    made.now += 12.0
    made.restart()
    made.send(Event(RESUMED, {"away": 12.0, "held": held, "detail": ""}))
    if held:
        made.send("operator.resume")
    assert [step.event.data["owner"] for step in made.wait(0.001)] == ["A.P.P0", "A.P.P1", "A.Q.Q0"]


def test_a_failed_journal_holds_and_a_code_is_told() -> None:
    """Both come from whoever runs the machine."""
    made = bench()
    made.send(Event(CODE_REPORTED, {"code": "journal_failed", "detail": "full"}))
    assert (made.machine.view.code, made.machine.view.detail) == ("journal_failed", "full")
    made.send(Event(HELD_BACK, {"hold": UNRECORDED, "detail": "full"}))
    assert made.machine.memory.held == [UNRECORDED]
    made.send(Event(HELD_BACK, {"hold": UNRECORDED, "detail": "full"}))
    assert made.machine.memory.held == [UNRECORDED]


def test_who_runs_the_machine_releases_the_engines_holds_only() -> None:
    """A policy after a restart: what a person, a level or the disk holds stays held."""
    made = bench()
    restarted(made)
    made.send("operator.pause")
    made.send(Event(HELD_BACK, {"hold": UNRECORDED, "detail": "full"}))
    made.send(Event(RELEASED, {"hold": "pause"}))
    assert made.machine.memory.held == [RESTARTED, "pause", UNRECORDED]
    made.send(Event(RELEASED, {"hold": RESTARTED}))
    made.send(Event(RELEASED, {"hold": RESTARTED}))
    assert made.machine.memory.held == ["pause", UNRECORDED]
    made.send("operator.resume")  # a person's, and the policy's in journals of before
    assert made.machine.memory.held == []


def test_the_release_of_the_last_hold_goes_on() -> None:
    """As a person's resume does, with the same target and what had waited."""
    made = bench()
    old = made.attempt
    restarted(made)
    made.send(events.cancelled(old))
    step = made.send(Event(RELEASED, {"hold": RESTARTED}))
    assert (made.machine.memory.held, step.accepted) == ([], None)
    assert [type(command).__name__ for command in step.commands] == ["Start"]


@pytest.mark.parametrize("adopts", [True, False])
def test_an_operation_may_be_gone_on_with(adopts: bool) -> None:
    """Its attempt speaks on, where the operation says so; its end waits for the release."""
    made = bench()
    made.send(events.done(made.attempt, {}))
    read = made.attempt
    operation = made.machine.chart.states["B"].invoke
    assert operation is not None
    object.__setattr__(operation.operation, "adopts", adopts)
    try:
        step = restarted(made)
    finally:
        object.__setattr__(operation.operation, "adopts", False)
    assert ("bridge.read goes on" in step.notes) is adopts
    made.send(events.done(read, {}))
    made.send("operator.resume")
    assert made.leaves == (["C"] if adopts else ["B"])
