"""Inputs: what is known of the world, for how long, and what a report must be to count."""

from __future__ import annotations

import math
from typing import Any

import pytest

from lupin_engine.chart.expressions.condition import Condition
from lupin_engine.chart.expressions.evaluation import Compiled
from lupin_engine.machine.step import Step
from lupin_engine.plugin.types import BOOL, COUNT, NUMBER, POSE, TEXT, list_of
from tests.lupin_engine.machine.charts import PLACE, Bench, chart, expression, fails

SLOT = {"slot": True, "states": {"M": {"mission": "M"}}, "on": {"operator.abort": "READY"}}
MISSION = {"READY": {"on": {"mission.start": "SLOT"}}, "SLOT": SLOT}


def unless_known(**spec: Any) -> Bench:
    """Return a bench that waits in A for input x, and goes to LOST as soon as that is not known."""
    lost = {"target": "LOST", "guard": lambda env: not env["known"]("x")}
    states = {"A": {"on": {"input.x": "B"}}, "B": {"always": lost}, "LOST": {}}
    return Bench(chart(states, inputs={"x": spec}))


def test_a_value_that_grows_old_makes_a_step_at_that_time() -> None:
    """What asks whether it is known is asked again just then."""
    bench = unless_known(freshness=5.0)
    bench.wait(1.0)
    bench.observe("x", True)
    assert bench.leaves == ["B"]
    assert bench.wait(4.9) == []
    (step,) = bench.wait(0.2)
    assert (step.time, step.notes, bench.leaves) == (
        6.0,
        ("input.x is unknown: last reported 5 s ago",),
        ["LOST"],
    )


def test_a_guard_that_is_watched_is_looked_at_when_its_input_grows_old() -> None:
    """Nothing that it reads has changed until then."""
    lost = {"target": "LOST", "guard": Condition("...", PLACE, BOOL, Compiled("not env['known']('x')"))}
    bench = Bench(chart({"A": {"always": lost}, "LOST": {}}, inputs={"x": {"initial": 1, "freshness": 5.0}}))
    bench.wait(4.9)
    assert bench.leaves == ["A"]
    bench.wait(0.1)
    assert bench.leaves == ["LOST"]


def test_growing_old_does_not_depend_on_how_numbers_are_rounded() -> None:
    """When its time has come the value is unknown, whatever sums and differences of such times are."""
    for stamp in (0.1, 0.7, 1e6 + 0.3, 1e9 + 0.1):
        bench = unless_known(freshness=0.3)
        bench.observe("x", True, stamp)
        bench.now = stamp
        bench.wait(0.31)
        assert (bench.leaves, bench.machine.next_deadline) == (["LOST"], None)


def test_a_newer_report_postpones_it() -> None:
    """The time counts from the last one."""
    bench = unless_known(freshness=5.0)
    bench.observe("x", True)
    bench.wait(3.0)
    bench.observe("x", True)
    (look, step) = bench.wait(5.0)
    assert (look.time, look.notes, step.time) == (5.0, (), 8.0)
    assert bench.leaves == ["LOST"]


def test_the_stamp_counts_and_not_the_arrival() -> None:
    """A report that took long is old sooner; one that is too old when it comes is unknown at once."""
    bench = unless_known(freshness=5.0)
    bench.now = 10.0
    bench.observe("x", True, 7.0)
    assert bench.machine.next_deadline == 12.0
    late = unless_known(freshness=5.0)
    late.now = 10.0
    late.observe("x", True, 4.0)
    assert (late.leaves, late.machine.input_value("x", 10.0)) == (["A"], None)


def test_a_report_that_is_too_old_reaches_no_level() -> None:
    """The hysteresis would hold a level that nothing has reached while the value was known."""
    levels = {"low": (0.2, 0.05)}
    bench = Bench(chart({"A": {}}, inputs={"charge": {"freshness": 6.0, "levels": levels}}))
    bench.now = 10.0
    step = bench.observe("charge", 0.1, 3.0)
    assert step.notes == ("dropped: a report of input.charge that is 7 s old, so too old already",)
    bench.observe("charge", 0.22, 10.0)
    assert bench.machine.memory.levels == {"input.charge.low": False}


