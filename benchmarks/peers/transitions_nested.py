"""Stock `transitions`, the HierarchicalMachine: queued, with send_event, without automatic transitions.

Every transition is declared at the machine with full names: declared inside a parallel state it would be
taken once for each active region.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib.metadata import version
from typing import Any

from bench import Bench, Reached, Unsupported, is_load, loading, reached, tree
from transitions.extensions.nesting import HierarchicalMachine, NestedState
from transitions_flat import Model, joining, sending, transitions

VERSION = f"transitions {version('transitions')}"

_OPTIONS: dict[str, Any] = {"auto_transitions": False, "queued": True, "send_event": True}


class _Dotted(NestedState):
    separator = "."


class _Machine(HierarchicalMachine):
    state_cls = _Dotted


def make(chart: str) -> Bench:
    """Return a chart, running."""
    if is_load(chart):
        return _load(chart)
    model = Model()
    _machine(model, chart)
    return Bench(sending(model), lambda: _reached(model, model.count if chart == "guarded" else None))


def further(chart: str) -> Callable[[], object]:
    """Return what makes one more model of the same machine."""
    return joining(_machine(None, chart))


def _machine(model: Any, chart: str) -> HierarchicalMachine:
    if chart == "timed":
        raise Unsupported("no clock")
    states, rules = _parallel() if chart == "parallel" else _cycle(chart)
    return _Machine(model, states=states, transitions=rules, initial=states[0]["name"], **_OPTIONS)


def _cycle(chart: str) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    work = {"name": "work", "initial": "a", "children": ["a", "b", "c"]}
    return [work], transitions(chart, "work.")


def _parallel() -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    regions, rules = [], []
    for side in ("left", "right"):
        one, other = f"{side[0]}1", f"{side[0]}2"
        regions.append({"name": side, "initial": one, "children": [one, other]})
        for source, dest in ((one, other), (other, one)):
            path = f"both.{side}."
            rules.append({"trigger": "go", "source": path + source, "dest": path + dest})
    return [{"name": "both", "parallel": regions}], rules


def _reached(model: Model, count: int | None = None) -> Reached:
    return reached([model.state] if isinstance(model.state, str) else model.state, count)


# -- loading ---------------------------------------------------------------------------------------------


class _Loaded(Model):
    def patient(self, event: object) -> bool:
        return self.count >= 3


def _load(chart: str) -> Bench:
    described = tree(chart)
    paths = dict(_paths(described, ""))
    states = [_state(state) for state in described]
    rules = [rule for state in described for rule in _rules(state, paths)]

    def load() -> _Loaded:
        model = _Loaded()
        _Machine(model, states=states, transitions=rules, initial=described[0]["name"], **_OPTIONS)
        return model

    def look(model: _Loaded) -> Reached:
        model.go()
        return _reached(model, len(paths))

    return loading(load, look)


def _paths(states: list[dict[str, Any]], prefix: str) -> list[tuple[str, str]]:
    found = []
    for state in states:
        path = prefix + state["name"]
        found += [(state["name"], path), *_paths(state["states"], f"{path}.")]
    return found


def _state(state: dict[str, Any]) -> dict[str, Any]:
    found: dict[str, Any] = {"name": state["name"]}
    if state["states"]:
        found["children"] = [_state(child) for child in state["states"]]
        found["initial"] = state["states"][0]["name"]
    if state["counts"]:
        found["on_enter"] = "add"
    return found


def _rules(state: dict[str, Any], paths: dict[str, str]) -> list[dict[str, Any]]:
    found = []
    for rule in state["on"]:
        made = {"trigger": rule["event"], "source": paths[state["name"]], "dest": paths[rule["target"]]}
        if rule["guarded"]:
            made["conditions"] = "patient"
        if rule["counts"]:
            made["before"] = "add"
        found.append(made)
    for child in state["states"]:
        found += _rules(child, paths)
    return found
