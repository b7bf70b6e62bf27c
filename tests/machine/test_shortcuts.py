"""Shortcuts give the very steps of the general way; so do rows and plans that are not kept."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import pytest
from hypothesis import given

from lupin_engine.chart.model import Chart
from lupin_engine.machine import machine as machines
from lupin_engine.machine import plan as plans
from lupin_engine.machine.event import Event
from lupin_engine.machine.machine import Machine
from tests.machine.charts import Bench, chart, expression, fails, legal
from tests.machine.random_charts import HAPPENINGS, Happening, charts, drive
from tests.machine.test_snapshot import RICH, RICH_HAPPENINGS, happen


class Plodder(Machine):
    """A machine that takes no shortcut, whatever it has learned."""

    __slots__ = ()

    @property
    def answers(self) -> Mapping[Any, Any]:
        """Nothing."""
        return {}

    @answers.setter
    def answers(self, _: Mapping[Any, Any]) -> None:
        """Forget what was learned."""


class Plodding(Bench):
    """A bench with such a machine."""

    machine_type = Plodder


@pytest.fixture(autouse=True, scope="module")
def _short_cycles() -> Iterator[None]:
    """Many random charts never come to rest; that need not take a thousand microsteps each time."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(machines, "MICROSTEP_LIMIT", 40)
        yield


def compare(one: Bench, other: Bench, happenings: list[Happening]) -> None:
    """Let the same happen to both; expect the same steps and memories, and legal configurations."""
    assert one.steps == other.steps
    for happening in happenings:
        before = len(one.steps)
        drive(one, happening)
        drive(other, happening)
        assert one.steps[before:] == other.steps[before:]
        assert [step.why for step in one.steps[before:]] == [step.why for step in other.steps[before:]]
        assert one.machine.memory == other.machine.memory
        assert legal(one.machine.chart, one.machine.memory.configuration)


@given(charts(), HAPPENINGS)
def test_shortcuts_change_nothing(given_chart: Chart, happenings: list[Happening]) -> None:
    """A machine with shortcuts and one without take the same steps, also when all have been learned."""
    compare(Bench(given_chart), Plodding(given_chart), happenings)
    compare(Bench(given_chart), Plodding(given_chart), happenings)


@given(RICH_HAPPENINGS)
def test_shortcuts_change_nothing_beside_operations(happenings: list[Any]) -> None:
    """Nor where operations, walks, budgets and holds of other states are under way."""
    quick, plodding = Bench(RICH), Plodding(RICH)
    for happening in happenings:
        for bench in (quick, plodding):
            happen(bench, happening)
        assert quick.steps == plodding.steps
    assert quick.machine.snapshot() == plodding.machine.snapshot()


@given(charts(), HAPPENINGS)
def test_what_is_not_kept_is_made_anew(given_chart: Chart, happenings: list[Happening]) -> None:
    """Beyond the number of rows and plans that are kept, steps cost more and are the same."""
    with pytest.MonkeyPatch.context() as patch:
        for module, name in ((plans, "MAX_ROWS"), (plans, "MAX_PLANS"), (machines, "MAX_PLANS")):
            patch.setattr(module, name, 1)
        poor = Bench(given_chart)
        plans.planner_of.cache_clear()
        assert poor.machine._planner is not Bench(given_chart).machine._planner
        for happening in happenings:
            drive(poor, happening)
    plans.planner_of.cache_clear()
    rich = Bench(given_chart)
    for happening in happenings:
        drive(rich, happening)
    assert poor.steps == rich.steps
    assert poor.machine.memory == rich.machine.memory


def test_more_configurations_than_are_kept() -> None:
    """They are worked out every time; the steps are the same, and memory is not spent on them."""
    moves = {name: {"on": {"go": after}} for name, after in ("AB", "BC", "CA")}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(plans, "MAX_ROWS", 2)
        bench = Bench(chart(moves))
        entered = [bench.send("go").entered for _ in range(6)]
    assert entered == [("B",), ("C",), ("A",)] * 2
    assert len(bench.machine._planner._rows) == 2


