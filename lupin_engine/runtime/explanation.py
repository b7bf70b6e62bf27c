"""Explains, for displays, whether each transition of a state would be taken now, and why not.

The answers are dry runs by the machine. For requests they are those of `possible`, which a sender would get.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TypedDict

from lupin_engine.chart.model import Chart, State, Transition
from lupin_engine.chart.semantics import ENGINE_EVENTS
from lupin_engine.errors import UsageError, meant, shortened
from lupin_engine.machine.event import Event
from lupin_engine.machine.machine import Machine
from lupin_engine.machine.requests import Possibility
from lupin_engine.machine.step import Considered
from lupin_engine.runtime.possible import requests_of

#: Letters of a value that are shown.
_LONGEST = 120


class RuleRecord(TypedDict):
    """Whether a transition would be taken if its event came now (`possible`), else the reason against it.

    Of a pattern (`nav.*`) and a `resume_at` only its state, holds and guard count; no request's fields do.
    """

    id: str
    state: str
    event: str
    possible: bool
    reason: str


class ExplanationRecord(TypedDict):
    """A dry run of a state's transitions, or of one transition: then `active` is always false."""

    element: str
    sequence: int
    active: bool
    rules: list[RuleRecord]


def explanation(machine: Machine, element: str, now: float) -> ExplanationRecord:
    """Dry-run a state, by its full name, or a transition, by its id, at time `now`.

    For a state these are all transitions that it listens to: its own, then those of the states around it.

    Raises:
        UsageError: the chart has neither a state nor a transition of that name.
    """
    memory = machine.memory
    return {
        "element": element,
        "sequence": memory.sequence,
        "active": element in memory.configuration,
        "rules": [_rule_record(machine, rule, now) for rule in _rules(machine.chart, element)],
    }


def _rules(chart: Chart, element: str) -> list[Transition]:
    state = chart.states.get(element)
    if state is not None:
        return [rule for name in chart.lineage[element] for rule in _of(chart.states[name])]
    every = {rule.id: rule for other in chart.states.values() for rule in _of(other)}
    if element not in every:
        hint = meant(element, [*filter(None, chart.states), *every])
        raise UsageError(f"no state or transition {shortened(element)!r}" + (f"; {hint}" if hint else ""))
    return [every[element]]


def _of(state: State) -> Iterator[Transition]:
    yield from state.transitions
    yield from state.resume_at


def _rule_record(machine: Machine, rule: Transition, now: float) -> RuleRecord:
    reason = _reason(machine, rule, now)
    return {
        "id": rule.id,
        "state": rule.source,
        "event": rule.event,
        "possible": not reason,
        "reason": reason,
    }


def _reason(machine: Machine, rule: Transition, now: float) -> str:
    """Return why a transition would not be taken if its event came now; '' if it would be."""
    chart = machine.chart
    source = chart.states[rule.source]
    if rule.source not in machine.memory.configuration:
        return f"{source.local_name} is not active"
    considered = machine.consider(rule, now)
    requests = [one.event for one in requests_of(chart) if one.event.name == rule.event]
    if requests and rule not in source.resume_at:
        return _refusal(machine, rule, considered, requests, now)
    why = considered.reason(_shown)
    if why or rule in source.resume_at or rule.event.endswith("*"):
        return why
    if rule.event.partition(".")[0] in ENGINE_EVENTS:
        # The end of an operation and a clock are the state's own: of its rules the first one is taken.
        before = source.transitions[: source.transitions.index(rule)]
        ready = (other for other in before if other.event == rule.event)
        first = next((other.id for other in ready if not machine.consider(other, now).reason()), "")
        return f"{first} is taken instead" if first else ""
    found = machine.explain_event(rule.event, now)
    if rule.id in found.taken:
        return ""
    if found.level is False:
        return f"{rule.event} is false"
    return _instead(found)


def _refusal(
    machine: Machine, rule: Transition, considered: Considered, requests: Sequence[Event], now: float
) -> str:
    """Return why no request takes a transition: the refusal that its sender would get."""
    found = [machine.dry_run(request, now, skip_fields=True) for request in requests]
    if any(rule.id in one.taken for one in found):
        return ""
    if not considered.holds:
        return considered.reason(_shown)
    refused = next((one.refusal.text for one in found if one.refusal is not None), "")
    return refused or _instead(found[0])


def _instead(found: Possibility) -> str:
    """Return the name of the transition that is taken instead."""
    return f"{found.taken[0]} is taken instead" if found.taken else f"{found.event} would not be taken"


def _shown(value: object) -> str:
    return shortened(str(value).lower() if isinstance(value, bool) else str(value), _LONGEST)
