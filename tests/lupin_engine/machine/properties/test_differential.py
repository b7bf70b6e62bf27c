"""Random charts where the stock machine and SCXML mean the same: both end every event in the same state."""

from __future__ import annotations

import contextlib
from typing import Any

from hypothesis import given
from hypothesis import strategies as st
from transitions import MachineError

from lupin_engine.chart.model import Chart
from tests.lupin_engine.machine.charts import Bench, chart
from tests.lupin_engine.machine.properties.random_charts import at, paths
from tests.lupin_engine.machine.stock import stock_model

EVENTS = ("e0", "e1", "e2")
GUARDS = ("g0", "g1")
REGIONS = ("R", "S", "T")


@st.composite
def trees(draw: st.DrawFn, depth: int = 3) -> dict[str, Any]:
    """Return states: one to three, each perhaps with states of its own."""
    names = ["A", "B", "C"][: draw(st.integers(1, 3))]
    return {
        name: {"states": draw(trees(depth=depth - 1))} if depth > 1 and draw(st.booleans()) else {}
        for name in names
    }


def _asks(guard: str) -> Any:
    return lambda env: env["event"][guard]


@st.composite
def rules(draw: st.DrawFn, targets: list[str]) -> dict[str, Any]:
    """Return a transition: perhaps guarded, perhaps without a target, perhaps re-entering."""
    rule: dict[str, Any] = {"do": "act", "target": draw(st.none() | st.sampled_from(targets))}
    guard = draw(st.none() | st.sampled_from(GUARDS))
    return rule if guard is None else {**rule, "guard": _asks(guard)}


@st.composite
def charts(draw: st.DrawFn) -> Chart:
    """Return a chart without parallel states."""
    tree = draw(trees())
    names = paths(tree)
    for _ in range(draw(st.integers(1, 12))):
        event = draw(st.sampled_from(EVENTS))
        at(tree, draw(st.sampled_from(names))).setdefault("on", {}).setdefault(event, []).append(
            draw(rules(names))
        )
    return chart(tree)


@st.composite
def parallel_charts(draw: st.DrawFn) -> Chart:
    """Return a parallel state each of whose regions has events of its own, and one event that leaves it."""
    regions = {name: {"states": draw(trees(depth=2))} for name in REGIONS[: draw(st.integers(2, 3))]}
    tree: dict[str, Any] = {"P": {"kind": "parallel", "states": regions}, "Z": {"on": {"back": "P"}}}
    for name in regions:
        inside = [path for path in paths(tree) if path.startswith(f"P.{name}.")]
        for _ in range(draw(st.integers(1, 4))):
            state = at(tree, draw(st.sampled_from(inside)))
            event = draw(st.sampled_from((f"{name}.e0", f"{name}.e1")))
            state.setdefault("on", {}).setdefault(event, []).append(draw(rules(inside)))
    leaver = draw(st.sampled_from([path for path in paths(tree) if path.startswith("P")]))
    at(tree, leaver).setdefault("on", {})["out"] = "Z"
    return chart(tree)


def events_of(names: tuple[str, ...]) -> st.SearchStrategy[list[tuple[str, bool, bool]]]:
    """Return events by name, each with what the guards will find."""
    return st.lists(st.tuples(st.sampled_from(names), st.booleans(), st.booleans()), max_size=12)


def compare(given_chart: Chart, sent: list[tuple[str, bool, bool]]) -> None:
    """Send the same to both; what the stock machine does not know, it must not be asked."""
    model, bench = stock_model(given_chart), Bench(given_chart)
    assert bench.leaves == model.leaves
    for event, g0, g1 in sent:
        data = {"g0": g0, "g1": g1}
        with contextlib.suppress(MachineError, AttributeError):
            model.trigger(event, environment={"event": data})  # type: ignore[attr-defined]
        bench.send(event, **data)
        assert bench.leaves == model.leaves


@given(charts(), events_of(EVENTS))
def test_the_stock_machine_and_ours_agree(given_chart: Chart, sent: list[tuple[str, bool, bool]]) -> None:
    """Without parallel states, history and eventless transitions the library and SCXML mean the same."""
    compare(given_chart, sent)


@given(
    parallel_charts(),
    events_of((*(f"{name}.{event}" for name in REGIONS for event in EVENTS[:2]), "out", "back")),
)
def test_they_agree_where_one_region_answers(given_chart: Chart, sent: list[tuple[str, bool, bool]]) -> None:
    """In parallel states too, as long as one region answers with a state of its own, or all are left."""
    compare(given_chart, sent)