def learned(bench: Bench, event: str) -> bool:
    """Say whether the machine takes a shortcut for an event where it is."""
    return bench.machine.answers.get(event) is not None


def test_what_was_taken_once_is_taken_by_a_shortcut() -> None:
    """The second time nothing is worked out, and the step says the same."""
    bench = Bench(chart({"A": {"on": {"go": "B"}}, "B": {"on": {"go": "A"}}}))
    steps = [bench.send("go") for _ in range(4)]
    assert learned(bench, "go")
    assert [step.entered for step in steps] == [("B",), ("A",), ("B",), ("A",)]
    assert [step.exited for step in steps] == [("A",), ("B",), ("A",), ("B",)]
    assert [step.taken for step in steps[:2]] == [step.taken for step in steps[2:]]
    assert [step.trail[0].lifecycle for step in steps] == ["B", "A", "B", "A"]


def test_the_past_is_asked_every_time() -> None:
    """A way through history leads elsewhere the second time: it is no shortcut."""
    inner = {"A": {"on": {"next": "B"}}, "B": {}, "H": {"kind": "history", "depth": 1}}
    states = {"M": {"states": inner, "on": {"out": "Z"}}, "Z": {"on": {"back": "M.H"}}}
    bench = Bench(chart(states))
    for event in ("out", "back", "next", "out", "back"):
        bench.send(event)
    assert bench.leaves == ["M.B"]


def test_a_timer_whose_guard_is_false_is_told_as_that_timer() -> None:
    """Where a shortcut finds nothing to take, the step is that of the timer all the same."""
    rule = {"target": "B", "guard": lambda env: env["context"]["n"] > 0}
    states = {"A": {"after": {1.0: rule}, "on": {"again": "A", "up": {"do": ("set", {"n": 1})}}}, "B": {}}
    bench = Bench(chart(states, context={"n": 0}))
    (first,) = bench.wait(1.0)
    bench.send("again")
    (second,) = bench.wait(1.0)
    assert (first.event, second.event) == (Event("timer.after", {"owner": "A"}),) * 2
    assert [one.transition for one in second.why] == [one.transition for one in first.why] != []
    bench.send("again")
    bench.send("up")
    (third,) = bench.wait(1.0)
    assert (third.event, bench.leaves) == (first.event, ["B"])


def test_what_a_transition_in_conflict_would_write_is_not_written() -> None:
    """The second region's transition gives way to the first, also in a shortcut."""
    writes = {"target": "s2", "do": ("set", {"n": 1})}
    regions = {
        "R": {"states": {"r": {"on": {"go": "Z"}}}},
        "S": {"states": {"s": {"on": {"go": writes}}, "s2": {}}},
    }
    states = {"P": {"kind": "parallel", "states": regions}, "Z": {"on": {"back": "P"}}}
    bench = Bench(chart(states, context={"n": 0}))
    for event in ("go", "back", "go"):
        bench.send(event)
    assert (bench.leaves, bench.context) == (["Z"], {"n": 0})


@pytest.mark.parametrize(
    ("rules", "more"),
    [
        ({"do": ("set", {"n": expression(lambda env: int(env["in_state"](("A",))), "in_state('A')")})}, {}),
        ({"do": ["wave"]}, {}),
        ({"target": "A", "code": "late"}, {}),
        ([{"target": "A", "guard": lambda env: True, "do": "wave"}], {}),
        ("A", {"entry": "wave"}),
        ("A", {"exit": "wave"}),
        ("A", {"after": {fails: "A"}}),
        ("A", {"after": {"soon": "A"}}),
        ("A", {"after": {float("inf"): "A"}}),
        ("A", {"budget": {9.0: "A"}}),
        ("A", {"itinerary": [1]}),
        ({"do": ("set", {"n": 1})}, {"for_each": {"do": "bridge.read", "items": []}}),
    ],
    ids=str,
)
def test_what_does_more_than_move_has_no_shortcut(rules: Any, more: dict[str, Any]) -> None:
    """Actions, codes, entries, exits, operations, budgets and timers to be computed go the general way."""
    bench = Bench(chart({"A": {"on": {"go": rules}, **more}}, context={"n": 0}))
    bench.send("go")
    assert not learned(bench, "go")
    assert "go" in bench.machine._row.answers


