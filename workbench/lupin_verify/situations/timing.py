"""Concretises a path of situations as a timed run of a machine: finds times that fit its order.

The times are the earliest solution of difference constraints t(j) >= t(i) + w: each move is a little after
the one before, a deadline fires exactly when it is due, and all else precedes deadlines that have not fired.
The length of a hold, which delays a deadline, is taken from the last solution, up to `_ROUNDS` times. There
may be no solution, or none is found in these rounds; then there is no run.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

from lupin_engine.machine import (
    CLOCK,
    Attempt,
    Event,
    Invocation,
    Machine,
    Macrostep,
    Operations,
    Step,
    Timer,
    successor,
)
from lupin_engine.machine import event as events
from lupin_verify.situations.classes import MORNING
from lupin_verify.situations.explorer import ChosenMachine, ChosenUpdates, SituationExplorer
from lupin_verify.situations.found import Effect
from lupin_verify.situations.relevance import reads
from lupin_verify.situations.situation import Situation, is_new
from lupin_verify.situations.worlds import (
    LOADED,
    OF_PROPERTY,
    TimerName,
    WorldMove,
    name_after,
    running,
)

#: The time between two moves, in seconds.
GAP = 0.01
#: How often the times are computed.
_ROUNDS = 12
#: The tolerance of a deadline, for sums of floats.
_CERTAINLY = 1e-6

#: How long after a time of day the robot's clock is set to it: so it shows that time in spite of rounding.
_AFTER = 1e-3

#: The samples of a live value that are tried to change an argument.
_SAMPLES = (1, 2, 3)

_NO_EVENT = Event("")

_Condition = tuple[int, int, float]


@dataclass
class Deadline:
    """A deadline along a path: set at the move `armed` with a `delay`; it has not fired at the moves `waits`.

    `stops` are the moves between which a hold stops it; `fired` is the move at which it fires.
    """

    armed: int
    delay: float
    stops: list[list[int]] = field(default_factory=list)
    waits: list[int] = field(default_factory=list)
    fired: int | None = None


class TimedRun(NamedTuple):
    """The steps of a machine, and the time of the last move, which may be a property's deadline, no step."""

    steps: list[Step]
    ends: float


def timed_run(explorer: SituationExplorer, moves: Sequence[int]) -> TimedRun | None:
    """Return the run of a machine along some moves; None where no times are found, or it does otherwise."""
    way = explorer.walk(moves)
    made = [explorer.moves.all[number] for number in moves]
    deadlines = list(_deadlines(explorer, way, made))
    times: list[float] | None = [GAP * index for index in range(len(way))]
    for _ in range(_ROUNDS):
        assert times is not None
        found = _earliest(deadlines, made, times)
        if found is None or found == times:
            steps = None if found is None else _run(explorer, way, made, found)
            return None if found is None or steps is None else TimedRun(steps, found[-1])
        times = found
    return None


def _deadlines(
    explorer: SituationExplorer, way: Sequence[tuple[Situation, Effect]], made: Sequence[WorldMove]
) -> Iterator[Deadline]:
    """Yield every deadline along a path."""
    along: dict[TimerName, Deadline] = {}
    for number, (situation, effect) in enumerate(way):
        armed = _by_name(running(explorer.table, situation))
        frozen = _by_name(explorer.table.get(situation, ("frozen", "")))
        fired = made[number - 1].timer if number else None
        before, along, renamed = along, {}, dict(effect.renamed)
        for name, one in before.items():
            now = name_after(name, renamed)
            if now not in effect.fresh and now in (armed | frozen):
                along[now] = one
                continue
            _end(one, number, name == fired)
            yield one
        for name, delay in (armed | frozen).items():
            _go_on(along.setdefault(name, Deadline(number, delay)), number, name in frozen, name in armed)
    yield from along.values()


def _end(one: Deadline, number: int, fired: bool) -> None:
    """Record that a deadline has ended before a step."""
    if fired:
        one.fired = number
    elif not _is_stopped(one):
        one.waits.append(number)


def _is_stopped(one: Deadline) -> bool:
    return bool(one.stops) and len(one.stops[-1]) == 1


def _go_on(one: Deadline, number: int, frozen: bool, armed: bool) -> None:
    """Record that a deadline exists at a step, running or stopped by a hold."""
    stopped = _is_stopped(one)
    if frozen and not stopped:
        one.stops.append([number])
    elif armed and stopped:
        one.stops[-1].append(number)
    if not stopped and one.armed != number:
        one.waits.append(number)


def _by_name(timers: Sequence[Timer] | None) -> dict[TimerName, float]:
    """Return deadlines with their delays; a time of day has none, as the clock is set to it."""
    return {(kind, *about): due for due, _, kind, about in timers or () if kind != "at"}


def _earliest(
    deadlines: Sequence[Deadline], made: Sequence[WorldMove], before: list[float]
) -> list[float] | None:
    """Return the earliest solution, with the lengths of holds of the times before; None without one."""
    gaps = [0.0 if move.event is None else GAP for move in made]
    conditions: list[_Condition] = [(index, index + 1, gap) for index, gap in enumerate(gaps)]
    for one in deadlines:
        conditions += _conditions(one, before)
    times = [0.0] * len(before)
    for _ in range(len(before) + 1):
        late = [(j, times[i] + gap) for i, j, gap in conditions if times[i] + gap > times[j] + 1e-9]
        if not late:
            return [round(time - times[0], 6) for time in times]
        for j, _ in late:
            times[j] = max(times[i] + gap for i, to, gap in conditions if to == j)
    return None


