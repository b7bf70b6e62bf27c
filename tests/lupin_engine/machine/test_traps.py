"""Where the state-machine library and SCXML differ: what the stock machine does, and that we follow SCXML.

Each test shows both. If a new version of the library changes its answer, the test says so.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from transitions import MachineError
from transitions.extensions.nesting import HierarchicalMachine

from lupin_engine.errors import ChartError
from lupin_engine.missions.folders import default_missions_folder
from lupin_engine.missions.load import load_chart
from tests import shipped
from tests.lupin_engine.machine.charts import Bench, chart, fails
from tests.lupin_engine.machine.stock import StockModel, stock_model


def stock(model: StockModel, states: list[Any], transitions: list[Any], **more: Any) -> HierarchicalMachine:
    """Return a stock machine as its documentation builds one."""
    return HierarchicalMachine(
        model=model, states=states, transitions=transitions, auto_transitions=False, queued=True, **more
    )


def both(states: dict[str, Any], *events: str) -> tuple[Any, list[str]]:
    """Send `events` to the stock machine of our layout and to ours; return both states at the end."""
    given = chart(states)
    model, bench = stock_model(given), Bench(given)
    for event in events:
        live = {"in_state": lambda names: any(_active(model.state, f"chart.{name}") for name in names)}
        model.trigger(event, environment=live)  # type: ignore[attr-defined]
        bench.send(event)
    return model.state, bench.leaves


def _active(state: Any, name: str) -> bool:
    if isinstance(state, list):
        return any(_active(inner, name) for inner in state)
    return bool(state == name or str(state).startswith(f"{name}."))


def region(name: str, **on: Any) -> dict[str, Any]:
    """Return a region with the states x1, x2 and x3 for region x."""
    return {"states": {f"{name}1": {"on": on}, f"{name}2": {}, f"{name}3": {}}}


# 1 -------------------------------------------------------------------------------------------------------


def test_1_a_transition_of_a_parallel_state_is_taken_once() -> None:
    """Stock: declared inside the parallel state, one event moves a region once per active region."""
    moves = [["go", "a_1", "a_2"], ["go", "a_2", "a_3"]]
    regions = [
        {"name": "a", "children": ["1", "2", "3"], "initial": "1"},
        {"name": "b", "children": ["1", "2"], "initial": "1"},
    ]
    model = StockModel()
    machine = stock(model, [{"name": "P", "parallel": regions, "transitions": moves}], [], initial="P")
    model.go()  # type: ignore[attr-defined]
    assert model.state == ["P_a_3", "P_b_1"]
    assert machine is not None

    inner = {"a": {"states": {"1": {}, "2": {}, "3": {}}}, "b": {"states": {"1": {}, "2": {}}}}
    inner["a"]["states"] = {"1": {"on": {"go": "2"}}, "2": {"on": {"go": "3"}}, "3": {}}
    bench = Bench(chart({"P": {"kind": "parallel", "states": inner}}))
    bench.send("go")
    assert bench.leaves == ["P.a.2", "P.b.1"]


# 2 -------------------------------------------------------------------------------------------------------


def test_2_a_transition_of_the_root_is_taken_once() -> None:
    """Stock: with several active root states, one event moves the first once per root state."""
    model = StockModel()
    states = [{"name": "a", "children": ["1", "2", "3"], "initial": "1"}, "b"]
    stock(model, states, [["go", "a_1", "a_2"], ["go", "a_2", "a_3"]], initial=["a_1", "b"])
    model.go()  # type: ignore[attr-defined]
    assert model.state == ["a_3", "b"]

    inner = {"1": {"on": {"go": "2"}}, "2": {"on": {"go": "3"}}, "3": {}}
    bench = Bench(chart({"P": {"kind": "parallel", "states": {"a": {"states": inner}, "b": {}}}}))
    bench.send("go")
    assert bench.leaves == ["P.a.2", "P.b"]


# 3 -------------------------------------------------------------------------------------------------------


def test_3_who_leaves_the_parallel_state_leaves_it_whole() -> None:
    """Stock: one region leaves, another stays and moves on, and the first is gone."""
    regions = {"A": region("a", go="X"), "B": region("b", go="b2")}
    state, leaves = both({"P": {"kind": "parallel", "states": regions}, "X": {}}, "go")
    assert state == "chart.P.B.b2"
    assert leaves == ["X"]


# 4 -------------------------------------------------------------------------------------------------------


def test_4_every_child_of_a_parallel_state_is_active() -> None:
    """Stock: a child that is not among the initial ones can be entered beside its siblings."""
    model = StockModel()
    idle = {"name": "c", "on_exit": model.note("exit c")}
    states = [{"name": "P", "children": ["a", "b", idle], "initial": ["a", "b"]}]
    stock(model, states, [["go", "P_a", "P_c"]], initial="P")
    model.go()  # type: ignore[attr-defined]
    assert model.state == ["P_a", "P_b", "P_c"]
    assert model.heard == ["exit c"]

    bench = Bench(chart({"P": {"kind": "parallel", "states": {"a": {}, "b": {}, "c": {}}}}))
    assert bench.leaves == ["P.a", "P.b", "P.c"]


# 5 -------------------------------------------------------------------------------------------------------


def test_5_the_inner_state_answers_first() -> None:
    """Stock: what a parent declares inside its scope beats what its child has outside."""
    model = StockModel()
    parent = {"name": "P", "children": ["a", "b", "c"], "initial": "a", "transitions": [["go", "a", "b"]]}
    inside = {"name": "O", "children": [parent, "z"], "initial": "P", "transitions": [["go", "P", "z"]]}
    stock(model, [inside], [["go", "O_P_a", "O_P_c"]], initial="O")
    model.go()  # type: ignore[attr-defined]
    assert model.state == "O_P_b"

    inner = {"a": {"on": {"go": "c"}}, "b": {}, "c": {}}
    bench = Bench(chart({"O": {"states": {"P": {"states": inner, "on": {"go": "z"}}, "z": {}}}}))
    bench.send("go")
    assert bench.leaves == ["O.P.c"]


# 6 -------------------------------------------------------------------------------------------------------


def test_6_guards_see_the_state_before_the_step() -> None:
    """Stock: a region's guard sees what an earlier region has just done."""
    still = {"target": "b2", "guard": lambda env: env["in_state"](("P.A.a1",))}
    regions = {"A": region("a", go="a2"), "B": region("b", go=still)}
    state, leaves = both({"P": {"kind": "parallel", "states": regions}}, "go")
    assert state == ["chart.P.A.a2", "chart.P.B.b1"]
    assert leaves == ["P.A.a2", "P.B.b2"]


