"""An operation whose arguments change while it runs: the server gets them as a new goal in its place."""

from __future__ import annotations

from typing import Any

import pytest

from lupin_engine.machine import event as events
from lupin_engine.machine.event import RESUMED, Event, Start
from lupin_engine.machine.memory import Phase
from lupin_engine.machine.operations import CANCEL_DEADLINE, RECOVERY_DEADLINE
from lupin_engine.properties import built_in
from tests.lupin_engine.machine.charts import PAUSE, Bench, chart, said


def follow(**more: Any) -> dict[str, Any]:
    """Return the states of a drive along a path that changes."""
    invoke = {
        "do": "nav.follow",
        "with": {"path": lambda env: env["input"]["path"]},
        "update": 1.0,
        "timeout": 10.0,
        "timeout_code": "late",
        **more,
    }
    return {
        "A": {"invoke": invoke, "on_done": "B", "on_error": "C", "on": {"away": "D", "out": "C"}},
        "B": {},
        "C": {},
        "D": {"invoke": "nav.dock", "on": {"back": "A"}},
    }


def driving(**more: Any) -> Bench:
    """Return a bench whose drive is accepted, along path 1."""
    bench = Bench(
        chart(
            follow(**more), holds={"pause": PAUSE}, inputs={"path": {"initial": 1.0}}, codes={"late": "late"}
        )
    )
    bench.send(events.accepted(bench.attempt))
    return bench


def updated(**more: Any) -> tuple[Bench, str, str]:
    """Return a bench with a drive that is replaced, its attempt, and the one in its place, not accepted."""
    bench = driving(**more)
    old = bench.attempt
    bench.observe("path", 2.0)
    bench.wait(1.0)
    assert bench.commands == [f"start {bench.attempt}"]
    return bench, old, bench.attempt


def phases(bench: Bench) -> dict[str, str]:
    """Return the phases of all attempts."""
    return {name: attempt.phase.value for name, attempt in bench.machine.memory.attempts.items()}


# -- the usual way ----------------------------------------------------------------------------------------


def test_new_arguments_are_a_new_goal_and_the_end_of_the_old_one_is_no_news() -> None:
    """Nothing is cancelled, nothing is counted as dropped, and no try is added."""
    bench, old, new = updated()
    assert bench.started[-1] == Start(new, "nav.follow", {"path": 2.0}, "A", 1, old)
    assert phases(bench) == {old: "replaced", new: "requested"}
    bench.send(events.accepted(new))
    step = bench.send(events.failed(old, "aborted"))
    assert (step.notes, step.codes, step.changed) == ((), (), False)
    assert (phases(bench), bench.machine.view.dropped) == ({new: "accepted"}, 0)
    bench.send(events.done(new, {}))
    assert (bench.leaves, phases(bench), bench.machine.memory.timers) == (["B"], {}, [])


def test_what_stays_the_same_is_not_sent_again() -> None:
    bench = driving()
    bench.observe("path", 1.0)
    for step in bench.wait(5.0):
        assert not step.changed
    assert len(bench.started) == 1


def test_it_is_sent_at_most_once_in_that_time() -> None:
    bench = driving()
    for number in range(40):
        bench.observe("path", 2.0 + number)
        bench.wait(0.125)
        if phases(bench).get(bench.attempt) == "requested":
            bench.send(events.accepted(bench.attempt))
            bench.send(events.cancelled(bench.started[-2].attempt))
    assert len(bench.started) == 1 + 5
    assert [start.tries for start in bench.started] == [1] * 6


def test_a_value_that_is_not_known_changes_nothing() -> None:
    """The goal goes on, and is updated when the value is known again."""
    bench = Bench(chart(follow(), inputs={"path": {"initial": 1.0, "freshness": 0.5}}))
    bench.send(events.accepted(bench.attempt))
    ticks = [step for step in bench.wait(3.0) if step.event.name == "timer.update"]
    assert [(step.changed, step.codes, step.notes) for step in ticks] == [(False, (), ())] * 3
    bench.wait(0.9)
    bench.observe("path", 3.0)
    bench.wait(0.2)
    assert bench.started[-1].arguments == {"path": 3.0}


def test_arguments_outside_their_range_change_nothing_and_are_noted() -> None:
    def path(env: Any) -> Any:
        return 1.0 if env["input"]["path"] < 5.0 else 1 / 0

    bench = driving(**{"with": {"path": path}})
    bench.observe("path", 6.0)
    (step,) = bench.wait(1.0)
    assert step.notes == ("nav.follow is not updated: test.yaml:1:1: division by zero",)
    assert (step.changed, phases(bench)) == (False, {bench.attempt: "accepted"})


