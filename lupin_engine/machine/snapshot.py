"""A machine's memory as JSON, and back: what a restarted process goes on from.

A snapshot is taken between two steps. A machine restored from it takes the same steps as the one that went
on. Deadlines are times of the caller's clock: who restores with another clock moves them with `shift`.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from functools import cache

from pydantic import TypeAdapter, ValidationError

from lupin_engine.chart.model import Chart, Kind
from lupin_engine.errors import LupinError
from lupin_engine.machine.holds import all_holds
from lupin_engine.machine.memory import Memory, Timer

#: Raised when the form of snapshots changes.
VERSION = 4


class SnapshotError(LupinError):
    """A snapshot cannot be used: it is damaged, of another version, or of another chart."""


@cache
def _adapter() -> TypeAdapter[Memory]:
    return TypeAdapter(Memory)


def snapshot(chart: Chart, memory: Memory) -> str:
    """Return the memory of a machine of `chart` as JSON text."""
    inside = _adapter().dump_python(memory)
    # Readings may hold nan and inf, which JSON has no words for; Python's writer and reader agree on some.
    return json.dumps({"version": VERSION, "chart": chart.name, "memory": inside})


def restore(chart: Chart, text: str) -> Memory:
    """Return the memory that `text` was made of, for a machine of `chart`.

    Raises:
        SnapshotError: naming everything that does not fit.
    """
    memory = _read(chart, text)
    problems = list(_strangers(chart, memory))
    if problems:
        raise SnapshotError(f"this snapshot does not fit the chart {chart.name!r}: {'; '.join(problems)}")
    return memory


def shift(memory: Memory, seconds: float) -> None:
    """Move every deadline and stamp to a clock that is `seconds` ahead of the old one."""
    memory.timers[:] = [_later(timer, seconds) for timer in memory.timers]
    for name, found in memory.inputs.items():
        memory.inputs[name] = found._replace(stamp=found.stamp + seconds)
    if memory.started_at is not None:
        memory.started_at += seconds
    if memory.wall is not None:
        memory.wall -= seconds


def _later(timer: Timer, seconds: float) -> Timer:
    due, token, kind, about = timer
    return due + seconds, token, kind, about


def _read(chart: Chart, text: str) -> Memory:
    try:
        found = json.loads(text)
    except ValueError as problem:
        raise SnapshotError(f"this is no snapshot: {problem}") from None
    if not isinstance(found, dict) or set(found) != {"version", "chart", "memory"}:
        raise SnapshotError("this is no snapshot: expected version, chart and memory")
    if found["version"] != VERSION:
        raise SnapshotError(f"this snapshot is of version {found['version']!r}, expected {VERSION}")
    if found["chart"] != chart.name:
        raise SnapshotError(f"this snapshot is of the chart {found['chart']!r}, not of {chart.name!r}")
    try:
        return _adapter().validate_python(found["memory"])
    except ValidationError as problem:
        wrong = (f"{'.'.join(map(str, e['loc']))}: {e['msg']}" for e in problem.errors(include_url=False))
        raise SnapshotError(f"this snapshot is damaged: {'; '.join(wrong)}") from None


def _strangers(chart: Chart, memory: Memory) -> Iterator[str]:
    """Yield what a memory speaks of that the chart does not have."""
    for what, (used, known) in _mentions(chart, memory).items():
        for name in sorted(set(used) - set(known)):
            yield f"there is no {what} {name!r}"
    if not _is_legal(chart, memory.configuration):
        yield f"these states are never active together: {', '.join(filter(None, memory.configuration))}"


def _mentions(chart: Chart, memory: Memory) -> Mapping[str, tuple[Iterable[str], Iterable[str]]]:
    """Return by kind the names that a memory speaks of, and those that the chart has."""
    timers = [(kind, owner) for _, _, kind, (owner, _) in (*memory.timers, *memory.frozen)]
    invocations = memory.invocations.values()
    past = {name for names in memory.history.values() for name in names}
    ageing = {spec.name for spec in chart.inputs.values() if spec.freshness is not None}
    return {
        "state": ({*memory.configuration, *memory.history, *past}, chart.states),
        "mission in state": (memory.given, _with(chart, "use")),
        "mission": ({memory.mission} - {""}, chart.missions),
        "variable": (memory.context, chart.context),
        "hold": (memory.held, all_holds(chart)),
        "input": ({*memory.inputs, *memory.heard, *memory.before}, chart.inputs),
        "invariant": (memory.broken, chart.invariants),
        "itinerary in state": (memory.itineraries, _with(chart, "itinerary")),
        "operation in state": ({i.state for i in invocations if i.key is None}, _with(chart, "invoke")),
        "question in state": (memory.asked, _with(chart, "ask")),
        "for_each in state": ({i.state for i in invocations if i.key is not None}, _with(chart, "for_each")),
        "timer in state": (
            {*memory.reached, *(owner for kind, owner in timers if kind in ("after", "at"))},
            _with(chart, "timers"),
        ),
        "budget in state": (
            {*memory.budgets, *(owner for kind, owner in timers if kind == "budget")},
            _with(chart, "budget"),
        ),
        "freshness of input": ((owner for kind, owner in timers if kind == "fresh"), ageing),
    }


def _with(chart: Chart, part: str) -> Iterable[str]:
    return (name for name, state in chart.states.items() if getattr(state, part))


def _is_legal(chart: Chart, configuration: Iterable[str]) -> bool:
    """Say whether states can be active together: of a compound one child, of a parallel one all."""
    active = {name for name in configuration if name in chart.states}
    for name in active:
        state = chart.states[name]
        regions = [child for child in state.children if chart.states[child].kind is not Kind.HISTORY]
        inside = sum(1 for child in regions if child in active)
        wanted = len(regions) if state.kind is Kind.PARALLEL else min(1, len(regions))
        if inside != wanted or (state.parent is not None and state.parent not in active):
            return False
    return True