def _conditions(one: Deadline, times: Sequence[float]) -> Iterator[_Condition]:
    def due(at: int) -> float:
        return one.delay + sum(
            times[stop[1]] - times[stop[0]] for stop in one.stops if stop[-1] <= at and len(stop) == 2
        )

    if one.fired is not None:
        yield one.armed, one.fired, due(one.fired)
        yield one.fired, one.armed, -due(one.fired)
    for index in one.waits:
        yield index, one.armed, GAP / 2 - due(index)


class _TimedUpdates(ChosenUpdates):
    """The updates of a timed run: with other arguments where there are some."""

    __slots__ = ()

    def new_arguments(
        self, invocation: Invocation, attempt: Attempt, step: Macrostep
    ) -> Mapping[str, Any] | None:
        """Return the arguments as they are now, or the same ones as if they were new; None, as was chosen."""
        found = Operations.new_arguments(self, invocation, attempt, step) if self.changes else None
        return found or super().new_arguments(invocation, attempt, step)


class _TimedMachine(ChosenMachine):
    """The machine of a timed run."""

    __slots__ = ()
    operations = _TimedUpdates


def _run(
    explorer: SituationExplorer,
    way: Sequence[tuple[Situation, Effect]],
    made: Sequence[WorldMove],
    times: Sequence[float],
) -> list[Step] | None:
    """Run the moves on a new machine at their times; None where a step takes other transitions."""
    machine: ChosenMachine = _TimedMachine(explorer.world)
    steps = [machine.start(0.0, None if explorer.world.calendar is None else MORNING)]
    names: dict[str, str] = {}
    _rename(names, way[0][1], list(machine.memory.attempts))
    for move, time, (_, effect) in zip(made, times[1:], way[1:], strict=True):
        before = set(machine.memory.attempts)
        if move.timer[0] == OF_PROPERTY:
            break  # the machine makes no step then
        passed = list(_pass(machine, time))
        if any(step.taken for step in passed):
            return None
        steps += passed
        if move.timer[0] == "at":
            steps.append(_come_to(machine, move.timer, time))
        if move.timer[0] == "update":
            machine.updates.changes = not move.unchanged
            steps += _change_arguments(explorer, machine, move, max(time - GAP / 4, steps[-1].time))
        if move.event is LOADED:
            machine = successor(machine, explorer.world)
            step: Step | None = machine.go_on(time)
        else:
            step = _carry_out(machine, move, time, names)
        if step is None or step.taken != effect.taken:
            return None
        _rename(names, effect, [name for name in machine.memory.attempts if name not in before])
        steps.append(step)
    return steps


def _change_arguments(
    explorer: SituationExplorer, machine: ChosenMachine, move: WorldMove, time: float
) -> list[Step]:
    """Report other live values to an update, so that its run is also one of a machine that evaluates them.

    None are found where its arguments read something else: then only this run has the update.
    """
    invocation = next(i for i in machine.memory.invocations.values() if f"i:{i.name}" == move.timer[1])
    attempt = machine.memory.attempts[invocation.attempt or ""]
    invoke = machine.chart.states[invocation.state].invoke
    values = () if invoke is None else invoke.arguments.values()
    names = [name for value in values for root, name in reads(value) if root == "input"]
    steps: list[Step] = []
    for name, number in itertools.product(names, _SAMPLES) if not move.unchanged else ():
        spec = machine.chart.inputs[name]
        value = explorer.classes.sample(spec.type, number)
        steps.append(machine.handle(events.observed(spec.value, value, time), time))
        if (
            Operations.new_arguments(machine.updates, invocation, attempt, Macrostep(_NO_EVENT, time))
            is not None
        ):
            break
    return steps


def _rename(names: dict[str, str], effect: Effect, begun: Sequence[str]) -> None:
    """Map the canonical names of attempts to the machine's after a step that has begun some."""
    new = iter(begun)
    names.update({to: next(new, "") if is_new(old) else names[old] for old, to in effect.renamed})


def _pass(machine: Machine, until: float) -> Iterator[Step]:
    """Fire deadlines that the path does not have: those of abandoned attempts."""
    while (due := machine.next_deadline) is not None and due < until - _CERTAINLY:
        step = machine.advance(due)
        if step is not None:
            yield step


def _come_to(machine: Machine, wanted: TimerName, time: float) -> Step:
    """Set the robot's clock to the time of day that ends a wait: a path does not have the hours before it."""
    _, owner, event = wanted
    word, _, of_day = event.split(" ")
    due = next(
        (
            t[0]
            for t in machine.memory.timers
            if t[3][0] == owner and t[3][1].split(" ")[::2] == [word, of_day]
        ),
        time,
    )
    return machine.handle(events.clock((machine.memory.wall or 0.0) + due - time + _AFTER), time)


def _carry_out(machine: Machine, move: WorldMove, time: float, names: dict[str, str]) -> Step | None:
    if move.event is None:
        due = machine.next_deadline
        return machine.advance(due) if due is not None and abs(due - time) < _CERTAINLY else None
    data = dict(move.event.data)
    if "attempt" in data:
        data["attempt"] = names.get(data["attempt"], data["attempt"])
    if move.event.name == "value":
        data["stamp"] = time
    if move.event.name == CLOCK:
        return machine.handle(events.clock(data["ahead"] - time), time)
    return machine.handle(replace(move.event, data=data), time)