def test_a_period_that_is_an_error_is_the_states_own() -> None:
    bench = driving(update=lambda env: 1.0 if env["input"]["path"] < 2.0 else 0.01)
    bench.observe("path", 2.0)
    (step,) = bench.wait(1.0)
    detail = "test.yaml:1:1: update: 0.01 s is too often, the shortest is 0.1 s"
    assert [code.detail for code in step.codes] == [detail]
    assert bench.leaves == ["C"]


def test_nothing_is_sent_before_the_server_has_taken_the_last_one() -> None:
    """At most one goal is not accepted, and at most one is replaced."""
    bench, old, new = updated()
    bench.observe("path", 3.0)
    bench.wait(2.0)
    assert phases(bench) == {old: "replaced", new: "requested"}
    bench.send(events.accepted(new))
    bench.wait(1.0)
    assert bench.attempt == new
    bench.send(events.cancelled(old))
    bench.wait(1.0)
    assert bench.started[-1].arguments == {"path": 3.0}
    assert phases(bench) == {new: "replaced", bench.attempt: "requested"}


def test_the_time_limit_is_that_of_all_of_them() -> None:
    bench, old, new = updated()
    bench.send(events.accepted(new))
    bench.send(events.cancelled(old))
    (shown,) = bench.machine.view.attempts
    assert (shown.deadline, shown.limit, shown.tries) == (10.0, 10.0, 1)
    bench.wait(9.0)
    assert bench.commands == [f"cancel {new}"]
    assert (bench.leaves, bench.machine.view.code) == (["C"], "late")
    assert bench.steps[-1].event.data == {"owner": new}


def test_a_retry_is_a_try_more_with_a_limit_of_its_own() -> None:
    bench, old, new = updated(attempts=2)
    bench.send(events.accepted(new))
    bench.send(events.cancelled(old))
    bench.send(events.failed(new, "blocked"))
    bench.wait(0.0)
    assert bench.started[-1].tries == 2
    assert bench.started[-1].updates == ""
    assert bench.machine.view.attempts[0].deadline == pytest.approx(bench.now + 10.0)


# -- what stops it ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("ends", ["replaced", "over"])
@pytest.mark.parametrize("accepted", [False, True])
def test_leaving_cancels_all_that_may_still_move(accepted: bool, ends: str) -> None:
    """In the window between the two also the goal that the server may still work on."""
    bench, old, new = updated()
    if accepted:
        bench.send(events.accepted(new))
    if ends == "over":
        bench.send(events.cancelled(old))
    bench.send("away")
    lives = [new] if ends == "over" else [new, old]
    assert bench.commands == [f"cancel {name}" for name in lives]
    assert phases(bench) == {**dict.fromkeys(sorted(lives), "cancelling"), list(phases(bench))[-1]: "waiting"}
    for name in lives:
        assert bench.started[-1].operation == "nav.follow"
        bench.send(events.cancelled(name))
    assert bench.started[-1].operation == "nav.dock"


@pytest.mark.parametrize("accepted", [False, True])
def test_a_hold_cancels_both_and_the_release_begins_once(accepted: bool) -> None:
    bench, old, new = updated()
    if accepted:
        bench.send(events.accepted(new))
    bench.send("operator.pause")
    assert bench.commands == [f"cancel {new}", f"cancel {old}"]
    seen = built_in.Passage(built_in.Glance(), bench.steps[-1], bench.machine.scope)
    assert built_in._hold_stops_all(seen) == ""
    bench.send(events.accepted(new))
    assert bench.commands == [f"cancel {new}"]
    bench.send(events.cancelled(old))
    bench.send(events.cancelled(new))
    bench.wait(20.0)
    bench.send("operator.resume")
    assert (bench.started[-1].updates, bench.started[-1].tries, bench.started[-1].arguments) == (
        "",
        1,
        {"path": 2.0},
    )


def test_the_time_limit_cancels_both() -> None:
    bench, old, new = updated()
    bench.wait(9.0)
    assert bench.commands == [f"cancel {new}", f"cancel {old}"]
    assert bench.leaves == ["C"]


@pytest.mark.parametrize("word", ["failed", "cancelled", "done"])
def test_when_the_new_one_ends_the_old_one_is_cancelled(word: str) -> None:
    """It was not accepted, so that the server may still work on the old one."""
    bench, old, new = updated()
    ends = {
        "failed": events.failed(new, "rejected"),
        "cancelled": events.cancelled(new),
        "done": events.done(new, {}),
    }
    bench.send(ends[word])
    assert bench.commands == [f"cancel {old}"]
    assert (phases(bench), bench.leaves) == ({old: "cancelling"}, ["B" if word == "done" else "C"])


