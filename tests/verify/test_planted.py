"""Planted defects: what the explorer says of charts and engines with one mistake each."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from lupin_engine.chart.model import Chart
from lupin_engine.machine import operations
from lupin_engine.machine.holds import Holds
from lupin_engine.machine.itineraries import Itineraries
from lupin_engine.machine.machine import Machine
from lupin_engine.machine.operations import Operations
from lupin_engine.machine.requests import Requests
from lupin_engine.machine.step import Refusal
from lupin_engine.machine.timers import Timers
from lupin_engine.verify.situations.situation import TooMany
from tests.machine.charts import PAUSE, chart, fails
from tests.verify.toys import broken

DRIVE = {"do": "nav.go", "timeout": 10.0}
CLOSE = ("itinerary.close", {"status": "OK"})
REST = ("itinerary.close_rest", {"status": "SKIPPED"})


def _more(env: Any) -> bool:
    """Say whether another target follows."""
    return bool(env["itinerary"]["remaining"] > 0)


#: Ends of missions, and where a person must look.
ENDS: dict[str, Any] = {"DONE": {"entry": "report.summary"}, "FAULT": {}}
#: Drives, is paused, tries again, and is aborted.
TRIP: dict[str, Any] = {
    "GO": {
        "invoke": {**DRIVE, "attempts": 2, "backoff": 1.0},
        "on_done": "READ",
        "on_error": "DONE",
        "on": {"operator.abort": {"target": "DONE", "releases": {"pause"}}},
    },
    "READ": {
        "invoke": {"do": "bridge.read", "timeout": 5.0},
        "on_done": "REST",
        "on_error": "REST",
        "on": {"operator.skip_current": {"refuse": "crashed"}},
    },
    "REST": {"after": {2.0: "DONE"}},
    **ENDS,
}
#: Walks two targets.
WALK: dict[str, Any] = {
    "W": {
        "itinerary": {"items": ["1", "2"]},
        "states": {
            "V": {
                "invoke": {"do": "bridge.read", "timeout": 5.0},
                "on_done": {"target": "NEXT", "do": CLOSE},
                "on_error": {"target": "NEXT", "do": CLOSE},
                "on": {"operator.skip_current": {"target": "NEXT", "do": CLOSE}},
            },
            "NEXT": {
                "after": {
                    1.0: [{"target": "V", "guard": _more, "do": "itinerary.advance"}, {"target": "DONE"}]
                },
                "on": {"operator.dock": {"do": CLOSE}},
            },
        },
        "on": {"operator.abort": {"target": "DONE", "do": REST}},
    },
    **ENDS,
}


def trip(**changes: Any) -> Chart:
    """Return the chart of `TRIP`, some of its states changed."""
    states = {name: {**state, **changes.get(name, {})} for name, state in TRIP.items()}
    return chart(states, holds={"pause": PAUSE})


def walk() -> Chart:
    """Return the chart of `WALK`, ended by an abort alone."""
    return chart(WALK)


def test_all_is_well_without_a_defect() -> None:
    """What is planted below stands in charts in which nothing else is wrong."""
    assert broken(trip()) == set()
    assert broken(walk()) == set()


#: What is planted -> the chart, and a property that must be found broken.
CHARTS: dict[str, tuple[Callable[[], Chart], str]] = {
    "a wait without a deadline": (lambda: trip(READ={"invoke": "bridge.read"}), "silence_is_told"),
    "a drive that nothing stops": (lambda: trip(GO={"invoke": "nav.go", "on": {}}), "abort_stops"),
    "a state without a way out": (lambda: trip(REST={"after": {}}), "no_deaf_wait"),
    "a state that is never left": (lambda: trip(REST={"after": {}}), "home_again"),
    "a circle of time": (lambda: _circle(2.0), "no_livelock"),
    "a circle without time": (lambda: _circle(0.0), "no_zeno"),
    "a circle within a step": (lambda: _circle(None), "no_execution_error"),
    "an end that nobody handles": (lambda: trip(GO={"on_error": []}), "home_again"),
    "an action that fails": (lambda: trip(REST={"entry": [("set", {"x": fails})]}), "no_execution_error"),
    "a guard that fails": (
        lambda: trip(READ={"on_done": {"target": "REST", "guard": fails}}),
        "no_execution_error",
    ),
    "an invariant that is broken": (
        lambda: chart(TRIP, invariants={"never REST": lambda env: not env["in_state"](["REST"])}),
        "invariants",
    ),
    "a mission that ends with open targets": (
        lambda: chart({**WALK, "W": {**WALK["W"], "on": {"operator.abort": "DONE"}}}),
        "all_closed",
    ),
    "a request that leads to nowhere": (lambda: _dead_end(), "no_deaf_wait"),
}


def _circle(seconds: float | None) -> Chart:
    def to(target: str) -> dict[str, Any]:
        return {"always": target} if seconds is None else {"after": {seconds: target}}

    return chart({"START": {"on": {"operator.dock": "X"}}, "X": to("Y"), "Y": to("X"), **ENDS})


def _dead_end() -> Chart:
    return chart({**TRIP, "REST": {"after": {2.0: "DONE"}, "on": {"operator.dock": "END"}}, "END": {}})


@pytest.mark.parametrize("planted", CHARTS)
def test_mistakes_of_charts_are_found(planted: str) -> None:
    """War stories and slips of the pen, put into a chart."""
    of, name = CHARTS[planted]
    assert name in broken(of())


def _end_as_wanted(self: Operations, kind: str, attempt: Any, data: Any, step: Any) -> None:
    """Book what is said of an attempt that nobody waits for."""
    for invocation in self._scope.memory.invocations.values():
        if invocation.name == attempt.invocation and kind == "done":
            self._signal("done", invocation, operations.Trigger(event=data["result"]), step)
    self._move(attempt, kind, step)


def _close_again(self: Itineraries, traversal: Any, outcome: Any, step: Any) -> None:
    """Close a visit, whether it has its outcome or not."""
    if traversal is not None and traversal.visit is not None:
        self._close(traversal, traversal.visit, outcome, step)


def _nothing(*_: Any, **__: Any) -> None:
    """Do nothing."""


def _no(*_: Any, **__: Any) -> bool:
    return False


#: What is planted -> where, what stands there instead, the chart, and a property that must be found broken.
ENGINES: dict[str, tuple[Any, str, Any, Callable[[], Chart], str]] = {
    "a hold cancels nothing": (Operations, "suspend", _nothing, trip, "hold_stops_all"),
    "a hold keeps nothing from beginning": (operations, "is_held_back", _no, trip, "hold_starts_nothing"),
    "a hold that is never released": (Holds, "release", _nothing, trip, "home_again"),
    "clocks that do not go on": (Timers, "thaw", _nothing, trip, "no_deaf_wait"),
    "answers that wait for ever": (Machine, "_come_back_to", _nothing, trip, "silence_is_told"),
    "a retry that is forgotten": (Operations, "retry", _nothing, trip, "silence_is_told"),
    "a timeout that nobody hears": (Operations, "timed_out", _nothing, trip, "silence_is_told"),
    "an end that is not told": (Operations, "_signal", _nothing, trip, "ends_are_handled"),
    "nothing is ever begun": (Operations, "begin_missing", _no, trip, "no_livelock"),
    "a refusal without a reason": (
        Requests,
        "_refusal",
        lambda *_: Refusal("", ""),
        trip,
        "refusals_have_reasons",
    ),
    "a former attempt is booked": (Operations, "_report_unwanted", _end_as_wanted, trip, "former_attempts"),
    "a visit is closed twice": (Itineraries, "close", _close_again, walk, "closed_once"),
    "open visits are forgotten": (Itineraries, "close_rest", _nothing, walk, "all_closed"),
}


@pytest.mark.parametrize("planted", ENGINES)
def test_mistakes_of_engines_are_found(planted: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Mutants of holds, cancels, timers, requests and itineraries."""
    place, name, instead, of, wanted = ENGINES[planted]
    monkeypatch.setattr(place, name, instead)
    assert wanted in broken(of())


def test_what_grows_without_end_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """Deadlines that nobody disarms are more and more."""
    monkeypatch.setattr(Timers, "disarm", _nothing)
    with pytest.raises(TooMany, match=r"^timers grows: it has had 31 values, the last one \["):
        broken(trip(), most_values=30)


def test_an_exception_is_a_breach(monkeypatch: pytest.MonkeyPatch) -> None:
    """An engine that raises is told with the way to it, like every other breach."""
    monkeypatch.setattr(Operations, "timed_out", lambda *_: fails(None))
    assert "no_exception" in broken(trip())
