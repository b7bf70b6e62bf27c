"""Draws a chart with some states collapsed, on a display's request; the last few drawings are cached."""

from __future__ import annotations

from functools import lru_cache

from lupin_engine.chart.model import Chart
from lupin_engine.diagram.outline import outline
from lupin_engine.diagram.svg import svg
from lupin_engine.errors import UsageError, meant, shortened

#: The most unknown states that are named.
_MOST_NAMED = 3


@lru_cache(maxsize=16)
def folded_svg(chart: Chart, folded: frozenset[str]) -> str:
    """Return the whole chart as SVG, with the states `folded` (full names) collapsed.

    Raises:
        UsageError: some states do not exist; up to three are named.
    """
    states = list(filter(None, chart.states))
    unknown = sorted(folded.difference(states))
    if unknown:
        hints = {name: meant(name, states) for name in unknown[:_MOST_NAMED]}
        named = [shortened(repr(name)) + (f" ({hint})" if hint else "") for name, hint in hints.items()]
        more = len(unknown) - _MOST_NAMED
        raise UsageError(f"no state {', '.join(named)}" + (f" and {more} more" if more > 0 else ""))
    return svg(outline(chart, folded=folded, whole=True))
