"""Compiles the author's temporal properties (`always`, `never`, `eventually`, `after`, `until`) to monitors.

A monitor's state (`properties.Remembered`): empty while nothing is pending; the deadline of a pending
`eventually`; `(math.inf,)` for an `always` or `never` that an `after` has activated, and for an `eventually`
without `after` that has come true. A condition that cannot be evaluated counts as false.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import Any

from lupin_engine.chart.expressions.evaluation import Constant, Environment, Expression
from lupin_engine.chart.expressions.names import names_read
from lupin_engine.chart.model import Chart, TemporalProperty
from lupin_engine.errors import reason
from lupin_engine.machine.event import Start
from lupin_engine.machine.timers import seconds
from lupin_engine.properties.built_in import (
    BUILT_IN,
    HOLDS,
    NOT_ABOUT,
    Passage,
    Property,
    Remembered,
    Verdict,
    is_moving,
    released,
    taken,
)
from lupin_engine.properties.inherited import INHERITED, bypassed

#: What is remembered where nothing is due.
_FOR_EVER: Remembered = (math.inf,)
#: Times are sums: what is due now may be due a little before it.
_ROUNDING = 1e-9


def properties_of(chart: Chart, more: Mapping[str, TemporalProperty] | None = None) -> tuple[Property, ...]:
    """Return all properties of a chart: built-in ones, its author's, and `more`."""
    written = {**chart.properties, **(more or {})}
    in_steps = (one for one in written.values() if not one.built_in or one.name in INHERITED)
    return (*BUILT_IN, *map(watched, in_steps))


def watched(rule: TemporalProperty) -> Property:
    """Return a property as a monitor."""
    if rule.built_in:
        return _named_of(rule)

    def watch(state: Remembered, passage: Passage) -> tuple[Remembered, Verdict]:
        if (rule.mission or rule.not_meant) and not rule.is_meant(passage.after.mission):
            return (), NOT_ABOUT
        env, now = passage.scope.at("", passage.step.time), passage.step.time
        passage.scope["this_step"] = StepView(passage)
        if rule.eventually is not None:
            return _comes(rule, rule.eventually, state, env, now)
        return _stays(rule, state, env)

    def end(state: Remembered, now: float) -> Verdict:
        if rule.eventually is None or not state or now <= state[0] + _ROUNDING:
            return NOT_ABOUT
        return Verdict(True, _late(rule))

    remembers = rule.after is not None or rule.eventually is not None
    of_values = remembers or not any(
        "this_step" in names_read(one.source) for one in (rule.always, rule.never) if one
    )
    return Property(rule.name, rule.summary or sentence(rule), watch, (), end, remembers, of_values)


def _named_of(rule: TemporalProperty) -> Property:
    """Return the built-in property that a file names."""
    known = INHERITED[rule.name]

    def watch(state: Remembered, passage: Passage) -> tuple[Remembered, Verdict]:
        if rule.not_meant and not rule.is_meant(passage.after.mission):
            return (), NOT_ABOUT
        return known.watch(state, passage)

    return replace(known, says=rule.summary or known.says, watch=watch)


class StepView(Mapping[str, Any]):
    """What a property sees of a step, as `step.NAME`; worked out when it is read."""

    def __init__(self, passage: Passage) -> None:
        self._passage = passage

    def __getitem__(self, name: str) -> Any:
        return _OF_A_STEP[name](self._passage)

    def __iter__(self) -> Iterator[str]:
        return iter(_OF_A_STEP)

    def __len__(self) -> int:
        return len(_OF_A_STEP)


def _ended(passage: Passage, event: str) -> list[str]:
    """Return the operations of which a transition has taken the end: `done` or `error`."""
    states = (passage.chart.states[rule.source] for rule in taken(passage) if rule.event == event)
    return [state.invoke.name for state in states if state.invoke is not None]


