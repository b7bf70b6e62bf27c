"""Whatever comes from outside, in whatever shape: no exception, no half step, no memory without bound."""

from __future__ import annotations

import copy
import math
import random
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lupin_engine.machine import event as events
from lupin_engine.machine.event import Event
from lupin_engine.machine.holds import MAX_DEFERRED
from lupin_engine.machine.operations import CANCEL_DEADLINE, MAX_LOST
from lupin_engine.machine.step import Refusal
from lupin_greenhouse.profile import PROFILE
from tests.lupin_engine.machine.charts import PAUSE, Bench, chart, legal
from tests.lupin_engine.machine.properties.test_properties import World
from tests.lupin_engine.machine.test_snapshot import RICH

WORDS = (
    "accepted",
    "progress",
    "done",
    "failed",
    "cancelled",
    "cancel_refused",
    "",
    "resource free",
    "not wanted",
    "unheard",
)
NAMES = st.sampled_from(
    [
        *(f"attempt.{word}" for word in WORDS),
        *(f"operator.{verb}" for verb in (*PROFILE.requests, "", "nonsense")),
        *("mission.start", "value", "start", "close", "rest", "flip", "out", "back", "", "done", "error"),
        *("error.execution", "after.0", "budget", "timer.after", "input.seen", "input.charge.low"),
        *("clock", "timer.at", "at.0", "at.waits", "every.0"),
    ]
)
PLAIN = st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=9) | st.just("x" * 100_000)
SHAPES = st.recursive(
    PLAIN,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3), inner, max_size=3),
    max_leaves=6,
)
IDS = st.sampled_from([f"a{number}" for number in range(1, 12)])
FIELDS = {
    "attempt": IDS | SHAPES,
    "code": st.just("blocked") | SHAPES,
    "detail": st.text(max_size=5) | SHAPES,
    "result": st.just({}) | SHAPES,
    "name": st.sampled_from(["seen", "charge", "robot.estop", "robot.battery"]) | SHAPES,
    "value": st.lists(st.sampled_from("abc"), max_size=3) | SHAPES,
    "stamp": st.floats(0, 100) | SHAPES,
    "ahead": st.sampled_from([0.0, -1.0, 23_390.0, 1e9, -1e11, 1e11]) | st.floats() | SHAPES,
    "owner": st.sampled_from(["P.R.REST", "READY"]) | SHAPES,
    "event": st.just("at.0") | SHAPES,
    "mission_type": st.sampled_from(["M", "InspectionMission"]) | SHAPES,
    "mission_id": SHAPES,
    "tag_sequence": st.just(["1"]) | SHAPES,
}
DATA = st.fixed_dictionaries({}, optional=FIELDS) | st.fixed_dictionaries(FIELDS) | SHAPES
EVENTS = st.builds(Event, NAMES | st.text(max_size=12), DATA)
HAPPENINGS = st.lists(EVENTS | st.sampled_from([0.5, 2.0, 10.0]), max_size=25)


@given(HAPPENINGS)
def test_nothing_from_outside_breaks_a_machine(happenings: list[Event | float]) -> None:
    """A chart with all there is: every step ends in a legal configuration."""
    bench = Bench(RICH, clock="2026-11-22 06:29")
    for happening in happenings:
        if isinstance(happening, float):
            bench.wait(happening)
        else:
            bench.send(happening)
        assert legal(RICH, bench.machine.memory.configuration)


@given(HAPPENINGS)
def test_nothing_from_outside_breaks_the_shipped_mission(happenings: list[Event | float]) -> None:
    """With real missions, readers and expressions; a refused request changes nothing."""
    world = World()
    world.report(-1, "done")
    for happening in happenings:
        if isinstance(happening, float):
            world.wait(happening)
        else:
            before = copy.deepcopy(world.memory)
            step = world.machine.handle(happening, world.now)
            assert legal(world.chart, world.memory.configuration)
            assert not (happening.is_request and not step.accepted and step.changed)
            if any(note.startswith("dropped: ") for note in step.notes) and not step.changed:
                before.sequence, before.dropped = world.memory.sequence, world.memory.dropped
                assert before == world.memory


