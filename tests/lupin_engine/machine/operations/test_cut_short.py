"""What an operation gives that was cut short, by a timeout or by a hold."""

from __future__ import annotations

from typing import Any

import pytest

from lupin_engine.chart.expressions.evaluation import UnknownValue
from lupin_engine.machine import event as events
from tests.lupin_engine.machine.charts import PAUSE, Bench, chart


def flowed(env: Any) -> Any:
    """What came until then, -1 where that is not known."""
    try:
        return env["error"]["result"]["flowed"]
    except UnknownValue:
        return -1.0


def valve(operation: str = "valve.give", **more: Any) -> Bench:
    """A state that gives water; how it ended and how much flowed are variables."""
    error = {
        "target": "FAILED",
        "do": ("set", {"flowed": flowed, "code": lambda env: env["error"]["code"]}),
    }
    done = {"target": "DONE", "do": ("set", {"flowed": lambda env: env["event"].get("flowed", 0.0)})}
    invoke = {"do": operation, "timeout": 10.0, "timeout_code": "late", **more}
    states: dict[str, Any] = {
        "GIVING": {"invoke": invoke, "on_done": done, "on_error": error, "on": {"away": "AWAY"}},
        "FAILED": {},
        "DONE": {},
        "AWAY": {},
    }
    bench = Bench(chart(states, holds={"pause": PAUSE}, context={"flowed": 0.0, "code": ""}))
    bench.send(events.accepted("a2"))
    return bench


def ended(bench: Bench) -> tuple[list[str], Any, Any]:
    """Where it led, with how much, by which code."""
    return bench.leaves, bench.context["flowed"], bench.context["code"]


def test_a_timeout_waits_for_what_its_attempt_gives() -> None:
    """The state hears of both together."""
    bench = valve()
    bench.wait(10.0)
    assert (bench.commands, bench.leaves) == (["cancel a2"], ["GIVING"])
    bench.wait(1.0)
    step = bench.send(events.cancelled("a2", {"flowed": 0.2}))
    assert ended(bench) == (["FAILED"], 0.2, "late")
    assert step.notes == ("valve.give gave flowed 0.2",)


def test_what_was_done_just_before_its_cancel_counts_as_given() -> None:
    """The error stays one: the timeout came first."""
    bench = valve()
    bench.wait(10.0)
    bench.send(events.done("a2", {"flowed": 0.4}))
    assert ended(bench) == (["FAILED"], 0.4, "late")
    assert bench.machine.memory.dropped == 0


@pytest.mark.parametrize("says", [True, False])
def test_what_is_not_given_is_unknown(says: bool) -> None:
    """Whether the server confirms the cancel, or never does: then after the time that a cancel may take."""
    bench = valve()
    bench.wait(10.0)
    if says:
        bench.send(events.cancelled("a2"))
    else:
        bench.wait(2.9)
        assert bench.leaves == ["GIVING"]
        bench.wait(0.1)
    assert ended(bench) == (["FAILED"], -1.0, "late")


def test_an_operation_that_gives_nothing_fails_at_once() -> None:
    """As without the word."""
    bench = valve("nav.go")
    bench.wait(10.0)
    assert ended(bench) == (["FAILED"], -1.0, "late")


def test_a_timeout_is_tried_again_when_its_attempt_has_ended() -> None:
    """The back-off counts from there."""
    bench = valve(attempts=2, backoff=5.0)
    bench.wait(10.0)
    bench.wait(1.0)
    bench.send(events.cancelled("a2", {"flowed": 0.2}))
    assert bench.leaves == ["GIVING"]
    assert (bench.wait_for_next(), len(bench.started)) == (5.0, 2)


def paused(bench: Bench, **gives: float) -> Bench:
    """Pause, let the cancel be confirmed, and go on."""
    bench.send("operator.pause")
    assert bench.commands == ["cancel a2"]
    bench.send(events.cancelled("a2", gives or None))
    assert bench.leaves == ["GIVING"]
    bench.send("operator.resume")
    return bench


def test_again_is_what_a_release_does_where_nothing_is_said() -> None:
    """The whole operation is begun anew."""
    bench = paused(valve(), flowed=0.2)
    assert (bench.leaves, len(bench.started)) == (["GIVING"], 2)


def test_fail_tells_the_mission_what_came() -> None:
    """It is no try: the hold ended it, not the server."""
    bench = paused(valve(on_hold="fail", attempts=3), flowed=0.2)
    assert ended(bench) == (["FAILED"], 0.2, "operation_cancelled")
    assert len(bench.started) == 1


def test_continue_counts_it_as_done() -> None:
    """With what came until then."""
    assert ended(paused(valve(on_hold="continue"), flowed=0.2)) == (["DONE"], 0.2, "")


def test_continue_without_a_result_fails() -> None:
    """Nobody could say what was done."""
    assert ended(paused(valve(on_hold="continue"))) == (["FAILED"], -1.0, "operation_cancelled")


def test_continue_needs_no_result_where_there_is_none() -> None:
    """The operation has none, so it counts as done."""
    assert ended(paused(valve("nav.go", on_hold="continue"))) == (["DONE"], 0.0, "")


def test_a_release_before_the_confirmation_waits_for_it() -> None:
    """What the server gives is worth the wait."""
    bench = valve(on_hold="fail")
    bench.send("operator.pause")
    bench.send("operator.resume")
    assert bench.leaves == ["GIVING"]
    bench.send(events.cancelled("a2", {"flowed": 0.1}))
    assert ended(bench) == (["FAILED"], 0.1, "operation_cancelled")


def test_a_hold_after_the_timeout_lets_the_end_wait() -> None:
    """It is told with the release."""
    bench = valve()
    bench.wait(10.0)
    bench.send("operator.pause")
    bench.send(events.cancelled("a2", {"flowed": 0.3}))
    assert bench.leaves == ["GIVING"]
    bench.send("operator.resume")
    assert ended(bench) == (["FAILED"], 0.3, "late")


def test_who_leaves_hears_nothing_of_it() -> None:
    """The attempt ends, and that is all."""
    bench = valve(on_hold="fail")
    bench.wait(10.0)
    bench.send("away")
    bench.send(events.cancelled("a2", {"flowed": 0.3}))
    assert ended(bench) == (["AWAY"], 0.0, "")


def test_a_machine_from_a_snapshot_still_waits() -> None:
    """What follows is remembered, and what was given."""
    bench = valve(on_hold="fail")
    bench.send("operator.pause")
    bench.restart()
    bench.send(events.cancelled("a2", {"flowed": 0.2}))
    bench.restart()
    bench.send("operator.resume")
    assert ended(bench) == (["FAILED"], 0.2, "operation_cancelled")
