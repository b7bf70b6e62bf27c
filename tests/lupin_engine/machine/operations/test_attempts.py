"""Operations in attempts: only the current one speaks, whatever the others say and whenever."""

from __future__ import annotations

import math
from typing import Any

import pytest

from lupin_engine.machine import event as events
from lupin_engine.machine.event import Cancel, Start
from lupin_engine.machine.memory import Phase
from lupin_engine.machine.operations import CANCEL_DEADLINE
from tests.lupin_engine.machine.charts import PAUSE, Bench, chart

ONE = {
    "A": {
        "invoke": {"do": "nav.go", "with": {"to": 7}, "timeout": 10.0, "timeout_code": "late"},
        "on_done": "B",
        "on_error": {"target": "C", "do": ("set", {"error": lambda env: dict(env["error"])})},
        "on": {"away": "C", "dock": "D"},
    },
    "B": {},
    "C": {"on": {"back": "A"}},
    "D": {"invoke": "nav.dock", "on_done": "B", "on_error": "C"},
}


def bench_with(**invoke: Any) -> Bench:
    """Return a bench whose first state drives, as `invoke` says."""
    state = {**ONE["A"], "invoke": {"do": "nav.go", **invoke}}
    return Bench(chart({**ONE, "A": state}, context={"error": None}))


def plain() -> Bench:
    """Return a bench with the one drive that takes at most 10 s."""
    return Bench(chart(ONE, context={"error": None}))


def test_an_operation_is_started_with_its_arguments() -> None:
    """Entering a state starts its operation; the arguments are evaluated then."""
    bench = plain()
    assert bench.steps[0].commands == (Start(bench.attempt, "nav.go", {"to": 7}, "A"),)


def test_done_moves_on_with_the_result() -> None:
    """The result is the event's data in the transition."""
    state = {
        "invoke": "nav.go",
        "on_done": {"target": "B", "do": ("set", {"seen": lambda env: env["event"]["seen"]})},
    }
    bench = Bench(chart({"A": state, "B": {}}, context={"seen": None}))
    bench.send(events.done(bench.attempt, {"seen": 3}))
    assert bench.leaves == ["B"]
    assert bench.context["seen"] == 3


def test_a_failure_is_an_error_with_code_and_detail() -> None:
    """What the server says of its failure is `error` in the transition, and reported."""
    bench = plain()
    bench.send(events.failed(bench.attempt, "nav_status_6", "blocked"))
    assert bench.leaves == ["C"]
    assert bench.context["error"] == {"code": "nav_status_6", "detail": "blocked"}
    assert (bench.machine.view.code, bench.machine.view.detail) == ("nav_status_6", "blocked")


def test_a_server_that_cancels_by_itself_has_failed() -> None:
    """A cancel that nobody asked for is an error, not a silence."""
    bench = plain()
    bench.send(events.cancelled(bench.attempt))
    assert bench.context["error"]["code"] == "operation_cancelled"


def test_leaving_the_state_cancels() -> None:
    """An operation lives exactly as long as its state."""
    bench = plain()
    attempt = bench.attempt
    bench.send("away")
    assert bench.steps[-1].commands == (Cancel(attempt, "nav.go"),)


def test_entering_a_state_and_leaving_it_in_one_step_starts_nothing() -> None:
    """Operations begin when the step has come to rest."""
    bench = Bench(chart({"A": {"invoke": "nav.go", "always": "B", "on_done": "B"}, "B": {}}))
    assert bench.commands == []


def test_a_late_acceptance_is_cancelled_again() -> None:
    """A server that takes a goal after its cancel gets a second cancel."""
    bench = plain()
    attempt = bench.attempt
    bench.send("away")
    bench.send(events.accepted(attempt))
    assert bench.commands == [f"cancel {attempt}"]


def test_a_late_acceptance_of_a_call_without_resources_is_cancelled_again() -> None:
    """The same holds for what uses nothing."""
    bench = Bench(chart({"A": {"invoke": "bridge.read", "on_done": "B", "on": {"away": "B"}}, "B": {}}))
    attempt = bench.attempt
    bench.send("away")
    bench.send(events.accepted(attempt))
    assert bench.commands == [f"cancel {attempt}"]
    bench.send(events.cancelled(attempt))
    assert bench.machine.memory.attempts == {}


@pytest.mark.parametrize("late", [events.done("a2", {}), events.failed("a2", "nav_status_5")])
def test_a_late_result_is_dropped_and_counted(late: events.Event) -> None:
    """What an attempt says after it was left moves nothing."""
    bench = plain()
    assert bench.attempt == "a2"
    bench.send("away")
    step = bench.send(late)
    assert (bench.leaves, step.changed, bench.machine.view.dropped) == (["C"], False, 1)
    assert step.notes == (
        f"dropped: {late.name.removeprefix('attempt.')} of attempt a2, which nobody waits for",
    )


