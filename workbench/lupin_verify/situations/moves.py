"""Words for the moves of an exploration, as in the printed steps of a run."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from lupin_engine.chart import Chart
from lupin_engine.machine import CLOCK, RELEASED, RESUMED
from lupin_engine.sim import short_name, shorten
from lupin_verify.situations.relevance import ANY_ABANDONED, is_abandoned, kind_of
from lupin_verify.situations.worlds import LOADED, OF_PROPERTY, WorldMove

#: Fields of every request, which are not shown.
_EVERY_START = ("mission_id", "mission_type", "attempt")


def move_text(chart: Chart, move: WorldMove) -> str:
    """Return a move in words."""
    if move.event is None:
        return _deadline(chart, *move.timer) + (", with the same arguments" if move.unchanged else "")
    name, data = move.event.name, move.event.data
    if move.event is LOADED:
        return "the missions are reloaded"
    if name == RESUMED:
        return "the process ends, and a new one continues"
    if name == RELEASED:
        return f"the resume policy ends the hold {data['hold']}"
    if name == CLOCK:
        return f"the robot's clock says {data['says']}"
    if name == "value":
        return f"{data['name']} = {shorten(data['value'])}"
    if name.startswith("attempt."):
        return _answer(chart, name.removeprefix("attempt."), data)
    return name + _fields({key: value for key, value in data.items() if key not in _EVERY_START})


def _answer(chart: Chart, word: str, data: Mapping[str, Any]) -> str:
    state = _state_of(chart, data["attempt"])
    if is_abandoned(data["attempt"]):
        return f"{_cancelled(data['attempt'])}: {word}"
    if not state:
        return "a server answers an attempt that ended long ago"
    why = f": {data['code']}" if data.get("code") else ""
    result = _fields(data.get("result") or {})
    return f"{short_name(chart, state)}: {_operation(chart, state)} {word}{why}{result}"


def _deadline(chart: Chart, kind: str, owner: str, event: str) -> str:
    state = _state_of(chart, owner.removeprefix("i:"))
    if kind == OF_PROPERTY:
        return f"the time of the property {owner} is over"
    if kind == "fresh":
        return f"input.{owner} is too old"
    if is_abandoned(owner):
        return f"{_cancelled(owner)}: its end is not confirmed"
    if not state:
        return f"{kind} of {owner}"
    where, operation = short_name(chart, state), _operation(chart, state)
    words = {
        "after": f"a tick in {where}" if event.startswith("every") else f"time is up in {where}",
        "budget": f"the budget is up in {where}",
        "at": f"the time of day comes in {where}",
        "ask": f"nobody has answered in {where}",
        "retry": f"{where}: next try of {operation}",
        "update": f"{where}: time for an update of {operation}",
        "replaced": f"{where}: {operation} has not ended what an update replaced",
        "timeout": f"{where}: {operation} timed out",
        "cancel": f"{where}: {operation} does not confirm its cancel",
    }
    return words.get(kind, f"{kind} in {where}")


def _cancelled(name: str) -> str:
    """Return an abandoned attempt in words."""
    kind = kind_of(name)
    return (
        "an operation from before the restart" if kind == ANY_ABANDONED else f"{kind[1:]}, cancelled before"
    )


def _state_of(chart: Chart, owner: str) -> str:
    """Return the state of a deadline or an attempt; '' where there is none."""
    found = [name for name in chart.states if name and owner.startswith(name)]
    return max(found, key=len, default="")


def _operation(chart: Chart, name: str) -> str:
    state = chart.states[name]
    invoke = state.invoke or (state.for_each.invoke if state.for_each is not None else None)
    return invoke.name if invoke is not None else "the operation"


def _fields(data: Mapping[str, Any]) -> str:
    return f" ({', '.join(f'{key}: {shorten(value)}' for key, value in data.items())})" if data else ""