# 7 -------------------------------------------------------------------------------------------------------


def test_7_a_region_that_goes_to_another_leaves_and_enters_all() -> None:
    """Stock: the source region stays as it is; SCXML leaves the parallel state and enters it anew."""
    regions = {
        "A": {"states": {"a1": {"on": {"move": "a2"}}, "a2": {"on": {"go": "B.b2"}}}},
        "B": region("b"),
    }
    state, leaves = both({"P": {"kind": "parallel", "states": regions}}, "move", "go")
    assert state == ["chart.P.A.a2", "chart.P.B.b2"]
    assert leaves == ["P.A.a1", "P.B.b2"]


# 8 -------------------------------------------------------------------------------------------------------


def test_8_a_parallel_state_ends_with_its_last_region() -> None:
    """Stock (issue 715): the machine is told to be final although a region is not."""
    model = StockModel()
    regions = [
        {"name": "a", "children": ["1", {"name": "f", "final": True}], "initial": "1"},
        {"name": "b", "children": ["1", {"name": "f", "final": True}], "initial": "1"},
    ]
    stock(
        model,
        [{"name": "P", "parallel": regions}],
        [["go", "P_b_1", "P_b_f"]],
        initial="P",
        on_final=model.note("final"),
    )
    model.go()  # type: ignore[attr-defined]
    assert model.state == ["P_a_1", "P_b_f"]
    assert model.heard == ["final"]

    ending = {"states": {"1": {"on": {"go": "f"}}, "f": {"kind": "final"}}}
    staying = {"states": {"1": {}, "f": {"kind": "final"}}}
    given = {"P": {"kind": "parallel", "states": {"a": staying, "b": ending}, "on_done": "Z"}, "Z": {}}
    bench = Bench(chart(given))
    bench.send("go")
    assert bench.leaves == ["P.a.1", "P.b.f"]


