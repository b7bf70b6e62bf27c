"""Learns from journals: durations and failures of attempts by place and hour, and the use of live values.

Everything is counted, nothing is fitted. A row has at least `ENOUGH` attempts; `table` writes the rows as a
file of rates (`rates`), the finest first.
"""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from itertools import accumulate
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

from lupin_engine.chart import Chart
from lupin_engine.errors import LupinError
from lupin_engine.machine import Start, restore
from lupin_engine.plugin import READY, TIME_ZONE, Catalog
from lupin_engine.replay import JournaledRun, LivedStep, chart_of, replay_run, runs_of
from lupin_engine.runtime import UTC, History, calendar_of, history
from lupin_engine.sim import distance_of, is_pose

#: A row has so many attempts at least.
ENOUGH = 5
#: An hour is compared that has so many; it differs by so many standard errors and by such a share.
ENOUGH_OF_HOUR, ERRORS, SHARE = 20, 4.0, 0.05
#: A target, or an hour, fails more than others whose failures chance brings once in so many.
RARE_FAILURES = 10_000.0
#: The classes of distances begin at these metres.
CLASSES = (0.0, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 16.0, 24.0, 32.0, 64.0, 128.0)
#: How many quantiles a row has, and the slowest tenth of it.
QUANTILES, QUANTILES_OF_SLOW = 9, 4
#: A live value that rises by so much was charged; one is told apart by driving with such a share of standing.
CHARGED, STANDING = 0.02, 0.1


class ObservedAttempt(NamedTuple):
    """One attempt: `code` is '' for done, TIMED_OUT, or that of its failure; `wall` when it began."""

    operation: str
    target: str
    metres: float | None
    hour: int
    wall: float
    seconds: float
    code: str


class RateKey(NamedTuple):
    """The attempts of a row; '' and None: any target, any distance."""

    operation: str
    target: str = ""
    metres: tuple[float, float] | None = None


@dataclass
class Drained:
    """The loss of a live value while the robot drove, and otherwise."""

    metres: float = 0.0
    driving: float = 0.0
    driving_lost: float = 0.0
    standing: float = 0.0
    standing_lost: float = 0.0

    @property
    def rates(self) -> tuple[float, float]:
        """The loss per metre and per minute; per minute alone where the two cannot be separated."""
        minutes = self.driving + self.standing
        if self.metres and self.standing >= STANDING * minutes:
            per_minute = max(0.0, self.standing_lost / self.standing)
            per_metre = (self.driving_lost - per_minute * self.driving) / self.metres
            if per_metre >= 0.0:
                return per_metre, per_minute
        return 0.0, max(0.0, self.driving_lost + self.standing_lost) / minutes if minutes else 0.0


@dataclass
class Evidence:
    """The contents of a journal; `left_out` are the files and missions that were not used, and why."""

    seen: list[ObservedAttempt] = field(default_factory=list)
    drained: dict[str, Drained] = field(default_factory=lambda: defaultdict(Drained))
    missions: int = 0
    first: str = ""
    last: str = ""
    parameters: Mapping[str, Any] = field(default_factory=dict)
    values: Mapping[str, Any] = field(default_factory=dict)
    left_out: list[str] = field(default_factory=list)


# -- reading journals --------------------------------------------------------------------------------------


def gather(folder: Path, catalog: Catalog, report: Callable[[str], object] = lambda text: None) -> Evidence:
    """Read the missions of a journal; `report` is called with the progress as text.

    Raises:
        JournalError: there is no journal.
    """
    found, charts = Evidence(), dict[str, Chart]()
    runs = [run for run in runs_of(folder, found.left_out.append) if run.mission_id]
    for number, run in enumerate(runs, 1):
        report(f"mission {number} of {len(runs)}")
        damaged = [file.problem for file in run.files if file.damaged]
        found.left_out += damaged
        try:
            if not damaged:
                key = run.files[0].head.chart
                charts[key] = charts.get(key) or chart_of(run, catalog).chart
                _MissionReader(found, run, charts[key]).take(replay_run(run, charts[key])[0])
        except LupinError as problem:
            found.left_out.append(f"{run.mission} {run.mission_id}: {problem}".splitlines()[0])
    return found


