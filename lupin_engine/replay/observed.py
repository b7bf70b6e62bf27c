"""A copy of a chart whose guards are observed while it runs."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any, TypeAlias

from lupin_engine.chart.expressions.condition import Condition
from lupin_engine.chart.expressions.evaluation import Environment
from lupin_engine.chart.model import Chart, Hold, State, Transition

#: Gets the name of what a guard belongs to, and the guard; returns what is evaluated in place of it.
Observe: TypeAlias = Callable[[str, Condition], Callable[[Environment], Any]]


def observed(chart: Chart, observe: Observe) -> Chart:
    """Return a copy of a chart in which the guards of transitions, `for_each` and holds are observed.

    They are named by the id of their transition, as `STATE.for_each`, and as `guards_of_hold` says. The parts
    that explain a false guard are not observed.
    """

    def guard(name: str, given: Condition) -> Condition:
        return replace(given, evaluate=observe(name, given), parts=given.operands) if given else given

    def rule(given: Transition) -> Transition:
        return replace(given, guard=guard(given.id, given.guard)) if given.guard else given

    def state(given: State) -> State:
        each = given.for_each
        return replace(
            given,
            transitions=tuple(map(rule, given.transitions)),
            resume_at=tuple(map(rule, given.resume_at)),
            for_each=each and replace(each, when=guard(f"{given.name}.for_each", each.when)),
        )

    def hold(given: Hold) -> Hold:
        engage, release = (guard(name, one) for name, _, one in guards_of_hold(given))
        return replace(given, engage_guard=engage, release_guard=release)

    states = {name: state(each) for name, each in chart.states.items()}
    return replace(chart, states=states, holds={name: hold(each) for name, each in chart.holds.items()})


def guards_of_hold(hold: Hold) -> Iterator[tuple[str, str, Condition]]:
    """Yield the guards of engaging and releasing a hold, each with its name and word."""
    yield f"hold.{hold.name}.engage", "engage", hold.engage_guard
    yield f"hold.{hold.name}.release", "release", hold.release_guard
