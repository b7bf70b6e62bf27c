"""Retries: how often, how long between, and what does not count as a try."""

from __future__ import annotations

import math
from typing import Any

import pytest

from lupin_engine.machine import event as events
from tests.lupin_engine.machine.charts import PAUSE, Bench, chart, fails


def retrying(*, seed: int = 0, mission_id: str = "", **invoke: Any) -> Bench:
    """Return a bench that drives, up to five times when nothing else is said."""
    drive = {"do": "nav.go", "attempts": 5, **invoke}
    states = {"A": {"invoke": drive, "on_done": "B", "on_error": "C"}, "B": {}, "C": {"on": {"back": "A"}}}
    bench = Bench(chart(states, holds={"pause": PAUSE}), seed=seed)
    bench.machine.memory.mission_id = mission_id
    return bench


def pauses(number: int = 4, **given: Any) -> list[float]:
    """Return the pauses between the tries of a drive that always fails."""
    bench, found = retrying(**given), []
    for _ in range(number):
        bench.send(events.failed(bench.attempt, "blocked"))
        found.append(bench.wait_for_next())
    assert len(bench.started) == number + 1
    return found


def test_every_pause_is_longer_by_a_factor() -> None:
    """The first is the back-off itself; without a factor they are alike, without a back-off there is none."""
    assert pauses(backoff=1.5, factor=2.0) == [1.5, 3.0, 6.0, 12.0]
    assert pauses(backoff=1.5) == [1.5] * 4
    assert pauses(factor=2.0) == [0.0] * 4


def test_jitter_changes_every_pause_by_a_share_of_itself() -> None:
    """Up to that share, longer or shorter, each another."""
    found = [pause for seed in range(20) for pause in pauses(backoff=10.0, jitter=0.2, seed=seed)]
    assert all(8.0 <= pause <= 12.0 for pause in found)
    assert min(found) < 9.0
    assert max(found) > 11.0
    assert len(set(found)) == len(found)


def test_jitter_is_drawn_from_the_seed_and_the_mission() -> None:
    """The same inputs give the same pauses; another robot, or another mission, waits another time."""
    rule: dict[str, Any] = {"backoff": 10.0, "jitter": 0.5}
    first = pauses(**rule, seed=1, mission_id="m1")
    assert pauses(**rule, seed=1, mission_id="m1") == first
    assert pauses(**rule, seed=2, mission_id="m1") != first
    assert pauses(**rule, seed=1, mission_id="m2") != first


def test_a_mission_may_be_called_anything() -> None:
    """Also what no encoding knows."""
    assert pauses(1, backoff=1.0, jitter=0.5, mission_id="\ud800") == pytest.approx([1.0], abs=0.5)


def test_a_pause_is_never_less_than_none() -> None:
    """However large the jitter."""
    assert min(pause for seed in range(9) for pause in pauses(backoff=1.0, jitter=5.0, seed=seed)) == 0.0


@pytest.mark.parametrize(
    "rule", [{"backoff": fails}, {"factor": fails}, {"jitter": fails}, {"attempts": fails}]
)
def test_what_cannot_be_computed_is_no_retry(rule: dict[str, Any]) -> None:
    """The failure itself is told, and the mistake in a note."""
    bench = retrying(**rule)
    step = bench.send(events.failed(bench.attempt, "blocked"))
    assert (bench.leaves, step.notes) == (["C"], ("test.yaml:1:1: retry: division by zero",))
    assert bench.machine.view.code == "blocked"


@pytest.mark.parametrize("backoff", [math.inf, math.nan])
def test_nobody_waits_for_ever(backoff: float) -> None:
    """A pause must be a time."""
    bench = retrying(backoff=backoff)
    step = bench.send(events.failed(bench.attempt, "blocked"))
    assert step.notes == (f"test.yaml:1:1: retry: {backoff} s is no time to wait",)
    assert bench.leaves == ["C"]


def test_a_hold_gives_the_try_back() -> None:
    """Of two tries, however many holds end the first one, the second one is still there."""
    bench = retrying(attempts=2)
    for _ in range(3):
        attempt = bench.attempt
        bench.send("operator.pause")
        bench.send(events.cancelled(attempt))
        bench.send("operator.resume")
    bench.send(events.failed(bench.attempt, "blocked"))
    bench.wait(0.0)
    assert bench.leaves == ["A"]
    bench.send(events.failed(bench.attempt, "blocked"))
    assert bench.leaves == ["C"]


def test_a_hold_during_the_pause_costs_nothing() -> None:
    """Between two tries there is nothing to cancel; the next one begins when its time has come."""
    bench = retrying(attempts=2, backoff=4.0)
    bench.send(events.failed(bench.attempt, "blocked"))
    bench.wait(1.0)
    assert bench.send("operator.pause").commands == ()
    bench.wait(10.0)
    assert bench.send("operator.resume").commands == ()
    assert bench.wait_for_next() == 3.0
    assert bench.commands == [f"start {bench.attempt}"]


def test_a_divert_gives_all_tries_back() -> None:
    """Coming back is a new activation."""
    bench = retrying(attempts=1)
    bench.send(events.failed(bench.attempt, "blocked"))
    bench.send("back")
    assert bench.machine.memory.invocations["A"].tries == 1