class _MissionReader:
    """Adds one mission to the evidence."""

    def __init__(self, found: Evidence, run: JournaledRun, chart: Chart) -> None:
        self._found = found
        self._run = run
        self._chart = chart
        self._catalog = chart.catalog
        self._drains = [spec.value for spec in chart.inputs.values() if spec.levels]
        self._calendar = calendar_of(run.files[0].head.parameters.get(TIME_ZONE, UTC))
        self._pose: Any = None
        self._values: dict[str, Any] = {}
        #: The first report and the newest one of each value that drains, with their times; whether it rose.
        self._levels: dict[str, list[tuple[float, float]]] = {}
        self._charged: set[str] = set()
        #: Each attempt's target, metres, and the levels at its start; and those at its end.
        self._begun: dict[str, tuple[str, float | None, dict[str, float]]] = {}
        self._over: dict[str, dict[str, float]] = {}
        head = run.files[0].head
        for name, known in restore(chart, head.snapshot).inputs.items() if head.snapshot else ():
            if known.reported and name in chart.inputs:
                self._report(chart.inputs[name].value, known.value, 0.0)

    def take(self, lived: Sequence[LivedStep]) -> None:
        """Read the steps of the mission."""
        steps, target = History(), ""
        for each in lived:
            step, data = each.step, each.step.event.data
            if step.event.name == "value":
                self._report(data["name"], data["value"], step.time)
            elif step.event.name.startswith("attempt.") and data.get("attempt") in self._begun:
                self._over[data["attempt"]] = self._now()
            target = step.trail[-1].target if step.trail else target
            for command in step.commands:
                if isinstance(command, Start) and command.operation != READY:
                    operation = self._catalog.operations[command.operation]
                    metres = distance_of(operation, command.arguments, self._pose)
                    self._begun[command.attempt] = target, metres, self._now()
            steps.take(step, each.held)
        self._add(steps, lived[-1].step.time / 60.0 if lived else 0.0)

    def _report(self, name: str, value: Any, time: float) -> None:
        if is_pose(self._catalog, name) and value is not None:
            self._pose = value
            self._values.setdefault(name, {axis: round(value[axis], 3) for axis in value})
        elif name in self._drains and isinstance(value, (int, float)):
            levels = self._levels.setdefault(name, [(time, value)])
            if value > levels[-1][1] + CHARGED:
                self._charged.add(name)
            levels[1:] = [(time, value)]

    def _now(self) -> dict[str, float]:
        return {name: levels[-1][1] for name, levels in self._levels.items()}

    def _add(self, steps: History, minutes: float) -> None:
        found, head = self._found, self._run.files[0].head
        drives = list[tuple[str, float, float | None]]()
        for name, attempt in steps.attempts.items():
            if name not in self._begun or attempt.over is None:
                continue
            target, metres, _ = self._begun[name]
            is_done = attempt.outcome == history.DONE and not attempt.late
            if metres is not None:
                drives.append((name, (attempt.over - attempt.started) / 60.0, metres if is_done else None))
            outcome = attempt.outcome
            cut_short = attempt.late and outcome != history.TIMED_OUT
            if cut_short or outcome in (history.CANCELLED, history.OPEN):
                continue
            codes = {history.DONE: "", history.FAILED: str(attempt.data.get("code", ""))}
            code = codes.get(outcome, history.TIMED_OUT)
            wall = self._run.began + attempt.started
            hour, seconds = self._calendar.hour(wall), attempt.over - attempt.started
            found.seen.append(ObservedAttempt(attempt.operation, target, metres, hour, wall, seconds, code))
        for value in self._levels.keys() - self._charged:
            self._drain(value, drives, minutes)
        found.missions += 1
        found.first = found.first or " ".join(self._calendar.shown(self._run.began))
        found.last = " ".join(self._calendar.shown(self._run.last))
        defaults = self._chart.parameters
        given = {n: v for n, v in head.parameters.items() if n in defaults and v != defaults[n].default}
        found.parameters, found.values = given, self._values

    def _drain(self, value: str, drives: Iterable[tuple[str, float, float | None]], minutes: float) -> None:
        """Add the loss of a value, with its time and metres."""
        (_, first), (_, last) = self._levels[value][0], self._levels[value][-1]
        sum_of, lost = self._found.drained[value], first - last
        for name, took, metres in drives:
            before = self._begun[name][2].get(value, first)
            used = before - self._over.get(name, self._now()).get(value, before)
            lost, minutes = lost - used, minutes - took
            if metres is not None:
                sum_of.metres += metres
                sum_of.driving += took
                sum_of.driving_lost += used
        sum_of.standing += max(0.0, minutes)
        sum_of.standing_lost += lost


