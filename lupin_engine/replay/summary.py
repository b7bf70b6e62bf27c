"""Sums up a run in figures: time in each state, targets by status, attempts by outcome."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from lupin_engine.replay.timeline import Lane, Timeline
from lupin_engine.runtime.history import CANCELLED, DONE, FAILED, OPEN, TIMED_OUT
from lupin_engine.sim.simulation import Run

#: In the order of reports.
OUTCOMES = (DONE, FAILED, TIMED_OUT, CANCELLED, OPEN)


@dataclass(frozen=True)
class Attempted:
    """The attempts of one operation by outcome; `retries` are those that were not a first try."""

    operation: str
    attempts: int
    retries: int
    outcomes: Mapping[str, int]
    seconds: float


@dataclass(frozen=True)
class RunSummary:
    """The figures of a run; times in seconds. `dropped` are results that no state waited for any more.

    `errors` counts the failures of each expression or action.
    """

    seconds: float
    states: Mapping[str, float]
    phases: Mapping[str, float]
    targets: Mapping[str, int]
    operations: tuple[Attempted, ...]
    held: Mapping[str, float]
    refused: int
    dropped: int
    errors: Mapping[str, int]


def summarise(run: Run, lanes: Timeline) -> RunSummary:
    """Return the figures of a run, of which `lanes` is the timeline."""
    return RunSummary(
        seconds=_rounded(run.seconds),
        states=_times([lanes.states]),
        phases=_times([lanes.phases]),
        targets=dict(Counter(visit.status or "open" for visit in run.visits)),
        operations=tuple(_attempted(lane) for lane in lanes.operations),
        held=_times(lanes.holds),
        refused=len(run.history.refused),
        dropped=run.view.dropped,
        errors=dict(Counter(run.history.errors)),
    )


def _times(lanes: Iterable[Lane]) -> dict[str, float]:
    found: dict[str, float] = {}
    for lane in lanes:
        for bar in lane.bars:
            found[bar.text] = found.get(bar.text, 0.0) + bar.seconds
    return {text: _rounded(seconds) for text, seconds in found.items()}


def _attempted(lane: Lane) -> Attempted:
    counted = Counter(bar.outcome for bar in lane.bars)
    return Attempted(
        operation=lane.name,
        attempts=len(lane.bars),
        retries=sum(bar.tries > 1 for bar in lane.bars),
        outcomes={outcome: counted[outcome] for outcome in OUTCOMES if counted[outcome]},
        seconds=_rounded(sum(bar.seconds for bar in lane.bars)),
    )


def _rounded(seconds: float) -> float:
    """Return a sum of times without rounding errors of floats."""
    return round(seconds, 6)
