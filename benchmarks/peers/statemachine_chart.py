"""python-statemachine: charts as classes, guards and actions as methods; loaded from its own YAML."""

from __future__ import annotations

from collections.abc import Callable
from importlib.metadata import version
from typing import Any

import yaml
from bench import BOUND, FIRST_EVENTS, Bench, Reached, Unsupported, is_load, loading, reached, tree
from statemachine import State, StateChart
from statemachine.io import load

VERSION = f"python-statemachine {version('python-statemachine')}"

_ADD = {"assign": {"location": "count", "expr": "count + 1"}}


class Cycle(StateChart):  # type: ignore[misc]
    """Three states in turn, inside a compound state."""

    class work(State.Compound):  # type: ignore[misc]  # noqa: N801
        """The compound state."""

        a = State(initial=True)
        b = State()
        c = State()
        go = a.to(b) | b.to(c) | c.to(a)


class Guarded(StateChart):  # type: ignore[misc]
    """The cycle with a guard and an action on each transition."""

    class work(State.Compound):  # type: ignore[misc]  # noqa: N801
        """The compound state."""

        a = State(initial=True)
        b = State()
        c = State()
        go = (
            a.to(b, cond="below", on="add")
            | b.to(c, cond="below", on="add")
            | c.to(a, cond="below", on="add")
        )

    def __init__(self) -> None:
        self.count = 0
        super().__init__()

    def below(self) -> bool:
        """The guard."""
        return self.count < BOUND

    def add(self) -> None:
        """The action."""
        self.count += 1


class Parallel(StateChart):  # type: ignore[misc]
    """Three levels; two regions answer the same event."""

    class both(State.Parallel):  # type: ignore[misc]  # noqa: N801
        """The parallel state."""

        class left(State.Compound):  # type: ignore[misc]  # noqa: N801
            """One region."""

            l1 = State(initial=True)
            l2 = State()
            go = l1.to(l2) | l2.to(l1)

        class right(State.Compound):  # type: ignore[misc]  # noqa: N801
            """The other region."""

            r1 = State(initial=True)
            r2 = State()
            go = r1.to(r2) | r2.to(r1)


_CHARTS: dict[str, type[StateChart]] = {"cycle": Cycle, "guarded": Guarded, "parallel": Parallel}


def make(chart: str) -> Bench:
    """Return a chart, running."""
    if is_load(chart):
        return _load(chart)
    machine = _class(chart)()
    return Bench(_sending(machine), lambda: _reached(machine, getattr(machine, "count", None)))


def further(chart: str) -> Callable[[], object]:
    """Return what makes one more machine of the same class."""
    kind = _class(chart)

    def one() -> StateChart:
        machine = kind()
        _sending(machine)(FIRST_EVENTS)
        return machine

    return one


def _class(chart: str) -> type[StateChart]:
    if chart not in _CHARTS:
        raise Unsupported("no virtual clock")
    return _CHARTS[chart]


def _sending(machine: StateChart) -> Callable[[int], None]:
    send = machine.send

    def run(number: int) -> None:
        for _ in range(number):
            send("go")

    return run


def _reached(machine: StateChart, count: int | None = None) -> Reached:
    return reached([state.id for state in machine.configuration if not state.states], count)


# -- loading ---------------------------------------------------------------------------------------------


def _load(chart: str) -> Bench:
    described = tree(chart)
    document = {"name": "generated", "datamodel": {"count": "0"}, "states": _states(described)}
    text = yaml.safe_dump(document, sort_keys=False)
    count = _count(described)

    def look(machine: StateChart) -> Reached:
        machine.send("go")
        return _reached(machine, count)

    return loading(lambda: load(text, format="yaml")(), look)


def _count(states: list[dict[str, Any]]) -> int:
    return sum(1 + _count(state["states"]) for state in states)


def _states(states: list[dict[str, Any]]) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for index, state in enumerate(states):
        made: dict[str, Any] = {"initial": True} if index == 0 else {}
        if state["states"]:
            made["states"] = _states(state["states"])
        if state["counts"]:
            made["enter"] = [_ADD]
        if state["on"]:
            made["transitions"] = [_rule(rule) for rule in state["on"]]
        found[state["name"]] = made
    return found


def _rule(rule: dict[str, Any]) -> dict[str, Any]:
    found: dict[str, Any] = {"event": rule["event"], "target": rule["target"]}
    if rule["guarded"]:
        found["cond"] = "count >= 3"
    if rule["counts"]:
        found["on"] = [_ADD]
    return found
