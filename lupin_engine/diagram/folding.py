"""Drawings of a chart with some of its states folded, as displays ask for them."""

from __future__ import annotations

from functools import lru_cache

from lupin_engine.chart.model import Chart
from lupin_engine.diagram.outline import outline
from lupin_engine.diagram.svg import svg
from lupin_engine.errors import UsageError, meant, shortened

#: Unknown states that are told of.
_MOST_TOLD = 3


@lru_cache(maxsize=16)
def folded_svg(chart: Chart, folded: frozenset[str]) -> str:
    """Return the whole chart as SVG; of the states `folded`, by their full names, the inside is left out.

    The last few are kept: who folds a state unfolds it again.

    Raises:
        UsageError: there is no such state; all that are unknown are told.
    """
    states = list(filter(None, chart.states))
    unknown = sorted(folded.difference(states))
    if unknown:
        hints = {name: meant(name, states) for name in unknown[:_MOST_TOLD]}
        told = [shortened(repr(name)) + (f" ({hint})" if hint else "") for name, hint in hints.items()]
        more = len(unknown) - _MOST_TOLD
        raise UsageError(f"no state {', '.join(told)}" + (f" and {more} more" if more > 0 else ""))
    return svg(outline(chart, folded=folded, whole=True))