MALFORMED: list[tuple[str, Any, str]] = [
    ("attempt.done", None, "attempt.done has no fields"),
    ("attempt.done", [], "attempt.done has no fields"),
    ("attempt.done", {}, "attempt.done has no attempt"),
    ("attempt.done", {"attempt": "a2"}, "attempt.done has no result"),
    ("attempt.done", {"attempt": "a2", "result": [1]}, "attempt.done has a wrong result: [1]"),
    ("attempt.done", {"attempt": ["a2"], "result": {}}, "attempt.done has a wrong attempt: ['a2']"),
    ("attempt.accepted", {"attempt": {}}, "attempt.accepted has a wrong attempt: {}"),
    ("attempt.failed", {"attempt": "a2", "detail": ""}, "attempt.failed has no code"),
    ("attempt.failed", {"attempt": "a2", "code": 6, "detail": ""}, "attempt.failed has a wrong code: 6"),
    ("attempt.progress", {"attempt": "a2", "detail": None}, "attempt.progress has a wrong detail: None"),
    ("attempt.unheard", {"attempt": "a2"}, "there is no report 'attempt.unheard'"),
    ("attempt.not wanted", {"attempt": "a2"}, "there is no report 'attempt.not wanted'"),
    ("value", {"name": "x", "stamp": 0.0}, "value has no value"),
    ("value", {"value": 1, "stamp": 0.0}, "value has no name"),
    ("value", {"name": [], "value": 1, "stamp": 0.0}, "value has a wrong name: []"),
    ("value", {"name": "x", "value": 1}, "value has no stamp"),
    ("value", {"name": "x", "value": 1, "stamp": "now"}, "value has a wrong stamp: 'now'"),
    ("value", {"name": "x", "value": 1, "stamp": True}, "value has a wrong stamp: True"),
    ("value", {"name": "x", "value": 1, "stamp": math.nan}, "value has a wrong stamp: nan"),
    ("value", {"name": "x", "value": 1, "stamp": math.inf}, "value has a wrong stamp: inf"),
    ("clock", {}, "clock has no ahead"),
    ("clock", {"ahead": "late"}, "clock has a wrong ahead: 'late'"),
    ("clock", {"ahead": math.inf}, "clock has a wrong ahead: inf"),
    ("value", {"name": "x", "value": 1, "stamp": 10**13}, "value has a wrong stamp: 10000000000000"),
]


@pytest.mark.parametrize(("name", "data", "flaw"), MALFORMED)
def test_what_is_malformed_is_dropped(name: str, data: Any, flaw: str) -> None:
    """The step says what is wrong with it, and nothing has changed."""
    states = {"A": {"invoke": "nav.go", "on_done": "B", "on_error": "B"}, "B": {}}
    bench = Bench(chart(states, inputs={"x": {}}))
    assert bench.attempt == "a2"
    before = copy.deepcopy(bench.machine.memory)
    step = bench.send(Event(name, data))
    before.sequence += 1
    assert (step.notes, step.changed) == ((f"dropped: {flaw}",), False)
    assert bench.machine.memory == before


@pytest.mark.parametrize(
    ("name", "data", "flaw"),
    [
        ("operator.abort", None, "operator.abort has no fields"),
        ("operator.", [1], "operator. has no fields"),
        ("mission.start", "M", "mission.start has no fields"),
        ("mission.start", {"mission_type": ["M"]}, "mission.start has a wrong mission_type: ['M']"),
    ],
)
def test_a_malformed_request_is_refused(name: str, data: Any, flaw: str) -> None:
    """A person waits for the answer."""
    bench = Bench(chart({"A": {"on": {"operator.abort": "B", "mission.start": "B"}}, "B": {}}))
    step = bench.send(Event(name, data))
    assert (step.accepted, step.refusal) == (False, Refusal("bad_request", flaw))
    assert (bench.leaves, step.changed) == (["A"], False)


def test_what_is_long_is_told_in_short() -> None:
    """A note is for people."""
    bench = Bench(chart({"A": {}}))
    step = bench.send("value", name="x" * 1_000_000, value=1, stamp="y" * 1_000_000)
    assert len(step.notes[0]) < 100


