"""Shortcuts: the macrosteps that need nothing beyond one plan, prepared as one small function each.

Most events of most charts take one transition that neither talks to the world nor waits for it. For those the
general algorithm of `machine` would ask many questions whose answers are known beforehand. A shortcut is made
for an event in a row only where these hold, so that it gives the very same step (a property test compares
them):

* each leaf's first candidate has no guard, or only one leaf has candidates; none leads to a history state;
* the transitions have no action, or one `set` whose values do not ask for the configuration;
* what is left and entered has no actions, operations, itinerary, budget or history, and its timers are
  constants;
* neither this row nor the one that it leads to has eventless transitions; that one has nothing to work off,
  and is no end;
* the chart has no invariants.

It is used only while the machine is quiet (`Machine` says when): at rest, no hold, no waiting answer, no
itinerary.
What raises, or finds no transition, returns None and goes the general way from the start: until then
nothing has been changed.
"""

from __future__ import annotations

from bisect import insort
from collections.abc import Callable, Sequence
from typing import Any

from lupin_engine.chart.expressions.evaluation import Compiled, Constant, Environment
from lupin_engine.chart.model import Chart, Kind, State, Timer, Transition
from lupin_engine.machine.environment import Surroundings
from lupin_engine.machine.event import Event
from lupin_engine.machine.memory import Memory
from lupin_engine.machine.plan import Plan, Shortcut, Taken
from lupin_engine.machine.structure import FAULT_RULE, Structure
from lupin_engine.machine.timers import seconds

Evaluate = Callable[[Environment], Any]
Writes = tuple[tuple[str, Evaluate], ...]
#: A guard (None: none), what is done when it holds, and what is written then.
Option = tuple[Evaluate | None, Plan, Writes]

#: A timer to arm: its delay in seconds, and what it is about.
Arm = tuple[float, tuple[str, str]]


def shortcut(
    structure: Structure,
    candidates: Sequence[Sequence[Transition]],
    plan_of: Callable[[Sequence[Transition]], Plan],
    fixed: Event | None = None,
) -> Shortcut | None:
    """Return the shortcut for an event, or None where it must go the general way.

    Args:
        structure: that of the machine's chart.
        candidates: the transitions that listen to the event, for each leaf in order of preference.
        plan_of: what taking transitions does.
        fixed: the event that steps are recorded with, when it is not the one that is handed in.
    """
    offered = [rules for rules in candidates if rules]
    rules = [rule for rules in offered for rule in rules]
    varies = any(rule.id == FAULT_RULE or structure.is_to_history(rule) for rule in rules)
    if structure.chart.invariants or varies or not offered:
        return None
    if all(rules[0].guard is None for rules in offered):
        plan = plan_of([rules[0] for rules in offered])
        writes = _writes(plan)
        if writes is None or not is_plain(plan):
            return None
        return _guarded(structure.chart, ((None, plan, writes),), fixed) if writes else _plain(plan, fixed)
    if len(offered) > 1:
        return None
    options = _options(offered[0], plan_of)
    return _guarded(structure.chart, options, fixed) if options else None


def _options(
    rules: Sequence[Transition], plan_of: Callable[[Sequence[Transition]], Plan]
) -> tuple[Option, ...] | None:
    """Return what can be taken, up to the first transition without a guard."""
    options: list[Option] = []
    for rule in rules:
        plan = plan_of([rule])
        writes = _writes(plan)
        if writes is None or not is_plain(plan):
            return None
        options.append((_function(rule.guard.evaluate) if rule.guard else None, plan, writes))
        if rule.guard is None:
            break
    return tuple(options)


def _writes(plan: Plan) -> Writes | None:
    """Return the variables that are written; None when more is done than one `set`."""
    calls = [call for rule in plan.rules for call in rule.actions]
    if not calls:
        return ()
    if len(calls) > 1 or calls[0].name != "set":
        return None
    values = calls[0].arguments
    if any("in_state" in getattr(value, "source", "") for value in values.values()):
        return None
    return tuple((name, _function(value.evaluate)) for name, value in values.items())


def _function(evaluate: Evaluate) -> Evaluate:
    return evaluate.compiled() if isinstance(evaluate, Compiled) else evaluate


def is_plain(plan: Plan) -> bool:
    """Say whether a plan only changes the configuration and the timers of states."""
    return (
        not plan.remembers
        and not any(rule.code or rule.releases or rule.refuse for rule in plan.rules)
        and not any(state.exit or _works(state) for state, _ in plan.exits)
        and not any(
            state.entry or state.slot or state.itinerary or _works(state) for state, _ in plan.entries
        )
        and not any(_delay(timer) is None for state, _ in plan.entries for timer in state.timers)
        and not any(state.kind is Kind.FINAL for state, _ in plan.entries)
        and not plan.row.levels
        and not any(state.for_each for state in plan.row.working)
    )