#: The fields of `this_step`, and what `was_in_state` asks.
_OF_A_STEP: Mapping[str, Callable[[Passage], Any]] = {
    "accepted": lambda one: one.step.event.name if one.step.accepted else "",
    "refused": lambda one: one.step.event.name if one.step.accepted is False else "",
    "because": lambda one: "" if one.step.refusal is None else one.step.refusal.code,
    "released": lambda one: sorted(released(one.step)),
    "begun": lambda one: [each.operation for each in one.step.commands if isinstance(each, Start)],
    "succeeded": lambda one: _ended(one, "done"),
    "failed": lambda one: _ended(one, "error"),
    "bypassed": bypassed,
    "codes": lambda one: [code.code for code in one.step.codes],
    "moving": is_moving,
    "was_in": lambda one: lambda names: any(name in one.before.configuration for name in names),
}


def sentence(rule: TemporalProperty) -> str:
    """Return a property as a sentence, with its conditions as written."""
    if rule.built_in:
        return rule.summary or (INHERITED[rule.name].says if rule.name in INHERITED else "")
    kind, that = next(
        (kind, that)
        for kind in ("always", "never", "eventually")
        if isinstance(that := getattr(rule, kind), Expression)
    )
    after = f"after {rule.after.source}: " if rule.after else ""
    within = f" within {_within(rule)}" if rule.within is not None else ""
    until = f", until {rule.until.source}" if rule.until else ""
    return f"{after}{kind} {that.source}{within}{until}"


def _stays(rule: TemporalProperty, state: Remembered, env: Environment) -> tuple[Remembered, Verdict]:
    """Judge an `always` or a `never`."""
    if rule.after is not None:
        is_asked = (bool(state) or _holds(rule.after, env)) and not _holds(rule.until, env)
        if not is_asked:
            return (), NOT_ABOUT
        state = _FOR_EVER
    if rule.never is not None:
        if _holds(rule.never, env):
            return state, Verdict(True, f"{_named(rule)} {rule.never.source} became true; it must never be")
        return state, HOLDS
    assert rule.always is not None, "a property says something"
    try:
        problem = "" if rule.always.evaluate(env) else " became false; it must always be true"
    except Exception as raised:
        problem = f" could not be evaluated: {reason(raised)}"
    return state, Verdict(True, f"{_named(rule)} {rule.always.source}{problem}") if problem else HOLDS


def _comes(
    rule: TemporalProperty, that: Expression, state: Remembered, env: Environment, now: float
) -> tuple[Remembered, Verdict]:
    """Judge an `eventually`: whenever `after` holds, it comes true within the time, or `until` does."""
    if state == _FOR_EVER:
        return state, NOT_ABOUT
    if state and now > state[0] + _ROUNDING:
        return (() if rule.after else _FOR_EVER), Verdict(True, _late(rule))
    if _holds(that, env):
        asked = bool(state) or rule.after is None or _holds(rule.after, env)
        return (() if rule.after else _FOR_EVER), HOLDS if asked else NOT_ABOUT
    if _holds(rule.until, env):
        return (), NOT_ABOUT
    if state:
        return state, HOLDS
    if rule.after is not None and not _holds(rule.after, env):
        return (), NOT_ABOUT
    assert rule.within is not None, "what comes eventually has a time"
    return (now + seconds(rule.within.evaluate(env)),), HOLDS


def _late(rule: TemporalProperty) -> str:
    assert rule.eventually is not None, "only what comes eventually is late"
    return f"{_named(rule)} {rule.eventually.source} did not become true within {_within(rule)}"


def _within(rule: TemporalProperty) -> str:
    """Return the deadline as written."""
    return rule.within.source if isinstance(rule.within, Expression) else f"{_constant(rule.within):g} s"


def _constant(within: Constant | None) -> float:
    assert within is not None, "what comes eventually has a time"
    return seconds(within.value)


def _named(rule: TemporalProperty) -> str:
    return f"property {rule.name} (line {rule.place.line}):"


def _holds(condition: Expression | None, env: Environment) -> bool:
    """Return whether a condition is true; a missing one, or one that cannot be evaluated, is not."""
    try:
        return condition is not None and bool(condition.evaluate(env))
    except Exception:
        return False
