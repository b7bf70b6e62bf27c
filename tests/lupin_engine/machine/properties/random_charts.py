"""Random charts and random happenings, for tests that compare two ways to run the same chart.

The charts hold all that SCXML has a word for: nested and parallel states, history, final states, eventless
transitions, timers, guards on data and on variables, actions that write, raise and act, entries and exits.
"""

from __future__ import annotations

from typing import Any

from hypothesis import strategies as st

from lupin_engine.chart.model import Chart
from lupin_engine.machine.event import Event
from tests.lupin_engine.machine.charts import Bench, chart, expression

EVENTS = ("e0", "e1", "e2", "door.open")
PATTERNS = (*EVENTS, "door.*", "*")
#: Guards by name; the third raises when the event has no such field, as an author's mistake would.
GUARDS = {
    "flag": lambda env: env["event"].get("flag"),
    "even": lambda env: env["context"]["n"] % 2 == 0,
    "field": lambda env: env["event"]["number"] > 1,
    "few": lambda env: env["context"]["n"] < 5,
    "inside": lambda env: env["in_state"](("A", "B", "A.A", "A.B", "B.A")),
}
ACTIONS = (
    "wave",
    ("set", {"n": expression(lambda env: env["context"]["n"] + 1, "n + 1")}),
    ("set", {"m": expression(lambda env: env["event"]["number"], "event.number"), "n": 0}),
    ("raise", {"event": "door.open"}),
    ("raise", {"event": "e2"}),
)

#: What can happen: an event with some fields, or time that passes.
Happening = tuple[str, dict[str, Any]] | float
FIELDS = st.fixed_dictionaries({}, optional={"flag": st.booleans(), "number": st.integers(0, 3)})
HAPPENINGS = st.lists(
    st.tuples(st.sampled_from(EVENTS), FIELDS) | st.sampled_from([0.5, 1.0, 7.0]), max_size=25
)


@st.composite
def trees(draw: st.DrawFn, depth: int = 3) -> dict[str, Any]:
    """Return one to three states, each perhaps with states of its own, some of them regions."""
    names = ["A", "B", "C"][: draw(st.integers(1, 3))]
    return {name: draw(_states(depth - 1)) for name in names}


@st.composite
def _states(draw: st.DrawFn, depth: int) -> dict[str, Any]:
    if depth == 0 or draw(st.booleans()):
        return {}
    inner = draw(trees(depth))
    if draw(st.booleans()):
        return {"kind": "parallel", "states": inner}
    if draw(st.booleans()):
        inner["H"] = {"kind": "history", "depth": draw(st.sampled_from([1, None]))}
    if len(inner) > 1 and draw(st.booleans()):
        inner["f"] = {"kind": "final"}
    return {"states": inner}


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
def rules(draw: st.DrawFn, targets: list[str], guarded: bool = False) -> dict[str, Any]:
    """Return a transition: to a state or none, with a guard or none, with actions or none."""
    rule: dict[str, Any] = {"do": draw(st.lists(st.sampled_from(ACTIONS), max_size=2))}
    target = draw(st.sampled_from(targets) if guarded else st.none() | st.sampled_from(targets))
    if target is not None:
        rule["target"] = target
        rule["internal"] = draw(st.booleans())
    guard = draw(st.sampled_from(sorted(GUARDS)) if guarded else st.none() | st.sampled_from(sorted(GUARDS)))
    if guard is not None:
        rule["guard"] = expression(GUARDS[guard], guard)
    return rule


@st.composite
def remembering_trees(draw: st.DrawFn) -> dict[str, Any]:
    """Return regions with states of their own in a state whose deep history goes back into all of them."""
    regions = {name: {"states": draw(trees(depth=2))} for name in ("A", "B")}
    past = {"kind": "history", "depth": None}
    states = {"P": {"kind": "parallel", "states": regions}, "D": {}, "H": past}
    return {
        "M": {"states": states, "on": {"e0": [{"target": "Z"}]}},
        "Z": {"on": {"e0": [{"target": "M.H"}]}},
    }


@st.composite
def charts(draw: st.DrawFn, of: st.SearchStrategy[dict[str, Any]] | None = None) -> Chart:
    """Return a chart with random transitions of every kind."""
    tree = draw(trees() if of is None else of)
    names = paths(tree)
    sources = [name for name in names if at(tree, name).get("kind") not in ("history", "final")]
    for _ in range(draw(st.integers(1, 14))):
        state = at(tree, draw(st.sampled_from(sources)))
        state.setdefault("on", {}).setdefault(draw(st.sampled_from(PATTERNS)), []).append(draw(rules(names)))
    for _ in range(draw(st.integers(0, 3))):
        state = at(tree, draw(st.sampled_from(sources)))
        what = draw(st.sampled_from(["after", "always", "on_done", "entry", "exit"]))
        if what == "after":
            state.setdefault("after", {}).setdefault(draw(st.sampled_from([1.0, 3.0])), draw(rules(names)))
        elif what in ("entry", "exit"):
            state[what] = [draw(st.sampled_from(ACTIONS[:3]))]
        else:
            state.setdefault(what, []).append(draw(rules(names, guarded=what == "always")))
    more = {"FAULT": {"on": {"e0": names[0]}}} if draw(st.booleans()) else {}
    return chart({**tree, **more}, context={"n": 0, "m": 0})


def drive(bench: Bench, happening: Happening) -> None:
    """Let something happen."""
    if isinstance(happening, float):
        bench.wait(happening)
    else:
        name, fields = happening
        bench.send(Event(name, fields))
