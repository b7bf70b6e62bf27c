"""Compiles the author's temporal properties to monitors.

A monitor's state (`properties.Remembered`): empty while nothing is pending; the deadline of a pending
`eventually`; `(math.inf,)` for an `always` or `never` that is active between two moments, and for an
`eventually` of the whole run that has come true; `math.inf` and the numbers of the places that were visited.
A condition that cannot be evaluated counts as false.
"""

from __future__ import annotations

import ast
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import lru_cache, partial
from typing import Any

from lupin_engine.chart.expressions.evaluation import Compiled, Constant, Environment, Expression
from lupin_engine.chart.model import Chart, Kind, TemporalProperty
from lupin_engine.chart.semantics import DIVERT
from lupin_engine.errors import reason
from lupin_engine.machine.event import Start
from lupin_engine.machine.timers import seconds
from lupin_engine.plugin.profile import START
from lupin_engine.properties.built_in import (
    ANY,
    BUILT_IN,
    CODED,
    COMMANDED,
    ENDED,
    FAILED,
    HELD,
    HOLDS,
    MOVED,
    NOT_ABOUT,
    NOTED,
    REQUESTED,
    Passage,
    Property,
    Remembered,
    StepKind,
    Verdict,
    is_moving,
    is_waiting,
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
        if _places(rule):
            return _visits(rule, state, passage, env)
        begins = partial(_begins, rule, passage, env)
        if rule.eventually is not None:
            return _comes(rule, rule.eventually, state, env, now, begins)
        return _stays(rule, state, env, begins)

    def end(state: Remembered, now: float) -> Verdict:
        if rule.eventually is None or not state or now <= state[0] + _ROUNDING:
            return NOT_ABOUT
        return Verdict(True, _late(rule))

    remembers = is_bounded(rule) or rule.eventually is not None
    found = Property(rule.name, rule.summary or sentence(rule), watch, (), end, remembers)
    meant_always = not rule.mission and not rule.not_meant
    return found if rule.never is None or not meant_always else _asked_by_kind(rule, found, remembers)


def _asked_by_kind(rule: TemporalProperty, found: Property, remembers: bool) -> Property:
    """Return the monitor of a `never` that is asked only in steps in which a condition of it may be true.

    A step in which none of them is true leaves as it is what is remembered.
    """
    conditions = [one for one in (rule.never, rule.after, rule.until) if one is not None]
    begins = REQUESTED if remembers and rule.after is None else 0
    return replace(
        found,
        of_values=any(_may_be_true(one, _QUIET) for one in conditions),
        is_asked=lambda kind: bool(kind[0] & begins) or any(_may_be_true(one, kind) for one in conditions),
        otherwise=NOT_ABOUT if remembers else HOLDS,
    )


#: The fields of `this_step` that are empty after a step without these bits, and what they are then.
_EMPTY: Mapping[str, tuple[int, Any]] = {
    "accepted": (REQUESTED, ""),
    "refused": (REQUESTED, ""),
    "released": (NOTED, []),
    "begun": (COMMANDED, []),
    "succeeded": (ENDED, []),
    "failed": (FAILED, []),
    "codes": (CODED, []),
    "given_up": (MOVED, []),
    "bypassed": (MOVED, []),
}
#: The kind of a step that changes only live values, in any configuration.
_QUIET: StepKind = (ANY | HELD, None)


def _may_be_true(condition: Expression, kind: StepKind) -> bool:
    """Return whether a condition may be true after steps of a kind: none of its conjuncts is surely false.

    A conjunct is decided if it reads only active states and fields of `this_step` that are empty.
    """
    if not isinstance(condition.evaluate, Compiled):
        return True
    bits, configuration = kind
    step = {name: value for name, (of, value) in _EMPTY.items() if not bits & of}
    env: dict[str, Any] = {"this_step": step}
    if configuration is not None:
        env["in_state"] = lambda names: any(name in configuration for name in names)
    return all(_is_true_or_unknown(conjunct, env) for conjunct in _conjuncts(condition.evaluate.code))


def _is_true_or_unknown(condition: Compiled, env: Mapping[str, Any]) -> bool:
    try:
        return bool(condition(env))
    except Exception:  # it reads something else
        return True


@lru_cache(4096)
def _conjuncts(code: str) -> tuple[Compiled, ...]:
    """Return the operands of checked code that is an `and`; else the code itself."""
    body = ast.parse(code, mode="eval").body
    if not (isinstance(body, ast.BoolOp) and isinstance(body.op, ast.And)):
        return (Compiled(code),)
    return tuple(Compiled(ast.unparse(one)) for one in body.values)


def _named_of(rule: TemporalProperty) -> Property:
    """Return the built-in property that a file names."""
    known = replace(INHERITED[rule.name], says=rule.summary or INHERITED[rule.name].says)
    if not rule.not_meant:
        return known

    def watch(state: Remembered, passage: Passage) -> tuple[Remembered, Verdict]:
        if rule.not_meant and not rule.is_meant(passage.after.mission):
            return (), NOT_ABOUT
        return known.watch(state, passage)

    return replace(known, watch=watch)


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


def _given_up(passage: Passage) -> list[str]:
    """Return the operations that failed, and those whose state was left before they succeeded."""
    chart, found = passage.chart, _ended(passage, "error")
    done = {rule.source for rule in taken(passage) if rule.event == "done"}
    for name in passage.step.exited:
        invoke = chart.states[name].invoke
        if invoke is not None and name not in done and name not in passage.before.settled:
            found.append(invoke.name)
    return found


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
    "given_up": _given_up,
    "bypassed": bypassed,
    "codes": lambda one: [code.code for code in one.step.codes],
    "divert": lambda one: one.scope.memory.context.get(DIVERT, ""),
    "moving": is_moving,
    "waiting": is_waiting,
    "was_in": lambda one: lambda names: any(name in one.before.configuration for name in names),
}