def test_a_guard_in_two_regions_has_no_shortcut() -> None:
    """Which transitions are taken together depends on data."""
    guarded = {"target": "y", "guard": lambda env: env["event"]["yes"]}
    region = {"states": {"x": {"on": {"go": guarded}}, "y": {"on": {"go": "x"}}}}
    bench = Bench(chart({"P": {"kind": "parallel", "states": {"R": region, "S": region}}}))
    bench.send("go", yes=False)
    assert not learned(bench, "go")
    bench.send("go", yes=True)
    assert bench.leaves == ["P.R.y", "P.S.y"]


def test_a_written_timer_is_armed_by_a_shortcut() -> None:
    """What is left forgets its timers, what is entered arms its own."""
    states = {"A": {"after": {2.0: "B"}, "on": {"go": "B"}}, "B": {"after": {3.0: "A"}, "on": {"go": "A"}}}
    bench = Bench(chart(states))
    for _ in range(4):
        bench.now += 1.0
        bench.send("go")
    assert learned(bench, "go")
    assert [timer[::2] for timer in bench.machine.memory.timers] == [(6.0, "after")]


def test_a_value_that_cannot_be_written_is_told() -> None:
    """A shortcut that raises leaves everything to the general way, which names the place."""
    rule = {"target": "A", "do": ("set", {"n": lambda env: env["event"]["number"], "m": 1})}
    bench = Bench(chart({"A": {"on": {"go": rule}}, "FAULT": {}}, context={"n": 0, "m": 0}))
    bench.send("go", number=2)
    assert learned(bench, "go")
    step = bench.send("go")
    assert (bench.leaves, bench.context) == (["FAULT"], {"n": 2, "m": 1})
    assert step.notes == ("test.yaml:1:1: set: there is no 'number'",)


def test_a_chart_that_did_not_come_to_rest_takes_no_shortcut() -> None:
    """What it has not begun is begun with the next event, also when a shortcut for that is known."""
    echo = ("raise", {"event": "ping"})
    regions: dict[str, Any] = {
        "R": {"states": {"x": {"invoke": "bridge.read"}}},
        "S": {"states": {"s": {"entry": echo, "on": {"ping": {"do": echo}, "go": "t"}}, "t": {}}},
    }
    endless = chart({"P": {"kind": "parallel", "states": regions}})
    for _ in range(2):
        bench = Bench(endless)
        assert (bench.started, bench.machine.answers) == ([], {})
        bench.send("go")
        assert [start.operation for start in bench.started] == ["bridge.read"]


def test_what_needs_no_event_goes_before_the_shortcut() -> None:
    """A value that has just grown old lets an eventless transition be taken before the event is."""
    late = {"target": "LATE", "guard": lambda env: not env["known"]("x")}
    states = {"A": {"always": late, "on": {"go": "B"}}, "B": {"on": {"go": "A"}}, "LATE": {}}
    bench = Bench(chart(states, inputs={"x": {"freshness": 5.0}}))
    assert bench.leaves == ["LATE"]
    bench = Bench(chart(states, inputs={"x": {"initial": 1, "freshness": 5.0}}))
    for _ in range(4):
        bench.send("go")
    bench.now = 5.0
    bench.send("go")
    assert bench.leaves == ["LATE"]


def test_constants_are_values() -> None:
    """A variable may be set to what is written out."""
    bench = Bench(chart({"A": {"on": {"go": {"do": ("set", {"n": 5})}}}}, context={"n": 0}))
    bench.send("go")
    assert learned(bench, "go")
    bench.context["n"] = 0
    bench.send("go")
    assert bench.context["n"] == 5