# -- rows ------------------------------------------------------------------------------------------------


def places(one: ObservedAttempt) -> Iterator[RateKey]:
    """Yield the rows that an attempt belongs to, the finest first."""
    metres = None
    if one.metres is not None:
        after = bisect_right(CLASSES, one.metres)
        metres = CLASSES[after - 1], CLASSES[after] if after < len(CLASSES) else math.inf
    if one.target:
        yield RateKey(one.operation, one.target, metres)
    if metres is not None:
        yield RateKey(one.operation, "", metres)
    yield RateKey(one.operation)


def rows_of(seen: Iterable[ObservedAttempt]) -> dict[RateKey, list[ObservedAttempt]]:
    """Return the attempts of each row that has enough."""
    rows = defaultdict[RateKey, list[ObservedAttempt]](list)
    for one in seen:
        for place in places(one):
            rows[place].append(one)
    return {place: row for place, row in rows.items() if sum(not one.code for one in row) >= ENOUGH}


def shares_of(seen: Sequence[ObservedAttempt], at_target: bool = True) -> list[float]:
    """Return how long each attempt took, as a share of the median of its row; of a failure, infinity.

    Args:
        at_target: whether rows of one target count; else all targets are compared.
    """
    rows = rows_of(seen)
    usual = {
        place: median(took) for place, row in rows.items() if (took := [o.seconds for o in row if not o.code])
    }
    shares = []
    for one in seen:
        known = (usual[p] for p in places(one) if p in usual and (at_target or not p.target))
        shares.append(math.inf if one.code else one.seconds / (next(known, one.seconds) or 1.0))
    return shares


@dataclass(frozen=True)
class Hour:
    """Attempts of an operation in an hour of the day, and the shares where these differ from the others."""

    operation: str
    hour: int
    seen: int
    failed: int
    takes: float = 1.0
    fails: float = 1.0


def hours_of(seen: Sequence[ObservedAttempt]) -> list[Hour]:
    """Return each hour of the day, compared with the others."""
    shares = defaultdict[str, dict[int, list[float]]](lambda: defaultdict(list))
    for one, share in zip(seen, shares_of(seen), strict=True):
        shares[one.operation][one.hour].append(share)
    found = []
    for operation, by_hour in sorted(shares.items()):
        for hour, mine in sorted(by_hour.items()):
            others = [share for other, row in by_hour.items() if other != hour for share in row]
            failed = sum(map(math.isinf, mine))
            takes, fails = 1.0, 1.0
            if min(len(mine), len(others)) >= ENOUGH_OF_HOUR:
                takes, fails = _takes(_finite(mine), _finite(others)), _fails(mine, others)
            found.append(Hour(operation, hour, len(mine), failed, takes, fails))
    return found


def _finite(shares: Iterable[float]) -> list[float]:
    return sorted(share for share in shares if share < math.inf)


