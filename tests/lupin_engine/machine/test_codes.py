"""Codes: every one that is reported is an event of its own; the newest of the worst is remembered."""

from __future__ import annotations

from typing import Any

import pytest

from lupin_engine.machine.step import CodeEvent
from tests.lupin_engine.machine.charts import Bench, chart, expression

CODES = {"late": "too late", "blocked": "in the way"}


def bench(**on: Any) -> Bench:
    """Return a bench in a state that listens to some events, with a number in its context."""
    return Bench(chart({"A": {"on": on}, "FAULT": {}}, codes=CODES, context={"depth": 0.25}))


def code(name: str, **more: Any) -> dict[str, Any]:
    """Return a transition that only reports a code."""
    return {"code": name, **more}


def test_mere_information_is_reported_as_well() -> None:
    """It is remembered as long as nothing is worse."""
    machine = bench(go=code("paused"), fail=code("late"))
    step = machine.send("go")
    assert [str(told) for told in step.codes] == ["paused"]
    assert machine.machine.view.code == "paused"
    machine.send("fail")
    machine.send("go")
    assert machine.machine.view.code == "late"


@pytest.mark.parametrize(
    ("sent", "shown"),
    [
        (["late", "blocked"], "blocked"),
        (["late", "crashed", "blocked"], "crashed"),
        (["paused", "late", "paused"], "late"),
        (["crashed", "crashed"], "crashed"),
        (["late", "clear", "paused"], "paused"),
    ],
)
def test_the_newest_of_the_worst_is_remembered(sent: list[str], shown: str) -> None:
    """Until something clears it; what comes between is reported all the same, and counted."""
    on = {name: code(name) for name in ("late", "blocked", "crashed", "paused")}
    machine = bench(**on, clear={"do": "report.clear"})
    told = [str(event) for name in sent for event in machine.send(name).codes]
    assert told == [name for name in sent if name != "clear"]
    assert (machine.machine.view.code, machine.machine.view.codes) == (shown, len(told))


def test_the_same_code_twice_is_two_events() -> None:
    """Each with its own detail, which sees what the actions have set."""
    detail = expression(lambda env: f"{env['context']['depth']:.2f} m", "depth")
    machine = bench(
        go=code("late", detail=detail, do=[("set", {"depth": lambda env: 2 * env["context"]["depth"]})])
    )
    first, second = machine.send("go").codes, machine.send("go").codes
    assert first == (CodeEvent("late", "too late", 1, "0.50 m", ""),)
    assert second == (CodeEvent("late", "too late", 1, "1.00 m", ""),)
    view = machine.machine.view
    assert (view.code, view.detail, view.codes) == ("late", "1.00 m", 2)


def test_a_detail_that_fails_is_an_error_and_the_code_is_reported_without_it() -> None:
    """Nothing hides why the transition was taken."""
    machine = bench(go=code("late", detail=expression(lambda env: env["absent"], "absent")))
    step = machine.send("go")
    assert [str(told) for told in step.codes] == [
        "late",
        "execution_error: test.yaml:1:1: detail: there is no 'absent'",
    ]


def test_a_code_names_the_target_of_the_states_that_are_left() -> None:
    """Also where the transition leaves the itinerary, or goes on to the next target."""
    close = ("itinerary.close", {"status": "OK"})
    on = {"next": code("late", do=[close, "itinerary.advance"]), "out": code("late", target="Z")}
    walk = {"itinerary": [{"id": "1"}, {"id": "2"}], "on": on}
    machine = Bench(chart({"W": walk, "Z": {"on": {"more": code("late")}}}, codes=CODES))
    targets = [machine.send(name).codes[0].target for name in ("next", "out", "more")]
    assert targets == ["1", "2", ""]


def test_what_the_time_of_a_state_reports_is_an_event() -> None:
    """A budget has a code like any transition."""
    state = {"budget": {5.0: {"target": "B", "code": "paused"}}}
    machine = Bench(chart({"A": state, "B": {}}, codes=CODES))
    (step,) = machine.wait(5.0)
    assert [str(told) for told in step.codes] == ["paused"]
