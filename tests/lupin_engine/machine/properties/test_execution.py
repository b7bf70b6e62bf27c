"""What the library does with the transitions that are taken, held against SCXML's algorithm.

The library executes them (`structure.ChartTransition`). What is left follows from `Semantics.exits`, what is
entered from SCXML's computeEntrySet, written down here; both know nothing of the library. Random charts with
parallel regions and history are run, and every microstep that is made on the way is compared.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import islice, product
from typing import TypeAlias

import pytest
from hypothesis import given

from lupin_engine.chart.model import Chart, Kind, State, Transition
from lupin_engine.chart.semantics import Aim, Semantics
from lupin_engine.machine.structure import Configuration, DispatchTable, Microstep, States, Structure
from tests.lupin_engine.machine.properties.random_charts import charts, remembering_trees

pytestmark = pytest.mark.slow


class EntrySet:
    """SCXML's computeEntrySet (W3C SCXML 1.0, appendix D): collects what is entered together."""

    def __init__(self, semantics: Semantics, mission: str) -> None:
        self._semantics = semantics
        self._states = semantics.chart.states
        self._mission = mission
        self.entered: set[str] = set()

    def follow(self, rule: Transition, targets: Sequence[str]) -> None:
        """Enter what a transition leads to."""
        if rule.target is not None:
            domain = self._semantics.domain(rule, rule.target)
            for state in targets:
                self._enter(state, domain, targets)

    def _enter(self, name: str, domain: str, targets: Sequence[str]) -> None:
        """Enter a state, what it begins with, and what lies between the domain and it."""
        self._enter_defaults(name)
        for ancestor in self._semantics.lineage[name][1:]:
            if ancestor == domain:
                break
            self.entered.add(ancestor)
            if self._states[ancestor].kind is Kind.PARALLEL:
                for region in self._semantics.regions(ancestor):
                    named = any(t == region or self._semantics.is_below(t, region) for t in targets)
                    if not named and region not in self.entered:
                        self._enter_defaults(region)

    def _enter_defaults(self, name: str) -> None:
        self.entered.add(name)
        state = self._states[name]
        if state.kind is Kind.PARALLEL:
            for region in self._semantics.regions(name):
                self._enter_defaults(region)
        elif state.kind is Kind.COMPOUND:
            chosen = self._semantics.default_child(state, self._mission)
            self._enter(chosen, name, (chosen,))


class ComparedTable(DispatchTable):
    """A dispatch table that compares every microstep that it makes."""

    def _make(
        self, active: Configuration, rules: tuple[Transition, ...], mission: str, aims: Sequence[Aim]
    ) -> Microstep:
        found = super()._make(active, rules, mission, aims)
        semantics = Semantics(self.structure.chart)
        order = semantics.order.__getitem__
        entry = EntrySet(semantics, mission)
        for rule, aim in zip(rules, aims, strict=True):
            entry.follow(rule, aim.targets)
        left = semantics.exits(active.states, rules)
        assert found.exited == left
        assert found.entered == tuple(sorted(entry.entered, key=order))
        kept = set(active.states) - set(left)
        assert found.between == tuple(sorted(kept, key=order))
        assert found.leads_to.states == tuple(sorted(kept | entry.entered, key=order))
        return found


#: What the history states of a chart remember.
Past: TypeAlias = Mapping[str, States]


def explore(given_chart: Chart) -> None:
    """Take all transitions that may be taken together, in every situation that they lead to: guards hold.

    A situation is a configuration and what its history states remember; a hundred of them are looked at.
    """
    table = ComparedTable(Structure(given_chart))
    waiting: list[tuple[Configuration, Past]] = [(table.beginning().leads_to, {})]
    seen: list[tuple[States, Past]] = []
    events = sorted({rule.event for state in given_chart.states.values() for rule in state.transitions})
    while waiting and len(seen) < 100:
        active, past = waiting.pop(0)
        if (active.states, past) not in seen:
            seen.append((active.states, past))
            for event in events:
                waiting += _following(table, active, active.candidates(event), past)


def _following(
    table: DispatchTable, active: Configuration, candidates: Sequence[Sequence[Transition]], past: Past
) -> Iterator[tuple[Configuration, Past]]:
    for chosen in _together(candidates):
        plan = table.microstep(active, chosen, "", lambda history: past.get(history.name, ()), _goes_on)
        yield plan.leads_to, {**past, **dict(plan.remembers)}


def _together(candidates: Sequence[Sequence[Transition]]) -> Iterator[list[Transition]]:
    """Yield choices of one transition or none for each leaf, not more than forty."""
    offered = [(None, *rules) for rules in candidates]
    for choice in islice(product(*offered), 40):
        if chosen := [rule for rule in choice if rule is not None]:
            yield chosen


def _goes_on(_: State) -> str | None:
    return None


@given(charts() | charts(remembering_trees()))
def test_the_library_does_what_scxml_says(given_chart: Chart) -> None:
    """The same states are left and entered, and the configuration is the same after it."""
    explore(given_chart)
