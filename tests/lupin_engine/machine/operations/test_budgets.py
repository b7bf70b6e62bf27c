"""`budget`: the time that a state may be active, over all its visits in one mission."""

from __future__ import annotations

from typing import Any

from lupin_engine.machine.event import Event
from tests.lupin_engine.machine.charts import PAUSE, Bench, chart, fails

MISSION: dict[str, Any] = {
    "slot": True,
    "states": {
        "M": {
            "mission": "M",
            "states": {
                "WORK": {"budget": {10.0: "LATE"}, "on": {"rest": "REST"}},
                "REST": {"on": {"work": "WORK"}},
                "LATE": {"on": {"work": "WORK", "end": "f"}},
                "f": {"kind": "final"},
            },
        }
    },
    "on_done": "READY",
}


def working(**ready: Any) -> Bench:
    """Return a bench whose mission works for at most 10 s."""
    states = {"READY": {"on": {"mission.start": "MISSION"}, **ready}, "MISSION": MISSION}
    bench = Bench(chart(states, missions={"M": {"state": "MISSION.M"}}, holds={"pause": PAUSE}))
    start(bench)
    return bench


def start(bench: Bench) -> None:
    """Begin a mission."""
    assert bench.send("mission.start", mission_type="M").accepted


def here(bench: Bench) -> str:
    """Return the last part of the active leaf's name."""
    return bench.leaves[0].rpartition(".")[2]


def test_a_budget_counts_the_time_of_all_visits() -> None:
    """Four seconds now and six later are ten; what passes elsewhere does not count."""
    bench = working()
    bench.wait(4.0)
    bench.send("rest")
    assert bench.machine.next_deadline is None
    bench.wait(100.0)
    bench.send("work")
    (step,) = bench.wait(6.0)
    assert (step.time, step.event, here(bench)) == (
        110.0,
        Event("timer.budget", {"owner": "MISSION.M.WORK"}),
        "LATE",
    )


def test_a_budget_that_is_used_up_ends_the_next_visit_at_once() -> None:
    """Zero is left; the state is entered, and left when its timer is looked at."""
    bench = working()
    bench.wait(10.0)
    bench.send("work")
    assert here(bench) == "WORK"
    (step,) = bench.wait(0.0)
    assert (step.time, here(bench)) == (10.0, "LATE")


def test_a_budget_stands_still_while_held() -> None:
    """Like every clock of the chart; also when its state is left and entered while held."""
    bench = working()
    bench.wait(4.0)
    bench.send("operator.pause")
    assert bench.wait(50.0) == []
    bench.send("operator.resume")
    assert bench.machine.next_deadline == 60.0


def test_a_state_that_is_left_while_held_keeps_what_it_had_left() -> None:
    """What is frozen is remembered as well."""
    states: dict[str, Any] = {
        "A": {"budget": {10.0: "C"}, "on": {"operator.dock": {"target": "B", "during": ["pause"]}}},
        "B": {"on": {"back": "A"}},
        "C": {},
    }
    bench = Bench(chart(states, holds={"pause": PAUSE}))
    bench.wait(4.0)
    for event in ("operator.pause", "operator.dock", "operator.resume", "back"):
        bench.send(event)
    assert bench.machine.next_deadline == 10.0


def test_a_new_mission_has_a_new_budget() -> None:
    """What the last one used up is forgotten."""
    bench = working()
    bench.wait(10.0)
    bench.send("end")
    start(bench)
    assert bench.machine.next_deadline == 20.0


def test_what_was_spent_before_the_mission_is_not_the_missions() -> None:
    """A state around the missions has its whole budget when it is entered in the next one."""
    states = {
        "READY": {"budget": {10.0: "LATE"}, "on": {"mission.start": "MISSION"}},
        "MISSION": MISSION,
        "LATE": {},
    }
    bench = Bench(chart(states, missions={"M": {"state": "MISSION.M"}}))
    bench.wait(9.0)
    start(bench)
    bench.wait(10.0)
    bench.send("end")
    assert (bench.leaves, bench.machine.next_deadline) == (["READY"], 29.0)


def test_a_budget_survives_a_restart() -> None:
    """Of the state that is active and of those that were."""
    bench = working()
    bench.wait(4.0)
    bench.send("rest")
    bench.restart()
    bench.send("work")
    bench.wait(5.0)
    bench.restart()
    (step,) = bench.wait(1.0)
    assert (step.time, here(bench)) == (10.0, "LATE")


def test_a_budget_and_a_timer_of_one_state_are_two() -> None:
    """`after` begins anew with every visit."""
    states: dict[str, Any] = {
        "A": {"budget": {10.0: "C"}, "after": {6.0: "B"}},
        "B": {"on": {"back": "A"}},
        "C": {},
    }
    bench = Bench(chart(states))
    bench.wait(6.0)
    bench.send("back")
    assert [(due, kind) for due, _, kind, _ in bench.machine.memory.timers] == [
        (10.0, "budget"),
        (12.0, "after"),
    ]
    bench.wait(4.0)
    assert bench.leaves == ["C"]


def test_a_budget_that_nothing_follows_from_is_used_up_once() -> None:
    """Where a guard keeps the state, the timer does not come again in this visit."""
    rule = {"target": "B", "guard": lambda env: False}
    bench = Bench(chart({"A": {"budget": {5.0: rule}}, "B": {}}))
    (step,) = bench.wait(100.0)
    assert (step.time, bench.leaves, [one.holds for one in step.why]) == (5.0, ["A"], [False])


def test_a_budget_that_cannot_be_computed_is_an_error_in_every_visit() -> None:
    """It is not used up by that: no visit ends at once."""
    states: dict[str, Any] = {
        "A": {"budget": {fails: "B"}, "on_error": "C"},
        "B": {},
        "C": {"on": {"back": "A"}},
    }
    bench = Bench(chart(states))
    first = bench.steps[0].notes
    assert (first, bench.leaves) == (("test.yaml:1:1: budget: division by zero",), ["C"])
    assert (bench.send("back").notes, bench.leaves) == (first, ["C"])