def test_an_old_goal_that_does_not_end_is_cancelled() -> None:
    """Its server was said to take the new one in its place, and does both."""
    bench, old, new = updated(timeout=100.0)
    bench.wait(2 * CANCEL_DEADLINE)
    assert phases(bench)[old] == "replaced"
    bench.send(events.accepted(new))
    cancels = [step for step in bench.wait(CANCEL_DEADLINE) if step.commands]
    assert [said(step) for step in cancels] == [[f"cancel {old}"]]
    assert cancels[0].notes == ("nav.follow still works on a goal that was replaced",)
    assert phases(bench) == {old: "replaced", new: "accepted"}
    bench.wait(CANCEL_DEADLINE)
    assert phases(bench) == {old: "lost", new: "accepted"}


def test_one_that_refuses_to_end_keeps_what_it_uses() -> None:
    bench, old, new = updated(timeout=100.0)
    bench.send(events.accepted(new))
    bench.wait(CANCEL_DEADLINE)
    bench.send(events.cancel_refused(old, "it goes on"))
    assert phases(bench) == {old: "refused", new: "accepted"}
    bench.observe("path", 3.0)
    bench.wait(5.0)
    assert bench.attempt == new
    bench.send("away")
    bench.send(events.cancelled(new))
    assert bench.attempt == new
    bench.send(events.cancelled(old))
    assert bench.started[-1].operation == "nav.dock"


@pytest.mark.parametrize("accepted", [False, True])
def test_another_process_cancels_both(accepted: bool) -> None:
    bench, old, new = updated()
    if accepted:
        bench.send(events.accepted(new))
    bench.restart()
    assert phases(bench)[old] == "replaced"
    bench.send(Event(RESUMED, {"detail": "", "held": True, "away": 1.0}))
    assert sorted(bench.commands) == [f"cancel {old}", f"cancel {new}"]
    assert phases(bench) == {old: "cancelling", new: "cancelling"}
    bench.send("operator.resume")
    assert bench.attempt == new
    bench.send(events.cancelled(old))
    bench.send(events.cancelled(new))
    assert bench.started[-1].arguments == {"path": 2.0}


def test_what_is_adopted_is_so_only_when_it_is_the_only_one() -> None:
    bench = driving(do="lamp.show")
    bench.restart()
    bench.send(Event(RESUMED, {"detail": "", "held": True, "away": 1.0}))
    assert (bench.commands, bench.steps[-1].notes[0]) == ([], "lamp.show goes on")
    bench, old, new = updated(do="lamp.show")
    bench.restart()
    bench.send(Event(RESUMED, {"detail": "", "held": True, "away": 1.0}))
    assert sorted(bench.commands) == [f"cancel {old}", f"cancel {new}"]
    bench.wait(RECOVERY_DEADLINE)
    assert set(phases(bench).values()) == {"lost"}


def test_while_held_nothing_is_updated_and_an_answer_is_heard_after_the_release() -> None:
    bench = driving(do="lamp.show")
    shown = bench.attempt
    bench.send("operator.pause")
    bench.observe("path", 2.0)
    bench.wait(5.0)
    assert bench.attempt == shown
    bench.send(events.done(shown, {}))
    bench.send("operator.resume")
    assert bench.leaves == ["B"]
    assert bench.machine.memory.timers == []


def test_who_waits_for_the_resource_waits_for_the_update_too() -> None:
    """It has waited longer than the new goal is there, and begins after it all the same."""
    regions = {
        "R": {"states": follow()},
        "S": {"states": {"x": {"on": {"go": "y"}}, "y": {"invoke": "nav.dock"}}},
    }
    bench = Bench(chart({"P": {"kind": "parallel", "states": regions}}, inputs={"path": {"initial": 1.0}}))
    old = bench.attempt
    bench.send(events.accepted(old))
    bench.send("go")
    bench.observe("path", 2.0)
    bench.wait(1.0)
    new = bench.attempt
    assert list(phases(bench).values()) == ["replaced", "waiting", "requested"]
    bench.send(events.accepted(new))
    bench.send(events.cancelled(old))
    assert bench.attempt == new
    bench.observe("path", 3.0)
    bench.wait(1.0)
    assert bench.started[-1].updates == new
    bench.send(events.cancelled(new))
    bench.send(events.done(bench.attempt, {}))
    assert bench.started[-1].operation == "nav.dock"


def test_only_the_same_operation_may_run_beside_what_it_replaced() -> None:
    """Else two goals would fight."""
    bench, old, _ = updated()
    seen = built_in.Passage(built_in.Glance(), bench.steps[-1], bench.machine.scope)
    assert built_in._resources_exclude(seen) == ""
    attempt = bench.machine.memory.attempts[old]
    attempt.phase = Phase.ACCEPTED
    assert "both use base" in (built_in._resources_exclude(seen) or "")
    attempt.phase, attempt.invocation = Phase.REPLACED, "D"
    assert "both use base" in (built_in._resources_exclude(seen) or "")