def _works(state: State) -> bool:
    return state.invoke is not None or state.for_each is not None or state.budget is not None


def _delay(timer: Timer) -> float | None:
    """Return a timer's delay in seconds, when it is known beforehand."""
    try:
        return seconds(timer.after.value) if isinstance(timer.after, Constant) else None
    except (TypeError, ValueError):
        return None  # the general way tells what is wrong with it


def _plain(plan: Plan, fixed: Event | None) -> Shortcut:
    """Return the shortcut for transitions without guards and actions."""
    arms, leaving = _timing(plan)
    if arms or leaving:
        return _timed(plan, arms, leaving, fixed)
    taken, configuration = Taken(plan, fixed), plan.row.configuration

    def take(memory: Memory, env: Surroundings, event: Event, now: float) -> Taken:
        memory.configuration = configuration
        return taken

    return take


def _timed(
    plan: Plan, arms: tuple[Arm, ...], leaving: frozenset[tuple[str, str]], fixed: Event | None
) -> Shortcut:
    """Return the shortcut for transitions that leave or enter states with timers."""
    taken, configuration = Taken(plan, fixed), plan.row.configuration

    def take(memory: Memory, env: Surroundings, event: Event, now: float) -> Taken:
        timers = memory.timers
        if timers and leaving:
            timers[:] = [timer for timer in timers if timer[3] not in leaving or timer[2] != "after"]
        for delay, about in arms:
            memory.next_id = token = memory.next_id + 1
            insort(timers, (now + delay, token, "after", about))
        memory.configuration = configuration
        return taken

    return take


def _timing(plan: Plan) -> tuple[tuple[Arm, ...], frozenset[tuple[str, str]]]:
    """Return the timers that a plan arms, and those that it forgets."""
    arms = tuple(
        (delay, (state.name, timer.event))
        for state, _ in plan.entries
        for timer in state.timers
        if (delay := _delay(timer)) is not None
    )
    return arms, frozenset((state.name, timer.event) for state, _ in plan.exits for timer in state.timers)


def _guarded(chart: Chart, options: tuple[Option, ...], fixed: Event | None) -> Shortcut:
    """Return the shortcut for transitions with guards, or that write variables."""
    choices = tuple((guard, _writer(chart, writes), _plain(plan, fixed)) for guard, plan, writes in options)
    if len(choices) == 1:
        return _guarded_once(*choices[0])

    def take(memory: Memory, env: Surroundings, event: Event, now: float) -> Taken | None:
        env["event"] = event.data
        env.inputs.now = now
        try:
            for guard, write, move in choices:
                if guard is None or guard(env):
                    if write is not None:
                        write(env)
                    return move(memory, env, event, now)
        except Exception:
            return None  # the general way tells what raised, and where
        return None

    return take


def _guarded_once(
    guard: Evaluate | None, write: Callable[[Environment], None] | None, move: Shortcut
) -> Shortcut:
    """Return the shortcut for the one transition that can be taken, which is what most have."""

    def take(memory: Memory, env: Surroundings, event: Event, now: float) -> Taken | None:
        env["event"] = event.data
        env.inputs.now = now
        try:
            if guard is not None and not guard(env):
                return None
            if write is not None:
                write(env)
        except Exception:
            return None  # the general way tells what raised, and where
        return move(memory, env, event, now)

    return take


def _writer(chart: Chart, writes: Writes) -> Callable[[Environment], None] | None:
    """Return what writes the variables, all or none; what raises, the general way tells."""
    if not writes:
        return None
    bounds = {name: chart.context[name].type.minimum for name, _ in writes if name in chart.context}
    if len(writes) > 1:
        return _writer_of_several([(name, evaluate, bounds.get(name)) for name, evaluate in writes])
    ((only, evaluate),) = writes
    least = bounds.get(only)
    return _bounded_writer(only, evaluate, least) if least is not None else _plain_writer(only, evaluate)


def _plain_writer(name: str, evaluate: Evaluate) -> Callable[[Environment], None]:
    def write(env: Environment) -> None:
        env["context"][name] = evaluate(env)

    return write


def _bounded_writer(name: str, evaluate: Evaluate, least: float) -> Callable[[Environment], None]:
    def write(env: Environment) -> None:
        value = evaluate(env)
        if value < least:
            raise ValueError(name)
        env["context"][name] = value

    return write


def _writer_of_several(writes: Sequence[tuple[str, Evaluate, float | None]]) -> Callable[[Environment], None]:
    """Return what writes variables after a look at each value: the type of some has a minimum."""

    def write(env: Environment) -> None:
        values = {}
        for name, evaluate, least in writes:
            values[name] = value = evaluate(env)
            if least is not None and value < least:
                raise ValueError(name)
        env["context"].update(values)

    return write