# 9 -------------------------------------------------------------------------------------------------------


def test_9_the_first_state_is_entered() -> None:
    """Stock: the entry action of the initial state never runs."""
    model = StockModel()
    stock(model, [{"name": "A", "on_enter": model.note("enter A")}], [], initial="A")
    assert model.heard == []

    bench = Bench(chart({"A": {"entry": "enter.A"}}))
    assert bench.commands == ["act enter.A"]


# 10 ------------------------------------------------------------------------------------------------------


def test_10_an_error_keeps_the_queue() -> None:
    """Stock: the new state stays, and what was queued is lost with the exception."""
    model = StockModel()
    model.boom = _boom  # type: ignore[attr-defined]
    rule = {"trigger": "go", "source": "A", "dest": "B", "before": lambda: model.next()}  # type: ignore[attr-defined]
    stock(model, ["A", {"name": "B", "on_enter": "boom"}, "C"], [rule, ["next", "B", "C"]], initial="A")
    with pytest.raises(ValueError, match="boom"):
        model.go()  # type: ignore[attr-defined]
    assert model.state == "B"

    moves = {"target": "B", "do": ("raise", {"event": "next"})}
    states = {"A": {"on": {"go": moves}}, "B": {"entry": ("act", {"x": fails}), "on": {"next": "C"}}, "C": {}}
    bench = Bench(chart(states))
    step = bench.send("go")
    assert bench.leaves == ["C"]
    assert step.notes[0] == "test.yaml:1:1: act: division by zero"


def _boom() -> None:
    raise ValueError("boom")


# 11 ------------------------------------------------------------------------------------------------------


def test_11_what_does_not_exist_is_told_before_anything_runs(tmp_path: Path) -> None:
    """Stock: unknown states and callbacks are accepted; the callback fails when the state has changed."""
    model = StockModel()
    missing = {"trigger": "call", "source": "A", "dest": "B", "after": "absent"}
    stock(model, ["A", "B"], [["go", "A", "NOWHERE"], ["back", "GHOST", "A"], missing], initial="A")
    with pytest.raises(ValueError, match="NOWHERE"):
        model.go()  # type: ignore[attr-defined]
    with pytest.raises(AttributeError, match="absent"):
        model.call()  # type: ignore[attr-defined]
    assert model.state == "B"

    file = tmp_path / "trap.yaml"
    file.write_text(
        "mission: Trap\nsummary: A trap.\nstates:\n  A:\n    entry: [arm.absent]\n    always: NOWHERE\n",
        encoding="utf-8",
    )
    lifecycle = default_missions_folder() / "lifecycle.yaml"
    with pytest.raises(ChartError) as told:
        load_chart(lifecycle, [file], shipped.catalog())
    found = {(one.rule, one.place.line) for one in told.value.diagnostics}
    assert {("unknown-action", 5), ("unknown-state", 6)} <= found


# 12 ------------------------------------------------------------------------------------------------------


