"""Minimises a run that violates a property to a small scenario that violates it, too (delta debugging).

The run up to the violation becomes a scenario. Then targets, faults of servers, events, settings and digits
are left out as long as the simulation still violates the same property. The result is not the smallest there
is, but a local minimum within `MOST_TRIES` simulations.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Container, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import fields, replace
from itertools import islice
from pathlib import Path
from typing import Any, TypeVar

from lupin_engine.errors import LupinError, UsageError
from lupin_engine.machine import Start, Step
from lupin_engine.properties import INVARIANTS, STANDSTILL
from lupin_engine.replay import RunRecord, script_of, yaml_text
from lupin_engine.sim import (
    Happening,
    Missions,
    MockOutcome,
    Run,
    Scenario,
    Script,
    load_scenario_text,
    mission_name,
)
from lupin_verify.script_parts import DIGITS, NO_CLOCK, USUAL, parts_of, when_of

#: How many scenarios are tried at most.
MOST_TRIES = 400
#: The same where each is a run of thousands of steps.
_FEW_TRIES = 40

_Said = TypeVar("_Said", MockOutcome, Happening)


class Minimiser:
    """Minimises one scenario; `tries` counts the simulations."""

    def __init__(self, name: str, promise: str, file: Path, mission: Path, missions: Missions) -> None:
        """Make one for a property.

        Args:
            name: the property.
            promise: its sentence.
            file: where the scenario will stand.
            mission: the mission's file.
            missions: has its chart.
        """
        self._name = name
        self._promise = promise
        self._file = file
        self._mission = mission
        self._missions = missions
        # A run in which time stands still is a long one.
        self._most = MOST_TRIES if name != STANDSTILL else _FEW_TRIES
        self.tries = 0

    def text(self, recording: RunRecord, script: Script) -> str:
        """Return the text of a scenario that fails by this property only.

        Args:
            recording: the run up to the violation.
            script: the script of the run.

        Raises:
            UsageError: the recorded run does not violate the property as a scenario.
        """
        found = self._recorded(recording, script)
        if found is not None:
            written = parts_of(self._smaller(found))
            run = self._run(self._read(written))
            if run is not None:
                return yaml_text({**written, "expect": _expected(run, self._name)})
        raise UsageError(f"no scenario was written: as a scenario the run does not violate {self._name}")

    # -- the scenario of a run ------------------------------------------------------------------------------

    def _recorded(self, recording: RunRecord, script: Script) -> Scenario | None:
        """Return a run as a scenario that violates the property, with as few digits as will do."""
        for digits in DIGITS:
            with suppress(LupinError):
                found = self._read(self._parts(recording, script, digits))
                run = self._violating(found)
                if run is not None and run.unfired:
                    found = _with(found, happenings=_fired(found, run))
                    run = self._run(found)
                if run is not None:
                    return found
        return None

    def _parts(self, recording: RunRecord, script: Script, digits: int) -> dict[str, Any]:
        """Return a run as the parts of a scenario's file."""
        chart, ended = self._missions.chart(self._mission), recording.steps[-1].time
        name = mission_name(self._mission, self._file, self._missions)
        parts = script_of(recording, name, self._promise, chart, digits)
        happened = (one for one in script.happenings if one.after <= ended)
        when = [when_of(replace(one, after=round(one.after, digits))) for one in happened]
        parts |= {"request": script.request, "when": when, "limit": f"{math.ceil(ended) + 1} s"}
        parts.pop("start", None)
        if self._name == STANDSTILL:
            parts["mocks"] = list(_standing(parts.get("mocks", ()), recording.steps))
        return parts

    def _read(self, parts: Mapping[str, Any]) -> Scenario:
        """Read the parts of a scenario's file as it would be written; errors as for `load_scenario`."""
        return load_scenario_text(yaml_text({**parts, "expect": {}}), self._file, self._missions)

    # -- simulations -----------------------------------------------------------------------------------------

    def _run(self, scenario: Scenario) -> Run | None:
        """Run a scenario; None when it does not violate the property, or not everything in it happens."""
        run = self._violating(scenario)
        return run if run is not None and not run.unfired else None

    def _violating(self, scenario: Scenario) -> Run | None:
        """Run a scenario; None when it does not violate the property, or cannot be run."""
        self.tries += 1
        with suppress(LupinError):
            run = scenario.run()
            if any(name == self._name for _, name, _ in run.violated):
                return run
        return None

    def _smaller(self, scenario: Scenario) -> Scenario:
        before = None
        while scenario is not before and self.tries < self._most:
            before = scenario
            scenario = self._fewer_pieces(scenario)
            for candidates in (_plainer, _earlier):
                scenario = self._first(scenario, candidates)
        return scenario

    def _first(self, scenario: Scenario, candidates: Callable[[Scenario], Iterable[Scenario]]) -> Scenario:
        """Accept every candidate that still violates the property; the next is made from it."""
        index = 0
        while self.tries < self._most:
            found = next(islice(candidates(scenario), index, None), None)
            if found is None:
                break
            if _differs(found, scenario) and self._run(found) is not None:
                scenario = found
            else:
                index += 1
        return scenario

    def _fewer_pieces(self, scenario: Scenario) -> Scenario:
        """Leave out targets, faults and happenings, first many at once, then each (delta debugging)."""
        size = max(1, len(_pieces(scenario)) // 2)
        while size and self.tries < self._most:
            at = 0
            while at < len(_pieces(scenario)) and self.tries < self._most:
                fewer = _without(scenario, _pieces(scenario)[at : at + size])
                if _differs(fewer, scenario) and self._run(fewer) is not None:
                    scenario = fewer
                else:
                    at += size
            size //= 2
        return scenario


def _with(scenario: Scenario, **changes: Any) -> Scenario:
    """Return a scenario with another script."""
    return replace(scenario, script=replace(scenario.script, **changes))


def _differs(one: Scenario, other: Scenario) -> bool:
    return (one.script, one.parameters) != (other.script, other.parameters)


def _fired(scenario: Scenario, run: Run) -> tuple[Happening, ...]:
    """Return the happenings of a scenario that fired in its run."""
    never = {one.number for one in run.unfired}
    return tuple(one for one in scenario.script.happenings if one.number not in never)


def _turns(scenario: Scenario) -> dict[int, list[MockOutcome]]:
    """Return the sequence of outcomes of each rule, by its number."""
    return {
        number: [one for one in rule.outcomes if isinstance(one, MockOutcome)]
        for number, rule in enumerate(scenario.script.rules)
        if rule.once
    }


def _with_turns(scenario: Scenario, turns: Mapping[int, Sequence[MockOutcome]]) -> Scenario:
    """Return a scenario with other sequences of outcomes; usual ones at the end are left out."""
    rules = []
    for number, rule in enumerate(scenario.script.rules):
        turn = turns.get(number, ())
        needed = max((at for at, one in enumerate(turn, start=1) if one != USUAL), default=0)
        kept = rule if number not in turns else replace(rule, outcomes=tuple(turn[:needed]))
        rules += [kept] if kept.outcomes else []
    return _with(scenario, rules=tuple(rules))


def _with_happening(scenario: Scenario, number: int, happening: Happening) -> Scenario:
    known = scenario.script.happenings
    return _with(scenario, happenings=(*known[:number], happening, *known[number + 1 :]))


# -- pieces -------------------------------------------------------------------------------------------------

#: An element of a list that is asked for, a fault of a server, or something that happens: which field of a
#: script, the name or the number in it, and the number of the element or outcome.
_Piece = tuple[str, str | int, int]


def _pieces(scenario: Scenario) -> list[_Piece]:
    script = scenario.script
    lists = {name: given for name, given in script.request.items() if isinstance(given, list)}
    elements = [("request", name, index) for name, given in lists.items() for index in range(len(given))]
    turns = [(n, index, one) for n, turn in _turns(scenario).items() for index, one in enumerate(turn)]
    faults = [("rules", number, index) for number, index, one in turns if one != USUAL]
    return [*elements, *faults, *(("happenings", number, 0) for number in range(len(script.happenings)))]


def _without(scenario: Scenario, pieces: Sequence[_Piece]) -> Scenario:
    gone, script = set(pieces), scenario.script
    turns = {
        number: [USUAL if ("rules", number, at) in gone else one for at, one in enumerate(turn)]
        for number, turn in _turns(scenario).items()
    }
    return _with(
        _with_turns(scenario, turns),
        request={name: _left_of(name, given, gone) for name, given in script.request.items()},
        happenings=tuple(one for n, one in enumerate(script.happenings) if ("happenings", n, 0) not in gone),
    )


def _left_of(name: str, given: Any, gone: Container[_Piece]) -> Any:
    """Return a field of a request without the elements in `gone`; a list keeps one element at least."""
    if not isinstance(given, list):
        return given
    return [one for i, one in enumerate(given) if ("request", name, i) not in gone] or given[:1]


# -- simpler scenarios --------------------------------------------------------------------------------------


def _plainer(scenario: Scenario) -> Iterator[Scenario]:
    """Yield the scenario without one setting, and with one simpler fault or time."""
    script = scenario.script
    if script.seed:
        yield _with(scenario, seed=0)
    if script.clock != NO_CLOCK:
        yield _with(scenario, clock=NO_CLOCK)
    for name in scenario.parameters:
        fewer = {key: said for key, said in scenario.parameters.items() if key != name}
        yield replace(scenario, parameters=fewer)
    yield from _plainer_turns(scenario)
    for number, happening in enumerate(script.happenings):
        for later in _with_less(happening, {"nth": 1, "after": 0.0}, happening.waits):
            yield _with_happening(scenario, number, later)


def _plainer_turns(scenario: Scenario) -> Iterator[Scenario]:
    """Yield the scenario with faults of the usual duration, and with one simpler fault."""
    turns = _turns(scenario)
    yield _with_turns(scenario, {n: [replace(one, after=None) for one in turn] for n, turn in turns.items()})
    for number, turn in turns.items():
        for at, outcome in enumerate(turn):
            for less in _less_of(outcome):
                yield _with_turns(scenario, {number: [*turn[:at], less, *turn[at + 1 :]]})


def _less_of(outcome: MockOutcome) -> Iterator[MockOutcome]:
    """Yield simpler outcomes that still differ from the usual one."""
    usual = {one.name: getattr(USUAL, one.name) for one in fields(outcome)}
    said = {name: normal for name, normal in usual.items() if getattr(outcome, name) != normal}
    return _with_less(outcome, said, droppable=len(said) > 1)


def _with_less(thing: _Said, usual: Mapping[str, Any], droppable: bool) -> Iterator[_Said]:
    """Yield an outcome or happening with one field at its default, or a time rounded."""
    for name, normal in usual.items():
        value = getattr(thing, name)
        plainer = [normal] if droppable else []
        plainer += [round(value, digits) for digits in (0, 1)] if isinstance(value, float) else []
        yield from (replace(thing, **{name: one}) for one in plainer if one != value)


def _earlier(scenario: Scenario) -> Iterator[Scenario]:
    """Yield the scenario with a fault or a happening earlier."""
    for number, turn in _turns(scenario).items():
        if turn[0] == USUAL:
            yield _with_turns(scenario, {number: turn[1:]})
    for number, happening in enumerate(scenario.script.happenings):
        if happening.nth == 0:
            yield _with_happening(scenario, number, replace(happening, nth=1))
        for share in (0.1, 0.25, 0.5, 0.75) if not happening.waits and happening.after > 1.0 else ():
            sooner = replace(happening, after=round(happening.after * share, 1))
            yield _with_happening(scenario, number, sooner)


# -- of a run -----------------------------------------------------------------------------------------------


def _standing(mocks: Iterable[Mapping[str, Any]], steps: Sequence[Step]) -> Iterator[dict[str, Any]]:
    """Yield mocks in which servers of a cycle without time repeat their most frequent outcome for ever."""
    begun = [(step.time, c.operation) for step in steps for c in step.commands if isinstance(c, Start)]
    earlier = Counter(operation for time, operation in begun if time < steps[-1].time)
    circle = {operation for time, operation in begun if time == steps[-1].time}
    lasting = []
    for mock in mocks:
        before = earlier[mock["do"]] if mock["do"] in circle else len(mock["then"])
        first, then = mock["then"][:before], mock["then"][before:]
        if first:
            yield {**mock, "then": first}
        if then:
            lasting.append({**mock, "then": _most_often(then)})
    yield from lasting


def _most_often(said: Sequence[Any]) -> Any:
    often = Counter(map(repr, said)).most_common(1)[0][0]
    return next(one for one in said if repr(one) == often)


def _expected(run: Run, name: str) -> dict[str, Any]:
    """Return the expectations that make all but the property `name` pass: refusals, broken invariants."""
    refused = [
        {"request": step.event.name, "code": step.refusal.code}
        for step in run.history.refused
        if step.refusal
    ]
    broken = [] if name == INVARIANTS else [invariant for _, invariant in run.history.broken]
    found = {"refused": refused, "broken": broken}
    return {key: value for key, value in found.items() if value}
