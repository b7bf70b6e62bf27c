"""What scenarios reached as a table, and below it the list of what they did not."""

from __future__ import annotations

from collections.abc import Iterator

from lupin_engine.replay.coverage import KINDS, Coverage, Part, Tally
from lupin_engine.sim.failure import shown

_WIDTH = 16


def coverage_lines(coverage: Coverage) -> Iterator[str]:
    """Yield a line for each mission and lifecycle, then every item that was not reached."""
    width = max(len(part.title) for part in coverage.parts) if coverage.parts else 0
    yield f"{'reached':{width}}" + "".join(f"{kind:>{_WIDTH}}" for kind in KINDS)
    for part in coverage.parts:
        yield f"{part.title:{width}}" + "".join(f"{_share(tally):>{_WIDTH}}" for tally in part.tallies())
    yield f"{coverage.percent:.1f} % of all"
    for part in coverage.parts:
        yield from _missing(part)


def _share(tally: Tally) -> str:
    return f"{tally.taken} of {tally.total}"


def _missing(part: Part) -> Iterator[str]:
    for tally in part.tallies():
        if tally.missing:
            yield ""
            yield f"{part.title}: {tally.kind} that were not reached"
        for item in tally.missing:
            yield f"  {shown(item.place)}: {item.text}"