def test_a_result_of_an_earlier_activation_is_dropped() -> None:
    """A state that is entered again does not take the answer of its first time."""
    bench = plain()
    first = bench.attempt
    bench.send("away")
    bench.send("back")
    bench.send(events.done(first, {}))
    assert bench.leaves == ["A"]
    bench.send(events.done(bench.attempt, {}))
    assert bench.leaves == ["B"]


def test_a_second_result_is_dropped() -> None:
    """An attempt ends once."""
    bench = plain()
    attempt = bench.attempt
    bench.send(events.failed(attempt, "nav_status_6"))
    bench.send(events.done(attempt, {}))
    assert (bench.leaves, bench.machine.view.dropped) == (["C"], 1)


def test_the_next_drive_waits_for_the_cancel() -> None:
    """What uses the same resource starts when the cancelled attempt has ended."""
    bench = plain()
    first = bench.attempt
    step = bench.send("dock")
    assert bench.commands == [f"cancel {first}"]
    assert step.notes == ("nav.dock waits until nav.go has ended",)
    bench.now = 1.0
    bench.send(events.cancelled(first))
    assert bench.commands == [f"start {bench.attempt}"]
    assert bench.attempt != first


def test_the_next_drive_waits_at_most_three_seconds() -> None:
    """A cancel that nobody confirms holds the resource for 3 s; a late acceptance is still cancelled."""
    bench = plain()
    first = bench.attempt
    bench.send("dock")
    (step,) = bench.wait(CANCEL_DEADLINE)
    assert (step.time, bench.commands) == (3.0, [f"start {bench.attempt}"])
    assert step.notes == ("nav.go did not confirm its cancel in 3 s",)
    bench.send(events.accepted(first))
    assert bench.commands == [f"cancel {first}"]


def test_what_waits_for_a_resource_needs_no_cancel() -> None:
    """An attempt that was never sent is only forgotten."""
    bench = plain()
    bench.send("dock")
    bench.send(events.failed(bench.attempt, "nav_status_5"))
    states = {
        "A": {**ONE["A"], "on": {"dock": "D"}},
        "D": {**ONE["D"], "on": {"away": "C"}},
        "C": {},
        "B": {},
    }
    other = Bench(chart(states, context={"error": None}))
    first = other.attempt
    other.send("dock")
    other.send("away")
    assert other.commands == []
    assert list(other.machine.memory.attempts) == [first]


# -- timeouts ---------------------------------------------------------------------------------------------


def test_a_timeout_counts_from_the_request() -> None:
    """A server that never accepts times out as well."""
    bench = plain()
    attempt = bench.attempt
    (step,) = bench.wait(10.0)
    assert step.time == 10.0
    assert bench.context["error"] == {"code": "late", "detail": ""}
    assert bench.commands == [f"cancel {attempt}"]


def test_a_timeout_does_not_count_while_the_resource_is_waited_for() -> None:
    """The deadline of an attempt begins when the server is asked, not when it waits for an earlier cancel."""
    states = {**ONE, "D": {**ONE["D"], "invoke": {"do": "nav.dock", "timeout": 4.0, "timeout_code": "late"}}}
    bench = Bench(chart(states, context={"error": None}))
    bench.send("dock")
    bench.wait(6.9)
    assert bench.leaves == ["D"]
    bench.wait(0.2)
    assert bench.leaves == ["C"]


def test_progress_becomes_the_detail_of_a_timeout() -> None:
    """What the server said last explains what it was waiting for."""
    bench = plain()
    bench.send(events.progress(bench.attempt, "variance 0.9"))
    bench.wait(10.0)
    assert bench.context["error"] == {"code": "late", "detail": "variance 0.9"}


def test_an_operation_that_ends_in_time_leaves_no_deadline() -> None:
    """No timer of an attempt survives it."""
    bench = plain()
    bench.send(events.done(bench.attempt, {}))
    assert bench.machine.next_deadline is None


# -- retry ------------------------------------------------------------------------------------------------


def test_a_failed_attempt_is_tried_again_after_the_back_off() -> None:
    """`retry` counts attempts in all; each has an id of its own."""
    bench = bench_with(attempts=2, backoff=1.5)
    first = bench.attempt
    step = bench.send(events.failed(first, "nav_status_6"))
    assert (bench.leaves, bench.commands) == (["A"], [])
    assert step.notes == ("try 1 failed (nav_status_6); next in 1.5 s",)
    (again,) = bench.wait(1.5)
    assert again.time == 1.5
    assert bench.commands == [f"start {bench.attempt}"]
    bench.send(events.failed(bench.attempt, "nav_status_6"))
    assert bench.leaves == ["C"]


def test_a_timeout_is_a_failed_try() -> None:
    """The next try waits for the cancel of the one that took too long."""
    bench = bench_with(timeout=10.0, timeout_code="late", attempts=2)
    first = bench.attempt
    bench.wait(10.0)
    bench.send(events.cancelled(first))
    assert bench.commands == [f"start {bench.attempt}"]
    bench.wait(10.0)
    assert (bench.leaves, bench.context["error"]["code"]) == (["C"], "late")


