"""Snapshots: a machine's memory as JSON, and back; a new process recovers from them.

A snapshot is taken between two steps. A machine restored from it takes the same steps as the original.
Deadlines are times of the caller's clock: `shift` moves them to another one. A damaged snapshot, another
version's or another chart's is refused with every name that does not fit.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from functools import cache

from pydantic import TypeAdapter, ValidationError

from lupin_engine.chart.model import Chart, Kind
from lupin_engine.errors import LupinError
from lupin_engine.machine.memory import Memory
from lupin_engine.machine.schema import BUDGETS, COLLECTIONS, OPERATIONS, STATES, TIMED, Owner

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
    for one in memory.schema():
        found, later = getattr(memory, one.name), one.later
        if later is None or found is None:
            continue
        if isinstance(found, dict):
            found.update({name: later(value, seconds) for name, value in found.items()})
        elif isinstance(found, list):
            found[:] = [later(value, seconds) for value in found]
        else:
            setattr(memory, one.name, later(found, seconds))


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
    """Yield the names in a memory that the chart does not have, and an impossible configuration."""
    strangers: dict[str, set[str]] = {}
    for owner, names in (*_mentions(memory), *_mentions_inside(memory)):
        strangers.setdefault(owner.word, set()).update(set(names) - set(owner.names(chart)))
    yield from (f"there is no {word} {name!r}" for word, some in strangers.items() for name in sorted(some))
    if not _is_legal(chart, memory.configuration):
        yield f"these states are never active together: {', '.join(filter(None, memory.configuration))}"


def _mentions(memory: Memory) -> Iterator[tuple[Owner, Iterable[str]]]:
    """Yield the names that a memory speaks of, with whose names they are."""
    for one in memory.schema():
        if one.owner is not None and one.owner.word:
            found = getattr(memory, one.name)
            yield one.owner, filter(None, [found]) if isinstance(found, str) else found


def _mentions_inside(memory: Memory) -> Iterator[tuple[Owner, Iterable[str]]]:
    """Yield those that stand deeper in it."""
    yield from ((STATES, names) for names in memory.history.values())
    for one in memory.invocations.values():
        yield OPERATIONS if one.key is None else COLLECTIONS, [one.state]
    for _, _, kind, (owner, _) in (*memory.timers, *memory.frozen):
        if kind in _OF_TIMERS:
            yield _OF_TIMERS[kind], [owner]


_AGEING = Owner(
    "freshness of input", lambda c: (i.name for i in c.inputs.values() if i.freshness is not None)
)
_OF_TIMERS = {"after": TIMED, "at": TIMED, "budget": BUDGETS, "fresh": _AGEING}


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
