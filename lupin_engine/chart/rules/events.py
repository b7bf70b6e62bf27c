"""The rule about fields of the event that led to the place of an expression.

The event stays visible through eventless transitions of the same macrostep (SCXML's `_event`). So its fields
in a state follow from all ways into the state, also eventless ones. Where one of them has no event, or one
without the field, the expression would be an error at run time.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from functools import lru_cache
from itertools import takewhile

from lupin_engine.chart.compose.carried import end_of
from lupin_engine.chart.expressions.evaluation import Constant, Expression
from lupin_engine.chart.expressions.names import tree_of
from lupin_engine.chart.model import Kind, State, Transition
from lupin_engine.chart.records import COMPUTED, walk
from lupin_engine.chart.rules.index import Index, always_taken, event_name, local
from lupin_engine.chart.semantics import EXECUTION_ERROR
from lupin_engine.chart.strictness import stricter
from lupin_engine.errors import Diagnostic
from lupin_engine.plugin.profile import ANSWER, START

_FAILURE = frozenset({"code", "detail"})

#: The transitions whose event may be the one that led somewhere, by their ids.
Causes = dict[str, Transition]


def event_field(index: Index) -> Iterator[Diagnostic]:
    """Find an expression that reads a field which the event there may not have."""
    reading = [state for state in index.states if any(True for _ in _expressions(state))]
    if not reading:
        return
    causes = _causes(index)
    for state in reading:
        for expression, by in _expressions(state):
            possible = causes[state.name] if by is None else _behind(index, by, causes[state.name])
            for name, lacking in _missing(index, expression, possible):
                yield _finding(expression, state, name, lacking)


def _missing(index: Index, expression: Expression, causes: Causes) -> Iterator[tuple[str, Transition]]:
    """Yield the fields that are read of an event and that it may lack, with the transition it comes by."""
    for name in sorted(_fields_read(expression.source)):
        lacking = next((t for t in causes.values() if _lacks(index, t, name)), None)
        if lacking is not None and expression.understood:
            yield name, lacking


def _finding(expression: Expression, state: State, name: str, lacking: Transition) -> Diagnostic:
    way = f"{event_name(lacking.event)!r} of {local(lacking.source) or 'the chart'!r}"
    problem = f"there may be no event.{name} here: {way} comes without"
    if not lacking.event:
        problem = f"there may be no event.{name} here: {way} is also taken later, when no event is seen"
    hint = f"where the event is seen, keep it: 'do: [set: {{NAME: \"${{ event.{name} }}\"}}]'"
    return stricter("event-field", expression.place, state.name, problem, hint)


# -- what reads an event ------------------------------------------------------------------------------------


def _expressions(state: State) -> Iterator[tuple[Expression, Transition | None]]:
    """Yield the expressions of a state that read an event's fields, with their transition.

    None stands for the transition of what the state does on its entry.
    """
    given = state.use.request.values() if state.use else ()
    for part in (*state.on_entry, *given, *((state.invoke,) if state.invoke else ())):
        yield from ((found, None) for found in _reading(part))
    for transition in state.transitions:
        yield from ((found, transition) for found in _reading(transition))


def _reading(part: object) -> Iterator[Expression]:
    for said in walk(part, COMPUTED):
        value = said.value
        if not isinstance(value, Constant) and "event." in value.source and _fields_read(value.source):
            yield value


@lru_cache(4096)
def _fields_read(source: str) -> frozenset[str]:
    tree = tree_of(source)
    return frozenset(
        node.attr
        for node in (ast.walk(tree) if tree is not None else ())
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "event"
    )


# -- which events lead to a state ---------------------------------------------------------------------------


def _causes(index: Index) -> dict[str, Causes]:
    """Return for every state the transitions whose event may have led there."""
    causes: dict[str, Causes] = {state.name: {} for state in index.states}
    ways = [t for state in index.states for t in state.transitions if t.target is not None]
    entered = {t.id: _entered(index, t) for t in ways}
    waiting = ways
    while waiting:
        changed = set()
        for transition in waiting:
            new = _behind(index, transition, causes[transition.source])
            for name in entered[transition.id]:
                if not new.keys() <= causes[name].keys():
                    causes[name].update(new)
                    changed.add(name)
        waiting = [t for t in ways if not t.event and t.source in changed]
    return causes


def _behind(index: Index, transition: Transition, causes: Causes) -> Causes:
    """Return the possible events of a transition: its own, or for an eventless one those of its state."""
    if transition.event:
        return {transition.id: transition}
    around = [index.chart.states[name] for name in index.lineage[transition.source]]
    moves_on = any(not t.event and always_taken(t) for state in around for t in state.transitions)
    passes = transition.during | transition.releases
    if moves_on and all(cause.during <= passes for cause in causes.values()):
        return causes
    return {**causes, transition.id: transition}


def _entered(index: Index, transition: Transition) -> set[str]:
    """Return the states that a transition may enter."""
    target = index.chart.states[transition.target or ""]
    domain = index.semantics.domain(transition, target.name)
    targets = [target.name] if target.kind is not Kind.HISTORY else list(_remembered(index, target))
    found: set[str] = set()
    for name in targets:
        found.update(index.entered(name))
        for around in takewhile(lambda one: one != domain, index.lineage[name][1:]):
            found.update((around, *_beside(index, name, index.chart.states[around])))
    return found


def _beside(index: Index, name: str, around: State) -> Iterator[str]:
    """Yield the states that are entered in the other regions of a parallel state around one."""
    if around.kind is Kind.PARALLEL:
        for region in index.regions(around):
            yield from () if index.inside(name, region.name) else index.entered(region.name)


def _remembered(index: Index, history: State) -> Iterator[str]:
    """Yield the possible values of a history state, and the targets of `resume_at`."""
    parent = history.parent or ""
    base = len(index.lineage[parent])
    for name, lineage in index.lineage.items():
        state, depth = index.chart.states[name], len(lineage) - base
        if state.kind is Kind.HISTORY or parent not in lineage:
            continue
        above = history.depth is None or depth < history.depth
        used = state.parent is not None and index.chart.states[state.parent].use is not None
        if depth and (depth == history.depth or (above and not state.children) or used):
            yield name
        if history.depth is None or depth <= history.depth:
            yield from (t.target for t in state.resume_at if t.target is not None)


def _lacks(index: Index, transition: Transition, name: str) -> bool:
    """Say whether the event of a transition certainly lacks a field."""
    fields = _fields(index, transition)
    return fields is not None and name not in fields


def _fields(index: Index, transition: Transition) -> frozenset[str] | None:
    """Return the fields of a transition's event; None for a wildcard, whose fields are unknown."""
    event, chart = transition.event, index.chart
    if event.endswith("*"):
        return None
    if event in ("error", EXECUTION_ERROR):
        return _FAILURE
    if event == "done":
        invoke = chart.states[transition.source].invoke
        ended = index.composed.carried.fields_of(end_of(transition.source)).fields
        return frozenset(invoke.operation.result if invoke is not None else ended)
    if event == START:
        return frozenset({"mission_type", "mission_id"})
    if event.startswith(ANSWER):
        return frozenset({"by"})
    known = chart.catalog.events.get(event)
    return frozenset(known.fields if known is not None else index.composed.carried.fields_of(event).fields)
