"""What cannot be evaluated: an error with its place, never a traceback, never half a step."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest

from lupin_engine.chart.model import Chart
from lupin_engine.machine import event as events
from lupin_engine.machine.step import Refusal
from tests.lupin_engine.machine.charts import PAUSE, Bench, chart, fails, legal

BAD = ("arm.preset", {"name": fails})


def around(state: dict[str, Any], **more: Any) -> Chart:
    """Return a chart that enters `state` on `go`, in one region of two."""
    region = {"states": {"x": {"on": {"go": "y", "fail": "z"}}, "y": state, "z": {"on": {"back": "y"}}}}
    regions = {"R": region, "S": {"states": {"x": {"on": {"go": "y"}}, "y": {}}}}
    return chart({"P": {"kind": "parallel", "states": regions}, "Z": {}, "FAULT": {}}, **more)


def go(given: Chart) -> Bench:
    """Return a bench with a chart after the event."""
    bench = Bench(given)
    bench.send("go")
    return bench


def ask(given: Chart) -> Bench:
    """Return a bench after a request in that state."""
    bench = go(given)
    bench.send("operator.dock")
    return bench


def fail(given: Chart) -> Bench:
    """Return a bench after the operation has failed."""
    bench = go(given)
    bench.send(events.failed(bench.attempt, "blocked"))
    return bench


EACH = {"do": "bridge.read", "items": ["a"]}


def place(name: str, make: Any, given: Chart, text: str) -> Any:
    """Return a case: what makes the error, and the text that must tell of it."""
    return pytest.param(make, given, f"test.yaml:1:1: {text}division by zero", id=name)


ERRORS = [
    place("guard", go, around({"always": {"target": "Z", "guard": fails}}), "guard: "),
    place(
        "guard of a request",
        ask,
        around({"on": {"operator.dock": {"target": "Z", "guard": fails}}}),
        "guard: ",
    ),
    place("entry", go, around({"entry": BAD}), "arm.preset: "),
    place("exit", ask, around({"exit": BAD, "on": {"operator.dock": "Z"}}), "arm.preset: "),
    place("action", ask, around({"on": {"operator.dock": {"do": BAD}}}), "arm.preset: "),
    place("after", go, around({"after": {fails: "Z"}}), "after: "),
    place("budget", go, around({"budget": {fails: "Z"}}), "budget: "),
    place("arguments", go, around({"invoke": {"do": "nav.go", "with": {"to": fails}}}), ""),
    place("timeout", go, around({"invoke": {"do": "nav.go", "timeout": fails}}), ""),
    place("itinerary", go, around({"itinerary": fails}), "itinerary: "),
    place("order", go, around({"itinerary": {"items": [1], "order": fails}}), "order: "),
    place("sweeps", go, around({"itinerary": {"items": [1], "sweeps": fails}}), "sweeps: "),
    place("for_each items", go, around({"for_each": {**EACH, "items": fails}}), "for_each: "),
    place("for_each key", go, around({"for_each": {**EACH, "key": fails}}), "for_each: "),
    place("for_each when", go, around({"for_each": {**EACH, "when": fails}}), "for_each: "),
    place("for_each limit", go, around({"for_each": {**EACH, "limit": fails}}), "for_each: "),
    place("for_each arguments", go, around({"for_each": {**EACH, "with": {"x": fails}}}), ""),
    place("context", go, around({}, context={"n": fails}), "context n: "),
    place(
        "level", go, around({}, inputs={"x": {"initial": 1, "levels": {"low": (fails, None)}}}), "level low: "
    ),
    place(
        "hold",
        ask,
        around({}, holds={"pause": {**PAUSE, "engage": "operator.dock", "engage_guard": fails}}),
        "guard: ",
    ),
]


@pytest.mark.parametrize(("make", "given", "detail"), ERRORS)
def test_an_error_leads_to_fault_and_names_its_place(make: Any, given: Chart, detail: str) -> None:
    """The code is the engine's own, the detail says where and what; the step is whole."""
    bench = make(given)
    assert legal(given, bench.machine.memory.configuration)
    assert bench.leaves == ["FAULT"]
    assert (bench.machine.view.code, bench.machine.view.detail) == ("execution_error", detail)
    assert bench.machine.memory.invocations == {}


@pytest.mark.parametrize(("make", "given", "detail"), ERRORS)
def test_without_fault_the_chart_stays_whole(make: Any, given: Chart, detail: str) -> None:
    """Nobody handles the error: it is told, and the machine goes on from a legal configuration."""
    states = {name: state for name, state in given.states.items() if name != "FAULT"}
    states[""] = replace(states[""], children=("P", "Z"))
    bare = replace(given, states=states)
    bench = make(bare)
    assert any(note.endswith(detail) for step in bench.steps for note in step.notes)
    assert legal(bare, bench.machine.memory.configuration)
    assert bench.send("back") is bench.steps[-1]
    assert legal(bare, bench.machine.memory.configuration)


def test_a_retry_that_cannot_be_computed_is_a_note() -> None:
    """There the failure itself is what counts; see test_retries."""
    bench = fail(around({"invoke": {"do": "nav.go", "attempts": fails}, "on_error": "z"}))
    assert (bench.steps[-1].notes, bench.leaves) == (
        ("test.yaml:1:1: retry: division by zero",),
        ["P.R.z", "P.S.y"],
    )


