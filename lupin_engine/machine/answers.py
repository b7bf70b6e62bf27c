"""Requests: resolved as a whole before anything changes; and what could be asked for now, and why not the
rest.

In this order: the chart's refusals, then the holds that the request engages or releases, then its
transitions. Refused means that nothing changed, not even a hold.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from lupin_engine.chart.expressions.evaluation import Expression, UnknownInput
from lupin_engine.chart.model import Transition
from lupin_engine.errors import reason
from lupin_engine.machine.core import Core, passes
from lupin_engine.machine.environment import NO_CAUSE, Cause
from lupin_engine.machine.event import Event
from lupin_engine.machine.plan import Row
from lupin_engine.machine.reasons import Considered, Refusal
from lupin_engine.machine.request import read_request
from lupin_engine.machine.structure import Structure
from lupin_engine.machine.turn import Turn
from lupin_engine.machine.view import moment_of

NOT_POSSIBLE = "not_possible"


@dataclass(slots=True)
class Answer:
    """What a request would do: transitions, holds, the request's values; or why it is refused."""

    rules: tuple[Transition, ...] = ()
    engages: list[str] = field(default_factory=list)
    releases: list[str] = field(default_factory=list)
    starts: bool = False
    values: dict[str, Any] = field(default_factory=dict)
    refusal: Refusal | None = None


class Answers:
    """Answers the requests of one machine without changing anything."""

    __slots__ = ("_core", "_structure")

    def __init__(self, core: Core, structure: Structure) -> None:
        self._core = core
        self._structure = structure

    def answer(self, event: Event, row: Row, turn: Turn, dry: bool = False) -> Answer:
        """Return what a request does here. With `dry` the fields of a mission's request are not looked at."""
        cause = Cause(event=event.data)
        found = Answer()
        self._holds(event, found, turn)
        staying = [hold for hold in self._core.memory.held if hold not in found.releases]
        held_back, found.refusal = found.refusal, None
        self._transitions(event, row, staying, cause, found, turn)
        found.refusal = found.refusal or held_back
        targets = (self._core.chart.states[rule.target] for rule in found.rules if rule.target is not None)
        found.starts = any(target.slot for target in targets)
        if found.refusal is None and found.starts and not dry:
            env = self._core.see("", turn, cause)
            found.values, found.refusal = read_request(self._core.world, event.data, env)
        if found.refusal is None and not (found.rules or found.engages or found.releases):
            found.refusal = self._impossible(event)
        return found

    def _holds(self, event: Event, found: Answer, turn: Turn) -> None:
        """Find the holds that a request engages and releases, or why it may not."""
        for hold in self._core.chart.holds.values():
            engaged = hold.name in self._core.memory.held
            code = ""
            if event.name in hold.release and engaged:
                if self._allows(hold.release_guard, turn):
                    found.releases.append(hold.name)
                else:
                    code = hold.code
            elif event.name == hold.engage:
                if not engaged and self._allows(hold.engage_guard, turn):
                    found.engages.append(hold.name)
                else:
                    code = hold.code if engaged else hold.engage_code or hold.code
            if code and found.refusal is None:
                found.refusal = self._refusal(event, code)

    def _allows(self, guard: Expression | None, turn: Turn) -> bool:
        return guard is None or self._core.check(guard, "", turn)

    def _transitions(
        self, event: Event, row: Row, staying: list[str], cause: Cause, found: Answer, turn: Turn
    ) -> None:
        """Find the transitions that answer a request, or the first refusal among them."""
        chosen = []
        for offered in row.candidates(self._structure, event.name):
            rule = next((r for r in offered if self._is_enabled(r, cause, turn)), None)
            if rule is None:
                continue
            blocking = next((hold for hold in staying if not passes(rule, (hold,))), None)
            if rule.refuse is not None or blocking is not None:
                code = rule.refuse or self._core.chart.holds[blocking or ""].code
                found.refusal = self._refusal(event, code)
                return
            chosen.append(rule)
        found.rules = tuple(chosen)

    def _is_enabled(self, rule: Transition, cause: Cause, turn: Turn) -> bool:
        return rule.guard is None or self._core.check(rule.guard, rule.source, turn, cause)

    def _refusal(self, event: Event, code: str) -> Refusal:
        label = self._core.chart.codes[code].label if code in self._core.chart.codes else code
        return Refusal(code, f"{_verb(event)} refused: {label}")

    def _impossible(self, event: Event) -> Refusal:
        """Say where a request would be possible, from the chart."""
        chart = self._core.chart
        here = moment_of(chart, self._core.memory)
        where = {
            "a running mission" if state.slot else state.label or state.local_name
            for state in chart.states.values()
            if any(rule.refuse is None for rule in self._structure.rules_of(state.name, event.name))
        } - {here.lifecycle}
        text = f"{_verb(event)} is not possible in {f'{here.lifecycle} {here.phase}'.strip() or 'this state'}"
        resumes = any(event.name in hold.release for hold in chart.holds.values())
        if resumes and event.name != "mission.start":
            text += " because nothing is paused"
        elif where:
            text += "; it is possible in " + ", ".join(sorted(where))
        return Refusal(NOT_POSSIBLE, text)


def _verb(event: Event) -> str:
    return event.name.rpartition(".")[2]


def consider(core: Core, rule: Transition, turn: Turn, cause: Cause = NO_CAUSE) -> Considered:
    """Return what keeps a transition from being taken, or that nothing does."""
    blocking = next((hold for hold in core.memory.held if not passes(rule, (hold,))), "")
    if rule.guard is None:
        return Considered(rule.id, rule.place, "", holds=True, held=blocking)
    source, parts = rule.guard.source, rule.guard.parts or ((rule.guard.source, rule.guard.evaluate),)
    value, problem = _value(core, rule.guard.evaluate, rule, turn, cause)
    if value and not problem:
        return Considered(rule.id, rule.place, source, holds=True, held=blocking)
    values = [(text, _value(core, part, rule, turn, cause)) for text, part in parts]
    told = tuple((text, problem or value) for text, (value, problem) in values)
    return Considered(rule.id, rule.place, source, holds=False, held=blocking, parts=told)


def _value(core: Core, part: Any, rule: Transition, turn: Turn, cause: Cause) -> tuple[object, str]:
    """Return what a part of a guard is, and what keeps it from being evaluated."""
    try:
        return part(core.see(rule.source, turn, cause)), ""
    except UnknownInput as unknown:
        return None, str(unknown)
    except Exception as problem:
        return None, f"an error: {reason(problem)}"