def test_an_older_report_is_dropped() -> None:
    """The order of arrival is not the order of what happened."""
    bench = unless_known()
    bench.now = 9.0
    bench.observe("x", False, 8.0)
    step = bench.observe("x", True, 7.0)
    assert step.notes == ("dropped: a report of input.x that is older than the last",)
    assert bench.machine.input_value("x", 9.0) is False


def test_what_the_chart_starts_with_is_overwritten_by_an_older_report() -> None:
    """A latched topic tells what was true before we started; it grows old from its own time on."""
    bench = Bench(chart({"A": {}}, inputs={"x": {"initial": 1, "freshness": 10.0}}))
    assert bench.machine.next_deadline == 10.0
    bench.observe("x", 2, -4.0)
    assert (bench.machine.input_value("x", 0.0), bench.machine.next_deadline) == (2, 6.0)
    (step,) = bench.wait(6.0)
    assert step.notes == ("input.x is unknown: last reported 10 s ago",)


def test_one_report_is_for_every_input_of_that_value() -> None:
    """Two inputs may look at one value, each in its own way; others are none of its business."""
    inputs: dict[str, Any] = {"a": {"value": "v", "maximum": 1}, "b": {"value": "v"}, "c": {}}
    bench = Bench(chart({"A": {}}, inputs=inputs))
    step = bench.observe("v", 2)
    assert step.notes == ("dropped: input.a is out of range: 2",)
    assert [bench.machine.input_value(name, 0.0) for name in "abc"] == [None, 2, None]


@pytest.mark.parametrize(
    ("spec", "given", "problem"),
    [
        ({"minimum": 0}, -0.1, "out of range"),
        ({"maximum": 1}, 1.1, "out of range"),
        ({"minimum": 0, "maximum": 1}, math.nan, "no number"),
        ({"minimum": 0}, "full", "no number"),
        ({"minimum": 0}, True, "no number"),
        ({"levels": {"low": (0.2, None)}}, math.nan, "no number"),
        ({"levels": {"low": (0.2, None)}}, [0.1], "no number"),
        ({"type": NUMBER}, "0.5", "no number"),
        ({"type": NUMBER}, math.nan, "no number"),
        ({"type": COUNT}, 1.5, "no count"),
        ({"type": COUNT}, True, "no count"),
        ({"type": BOOL}, 1, "no bool"),
        ({"type": TEXT}, 1, "no text"),
        ({"type": POSE}, [1, 2], "no pose"),
        ({"type": list_of(TEXT)}, "abc", "no list of text"),
        ({"type": list_of(TEXT)}, ["a", 1], "no list of text ([1]: expected text, got 1)"),
        ({"type": POSE}, {"x": 1.0, "y": 2.0}, "no pose (yaw of pose left out)"),
        (
            {"type": list_of(POSE)},
            [{"x": 1.0, "y": math.nan, "yaw": 0.0}],
            "no list of pose ([0].y: expected length, got nan)",
        ),
    ],
)
def test_what_cannot_be_the_value_is_dropped(spec: dict[str, Any], given: Any, problem: str) -> None:
    """Out of its range or of another type; what was known stays."""
    bench = Bench(chart({"A": {}}, inputs={"x": spec}))
    step = bench.observe("x", given)
    assert step.notes == (f"dropped: input.x is {problem}: {given!r}",)
    assert (bench.machine.memory.inputs, bench.machine.memory.levels) == ({}, {})


