"""Random charts without parallel states: the stock machine and ours end every event in the same state."""

from __future__ import annotations

import contextlib
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st
from transitions import MachineError

from lupin_engine.chart.model import Chart
from lupin_engine.machine.structure import build_machine
from tests.machine.charts import Bench, chart

EVENTS = ("e0", "e1", "e2")
GUARDS = ("g0", "g1")


class Model:
    """What the stock machine moves."""

    state: Any = None


@st.composite
def trees(draw: st.DrawFn, depth: int = 3) -> dict[str, Any]:
    """Return states: one to three, each perhaps with states of its own."""
    names = ["A", "B", "C"][: draw(st.integers(1, 3))]
    return {
        name: {"states": draw(trees(depth=depth - 1))} if depth > 1 and draw(st.booleans()) else {}
        for name in names
    }


def paths(tree: dict[str, Any], prefix: str = "") -> list[str]:
    """Return the full names of all states of a tree."""
    found = []
    for name, inner in tree.items():
        found += [f"{prefix}{name}", *paths(inner.get("states", {}), f"{prefix}{name}.")]
    return found


def at(tree: dict[str, Any], path: str) -> dict[str, Any]:
    """Return the description of a state."""
    found: dict[str, Any] = {"states": tree}
    for name in path.split("."):
        found = found["states"][name]
    return found


@st.composite
def charts(draw: st.DrawFn) -> Chart:
    """Return a chart with random transitions, some guarded, some without a target, some re-entering."""
    tree = draw(trees())
    names = paths(tree)
    for _ in range(draw(st.integers(1, 12))):
        source, target = draw(st.sampled_from(names)), draw(st.none() | st.sampled_from(names))
        guard = draw(st.none() | st.sampled_from(GUARDS))
        rule: dict[str, Any] = {"do": "act"}
        if target is not None:
            rule["target"] = target
        if guard is not None:
            rule["guard"] = _asks(guard)
        at(tree, source).setdefault("on", {}).setdefault(draw(st.sampled_from(EVENTS)), []).append(rule)
    return chart(tree)


def _asks(guard: str) -> Any:
    return lambda env: env["event"][guard]


EVENT = st.tuples(st.sampled_from(EVENTS), st.booleans(), st.booleans())


def stock_state(model: Model, event: str, data: dict[str, bool]) -> str:
    """Send an event to the stock machine; what it does not know changes nothing."""
    with contextlib.suppress(MachineError, AttributeError):
        model.trigger(event, environment={"event": data})  # type: ignore[attr-defined]
    return str(model.state).removeprefix("chart.")


@settings(max_examples=300, deadline=None)
@given(charts(), st.lists(EVENT, max_size=12))
def test_the_stock_machine_and_ours_agree(given_chart: Chart, sent: list[tuple[str, bool, bool]]) -> None:
    """Without parallel states, history and eventless transitions the library and SCXML mean the same."""
    model = Model()
    build_machine(given_chart).add_model(model)
    bench = Bench(given_chart)
    assert bench.leaves == [str(model.state).removeprefix("chart.")]
    for event, g0, g1 in sent:
        data = {"g0": g0, "g1": g1}
        bench.send(event, **data)
        assert bench.leaves == [stock_state(model, event, data)]
