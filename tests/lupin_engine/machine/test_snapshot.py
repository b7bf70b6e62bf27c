"""A machine's memory as text: whoever goes on from it takes the same steps."""

from __future__ import annotations

import json
import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lupin_engine.machine import event as events
from lupin_engine.machine.event import Event
from lupin_engine.machine.memory import Memory
from lupin_engine.machine.snapshot import SnapshotError, restore, shift, snapshot
from tests.lupin_engine.machine.charts import PAUSE, Bench, chart
from tests.lupin_engine.machine.properties.test_properties import HAPPENINGS, START, World

VISIT = {"on": {"close": {"do": [("itinerary.close", {"status": "OK"}), "itinerary.advance"]}}}
RULES: dict[str, Any] = {
    "do": "nav.go",
    "items": lambda env: env["input"]["seen"],
    "limit": 2,
    "attempts": 2,
    "backoff": 0.5,
    "jitter": 0.5,
}
RICH = chart(
    {
        "READY": {"on": {"mission.start": "P"}, "budget": {20.0: "P"}},
        "P": {
            "kind": "parallel",
            "on": {"out": "READY"},
            "states": {
                "R": {
                    "states": {
                        "WALK": {
                            "budget": {9.0: "REST"},
                            "itinerary": {"items": [{"id": "1"}, {"id": "2"}], "sweeps": 2},
                            "states": {"VISIT": VISIT},
                            "on": {"rest": "REST"},
                        },
                        "REST": {"on": {"back": "R.H"}, "after": {2.0: "R.H"}, "at": {"06:30": "R.H"}},
                        "H": {"kind": "history", "depth": None},
                    }
                },
                "S": {
                    "states": {
                        "LOOK": {"for_each": RULES, "on": {"flip": "DOCK"}},
                        "DOCK": {
                            "entry": "!arm.preset",
                            "invoke": {"do": "nav.dock", "timeout": 4.0, "timeout_code": "late"},
                            "on_done": "LOOK",
                            "on_error": "LOOK",
                            "on": {"flip": "LOOK", "input.seen": "LOOK"},
                        },
                    }
                },
            },
        },
        "FAULT": {"on": {"out": "READY"}},
    },
    holds={"pause": PAUSE},
    inputs={"seen": {"freshness": 6.0}, "charge": {"levels": {"low": (0.2, 0.05)}}},
    missions={"M": {"state": "P"}},
    context={"reading": None},
)
NAMES = ("close", "rest", "back", "flip", "out", "operator.pause", "operator.resume")
#: What happens on the chart above: events, seen elements, reports of one of the last attempts, time.
RICH_HAPPENINGS = st.lists(
    st.sampled_from(NAMES)
    | st.lists(st.sampled_from("abc"), max_size=3)
    | st.tuples(
        st.integers(-3, -1), st.sampled_from(["accepted", "done", "failed", "cancelled", "cancel_refused"])
    )
    | st.sampled_from([0.4, 1.0, 3.0, 8.0]),
    max_size=30,
)


def happen(bench: Bench, happening: Any) -> None:
    """Let something happen."""
    if isinstance(happening, float):
        bench.wait(happening)
    elif isinstance(happening, str):
        bench.send(happening)
    elif isinstance(happening, list):
        bench.observe("seen", happening)
    elif len(bench.started) >= -happening[0]:
        attempt = bench.started[happening[0]].attempt
        bench.send(_report(happening[1], attempt))


def _report(word: str, attempt: str) -> Event:
    if word == "done":
        return events.done(attempt, {"found": math.inf})
    return (
        events.failed(attempt, "blocked")
        if word == "failed"
        else events.cancel_refused(attempt, "it goes on")
        if word == "cancel_refused"
        else Event(f"attempt.{word}", {"attempt": attempt})
    )


@given(RICH_HAPPENINGS, RICH_HAPPENINGS)
def test_who_is_restored_goes_on_as_before(before: list[Any], after: list[Any]) -> None:
    """Parallel states, history, for_each, budgets, itineraries, retries: all of it is in the snapshot."""
    one = Bench(RICH)
    one.send("mission.start", mission_type="M")
    for happening in before:
        happen(one, happening)
    other = Bench(RICH)
    other.machine, other.now, other.steps = one.machine, one.now, list(one.steps)
    other.restart()
    assert other.machine.memory == one.machine.memory
    for happening in after:
        happen(one, happening)
        happen(other, happening)
        assert other.steps == one.steps
        assert other.machine.snapshot() == one.machine.snapshot()


@given(HAPPENINGS, HAPPENINGS)
def test_the_shipped_mission_goes_on_after_a_restart(before: list[Any], after: list[Any]) -> None:
    """Wherever the process ends, the next one takes the steps that the first would have taken."""
    one = World()
    one.report(-1, "done")
    one.send(START)
    for happening in before:
        one.happen(happening)
    other = one.twin()
    for happening in after:
        one.happen(happening)
        other.happen(happening)
    assert other.steps == one.steps
    assert other.machine.snapshot() == one.machine.snapshot()


def test_readings_that_are_no_numbers_survive() -> None:
    """nan and the infinities, which JSON has no words for."""
    write = {"do": ("set", {"seen": lambda env: env["event"]["values"]})}
    bench = Bench(chart({"A": {"on": {"see": write}}}, context={"seen": None}))
    bench.send("see", values=[math.nan, math.inf, -math.inf, {"depth": None}])
    bench.restart()
    nan, high, low, rest = bench.context["seen"]
    assert (math.isnan(nan), high, low, rest) == (True, math.inf, -math.inf, {"depth": None})