def _takes(mine: Sequence[float], others: Sequence[float]) -> float:
    """Return how long sorted shares are beside others; 1 where chance explains it (a rank sum)."""
    m, n = len(mine), len(others)
    if not m or not n:
        return 1.0
    below = sum(bisect_left(others, one) + bisect_right(others, one) for one in mine) / 2.0
    errors = (below - m * n / 2.0) / math.sqrt(m * n * (m + n + 1) / 12.0)
    share = median(mine) / median(others)
    return round(share, 3) if abs(errors) > ERRORS and abs(share - 1.0) > SHARE else 1.0


def _fails(mine: Sequence[float], others: Sequence[float]) -> float:
    """Return how often attempts fail beside all; 1 where chance explains it."""
    failed, elsewhere = sum(map(math.isinf, mine)), sum(map(math.isinf, others))
    if not fail_more(failed, len(mine), elsewhere, len(others)):
        return 1.0
    return round(failed / len(mine) * (len(mine) + len(others)) / (failed + elsewhere), 3)


def fail_more(failed: int, count: int, elsewhere: int, others: int, rare: float = RARE_FAILURES) -> bool:
    """Say whether so many of `count` fail that the share of failures among `others` does not explain it.

    Args:
        rare: chance may bring so many once in that many cases.
    """
    usual = max(elsewhere, 1) / max(others, 2)
    fewer = (math.comb(count, k) * usual**k * (1.0 - usual) ** (count - k) for k in range(failed))
    return failed > 0 and (1.0 - sum(fewer)) * rare < 1.0


class Failures(NamedTuple):
    """The failures of a target that fails more than others, or of all others together; and what was done."""

    done: int
    by_code: Mapping[str, Sequence[float]]


def failures_of(seen: Sequence[ObservedAttempt]) -> dict[tuple[str, str], Failures]:
    """Return the failures at each target of each operation, and under '' those of all that are like others.

    A few attempts say how long they take, but not how often they fail: what does not differ is pooled.
    """
    by_place, totals = defaultdict[tuple[str, str], list[ObservedAttempt]](list), Counter[tuple[str, bool]]()
    for one in seen:
        by_place[one.operation, one.target].append(one)
        totals[one.operation, bool(one.code)] += 1
    found, pools = dict[tuple[str, str], Failures](), defaultdict[str, list[ObservedAttempt]](list)
    for (operation, target), row in by_place.items():
        failed = sum(1 for one in row if one.code)
        elsewhere = totals[operation, True] - failed
        others = elsewhere + totals[operation, False] - (len(row) - failed)
        if target and fail_more(failed, len(row), elsewhere, others):
            found[operation, target] = _failures(row)
        else:
            pools[operation] += row
    found |= {(operation, ""): _failures(row) for operation, row in pools.items()}
    return found


def _failures(row: Iterable[ObservedAttempt]) -> Failures:
    by_code, done = defaultdict[str, list[float]](list), 0
    for one in row:
        done += not one.code
        if one.code:
            by_code[one.code].append(one.seconds)
    return Failures(done, by_code)


# -- the file ----------------------------------------------------------------------------------------------


def table(found: Evidence) -> dict[str, Any]:
    """Return the evidence as the data of a file of rates."""
    hours = hours_of(found.seen)
    takes = {(one.operation, one.hour): one.takes for one in hours}
    seen = [one._replace(seconds=one.seconds / takes[one.operation, one.hour]) for one in found.seen]
    counts = defaultdict[str, Counter[str]](Counter)
    for one in seen:
        counts[one.operation][one.target] += 1
    learned = {
        "missions": found.missions,
        "from": found.first,
        "to": found.last,
        "parameters": dict(found.parameters),
        "values": dict(found.values),
        "seen": {name: dict(sorted(row.items(), key=_by_number)) for name, row in sorted(counts.items())},
    }
    rows, failures = rows_of(seen), failures_of(seen)
    for operation, target in failures:
        if target:  # also where it was never reached from so far, or never at all
            here = [one for one in seen if (one.operation, one.target) == (operation, target)]
            rows.setdefault(RateKey(operation, target), here)
    return {
        "campaign": f"learned from {found.missions} missions, {found.first[:10]} to {found.last[:10]}",
        "defaults": False,
        "learned": {key: said for key, said in learned.items() if said != {}},
        "mocks": [_mock(place, row, failures) for place, row in sorted(rows.items(), key=_finest_first)],
        "hours": list(map(_hour, hours)),
        "drain": [_drained(name, drained) for name, drained in sorted(found.drained.items())],
    }


