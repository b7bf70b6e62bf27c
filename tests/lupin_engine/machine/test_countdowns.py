"""What states do by themselves later, as a view tells it: for whoever shows how the time runs down."""

from __future__ import annotations

from lupin_engine.machine import event as events
from lupin_engine.machine.step import Countdown
from tests.lupin_engine.machine.charts import PAUSE, Bench, chart


def told(bench: Bench) -> list[Countdown]:
    """Return what the view tells."""
    return list(bench.machine.view.countdowns)


def test_each_clock_of_an_active_state_is_told_until_it_is_left() -> None:
    """In the order in which they fire; the one of a budget is among them."""
    states = {
        "A": {"after": {5.0: "B"}, "every": {2.0: {"do": []}}, "budget": {9.0: "B"}, "on": {"go": "B"}},
        "B": {},
    }
    bench = Bench(chart(states))
    assert told(bench) == [
        Countdown("A", "every.0", 2.0, None),
        Countdown("A", "after.0", 5.0, None),
        Countdown("A", "budget", 9.0, None),
    ]
    bench.send("go")
    assert told(bench) == []


def test_a_hold_stops_the_clock_and_what_is_left_is_told() -> None:
    bench = Bench(chart({"A": {"after": {5.0: "B"}}, "B": {}}, holds={"pause": PAUSE}))
    bench.wait(3.0)
    bench.send("operator.pause")
    assert told(bench) == [Countdown("A", "after.0", None, 2.0)]
    bench.wait(7.0)
    bench.send("operator.resume")
    assert told(bench) == [Countdown("A", "after.0", 12.0, None)]


def test_a_hold_stops_the_clock_of_an_operation_that_may_finish() -> None:
    bench = Bench(chart({"A": {"invoke": {"do": "bridge.read", "timeout": 10.0}}}, holds={"pause": PAUSE}))
    bench.wait(3.0)
    bench.send("operator.pause")
    (attempt,) = bench.machine.view.attempts
    assert (attempt.deadline, attempt.limit, attempt.left) == (None, 10.0, 7.0)


def test_a_pause_before_the_next_try_is_told_with_its_state_and_an_attempt_with_its_limit() -> None:
    invoke = {"do": "nav.go", "timeout": 10.0, "attempts": 2, "backoff": 4.0}
    bench = Bench(chart({"A": {"invoke": invoke}}))
    (attempt,) = bench.machine.view.attempts
    assert (attempt.tries, attempt.limit) == (1, 10.0)
    bench.send(events.failed(bench.started[-1].attempt, "lost"))
    assert told(bench) == [Countdown("A", "retry", 4.0, None)]
