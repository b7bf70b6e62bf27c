"""The rule about live values that may be unknown."""

from __future__ import annotations

from collections.abc import Iterator

from lupin_engine.chart.expressions.names import inputs_read
from lupin_engine.chart.findings import warning
from lupin_engine.chart.model import Input
from lupin_engine.chart.rules.index import Index, understood
from lupin_engine.chart.rules.written import Read
from lupin_engine.errors import Diagnostic

#: What the engine does without as long as it is unknown: no element is new, the list's own order counts.
_MAY_WAIT = (("for_each", "in"), ("for_each", "key"), ("itinerary", "order"))


def unknown_input_read(index: Index) -> Iterator[Diagnostic]:
    """Find an expression that reads a live value without having asked whether it is known.

    A guard is then false, whatever it says; where a value is computed it is an error at run time.
    """
    if not index.unsure:
        return
    for read in index.reads:
        if "input." not in read.expression.source or not understood(read.expression):
            continue
        if read.words[-2:] in _MAY_WAIT:
            continue
        for name in inputs_read(read.expression.source):
            if name in index.unsure:
                yield _told(read, index.chart.inputs[name])


def _told(read: Read, found: Input) -> Diagnostic:
    name, why = f"input.{found.name}", _why(found)
    if read.condition:
        problem = f"{name} may be unknown ({why}), and then this guard is false"
        hint = f"write 'known({name}) and ...', or 'not known({name}) or ...'"
        return warning(read.expression.place, "unknown-input", read.path, problem, hint)
    problem = f"{name} may be unknown ({why}), and then this is an error while the mission runs"
    hint = f"write '... if known({name}) else ...'"
    return Diagnostic(read.expression.place, "unknown-input", read.path, problem, hint)


def _why(found: Input) -> str:
    if found.freshness is not None:
        return f"no report for {found.freshness:g} s"
    return "before the first report"
