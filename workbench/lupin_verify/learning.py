"""Learns from journals: durations and failures by target, distance and hour, and the use of live values.

Everything is counted, nothing is fitted. A row has at least `ENOUGH` attempts that were done, or it is a
target or an hour that fails more than others. `table` returns the rows, the finest first, as the data of a
file of rates (see `rates`).
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from lupin_engine.chart import Chart
from lupin_engine.errors import LupinError
from lupin_engine.machine import Start, restore
from lupin_engine.plugin import READY, TIME_ZONE, Catalog
from lupin_engine.replay import JournaledRun, LivedStep, chart_of, replay_run, runs_of
from lupin_engine.runtime import UTC, History, calendar_of, history
from lupin_engine.sim import distance_of, is_pose

#: A row has so many attempts at least that were done.
ENOUGH = 5
#: A target, or an hour, fails more than others if chance brings its failures once in so many cases.
RARE_FAILURES = 10_000.0
#: The classes of distances begin at these metres.
CLASSES = (0.0, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 16.0, 24.0, 32.0, 64.0, 128.0)
#: How many quantiles a row has, and the slowest tenth of it.
QUANTILES, QUANTILES_OF_SLOW = 9, 4
#: A live value that rises by so much was charged.
CHARGED = 0.02
#: The losses of driving and of standing are separated if the robot stood for such a share of the time.
STANDING = 0.1


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
    """The attempts that a row is about; '' and None: any target, any distance, any hour."""

    operation: str
    target: str = ""
    metres: tuple[float, float] | None = None
    hour: int | None = None


@dataclass
class Drained:
    """The loss of a live value while the robot drove, and otherwise; times in minutes.

    Only drives that were done count as driving; what was lost during others is left out.
    """

    metres: float = 0.0
    driving: float = 0.0
    driving_lost: float = 0.0
    standing: float = 0.0
    standing_lost: float = 0.0

    @property
    def rates(self) -> tuple[float, float]:
        """The loss per metre and per minute; the first is 0 where the two cannot be separated."""
        minutes = self.driving + self.standing
        if self.metres and self.standing >= STANDING * minutes:
            per_minute = max(0.0, self.standing_lost / self.standing)
            per_metre = (self.driving_lost - per_minute * self.driving) / self.metres
            if per_metre >= 0.0:
                return per_metre, per_minute
        return 0.0, max(0.0, self.driving_lost + self.standing_lost) / minutes if minutes else 0.0


@dataclass
class Evidence:
    """The contents of a journal; `left_out` are the files and missions that were not used, and why.

    `parameters` and `values` (the pose at its beginning) are those of the newest mission.
    """

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
        report(f"reading mission {number} of {len(runs)}")
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
        self._found, self._run, self._chart = found, run, chart
        self._drains = {spec.value for spec in chart.inputs.values() if spec.levels}
        self._pose: Any = None
        self._values: dict[str, Any] = {}
        #: The target and the metres of each attempt, and the drive that is under way; '' for none.
        self._begun: dict[str, tuple[str, float | None]] = {}
        self._drive = ""
        #: The last time and level of each value that drains; its minutes and losses during each drive.
        self._levels: dict[str, tuple[float, float]] = {}
        self._spent: dict[tuple[str, str], tuple[float, float]] = {}

    def take(self, lived: Sequence[LivedStep]) -> None:
        """Read the steps of the mission."""
        head, steps, target = self._run.files[0].head, History(), ""
        for name, known in restore(self._chart, head.snapshot).inputs.items() if head.snapshot else ():
            if known.reported and name in self._chart.inputs:
                self._report(self._chart.inputs[name].value, known.value, 0.0)
        for each in lived:
            step, data = each.step, each.step.event.data
            if step.event.name == "value":
                self._report(data["name"], data["value"], step.time)
            target = step.trail[-1].target if step.trail else target
            for command in step.commands:
                if isinstance(command, Start) and command.operation != READY:
                    self._begin(command, target)
            steps.take(step, each.held)
            if self._drive and steps.attempts[self._drive].over is not None:
                self._drive = ""
        self._add(steps)
        defaults = self._chart.parameters
        given = {n: v for n, v in head.parameters.items() if n in defaults and v != defaults[n].default}
        self._found.parameters, self._found.values = given, self._values

    def _report(self, name: str, value: Any, time: float) -> None:
        if is_pose(self._chart.catalog, name) and value is not None:
            self._pose = value
            self._values.setdefault(name, {axis: round(value[axis], 3) for axis in value})
        elif name in self._drains and isinstance(value, (int, float)):
            since, level = self._levels.get(name, (time, value))
            self._levels[name] = time, value
            if value <= level + CHARGED:
                minutes, lost = self._spent.get((name, self._drive), (0.0, 0.0))
                self._spent[name, self._drive] = minutes + (time - since) / 60.0, lost + level - value

    def _begin(self, command: Start, target: str) -> None:
        if command.updates in self._begun:
            self._begun[command.attempt] = self._begun.pop(command.updates)
            self._drive = command.attempt if self._drive == command.updates else self._drive
            return
        operation = self._chart.catalog.operations[command.operation]
        metres = distance_of(operation, command.arguments, self._pose)
        self._begun[command.attempt] = target, metres
        if metres is not None:
            self._drive = command.attempt

    def _add(self, steps: History) -> None:
        """Add the attempts that ended by themselves, and what live values lost during them."""
        found, run, done = self._found, self._run, dict[str, float | None]()
        calendar = calendar_of(run.files[0].head.parameters.get(TIME_ZONE, UTC))
        for name, (target, metres) in self._begun.items():
            attempt = steps.attempts[name]
            outcome, is_late = attempt.outcome, attempt.late and not attempt.timed_out
            if attempt.over is None or is_late or outcome in (history.CANCELLED, history.OPEN):
                continue
            codes = {history.DONE: "", history.FAILED: str(attempt.data.get("code", ""))}
            code, wall = codes.get(outcome, history.TIMED_OUT), run.began + attempt.started
            seconds, hour = attempt.over - attempt.started, calendar.hour(wall)
            found.seen.append(ObservedAttempt(attempt.operation, target, metres, hour, wall, seconds, code))
            if not code:
                done[name] = metres
        for (value, drive), (minutes, lost) in self._spent.items():
            sums = found.drained[value]
            if not drive:
                sums.standing += minutes
                sums.standing_lost += lost
            elif drive in done:
                sums.driving += minutes
                sums.driving_lost += lost
                sums.metres += done[drive] or 0.0
        found.missions += 1
        found.first = found.first or " ".join(calendar.shown(run.began))
        found.last = " ".join(calendar.shown(run.last))


# -- rows ------------------------------------------------------------------------------------------------


def places(one: ObservedAttempt) -> Iterator[RateKey]:
    """Yield the rows that an attempt belongs to, the finest first."""
    metres = None
    if one.metres is not None:
        after = bisect_right(CLASSES, one.metres)
        metres = CLASSES[after - 1], CLASSES[after] if after < len(CLASSES) else math.inf
    for target, distance in dict.fromkeys(((one.target, metres), ("", metres), ("", None))):
        yield RateKey(one.operation, target, distance, one.hour)
        yield RateKey(one.operation, target, distance)


def rows_of(seen: Iterable[ObservedAttempt]) -> dict[RateKey, list[ObservedAttempt]]:
    """Return the attempts of each row that has `ENOUGH` that were done; failed ones are in it, too."""
    rows = defaultdict[RateKey, list[ObservedAttempt]](list)
    for one in seen:
        for place in places(one):
            rows[place].append(one)
    return {place: row for place, row in rows.items() if len(row) - failed_of(row) >= ENOUGH}


def failed_of(row: Iterable[ObservedAttempt]) -> int:
    """Return how many attempts failed or timed out."""
    return sum(bool(one.code) for one in row)


def fail_more(failed: int, count: int, elsewhere: int, others: int, rare: float = RARE_FAILURES) -> bool:
    """Say whether so many of `count` fail that the share of failures among others does not explain it.

    Args:
        elsewhere: how many of the `others` failed; at least one is assumed.
        rare: chance may bring so many once in that many cases.
    """
    usual = max(elsewhere, 1) / max(others, 2)
    fewer = (math.comb(count, k) * usual**k * (1.0 - usual) ** (count - k) for k in range(failed))
    return failed > 0 and (1.0 - sum(fewer)) * rare < 1.0


def worse_of(seen: Iterable[ObservedAttempt]) -> dict[RateKey, list[ObservedAttempt]]:
    """Return the attempts at each target, and in each hour, that fail more than the rest of their operation.

    The key of an operation alone has the attempts that belong to none of these.

    A few attempts say how long they take, but not how often they fail: what does not differ is pooled.
    """
    rows, found = defaultdict[RateKey, list[ObservedAttempt]](list), dict[RateKey, list[ObservedAttempt]]()
    for one in seen:
        for place in {RateKey(one.operation), *_parts(one)}:
            rows[place].append(one)
    for place, row in rows.items():
        whole, failed = rows[RateKey(place.operation)], failed_of(row)
        if fail_more(failed, len(row), failed_of(whole) - failed, len(whole) - len(row)) and row != whole:
            found[place] = row
    alike = {
        p: [o for o in row if not found.keys() & {*_parts(o)}]
        for p, row in rows.items()
        if p == RateKey(p[0])
    }
    return {**found, **alike}


def _parts(one: ObservedAttempt | RateKey) -> tuple[RateKey, RateKey]:
    return RateKey(one.operation, one.target), RateKey(one.operation, hour=one.hour)


# -- the file ----------------------------------------------------------------------------------------------


def table(found: Evidence) -> dict[str, Any]:
    """Return the evidence as the data of a file of rates."""
    counts = defaultdict[str, Counter[str]](Counter)
    for one in found.seen:
        counts[one.operation][one.target] += 1
    learned = {
        "missions": found.missions,
        "from": found.first,
        "to": found.last,
        "parameters": dict(found.parameters),
        "values": dict(found.values),
        "seen": {name: dict(sorted(row.items(), key=_by_number)) for name, row in sorted(counts.items())},
    }
    rows, worse = rows_of(found.seen), worse_of(found.seen)
    for place, row in worse.items():
        if place != RateKey(place.operation):  # also where it was never reached from so far, or never at all
            rows.setdefault(place, row)
    return {
        "campaign": f"learned from {found.missions} missions, {found.first[:10]} to {found.last[:10]}",
        "defaults": False,
        "learned": {key: said for key, said in learned.items() if said != {}},
        "mocks": [_mock(place, row, worse) for place, row in sorted(rows.items(), key=_finest_first)],
        "drain": [_drained(name, drained) for name, drained in sorted(found.drained.items())],
    }


def _by_number(item: tuple[str, Any]) -> tuple[int, str]:
    return (int(item[0]) if item[0].isdecimal() else 10**9, item[0])


def _finest_first(item: tuple[RateKey, Any]) -> tuple[Any, ...]:
    operation, target, metres, hour = item[0]
    whole = (not target, metres is None)
    return (operation, *whole, *_by_number((target, 0)), metres or (0.0, 0.0), hour is None, hour)


def _mock(
    place: RateKey, row: Sequence[ObservedAttempt], worse: Mapping[RateKey, Sequence[ObservedAttempt]]
) -> dict[str, Any]:
    said: dict[str, Any] = {"do": place.operation}
    if place.target:
        said["target"] = place.target
    if place.metres is not None:
        said["metres"] = {"between": [min(bound, 1e6) for bound in place.metres]}
    if place.hour is not None:
        said["hour"] = place.hour
    pool = next(worse[part] for part in (*_parts(place), RateKey(place.operation)) if part in worse)
    outcomes = list(_outcomes([one.seconds for one in row if not one.code], pool))
    only = {key: value for key, value in outcomes[0].items() if key != "weight"}
    return {**said, "then": only if len(outcomes) == 1 else {"any_of": outcomes}}


def _outcomes(done: Sequence[float], pool: Sequence[ObservedAttempt]) -> Iterator[dict[str, Any]]:
    """Yield how attempts end, weighted by how many did; failures by their share in a pool."""
    failures = defaultdict[str, list[float]](list)
    for one in pool:
        failures[one.code].append(one.seconds)
    finished = len(failures.pop("", ()))
    share = len(done) / finished if done and finished else 1.0
    for count, quantiles in bands(done) if done else ():
        yield {"weight": count, "after": _after(quantiles)}
    for code, took in sorted(failures.items()):
        weight = len(took) * share
        if code == history.TIMED_OUT:
            yield {"weight": float(f"{weight:.3g}"), "never": True}
            continue
        for count, quantiles in bands(took):
            part = float(f"{weight * count / len(took):.3g}")
            yield {"weight": part, "fail": code, "after": _after(quantiles)}


def _after(quantiles: Iterable[float]) -> Any:
    texts = [f"{round(seconds, 2 if seconds < 10.0 else 1):.10g} s" for seconds in quantiles]
    return texts[0] if len(set(texts)) == 1 else {"between": texts}


def bands(took: Iterable[float]) -> Iterator[tuple[int, list[float]]]:
    """Yield durations as counts with quantiles: the faster ones, and the slowest tenth apart.

    Up to `QUANTILES` durations are one band, with themselves in place of quantiles.
    """
    ordered = sorted(took)
    if len(ordered) <= QUANTILES:
        yield len(ordered), ordered
        return
    slow = math.ceil(len(ordered) / 10)
    fast, slowest = ordered[:-slow], ordered[-slow - 1 :]
    yield len(fast), np.quantile(fast, np.linspace(0.0, 1.0, QUANTILES)).tolist()
    yield slow, np.quantile(slowest, np.linspace(0.0, 1.0, min(QUANTILES_OF_SLOW, len(slowest)))).tolist()


def percent(share: float) -> str:
    """Return a share in per cent, with three digits that count."""
    return f"{float(f'{100.0 * share:.3g}'):.10g} %"


def _drained(name: str, found: Drained) -> dict[str, Any]:
    per_metre, per_minute = found.rates
    driving = {"per_metre": percent(per_metre)} if per_metre else {}
    minutes = found.driving + found.standing
    rates = {"value": name, **driving, "per_minute": percent(per_minute)}
    return {**rates, "metres": round(found.metres, 1), "minutes": round(minutes, 1)}
