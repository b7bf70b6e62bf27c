"""What is compiled for a chart: configurations and microsteps, kept up to a number."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from hypothesis import given

from lupin_engine.chart.model import Chart
from lupin_engine.machine import machine as machines
from lupin_engine.machine import structure
from lupin_engine.machine.event import Event
from tests.lupin_engine.machine.charts import Bench, chart
from tests.lupin_engine.machine.properties.random_charts import HAPPENINGS, Happening, charts, drive


@pytest.fixture(autouse=True, scope="module")
def _short_cycles() -> Iterator[None]:
    """Many random charts never come to rest; that need not take a thousand microsteps each time."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(machines, "MICROSTEP_LIMIT", 40)
        yield


@given(charts(), HAPPENINGS)
def test_what_is_not_kept_is_made_anew(given_chart: Chart, happenings: list[Happening]) -> None:
    """Beyond the number of configurations and microsteps that are kept, steps cost more and are the same."""
    with pytest.MonkeyPatch.context() as patch:
        for name in ("MAX_CONFIGURATIONS", "MAX_MICROSTEPS"):
            patch.setattr(structure, name, 1)
        poor = Bench(given_chart)
        structure.dispatch_table.cache_clear()
        assert poor.machine._table is not Bench(given_chart).machine._table
        for happening in happenings:
            drive(poor, happening)
    structure.dispatch_table.cache_clear()
    rich = Bench(given_chart)
    for happening in happenings:
        drive(rich, happening)
    assert poor.steps == rich.steps
    assert poor.machine.memory == rich.machine.memory


def test_more_configurations_than_are_kept() -> None:
    """They are worked out every time; the steps are the same, and memory is not spent on them."""
    moves = {name: {"on": {"go": after}} for name, after in ("AB", "BC", "CA")}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(structure, "MAX_CONFIGURATIONS", 2)
        bench = Bench(chart(moves))
        entered = [bench.send("go").entered for _ in range(6)]
    assert entered == [("B",), ("C",), ("A",)] * 2
    assert len(bench.machine._table._known) == 2


def test_the_past_is_asked_every_time() -> None:
    """A way through history leads elsewhere the second time: nothing of it is kept."""
    inner = {"A": {"on": {"next": "B"}}, "B": {}, "H": {"kind": "history", "depth": 1}}
    states = {"M": {"states": inner, "on": {"out": "Z"}}, "Z": {"on": {"back": "M.H"}}}
    bench = Bench(chart(states))
    for event in ("out", "back", "next", "out", "back"):
        bench.send(event)
    assert bench.leaves == ["M.B"]


def test_a_timer_whose_guard_is_false_is_told_as_that_timer() -> None:
    """Where nothing is taken, the step is that of the timer all the same."""
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
    """The second region's transition gives way to the first."""
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


def test_a_guard_in_two_regions() -> None:
    """Which transitions are taken together depends on data."""
    guarded = {"target": "y", "guard": lambda env: env["event"]["yes"]}
    region = {"states": {"x": {"on": {"go": guarded}}, "y": {"on": {"go": "x"}}}}
    bench = Bench(chart({"P": {"kind": "parallel", "states": {"R": region, "S": region}}}))
    bench.send("go", yes=False)
    bench.send("go", yes=True)
    assert bench.leaves == ["P.R.y", "P.S.y"]


def test_timers_are_armed_and_forgotten() -> None:
    """What is left forgets its timers, what is entered arms its own."""
    states = {"A": {"after": {2.0: "B"}, "on": {"go": "B"}}, "B": {"after": {3.0: "A"}, "on": {"go": "A"}}}
    bench = Bench(chart(states))
    for _ in range(4):
        bench.now += 1.0
        bench.send("go")
    assert [timer[::2] for timer in bench.machine.memory.timers] == [(6.0, "after")]


def test_a_value_that_cannot_be_written_is_told() -> None:
    """An action that raises writes nothing of its own, and is told with its place."""
    rule = {"target": "A", "do": ("set", {"n": lambda env: env["event"]["number"], "m": 1})}
    bench = Bench(chart({"A": {"on": {"go": rule}}, "FAULT": {}}, context={"n": 0, "m": 0}))
    bench.send("go", number=2)
    step = bench.send("go")
    assert (bench.leaves, bench.context) == (["FAULT"], {"n": 2, "m": 1})
    assert step.notes == ("test.yaml:1:1: set: there is no 'number'",)


def test_a_chart_that_did_not_come_to_rest() -> None:
    """What it has not begun is begun with the next event."""
    echo = ("raise", {"event": "ping"})
    regions: dict[str, Any] = {
        "R": {"states": {"x": {"invoke": "bridge.read"}}},
        "S": {"states": {"s": {"entry": echo, "on": {"ping": {"do": echo}, "go": "t"}}, "t": {}}},
    }
    endless = chart({"P": {"kind": "parallel", "states": regions}})
    for _ in range(2):
        bench = Bench(endless)
        assert bench.started == []
        bench.send("go")
        assert [start.operation for start in bench.started] == ["bridge.read"]


def test_what_needs_no_event_goes_before_the_event() -> None:
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
    bench.context["n"] = 0
    bench.send("go")
    assert bench.context["n"] == 5
