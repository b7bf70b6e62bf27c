"""Builds the timeline of a run: lanes of states, phases, targets, operations, holds, live values, and events.

This is data; `timeline_svg` and `timeline_text` draw it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace

from lupin_engine.chart.model import Chart
from lupin_engine.errors import Severity
from lupin_engine.machine.step import Step
from lupin_engine.plugin.types import NUMBER
from lupin_engine.sim.narration import own_codes, rating
from lupin_engine.sim.simulation import Run, label_of


@dataclass(frozen=True)
class Bar:
    """An interval. `text` is its name, `outcome` how it ended, `detail` why.

    For a visit `rating` is the rating of its outcome (see `plugin.profile.Rating`).
    For an attempt `tries` counts from 1 and `wanted_until` is when it was cancelled, else its end.
    """

    begin: float
    end: float
    text: str
    outcome: str = ""
    detail: str = ""
    tries: int = 1
    wanted_until: float | None = None
    rating: str = ""

    @property
    def seconds(self) -> float:
        """Its duration."""
        return self.end - self.begin


@dataclass(frozen=True)
class Lane:
    """Bars of one kind, in order."""

    name: str
    bars: tuple[Bar, ...]


@dataclass(frozen=True)
class Curve:
    """A number over time: each value holds until the next one."""

    name: str
    points: tuple[tuple[float, float], ...]

    @property
    def bounds(self) -> tuple[float, float]:
        """The range to draw: 0 to 1 for a share, else that of the values."""
        values = [value for _, value in self.points]
        low, high = min(values), max(values)
        if low >= 0.0 and high <= 1.0:
            return 0.0, 1.0
        return (low, high) if low < high else (low - 1.0, high + 1.0)


@dataclass(frozen=True)
class Tick:
    """An external event, or a code that was reported, at one moment."""

    time: float
    text: str
    refused: bool = False
    is_error: bool = False


@dataclass(frozen=True)
class Timeline:
    """All lanes of a run."""

    title: str
    seconds: float
    states: Lane
    phases: Lane
    targets: Lane
    operations: tuple[Lane, ...]
    holds: tuple[Lane, ...]
    flags: tuple[Lane, ...]
    curves: tuple[Curve, ...]
    ticks: tuple[Tick, ...]


def timeline(run: Run) -> Timeline:
    """Return the timeline of a run."""
    return Timeline(
        title=run.view.mission,
        seconds=run.seconds,
        states=Lane("state", _spans(run, lambda step: label_of(run.chart, step.configuration))),
        phases=Lane("phase", _spans(run, lambda step: _phase(run.chart, step))),
        targets=Lane("target", _targets(run)),
        operations=tuple(_by_text(_attempts(run))),
        holds=tuple(_by_text(_holds(run))),
        flags=tuple(_flags(run)),
        curves=tuple(_curves(run)),
        ticks=tuple(_ticks(run)),
    )


# -- what lasts -------------------------------------------------------------------------------------------


def _spans(run: Run, what: Callable[[Step], str | None]) -> tuple[Bar, ...]:
    """Return the intervals of equal values of `what`; a step for which it is None changes nothing."""
    found: list[tuple[float, str]] = [(0.0, "")]
    for step in run.steps:
        text = what(step)
        if text is not None and text != found[-1][1]:
            found.append((step.time, text))
    ends = [begin for begin, _ in found[1:]] + [run.seconds]
    return tuple(
        Bar(begin, end, text) for (begin, text), end in zip(found, ends, strict=True) if text and end > begin
    )


def _phase(chart: Chart, step: Step) -> str:
    phases = (chart.states[name].phase for name in reversed(step.configuration))
    return next(filter(None, phases), "")


def _targets(run: Run) -> tuple[Bar, ...]:
    """Return the intervals of current targets; each bar ends as its visit did."""
    bars = list(_spans(run, lambda step: _target(run.chart, step)))
    for step, publish in run.history.published:
        for index, bar in enumerate(bars):
            if bar.text == publish.target and not bar.outcome and bar.begin <= step.time <= bar.end:
                means = rating(run.chart, publish.status)
                bars[index] = replace(
                    bar, outcome=publish.status, detail=publish.detail or publish.code, rating=means
                )
                break
    return tuple(bars)


def _target(chart: Chart, step: Step) -> str | None:
    """Return the target after a step; None where it is unchanged."""
    now = label_of(chart, step.configuration), _phase(chart, step)
    return next((m.target for m in reversed(step.trail) if (m.lifecycle, m.phase) == now), None)


def _attempts(run: Run) -> Iterator[Bar]:
    """Yield every attempt: from its start until the machine was done with it."""
    for attempt in run.history.attempts.values():
        yield Bar(
            begin=attempt.started,
            end=run.seconds if attempt.over is None else attempt.over,
            text=attempt.operation,
            outcome=attempt.outcome,
            detail=attempt.detail,
            tries=attempt.tries,
            wanted_until=attempt.cancelled,
        )


def _holds(run: Run) -> Iterator[Bar]:
    since: dict[str, float] = {}
    for time, held in (*run.history.held, (run.seconds, ())):
        for name in [name for name in since if name not in held]:
            yield Bar(since.pop(name), time, name)
        for name in held:
            since.setdefault(name, time)


def _by_text(bars: Iterable[Bar]) -> Iterator[Lane]:
    """Yield a lane for each name, in the order of first appearance."""
    lanes: dict[str, list[Bar]] = {}
    for bar in sorted(bars, key=lambda bar: (bar.begin, bar.end)):
        lanes.setdefault(bar.text, []).append(bar)
    for name, found in lanes.items():
        yield Lane(name, tuple(found))


# -- live values and what came from outside ---------------------------------------------------------------


def _reported(run: Run, name: str) -> Iterator[tuple[float, object]]:
    """Yield the reports of a live value with their times."""
    for step in run.steps:
        if step.event.name == "value" and step.event.data["name"] == name:
            yield step.time, step.event.data["value"]


def _flags(run: Run) -> Iterator[Lane]:
    """Yield the intervals in which boolean inputs were true."""
    for spec in run.chart.inputs.values():
        if spec.type.kind != "bool":
            continue
        points = [(0.0, spec.initial), *_reported(run, spec.value), (run.seconds, False)]
        since: float | None = None
        bars = []
        for time, value in points:
            if value is True and since is None:
                since = time
            elif value is not True and since is not None:
                bars.append(Bar(since, time, spec.name))
                since = None
        if bars:
            yield Lane(spec.name, tuple(bars))


def _curves(run: Run) -> Iterator[Curve]:
    """Yield the numeric inputs that have values."""
    for spec in run.chart.inputs.values():
        if spec.type.kind != NUMBER.kind:
            continue
        points = [(0.0, spec.initial), *_reported(run, spec.value)]
        known = tuple((time, float(v)) for time, v in points if isinstance(v, (int, float)))
        if known:
            yield Curve(spec.name, known)


def _ticks(run: Run) -> Iterator[Tick]:
    """Yield requests, events of plugins and clocks, and codes; those of holds and attempts have lanes."""
    lanes = {hold.code for hold in run.chart.holds.values()}
    for step in run.steps:
        name = step.event.name
        if step.accepted is not None:
            yield Tick(step.time, name.rpartition(".")[2], not step.accepted)
        elif name == "timer.at":
            yield Tick(step.time, str(step.event.data["time"]))
        elif name != "start" and name != "value" and name.partition(".")[0] not in ("attempt", "timer"):
            yield Tick(step.time, name)
        for code in own_codes(step)[name == "timer.timeout" :]:
            if code.code not in lanes:
                yield Tick(step.time, code.code, is_error=code.severity is Severity.ERROR)
