"""What happens at a rate: `every`."""

from __future__ import annotations

from typing import Any

import pytest

from tests.lupin_engine.machine.charts import PAUSE, Bench, chart

COUNT = {"do": ("set", {"n": lambda env: env["context"]["n"] + 1})}


def ticking(period: Any = 5.0, **more: Any) -> Bench:
    """A state that counts ticks."""
    states = {"A": {"every": {period: COUNT}, "on": {"go": "B"}, **more}, "B": {}, "FAULT": {}}
    return Bench(chart(states, context={"n": 0}, holds={"pause": PAUSE}))


def test_it_happens_at_a_rate_while_the_state_is_active() -> None:
    """The first time one period after entering."""
    bench = ticking()
    bench.wait(4.9)
    assert bench.context["n"] == 0
    bench.wait(15.1)
    assert bench.context["n"] == 4
    bench.send("go")
    bench.wait(60.0)
    assert (bench.context["n"], bench.machine.memory.timers) == (4, [])


def test_a_late_tick_does_not_shift_the_next_ones() -> None:
    """They are counted from when each was due; what was missed meanwhile is left out."""
    bench = ticking()
    bench.now = 7.0
    bench.wait(0.0)
    assert (bench.context["n"], bench.machine.next_deadline) == (1, 10.0)
    bench.now = 33.0
    bench.wait(0.0)
    assert (bench.context["n"], bench.machine.next_deadline) == (2, 35.0)


def test_a_hold_stops_its_clock() -> None:
    """What was left of the period is left after it."""
    bench = ticking()
    bench.wait(8.0)
    bench.send("operator.pause")
    bench.wait(100.0)
    assert bench.context["n"] == 1
    bench.send("operator.resume")
    assert (bench.wait_for_next(), bench.context["n"]) == (2.0, 2)


def test_it_goes_on_from_a_snapshot() -> None:
    """With the rhythm that it had."""
    bench = ticking()
    bench.wait(8.0)
    bench.restart()
    assert (bench.wait_for_next(), bench.wait_for_next(), bench.context["n"]) == (2.0, 5.0, 3)


def test_an_after_beside_it_counts_for_itself() -> None:
    """And a tick may lead out."""
    bench = ticking(after={12.0: "B"})
    bench.wait(12.0)
    assert (bench.leaves, bench.context["n"]) == (["B"], 2)
    states: dict[str, Any] = {"A": {"every": {5.0: {"target": "B"}}}, "B": {}}
    other = Bench(chart(states))
    other.wait(5.0)
    assert (other.leaves, other.machine.memory.timers) == (["B"], [])


@pytest.mark.parametrize("period", [0.0, 0.05])
def test_no_period_is_too_short_to_end(period: float) -> None:
    """A chart that ticks without a pause would do nothing else."""
    bench = ticking(lambda _: period)
    bench.wait(1.0)
    assert bench.leaves == ["FAULT"]
    assert bench.context["n"] == 0
    problem = f"every: {period:g} s is too often, the shortest is 0.1 s"
    assert bench.machine.view.detail == f"test.yaml:1:1: {problem}"