def test_where_to_go_on_that_cannot_be_computed() -> None:
    """A guard of `resume_at` that fails is false and an error."""
    walk = {"states": {"x": {"on": {"next": "y"}}, "y": {}}, "resume_at": [{"target": "y", "guard": fails}]}
    family = {"states": {"W": walk, "H": {"kind": "history", "depth": 1}}}
    given = chart({"F": family, "Z": {"on": {"back": "F.H"}}, "FAULT": {}}, on={"out": "Z"})
    bench = Bench(given)
    bench.send("out")
    step = bench.send("back")
    assert step.entered == ("F", "F.W", "F.W.x", "FAULT")
    assert bench.machine.view.detail == "test.yaml:1:1: guard: division by zero"


def test_a_hold_whose_release_cannot_be_judged_stays() -> None:
    """Refused, with the reason that the hold gives; the mistake is told beside it."""
    holds = {"pause": {**PAUSE, "release_guard": fails}}
    bench = Bench(chart({"A": {}}, holds=holds))
    bench.send("operator.pause")
    step = bench.send("operator.resume")
    assert step.refusal == Refusal("paused", "resume refused: paused by the operator")
    assert step.notes[0] == "test.yaml:1:1: guard: division by zero"
    assert bench.machine.view.held == ("pause",)


def test_a_mistake_in_the_release_of_what_is_not_engaged_is_not_told() -> None:
    """A request that releases two holds has to do with the one that is engaged."""
    holds = {"pause": PAUSE, "stop": {**PAUSE, "engage": "input.estop", "release_guard": fails}}
    inputs = {"estop": {"value": "robot.estop", "initial": False}}
    bench = Bench(chart({"A": {}}, holds=holds, inputs=inputs))
    bench.send("operator.pause")
    step = bench.send("operator.resume")
    assert (step.accepted, step.notes) == (True, ("hold pause released",))


@pytest.mark.parametrize("delay", [math.inf, math.nan])
@pytest.mark.parametrize("word", ["after", "budget"])
def test_a_time_that_no_clock_shows_is_an_error(word: str, delay: float) -> None:
    """Nobody waits for ever by mistake."""
    bench = go(around({word: {delay: "Z"}}))
    assert bench.machine.view.detail == f"test.yaml:1:1: {word}: {delay} s is no time to wait"


def test_a_time_in_the_past_is_now() -> None:
    """What is left of a time may be less than nothing."""
    bench = Bench(chart({"A": {"after": {(lambda env: -5.0): "B"}}, "B": {}}))
    assert [step.time for step in bench.wait(0.0)] == [0.0]
    assert bench.leaves == ["B"]


def test_an_attempt_must_have_a_time() -> None:
    """A timeout of nan is no timeout: nothing is sent."""
    bench = go(around({"invoke": {"do": "nav.go", "timeout": math.nan}}))
    assert (bench.leaves, bench.started) == (["FAULT"], [])


def test_the_first_mistake_of_a_block_ends_it() -> None:
    """As in SCXML: what stands behind it is not done, other blocks are."""
    rule = {"target": "B", "do": ["one", BAD, "two"]}
    bench = Bench(chart({"A": {"exit": "left", "on": {"go": rule}}, "B": {"entry": "entered"}}))
    bench.send("go")
    assert bench.commands == ["act left", "act one", "act entered"]


def test_two_mistakes_in_one_step_are_two_errors() -> None:
    """The first is handled where it arose; the second finds its state left, and leads to FAULT."""
    states: dict[str, Any] = {
        "A": {"entry": BAD, "exit": BAD, "on_error": "B"},
        "B": {"on": {"error.execution": {"do": "told"}}},
        "FAULT": {},
    }
    bench = Bench(chart(states))
    assert (bench.leaves, bench.commands) == (["B"], ["act told"])


def test_the_queue_is_kept_when_an_action_fails() -> None:
    """What was raised before the mistake is still heard (stock: lost, trap 10)."""
    entry = [("raise", {"event": "ping"}), BAD]
    states = {"A": {"on": {"go": "B"}}, "B": {"entry": entry, "on": {"ping": {"do": "heard"}}}, "FAULT": {}}
    bench = Bench(chart(states))
    bench.send("go")
    assert (bench.commands, bench.leaves) == (["act heard"], ["FAULT"])


def test_an_error_that_nobody_handles_keeps_its_turn() -> None:
    """As in SCXML, what was raised after it is dealt with after it: in FAULT, and not before that."""
    states: dict[str, Any] = {
        "A": {"exit": BAD, "on": {"go": "B"}},
        "B": {"entry": ("raise", {"event": "later"}), "on": {"later": "C"}},
        "C": {},
        "FAULT": {},
    }
    assert go(chart(states)).steps[-1].entered == ("B", "FAULT")


@pytest.mark.parametrize(
    "call",
    [
        ("itinerary.close", {}),
        ("raise", {}),
        ("publish.reading", {}),
    ],
    ids=lambda call: str(call[0]),
)
def test_a_built_in_action_that_lacks_an_argument_is_an_error(call: Any) -> None:
    """The checker refuses such a chart; the machine survives it."""
    bench = go(around({"itinerary": [1], "entry": call}))
    assert bench.leaves == ["FAULT"]
    assert bench.machine.view.detail.startswith(f"test.yaml:1:1: {call[0]}: ")


def test_what_was_reported_can_be_cleared() -> None:
    """After a reset nothing is wrong any more."""
    bench = go(around({"entry": BAD}, on={"clear": {"do": "report.clear"}}))
    bench.send("clear")
    assert (bench.machine.view.code, bench.machine.view.detail) == ("", "")
