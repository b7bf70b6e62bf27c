"""A run as lanes over time: states, phases, targets, operations, holds, live values, what came from outside.

This is what was, in numbers and words; `timeline_svg` and `timeline_text` draw it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace

from lupin_engine.chart.model import Chart
from lupin_engine.machine.event import Cancel, Publish, Start
from lupin_engine.machine.step import Step
from lupin_engine.plugin.types import NUMBER
from lupin_engine.sim.simulation import Run, label_of

#: How an attempt can end, beside the codes of its operation.
DONE, FAILED, CANCELLED, TIMED_OUT, OPEN = "done", "failed", "cancelled", "timed out", "open"


@dataclass(frozen=True)
class Bar:
    """Something that lasted. `text` is what it was, `outcome` how it ended, `detail` why.

    For an attempt `tries` counts from 1 and `wanted_until` is when it was cancelled, else its end.
    """

    begin: float
    end: float
    text: str
    outcome: str = ""
    detail: str = ""
    tries: int = 1
    wanted_until: float | None = None

    @property
    def seconds(self) -> float:
        """How long it lasted."""
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
        """The range to draw: 0 to 1 for a share, else what came."""
        values = [value for _, value in self.points]
        low, high = min(values), max(values)
        if low >= 0.0 and high <= 1.0:
            return 0.0, 1.0
        return (low, high) if low < high else (low - 1.0, high + 1.0)


@dataclass(frozen=True)
class Tick:
    """Something that came from outside, at one moment."""

    time: float
    text: str
    refused: bool = False


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
    """Return what a run looked like over time."""
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
        ticks=tuple(_ticks(run.steps)),
    )


# -- what lasts -------------------------------------------------------------------------------------------


def _spans(run: Run, what: Callable[[Step], str | None]) -> tuple[Bar, ...]:
    """Return for how long it was what; a step for which that is None changes nothing."""
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
    """Return when the robot was about which target; each bar ends as its visit did."""
    bars = list(_spans(run, lambda step: _target(run.chart, step)))
    for time, publish in run.published:
        for index, bar in enumerate(bars):
            if bar.text == publish.target and not bar.outcome and bar.begin <= time <= bar.end:
                bars[index] = replace(bar, outcome=publish.status, detail=_reason(publish))
                break
    return tuple(bars)


def _target(chart: Chart, step: Step) -> str | None:
    """Return the target after a step, None where it is as before."""
    now = label_of(chart, step.configuration), _phase(chart, step)
    return next((m.target for m in reversed(step.trail) if (m.lifecycle, m.phase) == now), None)


def _reason(publish: Publish) -> str:
    return publish.detail or publish.code


def _holds(run: Run) -> Iterator[Bar]:
    since: dict[str, float] = {}
    for time, held in (*run.held, (run.seconds, ())):
        for name in [name for name in since if name not in held]:
            yield Bar(since.pop(name), time, name)
        for name in held:
            since.setdefault(name, time)


def _by_text(bars: Iterable[Bar]) -> Iterator[Lane]:
    """Yield a lane for each thing that lasted, in the order of their first appearance."""
    lanes: dict[str, list[Bar]] = {}
    for bar in sorted(bars, key=lambda bar: bar.begin):
        lanes.setdefault(bar.text, []).append(bar)
    for name, found in lanes.items():
        yield Lane(name, tuple(found))


# -- attempts ---------------------------------------------------------------------------------------------


@dataclass
class _Attempt:
    """An attempt while the steps are gone through."""

    operation: str
    begin: float
    tries: int
    cancelled: float | None = None
    outcome: str = ""
    detail: str = ""


@dataclass
class _Attempts:
    """Follows the attempts of a run through its steps."""

    run: Run
    running: dict[str, _Attempt] = field(default_factory=dict)

    def ended_by(self, step: Step) -> Iterator[Bar]:
        """Take in a step; yield the attempts that it ends."""
        event = step.event
        about = str(event.data.get("attempt") or event.data.get("owner") or "")
        attempt = self.running.get(about)
        if event.name == "timer.timeout" and attempt is not None:
            attempt.outcome = TIMED_OUT
        ended = _ENDS.get(event.name)
        if ended and attempt is not None:
            del self.running[about]
            attempt.detail = " ".join(filter(None, map(event.data.get, ("code", "detail"))))
            attempt.outcome = attempt.outcome or ended
            yield _bar(attempt, step.time)
        for command in step.commands:
            if isinstance(command, Start):
                self.running[command.attempt] = self._started(command, step.time)
            elif isinstance(command, Cancel) and command.attempt in self.running:
                self.running[command.attempt].cancelled = step.time

    def _started(self, command: Start, time: float) -> _Attempt:
        return _Attempt(command.operation, time, self.run.tries.get(command.attempt, 1))


#: `timer.cancel`: the server did not confirm the cancel in time, and nobody listens to it any more.
_ENDS = {
    "attempt.done": DONE,
    "attempt.failed": FAILED,
    "attempt.cancelled": CANCELLED,
    "timer.cancel": CANCELLED,
}


def _attempts(run: Run) -> Iterator[Bar]:
    """Yield every attempt: from its start until its server said how it ended."""
    following = _Attempts(run)
    for step in run.steps:
        yield from following.ended_by(step)
    for attempt in following.running.values():
        attempt.outcome = attempt.outcome or OPEN
        yield _bar(attempt, run.seconds)


def _bar(attempt: _Attempt, end: float) -> Bar:
    return Bar(
        begin=attempt.begin,
        end=end,
        text=attempt.operation,
        outcome=attempt.outcome,
        detail=attempt.detail,
        tries=attempt.tries,
        wanted_until=attempt.cancelled,
    )


# -- live values and what came from outside ---------------------------------------------------------------


def _reported(run: Run, name: str) -> Iterator[tuple[float, object]]:
    """Yield what a live value was, from when on."""
    for step in run.steps:
        if step.event.name == "value" and step.event.data["name"] == name:
            yield step.time, step.event.data["value"]


def _flags(run: Run) -> Iterator[Lane]:
    """Yield when the inputs that are true or false were true."""
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
    """Yield the inputs that are numbers, where anything is known of them."""
    for spec in run.chart.inputs.values():
        if spec.type.kind != NUMBER.kind:
            continue
        points = [(0.0, spec.initial), *_reported(run, spec.value)]
        known = tuple((time, float(v)) for time, v in points if isinstance(v, (int, float)))
        if known:
            yield Curve(spec.name, known)


def _ticks(steps: Iterable[Step]) -> Iterator[Tick]:
    """Yield the requests and what plugins told."""
    for step in steps:
        name = step.event.name
        if step.accepted is not None:
            yield Tick(step.time, name.rpartition(".")[2], not step.accepted)
        elif name != "start" and name != "value" and name.partition(".")[0] not in ("attempt", "timer"):
            yield Tick(step.time, name)