def _by_number(item: tuple[str, Any]) -> tuple[int, str]:
    return (int(item[0]) if item[0].isdecimal() else 10**9, item[0])


def _finest_first(item: tuple[RateKey, Any]) -> tuple[Any, ...]:
    place = item[0]
    whole = (not place.target, place.metres is None)
    return (place.operation, *whole, *_by_number((place.target, 0)), place.metres or (0.0, 0.0))


def _mock(
    place: RateKey, row: Sequence[ObservedAttempt], failures: Mapping[tuple[str, str], Failures]
) -> dict[str, Any]:
    said: dict[str, Any] = {"do": place.operation}
    if place.target:
        said["target"] = place.target
    if place.metres is not None:
        said["metres"] = {"between": [min(bound, 1e6) for bound in place.metres]}
    pool = failures.get((place.operation, place.target)) or failures.get((place.operation, ""))
    outcomes = list(_outcomes([one.seconds for one in row if not one.code], pool or _failures(row)))
    only = {key: value for key, value in outcomes[0].items() if key != "weight"}
    return {**said, "then": only if len(outcomes) == 1 else {"any_of": outcomes}}


def _outcomes(done: Sequence[float], failures: Failures) -> Iterator[dict[str, Any]]:
    """Yield how attempts end, weighted by how many did; failures by their share where they are pooled."""
    share = len(done) / failures.done if done and failures.done else 1.0
    for count, quantiles in bands(done) if done else ():
        yield {"weight": count, "after": _after(quantiles)}
    for code, took in sorted(failures.by_code.items()):
        weight = float(f"{len(took) * share:.3g}")
        if code == history.TIMED_OUT:
            yield {"weight": weight, "never": True}
            continue
        for count, quantiles in bands(took):
            part = float(f"{weight * count / len(took):.3g}")
            yield {"weight": part, "fail": code, "after": _after(quantiles)}


def _after(quantiles: Iterable[float]) -> Any:
    texts = list(map(seconds_text, quantiles))
    return texts[0] if len(set(texts)) == 1 else {"between": texts}


def bands(took: Iterable[float]) -> Iterator[tuple[int, list[float]]]:
    """Yield durations as counts with quantiles: all where they are few, else the slowest tenth apart."""
    ordered = sorted(took)
    if len(ordered) <= QUANTILES:
        yield len(ordered), ordered
        return
    slow = math.ceil(len(ordered) / 10)
    yield len(ordered) - slow, _quantiles(ordered[:-slow], QUANTILES)
    yield slow, _quantiles(ordered[-slow - 1 :], QUANTILES_OF_SLOW)


def _quantiles(ordered: Sequence[float], most: int) -> list[float]:
    count = min(most, len(ordered))
    return [quantile(ordered, number / (count - 1)) for number in range(count)]


def quantile(ordered: Sequence[float], share: float) -> float:
    """Return a quantile of sorted values, interpolated between neighbours; `share` is 0 to 1."""
    place = share * (len(ordered) - 1)
    low = min(int(place), max(0, len(ordered) - 2))
    high = min(low + 1, len(ordered) - 1)
    return ordered[low] + (place - low) * (ordered[high] - ordered[low])


def seconds_text(seconds: float) -> str:
    """Return a duration as files say it."""
    return f"{round(seconds, 2 if seconds < 10.0 else 1):.10g} s"


def _hour(one: Hour) -> dict[str, Any]:
    said: dict[str, Any] = {"do": one.operation, "hour": one.hour, "seen": one.seen, "failed": one.failed}
    shares = {"takes": one.takes, "fails": one.fails}
    return {**said, **{key: percent(share) for key, share in shares.items() if share != 1.0}}