def test_a_code_that_is_excepted_is_not_tried_again() -> None:
    """`unless` names what a further try cannot mend."""
    bench = bench_with(attempts=5, unless=["drift"])
    bench.send(events.failed(bench.attempt, "drift"))
    assert bench.leaves == ["C"]


def test_leaving_the_state_ends_the_back_off() -> None:
    """No try follows when the state has been left."""
    bench = bench_with(attempts=2, backoff=5.0)
    bench.send(events.failed(bench.attempt, "nav_status_6"))
    bench.send("away")
    assert bench.wait(10.0) == []


def test_a_new_activation_has_all_its_tries() -> None:
    """A state that is entered again begins to count anew."""
    bench = bench_with(attempts=2)
    bench.send(events.failed(bench.attempt, "nav_status_6"))
    bench.send("away")
    bench.send("back")
    bench.wait(3.0)
    bench.send(events.failed(bench.attempt, "nav_status_6"))
    bench.wait(0.0)
    assert bench.leaves == ["A"]


def test_the_view_tells_the_try_and_the_deadline() -> None:
    """What is shown of an operation: state, try, phase, detail, deadline."""
    bench = bench_with(timeout=10.0, timeout_code="late", attempts=2)
    bench.send(events.accepted(bench.attempt))
    bench.send(events.progress(bench.attempt, "half way"))
    (shown,) = bench.machine.view.attempts
    assert (shown.state, shown.tries, shown.detail, shown.deadline) == ("A", 1, "half way", 10.0)
    assert shown.phase == Phase.ACCEPTED.value


# -- errors in expressions --------------------------------------------------------------------------------


def test_arguments_that_cannot_be_computed_are_an_error_of_the_operation() -> None:
    """The state's `on_error` is taken, with the place in the file."""
    bench = bench_with(**{"with": {"to": lambda env: 1 / 0}})
    assert bench.leaves == ["C"]
    assert bench.context["error"] == {"code": "execution_error", "detail": "test.yaml:1:1: division by zero"}
    assert bench.commands == []


@pytest.mark.parametrize(
    ("by", "why"),
    [
        (2.5, "by: expected number between 0 and 2, got 2.5"),
        (math.nan, "by: expected number, got nan"),
        ("1 m", "by: expected number, got '1 m'"),
    ],
    ids=str,
)
def test_computed_arguments_outside_their_range_are_an_error_of_the_operation(by: Any, why: str) -> None:
    """What the catalog rules out reaches no plugin; what is written out was checked at load."""
    bench = bench_with(do="arm.bend", **{"with": {"by": lambda env: by}})
    assert bench.leaves == ["C"]
    assert bench.context["error"] == {"code": "execution_error", "detail": f"test.yaml:1:1: {why}"}
    assert bench.commands == []


def test_computed_arguments_may_be_at_the_end_of_their_range() -> None:
    bench = bench_with(do="arm.bend", **{"with": {"by": lambda env: 2.0}})
    assert bench.steps[0].commands == (Start(bench.attempt, "arm.bend", {"by": 2.0}, "A"),)


def test_a_timeout_that_cannot_be_computed_is_an_error_of_the_operation() -> None:
    """Nothing is started without its deadline."""
    bench = bench_with(timeout=lambda env: 1 / 0)
    assert (bench.leaves, bench.commands) == (["C"], [])


def test_a_retry_that_cannot_be_computed_is_no_retry() -> None:
    """The failure itself is what the chart hears of."""
    bench = bench_with(attempts=lambda env: 1 / 0)
    step = bench.send(events.failed(bench.attempt, "nav_status_6"))
    assert (bench.leaves, bench.context["error"]["code"]) == (["C"], "nav_status_6")
    assert step.notes == ("test.yaml:1:1: retry: division by zero",)


def test_an_error_that_nobody_handles_leads_to_fault() -> None:
    """A state without `on_error` cannot swallow a failure."""
    bench = Bench(chart({"A": {"invoke": "nav.go", "on_done": "FAULT"}, "FAULT": {}}))
    bench.send(events.failed(bench.attempt, "nav_status_6", "blocked"))
    assert bench.leaves == ["FAULT"]
    assert (bench.machine.view.code, bench.machine.view.detail) == ("nav_status_6", "blocked")


def test_arguments_see_the_event_that_led_to_the_state() -> None:
    """Where to drive was said by what happened before; a retry and a release drive there again."""
    go = {"do": "nav.go", "with": {"to": lambda env: env["event"]["place"]}, "attempts": 2}
    states = {"A": {"on": {"found": "B"}}, "B": {"invoke": go, "on_done": "A", "on_error": "A"}}
    bench = Bench(chart(states, holds={"pause": PAUSE}))
    bench.send("found", place="shelf")
    first = bench.attempt
    bench.send(events.failed(first, "blocked"))
    bench.wait(0.0)
    bench.send("operator.pause")
    bench.send(events.cancelled(bench.attempt))
    bench.send("operator.resume")
    started = [c for step in bench.steps for c in step.commands if isinstance(c, Start)]
    assert [command.arguments for command in started] == [{"to": "shelf"}] * 3
