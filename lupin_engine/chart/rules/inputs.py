"""The rule about live values that may be unknown."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from lupin_engine.chart.expressions.names import may_ask, unknowns_read
from lupin_engine.chart.findings import warning
from lupin_engine.chart.model import ActionCall
from lupin_engine.chart.rules.index import Index
from lupin_engine.chart.rules.written import Read
from lupin_engine.errors import Diagnostic

#: What the engine does without as long as it is unknown: no element is new, the list's own order counts.
_MAY_WAIT = (("for_each", "in"), ("for_each", "key"), ("itinerary", "order"))


def unknown_input_read(index: Index) -> Iterator[Diagnostic]:
    """Find an expression that reads a live value without a check by `known`.

    A guard is then false, whatever its condition; elsewhere it is an error at run time. A check in the guard
    of a transition or an `if` counts for its actions, which run at the same moment.
    """
    asked = dict(_asked(index))
    for read in index.reads:
        source = read.expression.source
        if not may_ask(source) or not read.expression.understood:
            continue
        if read.words[-2:] in _MAY_WAIT:
            continue
        for name in unknowns_read(source, asked.get(id(read.expression), frozenset())):
            if index.may_be_unknown(name):
                yield _finding(read, name, _why(index, name))


def _asked(index: Index) -> Iterator[tuple[int, frozenset[str]]]:
    """Yield the expressions in actions, by their ids, with the values that guards before have checked."""
    for state in index.states:
        each = state.for_each
        ends = (*each.on_done, *each.on_error) if each else ()
        yield from _given((*state.on_entry, *state.on_exit, *ends))
        for transition in state.transitions:
            known = transition.guard.known_when(True)
            yield from _given(transition.actions, known)
            yield id(transition.detail), known


def _given(
    actions: Iterable[ActionCall], known: frozenset[str] = frozenset()
) -> Iterator[tuple[int, frozenset[str]]]:
    for call in actions:
        yield from ((id(value), known) for value in (*call.arguments.values(), *call.data.values()))
        yield id(call.guard), known
        yield from _given(call.then, known | call.guard.known_when(True))
        yield from _given(call.otherwise, known | call.guard.known_when(False))


def _finding(read: Read, name: str, why: str) -> Diagnostic:
    if read.condition:
        problem = f"{name} may be unknown ({why}), and then this guard is false"
        hint = f"write 'known({name}) and ...', or 'not known({name}) or ...'"
        return warning(read.expression.place, "unknown-input", read.path, problem, hint)
    problem = f"{name} may be unknown ({why}), and then this is an error while the mission runs"
    hint = f"write '... if known({name}) else ...'"
    return Diagnostic(read.expression.place, "unknown-input", read.path, problem, hint)


def _why(index: Index, name: str) -> str:
    found = index.chart.inputs.get(name.removeprefix("input."))
    if found is None:
        return "where no element is such" if name.startswith("find(") else "where it was not told"
    if found.freshness is not None:
        return f"no report for {found.freshness:g} s"
    return "before the first report"