def test_what_waits_for_a_release_survives() -> None:
    """An answer, an event and an action that a hold keeps are dealt with by who is released."""
    states = {
        "A": {
            "invoke": "bridge.read",
            "on_done": "B",
            "on": {"door.open": {"do": "wave"}, "operator.dock": {"do": "!arm.preset", "during": ["pause"]}},
        },
        "B": {"on": {"door.open": {"do": "wave"}}},
    }
    bench = Bench(chart(states, holds={"pause": PAUSE}))
    for happening in ("operator.pause", "operator.dock", "door.open", events.done(bench.attempt, {})):
        bench.send(happening)
    bench.restart()
    bench.send("operator.resume")
    assert (bench.leaves, bench.commands) == (["B"], ["act arm.preset", "act wave"])


def test_deadlines_move_to_another_clock() -> None:
    """A process that starts again has a clock that began elsewhere; what is left of a wait stays."""
    states = {"A": {"after": {10.0: "B"}}, "B": {}}
    inputs = {"pose": {"freshness": 8.0}}
    bench = Bench(chart(states, inputs=inputs, missions={"M": {"state": "A"}}))
    bench.observe("pose", 1)
    bench.machine.memory.started_at = 2.0
    bench.wait(4.0)
    bench.restart()
    shift(bench.machine.memory, 100.0 - bench.now)
    bench.now = 100.0
    assert bench.machine.memory.started_at == 98.0
    assert [step.time for step in bench.wait(20.0)] == [104.0, 106.0]
    assert bench.leaves == ["B"]


def test_what_is_frozen_does_not_move() -> None:
    """A held chart's timers are no times of a clock, and before the first mission there is no start."""
    bench = Bench(chart({"A": {"after": {10.0: "B"}}, "B": {}}, holds={"pause": PAUSE}))
    bench.send("operator.pause")
    shift(bench.machine.memory, 50.0)
    assert bench.machine.memory.frozen[0][0] == 10.0
    assert bench.machine.memory.started_at is None


# -- snapshots that cannot be used ------------------------------------------------------------------------


def changed(**fields: Any) -> str:
    """Return the snapshot of the chart above with some parts of its memory replaced."""
    bench = Bench(RICH)
    bench.send("mission.start", mission_type="M")
    found = json.loads(bench.machine.snapshot())
    found["memory"].update(fields)
    return json.dumps(found)


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        (
            "?",
            "this is no snapshot: Expecting value: line 1 column 1 (char 0)",
        ),
        ("[]", "this is no snapshot: expected version, chart and memory"),
        ('{"version": 4}', "this is no snapshot: expected version, chart and memory"),
        (
            '{"version": 1, "chart": "test", "memory": {}}',
            "this snapshot is of version 1, expected 4",
        ),
        (
            '{"version": 4, "chart": "other", "memory": {}}',
            "this snapshot is of the chart 'other', not of 'test'",
        ),
        (
            '{"version": 4, "chart": "test", "memory": {"held": 3, "sequence": "x"}}',
            "this snapshot is damaged: held: Input should be a valid list; "
            "sequence: Input should be a valid integer, unable to parse string as an integer",
        ),
    ],
)
def test_what_is_no_snapshot_is_refused(text: str, problem: str) -> None:
    """With all that is wrong, in one sentence."""
    with pytest.raises(SnapshotError) as told:
        restore(RICH, text)
    assert str(told.value) == problem


STRANGERS: list[tuple[dict[str, Any], str]] = [
    (
        {"configuration": ["", "GONE"]},
        "there is no state 'GONE'; these states are never active together: GONE",
    ),
    ({"history": {"H": ["P.Q"]}}, "there is no state 'H'; there is no state 'P.Q'"),
    ({"mission": "N"}, "there is no mission 'N'"),
    ({"context": {"k": 1}}, "there is no variable 'k'"),
    ({"held": ["stop"]}, "there is no hold 'stop'"),
    ({"inputs": {"pose": [1, 0.0, True]}}, "there is no input 'pose'"),
    ({"broken": ["safe"]}, "there is no invariant 'safe'"),
    ({"itineraries": {"P": {"state": "P", "items": [], "visits": []}}}, "there is no itinerary in state 'P'"),
    ({"invocations": {"P": {"id": "i1", "state": "P"}}}, "there is no operation in state 'P'"),
    ({"invocations": {"P[a]": {"id": "i1", "state": "P", "key": "a"}}}, "there is no for_each in state 'P'"),
    ({"timers": [[1.0, 1, "after", ["P", "after.0"]]]}, "there is no timer in state 'P'"),
    ({"frozen": [[1.0, 1, "fresh", ["charge", ""]]]}, "there is no freshness of input 'charge'"),
    ({"given": {"P": {}}}, "there is no mission in state 'P'"),
    ({"budgets": {"P": 1.0}}, "there is no budget in state 'P'"),
    ({"timers": [[1.0, 1, "budget", ["P", "budget"]]]}, "there is no budget in state 'P'"),
    ({"configuration": ["", "P", "READY"]}, "these states are never active together: P, READY"),
    ({"configuration": ["READY"]}, "these states are never active together: READY"),
]


@pytest.mark.parametrize(("fields", "problem"), STRANGERS, ids=lambda given: str(given)[:40])
def test_a_snapshot_of_another_chart_is_refused(fields: dict[str, Any], problem: str) -> None:
    """A mission that was edited between two runs has the same name; what it no longer has is named."""
    with pytest.raises(SnapshotError) as told:
        restore(RICH, changed(**fields))
    assert str(told.value) == f"this snapshot does not fit the chart 'test': {problem}"


def test_a_machine_that_never_started_has_a_snapshot() -> None:
    """Nothing is remembered, and that is legal."""
    assert restore(RICH, snapshot(RICH, Memory())) == Memory()
