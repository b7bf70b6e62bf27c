"""Compiles the author's temporal properties (`always`, `never`, `eventually`, `after`, `until`) to monitors.

A monitor's state (`properties.Remembered`): empty while nothing is pending; the deadline of a pending
`eventually`; `(math.inf,)` for an `always` or `never` that an `after` has activated, and for an `eventually`
without `after` that has come true. A condition that cannot be evaluated counts as false.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from lupin_engine.chart.expressions.evaluation import Constant, Environment, Expression
from lupin_engine.chart.model import Chart, TemporalProperty
from lupin_engine.errors import reason
from lupin_engine.machine.timers import seconds
from lupin_engine.properties.built_in import (
    BUILT_IN,
    HOLDS,
    NOT_ABOUT,
    Passage,
    Property,
    Remembered,
    Verdict,
)

#: What is remembered where nothing is due.
_FOR_EVER: Remembered = (math.inf,)
#: Times are sums: what is due now may be due a little before it.
_ROUNDING = 1e-9


def properties_of(chart: Chart, more: Mapping[str, TemporalProperty] | None = None) -> tuple[Property, ...]:
    """Return all properties of a chart: built-in ones, its author's, and `more`."""
    written = {**chart.properties, **(more or {})}
    return (*BUILT_IN, *map(watched, written.values()))


def watched(rule: TemporalProperty) -> Property:
    """Return a property as a monitor."""

    def watch(state: Remembered, passage: Passage) -> tuple[Remembered, Verdict]:
        if rule.mission and passage.after.mission != rule.mission:
            return (), NOT_ABOUT
        env, now = passage.scope.at("", passage.step.time), passage.step.time
        if rule.eventually is not None:
            return _comes(rule, rule.eventually, state, env, now)
        return _stays(rule, state, env)

    def end(state: Remembered, now: float) -> Verdict:
        if rule.eventually is None or not state or now <= state[0] + _ROUNDING:
            return NOT_ABOUT
        return Verdict(True, _late(rule))

    return Property(rule.name, rule.summary or sentence(rule), watch, (), end)


def sentence(rule: TemporalProperty) -> str:
    """Return a property as a sentence, with its conditions as written."""
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