def percent(share: float) -> str:
    """Return a share in per cent, with three digits that count."""
    return f"{float(f'{100.0 * share:.3g}'):.10g} %"


def _drained(name: str, found: Drained) -> dict[str, Any]:
    per_metre, per_minute = found.rates
    driving = {"per_metre": percent(per_metre)} if per_metre else {}
    minutes = found.driving + found.standing
    rates = {"value": name, **driving, "per_minute": percent(per_minute)}
    return {**rates, "metres": round(found.metres, 1), "minutes": round(minutes, 1)}


# -- drift -------------------------------------------------------------------------------------------------

#: The newest attempts at a target are compared with those before: so many at least, and so many at most.
NEWEST, BEFORE, MOST_BEFORE = range(3, 11), 20, 100
#: What chance does once in so many comparisons is told, where the median is slower by such a share.
RARE, SLOWER = 50_000.0, 0.2


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
    rows, by_target = rows_of(seen), defaultdict[tuple[str, str], list[tuple[float, float]]](list)
    coarse = defaultdict[tuple[str, str], list[float]](list)
    both = list(zip(seen, shares_of(seen), shares_of(seen, at_target=False), strict=True))
    for one, _, share in both:
        coarse[one.operation, one.target] += [share] if share < math.inf else []
    usual = {target: median(shares) for target, shares in coarse.items() if shares}
    for one, share, beside in both:  # where its row is too small, beside what is usual at this target
        target = one.operation, one.target
        share = share if next(places(one)) in rows else beside / usual.get(target, 1.0)
        by_target[target].append((one.wall, share))
    found = (_drift(place, sorted(row)) for place, row in sorted(by_target.items()))
    return [one for one in found if one is not None]


def _drift(place: tuple[str, str], row: Sequence[tuple[float, float]]) -> Drift | None:
    """Compare the newest attempts with those before: how many fail, else how long the others take."""
    for newest in reversed(NEWEST):
        before, now = row[-newest - MOST_BEFORE : -newest], row[-newest:]
        failed, elsewhere = (sum(math.isinf(share) for _, share in some) for some in (now, before))
        enough = len(before) >= BEFORE and math.isinf(now[0][1])
        if enough and fail_more(failed, newest, elsewhere, len(before), RARE):
            return Drift(*place, newest, len(before), math.inf, now[0][0], failed)
    done = [one for one in row if one[1] < math.inf]
    best = (1.0, 0)
    for newest in NEWEST:
        shares = [share for _, share in done[-newest - MOST_BEFORE :]]
        before_it = shares[:-newest]
        if len(before_it) >= BEFORE:
            as_slow = sum(one >= new for new in shares[-newest:] for one in before_it)
            best = min(best, (chance_of(as_slow, len(before_it), newest), newest))
    newest = best[1]
    if best[0] * RARE > 1.0:
        return None
    shares = [share for _, share in done[-newest - MOST_BEFORE :]]
    slower = median(shares[-newest:]) / median(shares[:-newest]) - 1.0
    if slower < SLOWER:
        return None
    return Drift(*place, newest, len(shares) - newest, slower, done[-newest][0])


@cache
def _orders(before: int, newest: int) -> list[int]:
    """Return how many orders of attempts have so many pairs in which an earlier one is slower, summed up."""
    ways = [1] + [0] * (before * newest)
    for number in range(1, newest + 1):
        for pairs in range(number, len(ways)):
            ways[pairs] += ways[pairs - number]
        for pairs in range(len(ways) - 1, before + number - 1, -1):
            ways[pairs] -= ways[pairs - before - number]
    return list(accumulate(ways))


def chance_of(pairs: int, before: int, newest: int) -> float:
    """Return how likely chance leaves so few pairs with the earlier attempt slower: an exact rank sum."""
    return _orders(before, newest)[pairs] / math.comb(before + newest, newest)
