"""Shared by the drawings of a timeline: rows in groups, marks of the axis, placement of labels."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from lupin_engine.plugin.profile import Rating
from lupin_engine.replay.timeline import Bar, Curve, Lane, Tick, Timeline
from lupin_engine.runtime.history import FAILED

#: What the rows of a picture can be about.
STATE, PHASE, TARGET, OPERATION, HOLD, FLAG, CURVE = (
    "state",
    "phase",
    "target",
    "operation",
    "hold",
    "flag",
    "curve",
)
#: Distances between two marks of the axis, in seconds.
_STEPS = (0.1, 0.2, 0.5, 1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 14400)
_DAY = 86400
#: Up to here a time is shown in seconds, in minutes.
_IN_SECONDS, _IN_MINUTES = 180.0, 3 * 3600.0


@dataclass(frozen=True)
class TimelineRow:
    """One row of a picture: bars, or a curve."""

    kind: str
    name: str
    bars: tuple[Bar, ...] = ()
    curve: Curve | None = None


def groups(lanes: Timeline) -> list[tuple[str, list[TimelineRow]]]:
    """Return the rows in groups, each with its heading; empty groups are left out."""
    found = {
        "states": _split(STATE, lanes.states),
        "phases": _split(PHASE, lanes.phases),
        "targets": [TimelineRow(TARGET, "target", lanes.targets.bars)] if lanes.targets.bars else [],
        "operations": [TimelineRow(OPERATION, lane.name, lane.bars) for lane in lanes.operations],
        "holds": [TimelineRow(HOLD, lane.name, lane.bars) for lane in lanes.holds],
        "inputs": [TimelineRow(FLAG, lane.name, lane.bars) for lane in lanes.flags]
        + [TimelineRow(CURVE, curve.name, curve=curve) for curve in lanes.curves],
    }
    return [(name, rows) for name, rows in found.items() if rows]


def _split(kind: str, lane: Lane) -> list[TimelineRow]:
    """Return a row for each name in a lane, in the order of first appearance."""
    names = dict.fromkeys(bar.text for bar in lane.bars)
    return [TimelineRow(kind, name, tuple(bar for bar in lane.bars if bar.text == name)) for name in names]


def marks(seconds: float, most: int) -> list[float]:
    """Return the axis marks, the beginning included; not more than `most` and one."""
    rough = seconds / max(1, most)
    step = next((step for step in _STEPS if step >= rough), _DAY * math.ceil(rough / _DAY))
    return [round(index * step, 6) for index in range(int(seconds / step + 1e-9) + 1)]


def axis_text(time: float, seconds: float) -> str:
    """Return the text of a mark, for a run of so many seconds."""
    if seconds <= _IN_SECONDS:
        return f"{time:g} s"
    return f"{time / 60:g} min" if seconds <= _IN_MINUTES else f"{time / 3600:g} h"


def lasting(seconds: float) -> str:
    """Return a duration in a suitable unit."""
    if seconds <= _IN_SECONDS:
        return f"{seconds:.1f} s"
    return f"{seconds / 60:.1f} min" if seconds <= _IN_MINUTES else f"{seconds / 3600:.1f} h"


def is_bad(tick: Tick) -> bool:
    """Return whether an event is drawn in the colour of errors."""
    return tick.refused or tick.is_error


def tick_text(tick: Tick) -> str:
    """Return the text of an event, with "refused" where it was; or the reported code."""
    return f"{tick.text} refused" if tick.refused else tick.text


def inside(bar: Bar, kind: str) -> Iterator[str]:
    """Yield texts for the inside of a bar, the best first, without what its row says already."""
    why = bar.detail.partition(" ")[0] if bar.outcome and bar.rating != Rating.GOOD.value else ""
    if kind == TARGET:
        yield f"{bar.text} {why}".rstrip()
        yield bar.text
    elif kind == OPERATION:
        tried = f"try {bar.tries}" if bar.tries > 1 else ""
        why = why if bar.outcome == FAILED else ""
        yield from filter(None, (f"{tried} {why}".strip(), tried))
    else:
        yield lasting(bar.seconds)


def description(bar: Bar) -> str:
    """Return all about a bar in one line."""
    tried = f", try {bar.tries}" if bar.tries > 1 else ""
    outcome = f" {bar.outcome}" if bar.outcome else ""
    detail = f": {bar.detail}" if bar.detail else ""
    return f"{bar.text} {bar.begin:.1f} s to {bar.end:.1f} s ({lasting(bar.seconds)}){outcome}{tried}{detail}"


def placed(
    ticks: Sequence[Tick], begin: Callable[[Tick], float], size: Callable[[Tick], float], rows: int
) -> list[tuple[Tick, int | None]]:
    """Assign each label a row where it overlaps no other; None where there is no room."""
    free = [-math.inf] * rows
    found: list[tuple[Tick, int | None]] = []
    for tick in ticks:
        row = next((row for row, end in enumerate(free) if end <= begin(tick)), None)
        if row is not None:
            free[row] = begin(tick) + size(tick)
        found.append((tick, row))
    return found
