"""Why something can happen in a state, or cannot: by the exact words."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pytest

from lupin_engine.errors import UsageError
from lupin_engine.runtime.explanation import explanation
from tests.lupin_engine.machine.charts import PAUSE, Bench, chart, expression

FULL = expression(lambda env: env["context"]["full"], "context.full")


def bench(**more: Any) -> Bench:
    """Return a bench in a state that works, within one that listens as well."""
    drive = {
        "invoke": "nav.go",
        "on": {"go": [{"target": "END", "id": "go.1", "guard": FULL}, {"target": "END", "id": "go.2"}]},
        "on_done": [{"target": "END", "id": "done.1"}, {"target": "END", "id": "done.2"}],
        "after": {5.0: {"target": "END", "id": "late", "guard": FULL}},
    }
    work = {
        "states": {"DRIVE": drive},
        "on": {"go": {"target": "END", "id": "go.above"}, "operator.dock": {"target": "END", "id": "dock"}},
    }
    end = {
        "on": {"operator.dock": {"refuse": "docked", "id": "no"}, "nav.*": {"target": "WORK", "id": "any"}}
    }
    states = {"WORK": work, "END": end}
    return Bench(chart(states, context={"full": False}, holds={"pause": PAUSE}, **more))


def reasons(bench: Bench, element: str) -> Mapping[str, str]:
    """Return of each transition why it would not be taken."""
    told = explanation(bench.machine, element, bench.now)
    assert all(rule["possible"] == (not rule["reason"]) for rule in told["rules"])
    return {rule["id"]: rule["reason"] for rule in told["rules"]}


def test_each_transition_says_what_speaks_against_it() -> None:
    """Its guard with what it is, or the one that is taken instead; those of the states around come last."""
    assert reasons(bench(), "WORK.DRIVE") == {
        "go.1": "context.full is false",
        "go.2": "",
        "done.1": "",
        "done.2": "done.1 is taken instead",
        "late": "context.full is false",
        "go.above": "go.2 is taken instead",
        "dock": "",
    }


def test_a_hold_stops_what_does_not_pass_it() -> None:
    held = bench()
    held.send("operator.pause")
    assert reasons(held, "WORK") == {
        "go.above": "pause is engaged",
        "dock": "dock refused: paused by the operator",
    }


def test_a_request_is_refused_in_the_words_of_its_answer() -> None:
    ended = bench()
    ended.send("go")
    assert reasons(ended, "END") == {"no": "dock refused: docked", "any": ""}
    ended.send("operator.pause")
    assert reasons(ended, "END") == {"no": "dock refused: docked", "any": "pause is engaged"}


def test_what_is_not_active_says_so() -> None:
    """A transition by itself is told as in its state."""
    one = bench()
    assert reasons(one, "END") == {"no": "END is not active", "any": "END is not active"}
    assert explanation(one.machine, "any", 0.0) == {
        "element": "any",
        "sequence": 1,
        "active": False,
        "rules": [
            {
                "id": "any",
                "state": "END",
                "event": "nav.*",
                "possible": False,
                "reason": "END is not active",
            }
        ],
    }


def test_a_level_that_is_not_true_is_no_event() -> None:
    rule = {"target": "B", "id": "low"}
    one = Bench(
        chart({"A": {"on": {"input.x.low": rule}}, "B": {}}, inputs={"x": {"levels": {"low": (1, None)}}})
    )
    one.observe("x", 3)
    assert reasons(one, "A") == {"low": "input.x.low is false"}


def test_an_unknown_name_is_told_with_the_nearest() -> None:
    with pytest.raises(UsageError) as told:
        explanation(bench().machine, "WORK.DRIV", 0.0)
    assert str(told.value) == "no state or transition 'WORK.DRIV'; did you mean 'WORK.DRIVE'?"


def test_nothing_changes_by_it() -> None:
    one = bench()
    before = one.machine.snapshot()
    explanation(one.machine, "WORK.DRIVE", 3.0)
    assert one.machine.snapshot() == before
