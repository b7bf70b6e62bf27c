"""Finds targets at which an operation has become slower, or fails: the newest attempts beside those before.

Durations are compared on a logarithmic scale, beside what the distance and the target usually take, by the
difference of two means (a z-test). The standard deviation is that of the operation at all targets, so five
attempts are enough. An outlier counts as `MOST_DEVIATIONS`, and the medians must differ, too.
"""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

from lupin_verify.learning import ObservedAttempt, fail_more, failed_of

Logarithms = NDArray[np.float64]
#: So many of the newest attempts at a target are compared with at least and at most so many before.
NEWEST, BEFORE, MOST_BEFORE = (5, 10), 20, 100
#: With fewer attempts an operation at a target is not compared.
NEEDED = NEWEST[0] + BEFORE
#: Chance alone may report one of so many comparisons: once in some 200 missions to 16 targets.
RARE = 15_000.0
#: The smallest slow-down (of the medians), deviation, and number of deviations of an outlier.
SLOWER, DEVIATION, MOST_DEVIATIONS = 0.25, 0.02, 4.0


@dataclass(frozen=True)
class Drift:
    """An operation that has become slower at a target: the `newest` attempts beside those `before`.

    `slower` is by which share (infinity: so many `failed`), `since` when the first of them began (POSIX).
    """

    operation: str
    target: str
    newest: int
    before: int
    slower: float
    since: float
    failed: int = 0


def drifts(seen: Sequence[ObservedAttempt]) -> list[Drift]:
    """Return the targets at which the newest attempts take longer than chance explains, or fail."""
    by_operation = defaultdict[str, list[ObservedAttempt]](list)
    for one in sorted(seen, key=lambda one: one.wall):
        by_operation[one.operation].append(one)
    return [found for _, row in sorted(by_operation.items()) for found in _drifts(row)]


def compared(seen: Sequence[ObservedAttempt]) -> tuple[int, int]:
    """Return at how many places `drifts` has enough attempts to compare, and at how many there are any.

    A place is an operation at a target.
    """
    counts = Counter((one.operation, one.target) for one in seen)
    return sum(count >= NEEDED for count in counts.values()), len(counts)


def _drifts(row: Sequence[ObservedAttempt]) -> Iterator[Drift]:
    """Yield the drifts of one operation."""
    by_target = defaultdict[str, list[ObservedAttempt]](list)
    for one in row:
        by_target[one.target].append(one)
    shares = deviations(by_target)
    for target, attempts in sorted(by_target.items()):
        done = [one for one in attempts if not one.code]
        if found := _failing(attempts) or _slower(done, *shares[target]):
            yield found


def deviations(by_target: Mapping[str, Sequence[ObservedAttempt]]) -> dict[str, tuple[Logarithms, float]]:
    """Return for each target by how much its attempts took longer than usual, as logarithms.

    With them is the standard deviation at all targets, without the newest attempts at each. Failed attempts
    are left out.
    """
    done = [one for row in by_target.values() for one in row if not one.code]
    if not done:
        return {target: (np.zeros(0), DEVIATION) for target in by_target}
    seconds, metres = np.array([(max(one.seconds, 1e-3), one.metres or 0.0) for one in done]).T
    usual = np.full(len(done), np.median(seconds))
    if metres.min() < metres.max():
        usual = np.maximum(np.polyval(np.polyfit(metres, seconds, 1), metres), seconds.min())
    ends = np.cumsum([len(row) - failed_of(row) for row in by_target.values()])
    parts = np.split(np.log(seconds / usual), ends[:-1])
    before = [part[: -NEWEST[0]] for part in parts if len(part) > NEWEST[0]] or [np.zeros(1)]
    apart = np.concatenate([part - np.median(part) for part in before])
    most = MOST_DEVIATIONS * max(DEVIATION, 1.5 * float(np.median(np.abs(apart))))
    deviation = max(DEVIATION, float(np.std(np.clip(apart, -most, most))))
    return {target: (part, deviation) for target, part in zip(by_target, parts, strict=True)}


def _slower(done: Sequence[ObservedAttempt], logs: Logarithms, deviation: float) -> Drift | None:
    """Compare the durations of the newest attempts at a target with those before."""
    best, most = None, NormalDist().inv_cdf(1.0 - 1.0 / RARE)
    for newest in NEWEST:
        before, now = logs[-newest - MOST_BEFORE : -newest], logs[-newest:]
        if len(before) < BEFORE:
            continue
        usual = np.median(before)
        ends = -MOST_DEVIATIONS * deviation, MOST_DEVIATIONS * deviation
        apart = np.clip(now - usual, *ends).mean() - np.clip(before - usual, *ends).mean()
        found = apart / deviation / math.sqrt(1.0 / newest + 1.0 / len(before))
        slower = math.expm1(float(np.median(now) - usual))
        if found > most and slower >= SLOWER:
            best, most = Drift(*done[0][:2], newest, len(before), slower, done[-newest].wall), found
    return best


def _failing(row: Sequence[ObservedAttempt]) -> Drift | None:
    """Compare how many of the newest attempts at a target fail with those before."""
    for newest in NEWEST:
        before, now = row[-newest - MOST_BEFORE : -newest], row[-newest:]
        failed, elsewhere = failed_of(now), failed_of(before)
        if len(before) >= BEFORE and fail_more(failed, newest, elsewhere, len(before), RARE):
            since = next(one.wall for one in now if one.code)
            return Drift(*row[0][:2], newest, len(before), math.inf, since, failed)
    return None