def test_12_exits_then_actions_then_entries() -> None:
    """Stock: what a transition does `before` precedes the exits, what it does `after` the entries."""
    model = StockModel()
    states = [
        {"name": "A", "on_exit": model.note("exit A")},
        {"name": "B", "on_enter": model.note("enter B")},
    ]
    rule = {
        "trigger": "go",
        "source": "A",
        "dest": "B",
        "before": model.note("before"),
        "after": model.note("after"),
    }
    stock(model, states, [rule], initial="A")
    model.go()  # type: ignore[attr-defined]
    assert model.heard == ["before", "exit A", "enter B", "after"]

    bench = Bench(
        chart(
            {"A": {"exit": "exit.A", "on": {"go": {"target": "B", "do": "act"}}}, "B": {"entry": "enter.B"}}
        )
    )
    bench.send("go")
    assert bench.commands == ["act exit.A", "act act", "act enter.B"]


# 13 ------------------------------------------------------------------------------------------------------


def test_13_all_regions_are_entered() -> None:
    """Stock: a transition into one region enters no other."""
    regions = {"A": region("a"), "B": region("b")}
    state, leaves = both({"X": {"on": {"go": "P.A.a2"}}, "P": {"kind": "parallel", "states": regions}}, "go")
    assert state == "chart.P.A.a2"
    assert leaves == ["P.A.a2", "P.B.b1"]


# 14 ------------------------------------------------------------------------------------------------------


def test_14_who_leaves_is_decided_by_the_source_too() -> None:
    """Stock: a transition of an outer state leaves only what is inside of its target's active ancestors."""
    inner: dict[str, Any] = {"C": {"states": {"c1": {}, "c2": {}}}}
    given = chart({"O": {"states": inner, "on": {"go": "O.C.c2"}}})
    model, bench = stock_model(given), Bench(given)
    model.trigger("go", environment={})  # type: ignore[attr-defined]
    step = bench.send("go")
    assert (model.left, model.entered) == (["O.C.c1"], ["O.C.c2"])
    assert (step.exited, step.entered) == (("O.C.c1", "O.C", "O"), ("O", "O.C", "O.C.c2"))


# 15 ------------------------------------------------------------------------------------------------------


def test_15_a_region_moves_beside_one_that_has_ended() -> None:
    """Stock (issue 715 again): it looks for the entry of the machine itself, after the state has changed."""
    model = StockModel()
    regions = [
        {"name": "a", "children": ["1", "2"], "initial": "1"},
        {"name": "b", "children": ["1", {"name": "f", "final": True}], "initial": "1"},
    ]
    moves = [["end", "P_b_1", "P_b_f"], ["go", "P_a_1", "P_a_2"]]
    stock(model, [{"name": "P", "parallel": regions}], moves, initial="P")
    model.end()  # type: ignore[attr-defined]
    with pytest.raises(AttributeError, match="scoped_enter"):
        model.go()  # type: ignore[attr-defined]
    assert model.state == ["P_a_2", "P_b_f"]

    moving = {"states": {"1": {"on": {"go": "2"}}, "2": {}}}
    ending = {"states": {"1": {"on": {"end": "f"}}, "f": {"kind": "final"}}}
    bench = Bench(chart({"P": {"kind": "parallel", "states": {"a": moving, "b": ending}}}))
    bench.send("end")
    bench.send("go")
    assert bench.leaves == ["P.a.2", "P.b.f"]


# our layout ----------------------------------------------------------------------------------------------


def test_names_with_underscores_are_no_hierarchy() -> None:
    """The library's default separator would make three levels of NAV_TO_TAG; ours is a dot."""
    state, leaves = both({"NAV_TO_TAG": {"on": {"go": "AT_TAG"}}, "AT_TAG": {}}, "go")
    assert (state, leaves) == ("chart.AT_TAG", ["AT_TAG"])


def test_the_stock_machine_refuses_what_it_does_not_know() -> None:
    """Stock: a known event without a transition is an exception; ours is a step without effect."""
    given = chart({"A": {"on": {"go": "B"}}, "B": {}})
    model = stock_model(given)
    model.trigger("go", environment={})  # type: ignore[attr-defined]
    with pytest.raises(MachineError):
        model.trigger("go", environment={})  # type: ignore[attr-defined]
    bench = Bench(given)
    bench.send("go")
    assert not bench.send("go").changed