def sentence(rule: TemporalProperty) -> str:
    """Return a property as a sentence, with its conditions as written."""
    if rule.built_in:
        return rule.summary or (INHERITED[rule.name].says if rule.name in INHERITED else "")
    after = f"after {rule.after.source}: " if rule.after else ""
    until = f", until {rule.until.source}" if rule.until else ""
    if places := _places(rule):
        order = ", in this order" if rule.visit_in_order else ""
        return f"before the mission is done: {', '.join(places)}{order}{until}"
    if until and not after:
        after = "from the start of a mission: "
    kind, that = next(
        (kind, that)
        for kind in ("always", "never", "eventually")
        if isinstance(that := getattr(rule, kind), Expression)
    )
    within = f" within {_within(rule)}" if rule.within is not None else ""
    return f"{after}{kind} {that.source}{within}{until}"


def _places(rule: TemporalProperty) -> Mapping[str, Expression]:
    return rule.visit_all or rule.visit_in_order


def is_bounded(rule: TemporalProperty) -> bool:
    """Return whether a property is about parts of a run, each of which begins anew."""
    return rule.after is not None or rule.until is not None or bool(_places(rule))


def _begins(rule: TemporalProperty, passage: Passage, env: Environment) -> bool:
    """Return whether such a part begins: `after` holds, or without it, a mission starts."""
    if rule.after is not None:
        return _holds(rule.after, env)
    return passage.step.event.name == START and passage.step.accepted is True


def _visits(
    rule: TemporalProperty, state: Remembered, passage: Passage, env: Environment
) -> tuple[Remembered, Verdict]:
    """Judge a `visit_all` or a `visit_in_order`: from the start of the mission until it is done."""
    state = _FOR_EVER if _begins(rule, passage, env) else state
    if not state or _holds(rule.until, env):
        return (), NOT_ABOUT
    places, seen = _places(rule), list(state[1:])
    for number, (place, condition) in enumerate(places.items()):
        if number in seen or not _holds(condition, env):
            continue
        if rule.visit_in_order and number > len(seen):
            before = list(places)[len(seen)]
            return (), Verdict(True, f"{_named(rule)} {place} became true, but {before} had not yet")
        seen.append(number)
    root = passage.chart.missions[rule.mission].state
    ends = (passage.chart.states[name] for name in passage.step.entered)
    if not any(end.kind is Kind.FINAL and end.parent == root for end in ends):
        return (math.inf, *sorted(seen)), HOLDS
    left = [place for number, place in enumerate(places) if number not in seen]
    breach = f"{_named(rule)} the mission is done, but {', '.join(left)} never became true"
    return (), Verdict(True, breach) if left else HOLDS


def _stays(
    rule: TemporalProperty, state: Remembered, env: Environment, begins: Callable[[], bool]
) -> tuple[Remembered, Verdict]:
    """Judge an `always` or a `never`."""
    if is_bounded(rule):
        has_begun = bool(state) or begins()
        if not has_begun or _holds(rule.until, env):
            return (), HOLDS if has_begun and rule.after is None else NOT_ABOUT
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
    rule: TemporalProperty,
    that: Expression,
    state: Remembered,
    env: Environment,
    now: float,
    begins: Callable[[], bool],
) -> tuple[Remembered, Verdict]:
    """Judge an `eventually`: whenever it `begins`, it comes true within the time, or `until` does."""
    once = not is_bounded(rule)
    over = _FOR_EVER if once else ()
    if state == _FOR_EVER:
        return state, NOT_ABOUT
    if state and now > state[0] + _ROUNDING:
        return over, Verdict(True, _late(rule))
    if _holds(that, env):
        return over, HOLDS if state or once or begins() else NOT_ABOUT
    if _holds(rule.until, env):
        return (), NOT_ABOUT
    if state:
        return state, HOLDS
    if not once and not begins():
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
