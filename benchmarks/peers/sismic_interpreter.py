"""sismic: statecharts in YAML with Python for guards and actions, its interpreter and simulated clock."""

from __future__ import annotations

from collections.abc import Callable
from importlib.metadata import version
from typing import Any

import yaml
from bench import BOUND, FIRST_EVENTS, Bench, Reached, is_load, loading, reached, tree
from sismic.interpreter import Interpreter
from sismic.io import import_from_yaml

VERSION = f"sismic {version('sismic')}"

_ADD = "count = count + 1"


def make(chart: str) -> Bench:
    """Return a chart, running."""
    if is_load(chart):
        return _load(chart)
    interpreter = _started(import_from_yaml(_text(chart)))
    if chart == "timed":
        return _timed(interpreter)
    count = (lambda: interpreter.context["count"]) if chart == "guarded" else (lambda: None)
    return Bench(_sending(interpreter), lambda: _reached(interpreter, count()))


def further(chart: str) -> Callable[[], object]:
    """Return what makes one more interpreter of the same statechart."""
    statechart = import_from_yaml(_text(chart))

    def one() -> Interpreter:
        interpreter = _started(statechart)
        _sending(interpreter)(FIRST_EVENTS)
        return interpreter

    return one


def _started(statechart: Any) -> Interpreter:
    interpreter = Interpreter(statechart)
    interpreter.execute_once()
    return interpreter


def _sending(interpreter: Interpreter) -> Callable[[int], None]:
    queue, execute = interpreter.queue, interpreter.execute_once

    def run(number: int) -> None:
        for _ in range(number):
            queue("go")
            execute()

    return run


def _timed(interpreter: Interpreter) -> Bench:
    clock, execute = interpreter.clock, interpreter.execute_once

    def run(number: int) -> None:
        for _ in range(number):
            clock.time += 1
            execute()

    return Bench(run, lambda: _reached(interpreter, round(clock.time)))


def _reached(interpreter: Interpreter, count: int | None = None) -> Reached:
    return reached([name for name in interpreter.configuration if not _children(interpreter, name)], count)


def _children(interpreter: Interpreter, name: str) -> list[str]:
    found: list[str] = interpreter.statechart.children_for(name)
    return found


# -- the charts, as its YAML -----------------------------------------------------------------------------


def _text(chart: str) -> str:
    if chart == "parallel":
        regions = [_cycle("left", ["l1", "l2"]), _cycle("right", ["r1", "r2"])]
        return _chart([{"name": "both", "parallel states": regions}])
    if chart == "timed":
        return _chart([_cycle("work", ["ping", "pong"], {"guard": "after(1)"})])
    rule = {"event": "go", "guard": f"count < {BOUND}", "action": _ADD} if chart == "guarded" else None
    return _chart([_cycle("work", ["a", "b", "c"], rule)])


def _cycle(name: str, states: list[str], rule: dict[str, str] | None = None) -> dict[str, Any]:
    following = [*states[1:], states[0]]
    children = [
        {"name": one, "transitions": [{"target": other, **(rule or {"event": "go"})}]}
        for one, other in zip(states, following, strict=True)
    ]
    return {"name": name, "initial": states[0], "states": children}


def _chart(states: list[dict[str, Any]]) -> str:
    root = {"name": "root", "initial": states[0]["name"], "states": states}
    chart = {"statechart": {"name": "chart", "preamble": "count = 0", "root state": root}}
    return str(yaml.safe_dump(chart, sort_keys=False))


# -- loading ---------------------------------------------------------------------------------------------


def _load(chart: str) -> Bench:
    text = _chart([_state(state) for state in tree(chart)])

    def look(interpreter: Interpreter) -> Reached:
        _sending(interpreter)(1)
        return _reached(interpreter, len(interpreter.statechart.states) - 1)

    return loading(lambda: _started(import_from_yaml(text)), look)


def _state(state: dict[str, Any]) -> dict[str, Any]:
    found: dict[str, Any] = {"name": state["name"]}
    if state["states"]:
        found["initial"] = state["states"][0]["name"]
        found["states"] = [_state(child) for child in state["states"]]
    if state["counts"]:
        found["on entry"] = _ADD
    if state["on"]:
        found["transitions"] = [_rule(rule) for rule in state["on"]]
    return found


def _rule(rule: dict[str, Any]) -> dict[str, str]:
    found = {"event": rule["event"], "target": rule["target"]}
    if rule["guarded"]:
        found["guard"] = "count >= 3"
    if rule["counts"]:
        found["action"] = _ADD
    return found
