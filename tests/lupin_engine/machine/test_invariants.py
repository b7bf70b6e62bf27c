"""Invariants: looked at whenever the machine has come to rest; one that is broken is an error, once."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from lupin_engine.machine.step import Refusal
from tests.lupin_engine.machine.charts import Bench, chart, fails, said

STATES: dict[str, Any] = {
    "A": {"on": {"set": {"do": ("set", {"n": lambda env: env["event"]["to"]})}, "go": "B"}},
    "B": {"always": {"target": "A", "do": ("set", {"n": 0})}, "entry": ("set", {"n": 9})},
    "FAULT": {"on": {"set": {"do": ("set", {"n": lambda env: env["event"]["to"]})}, "reset": "A"}},
}
BROKEN = "test.yaml:1:1: invariant small does not hold: small"


def watching(states: dict[str, Any] | None = None, **invariants: Any) -> Bench:
    """Return a bench whose variable n must stay below 5."""
    watched = invariants or {"small": lambda env: env["context"]["n"] < 5}
    return Bench(chart(states or STATES, context={"n": 0}, invariants=watched))


def test_what_does_not_hold_leads_to_fault_with_place_and_text() -> None:
    """The code of the report is the engine's own."""
    bench = watching()
    step = bench.send("set", to=7)
    assert (bench.leaves, step.taken[-1], step.notes) == (["FAULT"], "engine.fault", (BROKEN,))
    assert (bench.machine.view.code, bench.machine.view.detail) == ("invariant_broken", BROKEN)
    assert bench.machine.memory.broken == ["small"]


def test_it_is_told_once() -> None:
    """While it stays broken nothing further happens; after it held again it can break again."""
    bench = watching()
    bench.send("set", to=7)
    assert bench.send("reset").notes == ()
    assert bench.leaves == ["A"]
    assert bench.send("set", to=8).notes == ()
    assert bench.send("set", to=1).notes == ()
    assert bench.machine.memory.broken == []
    assert bench.send("set", to=9).notes == (BROKEN,)


def test_a_machine_on_its_way_is_not_looked_at() -> None:
    """Between two microsteps anything may be true."""
    bench = watching()
    bench.send("go")
    assert (bench.leaves, bench.machine.memory.broken) == (["A"], [])


def test_a_chart_without_fault_says_that_nobody_handles_it() -> None:
    """It stays where it is, and runs on."""
    bench = watching({"A": STATES["A"], "B": STATES["B"]})
    step = bench.send("set", to=7)
    assert step.notes == (BROKEN, f"nobody handles the error {BROKEN}")
    assert (bench.leaves, bench.machine.view.code) == (["A"], "invariant_broken")


def test_a_chart_may_handle_it_itself() -> None:
    """`error.execution` is an event like others."""
    states = {**STATES, "A": {"on": {**STATES["A"]["on"], "error.execution": {"do": "told"}}}}
    bench = watching(states)
    assert said(bench.send("set", to=7)) == ["act told"]
    assert bench.leaves == ["A"]


def test_one_that_cannot_be_evaluated_does_not_hold() -> None:
    """Told once as well, with what is wrong; so is one about a value that nobody knows."""
    bench = watching(safe=fails)
    text = "test.yaml:1:1: invariant safe does not hold: safe: division by zero"
    assert (bench.leaves, bench.steps[0].notes) == (["FAULT"], (text,))
    assert bench.send("reset").notes == ()
    unknown = Bench(
        chart({"A": {}}, inputs={"x": {}}, invariants={"near": lambda env: env["input"]["x"] < 1})
    )
    assert (
        unknown.steps[0].notes[0] == "test.yaml:1:1: invariant near does not hold: near: input.x is unknown"
    )


def test_two_at_once_are_two_errors_and_one_fault() -> None:
    """FAULT is entered for the first; the second is told."""
    bench = watching(low=lambda env: env["context"]["n"] < 5, lower=lambda env: env["context"]["n"] < 4)
    step = bench.send("set", to=7)
    low, lower = (f"test.yaml:1:1: invariant {name} does not hold: {name}" for name in ("low", "lower"))
    assert step.notes == (low, lower, f"nobody handles the error {lower}")
    assert step.taken.count("engine.fault") == 1


def test_time_alone_may_break_one() -> None:
    """A value that grew old is looked at when it does."""
    given = chart(
        {"A": {}, "FAULT": {}},
        inputs={"x": {"initial": 1, "freshness": 5.0}},
        invariants={"seen": lambda env: env["known"]("x")},
    )
    bench = Bench(given)
    (step,) = bench.wait(5.0)
    assert (step.time, bench.leaves) == (5.0, ["FAULT"])


# -- starting -----------------------------------------------------------------------------------------------


def test_while_one_does_not_hold_no_mission_starts() -> None:
    """The refusal names it. One about variables that begin anew with the mission is no reason."""
    mission = {"slot": True, "states": {"M": {"mission": "M", "states": {"WALK": {}}}}}
    states = {
        "READY": {"on": {"mission.start": "MISSION", "set": STATES["A"]["on"]["set"]}},
        "MISSION": {**mission, "on": {"set": STATES["A"]["on"]["set"]}},
        "FAULT": {"on": {"operator.reset": "READY", "set": STATES["A"]["on"]["set"]}},
    }
    given = chart(
        states,
        context={"n": 0},
        invariants={"n": lambda env: env["context"]["n"] < 5},
        missions={"M": {"state": "MISSION.M"}},
    )
    bench = Bench(given)
    bench.send("set", to=7)
    bench.send("operator.reset")
    step = bench.send("mission.start", mission_type="M")
    assert step.refusal == Refusal("invariant_broken", "start refused: the invariant n does not hold: n")
    assert bench.leaves == ["READY"]
    bench.send("set", to=1)
    assert bench.send("mission.start", mission_type="M").accepted
    anew = Bench(replace(given, context={"n": replace(given.context["n"], of_mission=True)}))
    anew.send("set", to=7)
    anew.send("operator.reset")
    assert anew.send("mission.start", mission_type="M").accepted
    assert (anew.context, anew.machine.memory.broken) == ({"n": 0}, [])