@pytest.mark.parametrize(
    ("spec", "given"),
    [
        ({"minimum": 0, "maximum": 1}, 1),
        ({"minimum": 0}, math.inf),
        ({"type": NUMBER}, 3),
        ({"type": COUNT}, 3),
        ({"type": BOOL}, False),
        ({"type": TEXT}, ""),
        ({"type": POSE}, {"x": 1.0, "y": 2.0, "yaw": 0.0}),
        ({"type": list_of(TEXT)}, ["a"]),
        ({}, None),
        ({}, True),
    ],
)
def test_what_can_be_the_value_is_taken(spec: dict[str, Any], given: Any) -> None:
    """Bounds belong to the range."""
    bench = Bench(chart({"A": {}}, inputs={"x": spec}))
    assert bench.observe("x", given).notes == ()
    assert bench.machine.memory.inputs["x"].value == given


# -- inputs of a mission ----------------------------------------------------------------------------------


def of_mission(**spec: Any) -> Bench:
    """Return a bench that waits for a mission, with an input that is about it."""
    inputs = {"x": {"of_mission": True, **spec}}
    return Bench(chart(MISSION, inputs=inputs, missions={"M": {"state": "SLOT.M"}}))


def start(bench: Bench) -> Step:
    """Begin the mission."""
    return bench.send("mission.start", mission_type="M")


def test_what_was_reported_before_the_mission_does_not_count() -> None:
    """Neither before there was one, nor with a stamp from before it."""
    bench = of_mission()
    bench.now = 5.0
    dropped = "dropped: a report of input.x from before the mission"
    assert bench.observe("x", 1).notes == (dropped,)
    assert start(bench).accepted
    assert bench.observe("x", 2, 4.9).notes == (dropped,)
    assert bench.machine.input_value("x", 5.0) is None
    assert bench.observe("x", 3, 5.0).notes == ()
    assert bench.machine.input_value("x", 5.0) == 3


def test_of_a_list_what_is_told_again_after_the_mission_began_does_not_count() -> None:
    """A registry that forgets nothing repeats old finds; what is new, or has changed, is of the mission."""
    bench = of_mission(type=list_of(TEXT), initial=[])
    bench.observe("x", ["1 seen 9 times"])  # before there was a mission
    start(bench)
    bench.observe("x", ["1 seen 9 times", "2 seen 5 times"])
    assert bench.machine.input_value("x", 0.0) == ["2 seen 5 times"]
    bench.send("operator.abort")
    bench.now = 5.0
    start(bench)  # the next mission
    assert bench.machine.input_value("x", 5.0) == []
    bench.observe("x", ["1 seen 9 times", "2 seen 5 times"])
    assert bench.machine.input_value("x", 5.0) == []
    bench.observe("x", ["1 seen 9 times", "2 seen 6 times", "3 seen once"])
    assert bench.machine.input_value("x", 5.0) == ["2 seen 6 times", "3 seen once"]


def test_of_a_list_what_was_found_anew_counts_however_much_it_is_like_the_old_find() -> None:
    """A registry that began anew with the mission finds the same tag at the same place."""
    bench = of_mission(type=list_of(TEXT), initial=[])
    bench.observe("x", ["1 seen 3 times", "2 seen 3 times"])
    start(bench)
    bench.observe("x", ["1 seen twice"])
    bench.observe("x", ["1 seen 3 times", "2 seen 3 times"])
    assert bench.machine.input_value("x", 0.0) == ["1 seen 3 times", "2 seen 3 times"]


def test_of_a_list_a_late_report_from_before_the_mission_tells_what_was_there_before() -> None:
    """The sample of a latched topic may arrive after the start; the next one only repeats it."""
    bench = of_mission(type=list_of(TEXT), initial=[])
    bench.now = 5.0
    start(bench)
    bench.observe("x", ["a"], 4.0)
    bench.observe("x", ["a", "b"], 5.5)
    assert bench.machine.input_value("x", 5.5) == ["b"]


