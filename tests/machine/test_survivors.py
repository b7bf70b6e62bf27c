"""Rules of the machine that mutation testing found nobody asking about."""

from __future__ import annotations

import pytest

from lupin_engine.machine.event import Act, Event, failed
from tests.machine.charts import PAUSE, Bench, chart

# -- events -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "is_request", "is_report"),
    [
        ("mission.start", True, False),
        ("operator.abort", True, False),
        ("attempt.done", False, True),
        ("value", False, False),
        ("mission.over", False, False),
    ],
)
def test_an_event_is_a_request_a_report_or_neither(name: str, is_request: bool, is_report: bool) -> None:
    """Requests are answered; reports are about an attempt."""
    event = Event(name)
    assert (event.is_request, event.is_report) == (is_request, is_report)


# -- what expressions see ------------------------------------------------------------------------------------


def test_an_expression_sees_the_itinerary_of_the_state_it_is_written_in() -> None:
    """Two regions walk at the same time; each one's actions name their own target."""
    say = ("say", {"target": lambda env: env["target"], "left": lambda env: env["itinerary"]["remaining"]})
    regions = {
        "L": {"itinerary": ["a", "b"], "states": {"ON": {"on": {"ask": {"do": say}}}}},
        "R": {"itinerary": ["c"], "states": {"ON": {"on": {"ask": {"do": say}}}}},
    }
    step = Bench(chart({"P": {"kind": "parallel", "states": regions}})).send("ask")
    assert step.commands == (Act("say", {"target": "a", "left": 1}), Act("say", {"target": "c", "left": 0}))


def test_in_state_asks_for_any_of_the_states() -> None:
    """One active state is enough; none is not."""
    rules = [
        {"target": "A", "guard": lambda env: env["in_state"](["B", "C"])},
        {"target": "B", "guard": lambda env: env["in_state"](["A", "C"])},
    ]
    bench = Bench(chart({"A": {}, "B": {}, "C": {}}, on={"go": rules}))
    bench.send("go")
    assert bench.leaves == ["B"]
    bench.send("go")
    assert bench.leaves == ["A"]


def test_held_asks_for_one_hold() -> None:
    """A condition may depend on which hold is engaged."""
    rule = {
        "do": ("say", {"held": lambda env: [env["held"]("pause"), env["held"]("estop")]}),
        "during": ("pause",),
    }
    estop = {"engage": "operator.stop", "release": ("operator.go",), "code": "paused"}
    bench = Bench(chart({"A": {"on": {"ask": rule}}}, holds={"pause": PAUSE, "estop": estop}))
    assert bench.send("ask").commands == (Act("say", {"held": [False, False]}),)
    bench.send("operator.pause")
    assert bench.send("ask").commands == (Act("say", {"held": [True, False]}),)


def test_a_guard_that_fails_is_told_with_its_place_and_its_text() -> None:
    """The author reads where, which condition, and what went wrong."""
    bench = Bench(chart({"A": {"on": {"go": {"target": "B", "guard": lambda env: env["absent"]}}}, "B": {}}))
    assert bench.send("go").notes[0] == "test.yaml:1:1: guard: 'absent'"


# -- actions -------------------------------------------------------------------------------------------------


def test_an_action_that_waited_for_a_release_is_carried_out_once() -> None:
    """The second release has nothing left to do."""
    states = {"A": {"on": {"go": {"do": "!arm.preset", "during": ("pause",)}}}}
    bench = Bench(chart(states, holds={"pause": PAUSE}))
    bench.send("operator.pause")
    assert bench.send("go").commands == ()
    assert bench.send("operator.resume").commands == (Act("arm.preset", {}),)
    bench.send("operator.pause")
    assert bench.send("operator.resume").commands == ()


def test_clearing_forgets_the_code_reported_last() -> None:
    """`report.clear` empties code and detail of what is published."""
    failing = {"invoke": "nav.go", "on_error": {"target": "B", "do": ()}}
    given = chart({"A": failing, "B": {"on": {"fine": {"do": "report.clear"}}}}, codes={"blocked": "blocked"})
    bench = Bench(given)
    bench.send(failed(bench.attempt, "blocked", "by a chair"))
    assert (bench.machine.view.code, bench.machine.view.detail) == ("blocked", "by a chair")
    bench.send("fine")
    assert (bench.machine.view.code, bench.machine.view.detail) == ("", "")