@pytest.mark.parametrize("data", [None, [], 5, "text"])
def test_an_event_without_fields_is_an_event(data: Any) -> None:
    """What no guard and no action reads may be anything; who reads a field misses it, as in an empty one."""
    states = {
        "A": {"on": {"go": "B", "look": {"target": "B", "guard": lambda env: env["event"]["x"]}}},
        "B": {"invoke": "nav.go", "on": {"back": "A"}},
        "FAULT": {},
    }
    bench = Bench(chart(states))
    for _ in range(2):
        bench.send(Event("go", data))
        assert bench.leaves == ["B"]
        bench.send("back")
    bench.send(Event("look", data))
    assert (bench.leaves, bench.machine.view.detail) == (["FAULT"], "test.yaml:1:1: guard: there is no 'x'")


# -- bounded memory ---------------------------------------------------------------------------------------


def test_ten_thousand_events_leave_a_small_memory() -> None:
    """Attempts, deadlines and what waits are bounded, whatever servers and sensors do, held or not."""
    bench = Bench(RICH)
    bench.send("mission.start", mission_type="M")
    chance = random.Random(7)
    size = 0
    for number in range(10_000):
        bench.now += 0.01
        bench.wait(0.0)
        _anything(bench, chance, number)
        del bench.steps[:-1]
        memory = bench.machine.memory
        size = max(
            size, len(memory.attempts) + len(memory.timers) + len(memory.frozen) + len(memory.deferred)
        )
    # Within the cancel deadline every event may have started an attempt, each with a deadline.
    assert size < 2 * CANCEL_DEADLINE / 0.01 + MAX_LOST + MAX_DEFERRED
    assert len(bench.machine.snapshot()) < 200_000
    bench.send("out")
    bench.wait(60.0)
    assert len(bench.machine.memory.attempts) <= MAX_LOST


def _anything(bench: Bench, chance: random.Random, number: int) -> None:
    newest = f"a{max(1, bench.machine.memory.next_id - chance.randrange(6))}"
    bench.send(
        chance.choice(
            [
                Event(chance.choice(["close", "rest", "back", "flip", "out", "mission.start", "door.open"])),
                Event(chance.choice(["operator.pause", "operator.resume", "operator.resume"])),
                events.accepted(newest),
                events.done(newest, {}),
                events.failed(newest, "blocked", "because" * 9),
                events.observed("seen", chance.sample("abcdefgh", 3), bench.now),
                events.observed("charge", chance.random(), bench.now),
                Event(f"noise.{number}"),
            ]
        )
    )


def test_events_that_wait_are_bounded() -> None:
    """A hold of an hour and a plugin that talks: the newest are kept, and what was dropped is told."""
    states = {
        "A": {"on": {"seen": {"do": ("set", {"n": lambda env: [*env["context"]["n"], env["event"]["n"]]})}}}
    }
    bench = Bench(chart(states, holds={"pause": PAUSE}, context={"n": []}))
    bench.send("operator.pause")
    for number in range(MAX_DEFERRED + 2):
        step = bench.send("seen", n=number)
    assert step.notes == (
        "seen waits for the release",
        f"dropped: seen, because more than {MAX_DEFERRED} events wait",
    )
    bench.send("operator.resume")
    assert bench.context["n"] == list(range(2, MAX_DEFERRED + 2))


def test_answers_that_wait_are_not_dropped_for_events() -> None:
    """There is at most one for each operation."""
    states = {"A": {"invoke": "bridge.read", "on_done": "B", "on": {"seen": {"do": "wave"}}}, "B": {}}
    bench = Bench(chart(states, holds={"pause": PAUSE}))
    bench.send("operator.pause")
    bench.send(events.done(bench.attempt, {}))
    for _ in range(MAX_DEFERRED + 5):
        bench.send("seen", attempt=bench.attempt)
    bench.send("operator.resume")
    assert bench.leaves == ["B"]


def test_names_without_number_teach_nothing_without_bound() -> None:
    """What an event's name finds is kept up to a number, in each configuration."""
    bench = Bench(chart({"A": {"on": {"nav.*": {"do": "wave"}}}}))
    for number in range(3000):
        bench.machine.handle(Event(f"nav.{number}"), 0.0)
    assert len(bench.machine._active._candidates) == 1024


def test_a_name_that_is_no_text_is_dropped() -> None:
    """Against the types, but a driver of others may do it."""
    bench = Bench(chart({"A": {}}))
    for name, shown in ((None, "None"), (5, "5")):
        step = bench.machine.handle(Event(name), 0.0)  # type: ignore[arg-type]
        assert step.notes == (f"dropped: the name of an event is no text: {shown}",)