def test_what_was_there_before_the_mission_survives_a_crash() -> None:
    """It stands in the snapshot; what is no list has nothing of the kind."""
    bench = of_mission(type=list_of(TEXT), initial=[])
    bench.observe("x", ["a"])
    start(bench)
    bench.observe("x", ["a", "b"])
    bench.restart()
    bench.observe("x", ["a", "b", "c"])
    assert bench.machine.input_value("x", 0.0) == ["b", "c"]
    single = of_mission()
    start(single)
    single.observe("x", 1)
    assert (single.machine.memory.heard, single.machine.memory.before) == ({}, {})


def test_a_new_mission_forgets_what_the_last_one_saw() -> None:
    """Its levels, its age, and the value itself; what the chart starts with holds again."""
    spec = {"levels": {"low": (0.2, 0.1)}, "initial": 0.9, "freshness": 50.0}
    bench = of_mission(**spec)
    bench.machine.memory.started_at = 0.0
    bench.observe("x", 0.1)
    bench.now = 7.0
    start(bench)
    memory = bench.machine.memory
    assert (memory.inputs["x"].value, memory.levels, bench.machine.next_deadline) == (
        0.9,
        {"input.x.low": False},
        57.0,
    )
    bench.observe("x", 0.25)
    assert memory.levels == {"input.x.low": False}


def test_without_a_first_value_it_is_unknown_in_the_new_mission() -> None:
    """Until something is reported."""
    bench = of_mission(freshness=5.0)
    bench.machine.memory.started_at = 0.0
    bench.observe("x", 1)
    start(bench)
    assert (bench.machine.memory.inputs, bench.machine.next_deadline) == ({}, None)


# -- levels -----------------------------------------------------------------------------------------------


def test_a_level_above_has_hysteresis_downwards() -> None:
    """Too hot until it is clearly cooler."""
    levels = {"hot": {"above": 40.0, "hysteresis": 5.0}}
    bench = Bench(chart({"A": {}}, inputs={"heat": {"levels": levels}}))
    found = []
    for value in (20.0, 40.0, 40.1, 38.0, 35.1, 35.0, 38.0):
        bench.observe("heat", value)
        found.append(bench.machine.memory.levels["input.heat.hot"])
    assert found == [False, False, True, True, True, False, False]


def test_bounds_may_be_computed() -> None:
    """From parameters, for example; one that fails is an error with its place."""
    bound = expression(lambda env: env["param"]["limit"])
    bench = Bench(chart({"A": {}}, inputs={"heat": {"levels": {"hot": {"above": bound}}}}), limit=9)
    bench.observe("heat", 9.5)
    assert bench.machine.memory.levels["input.heat.hot"] is True
    broken = Bench(chart({"A": {}, "FAULT": {}}, inputs={"heat": {"levels": {"hot": {"above": fails}}}}))
    broken.observe("heat", 9.5)
    assert broken.machine.view.detail == "test.yaml:1:1: level hot: division by zero"
    assert broken.leaves == ["FAULT"]


def test_a_value_with_levels_shows_both() -> None:
    """`input.x.value` and `input.x.LEVEL`; all inputs together are a mapping."""
    bench = Bench(chart({"A": {}}, inputs={"x": {"initial": 1, "levels": {"low": (2, None)}}, "y": {}}))
    assert bench.machine.input_value("x", 0.0) == {"value": 1, "low": True}
    assert (list(bench.machine.scope.inputs), len(bench.machine.scope.inputs)) == (["x", "y"], 2)


def test_a_transition_on_a_level_that_is_unknown_waits() -> None:
    """Nothing is assumed; a level that was true when its input grew old does not hold any more."""
    states = {"A": {"on": {"go": "B"}}, "B": {"on": {"input.x.low": "C"}}, "C": {}}
    bench = Bench(chart(states, inputs={"x": {"freshness": 5.0, "levels": {"low": (0.2, None)}}}))
    bench.observe("x", 0.1)
    bench.wait(6.0)
    bench.send("go")
    assert (bench.leaves, bench.machine.memory.levels) == (["B"], {"input.x.low": True})
    bench.observe("x", 0.1)
    assert bench.leaves == ["C"]
