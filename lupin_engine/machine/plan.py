"""What transitions do, worked out once for each configuration and kept: nothing in it depends on data.

A `Row` is a configuration with all that follows from it alone. A `Plan` is what taking certain transitions
from there does: the states left and entered in their order, the configuration after each of them, and the row
that it leads to. Both are made when they are first needed, from the objects of the library's machine (through
`Structure`), and shared by all machines of a chart. Their number is bounded: a chart with many parallel
regions has more configurations than memory; beyond the bound they are made anew every time, to the same
effect.

Two things do depend on data and are therefore asked for: what a history state remembers, and where a state
goes on that comes back by history (`resume_at`). Plans through a history state are not kept.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from typing import TypeAlias

from lupin_engine.chart.model import Chart, Kind, State, Transition
from lupin_engine.machine.environment import Surroundings
from lupin_engine.machine.event import NO_EVENT, Event
from lupin_engine.machine.memory import Memory
from lupin_engine.machine.structure import Structure
from lupin_engine.machine.view import Moment

#: How many configurations, and how many plans of each, are kept.
MAX_ROWS = 4096
MAX_PLANS = 1024

Configuration = tuple[str, ...]

#: Takes an event's transitions at a time, or returns None where it cannot; see `shortcut`.
Shortcut: TypeAlias = "Callable[[Memory, Surroundings, Event, float], Taken | None]"
#: An event that has shortcuts: its name, or (state, event) for the event of one state alone.
Heard: TypeAlias = str | tuple[str, str]


class Row:
    """A configuration and what follows from it alone.

    `label` and `phase` are published. `levels` are, for each leaf, the transitions that need no event.
    `working` are the states with an operation. In a `passing` row a final state is active, or a helper
    (named in lower case): nobody should see it. `answers` are the shortcuts from here.
    """

    __slots__ = (
        "_candidates",
        "answers",
        "configuration",
        "label",
        "leaves",
        "levels",
        "moment",
        "passing",
        "phase",
        "plans",
        "working",
    )

    def __init__(self, structure: Structure, configuration: Configuration) -> None:
        states = [structure.chart.states[name] for name in configuration]
        self.configuration = configuration
        self.leaves = structure.leaves(configuration)
        self.label = next((state.label for state in states if state.label), "")
        self.phase = next((state.phase for state in reversed(states) if state.phase), "")
        self.moment = Moment(self.label, self.phase, "")
        self.levels = tuple(filter(None, (structure.level_rules(leaf) for leaf in self.leaves)))
        self.working = tuple(state for state in states if state.invoke or state.for_each)
        self.passing = self.label.islower() or any(state.kind is Kind.FINAL for state in states)
        self.plans: dict[tuple[str, ...], Plan] = {}
        self.answers: dict[Heard, Shortcut | None] = {}
        self._candidates: dict[str, tuple[tuple[Transition, ...], ...]] = {}

    def candidates(self, structure: Structure, event: str) -> tuple[tuple[Transition, ...], ...]:
        """Return for each active leaf the transitions that may answer `event`, in order of preference."""
        found = self._candidates.get(event)
        if found is None:
            found = tuple(structure.candidates(leaf, event) for leaf in self.leaves)
            if len(self._candidates) < MAX_PLANS:
                self._candidates[event] = found
        return found


class Plan:
    """Transitions taken together from one row: SCXML's microstep without its data.

    `exits` and `entries` pair each state with the configuration once it was left or entered. `remembers` is
    what the history states of what is left will stand for. `back` are the entered states that history
    brought back.
    """

    __slots__ = (
        "alone",
        "back",
        "entered",
        "entries",
        "exited",
        "exits",
        "remembers",
        "row",
        "rules",
        "taken",
    )

    def __init__(
        self,
        rules: tuple[Transition, ...],
        exits: tuple[tuple[State, Configuration], ...],
        entries: tuple[tuple[State, Configuration], ...],
        row: Row,
        remembers: tuple[tuple[str, Configuration], ...] = (),
        back: frozenset[str] = frozenset(),
    ) -> None:
        self.rules = rules
        self.exits = exits
        self.entries = entries
        self.row = row
        self.remembers = remembers
        self.back = back
        self.taken = tuple(rule.id for rule in rules if rule.id)
        self.exited = tuple(state.name for state, _ in exits)
        self.entered = tuple(state.name for state, _ in entries)
        self.alone = (self,)


class Taken:
    """What a shortcut has done: always the same, so it is made once.

    `answers` are the shortcuts from then on, `event` is that of a timer, which steps are recorded with.
    """

    __slots__ = ("answers", "event", "plans")

    def __init__(self, plan: Plan, event: Event | None) -> None:
        self.plans = plan.alone
        self.answers: Mapping[Heard, Shortcut | None] = plan.row.answers
        self.event = event or NO_EVENT


@lru_cache(maxsize=32)
def planner_of(chart: Chart) -> Planner:
    """Return the planner that all machines of a chart share."""
    return Planner(Structure(chart))


class Planner:
    """Makes and keeps the rows and plans of one chart."""

    def __init__(self, structure: Structure) -> None:
        self.structure = structure
        self._rows: dict[Configuration, Row] = {}
        self._beginning: Plan | None = None

    def row(self, configuration: Configuration) -> Row:
        """Return the row of a configuration, given in document order."""
        row = self._rows.get(configuration)
        if row is None:
            row = Row(self.structure, configuration)
            if len(self._rows) < MAX_ROWS:
                self._rows[configuration] = row
        return row

    def beginning(self) -> Plan:
        """Return the plan that enters the states in which the chart starts."""
        if self._beginning is None:
            start = Transition("", "start", "", self.structure.chart.states[""].place, target="")
            self._beginning = self._make(self.row(()), [start], "", lambda _: (), lambda _: None)
        return self._beginning

    def plan(
        self,
        row: Row,
        chosen: Sequence[Transition],
        mission: str,
        remembered: Callable[[State], Configuration],
        resume: Callable[[State], str | None],
    ) -> Plan:
        """Return what taking the chosen transitions does; of those in conflict only the preferred ones count.

        Args:
            row: where they are taken.
            chosen: the first enabled one of each leaf, in document order of the leaves.
            mission: chooses the branch of the slot.
            remembered: what a history state stands for now.
            resume: the child in which a state goes on that comes back by history.
        """
        key = (mission, *[rule.id for rule in chosen])
        plan = row.plans.get(key)
        if plan is None:
            plan = self._make(row, chosen, mission, remembered, resume)
            if len(row.plans) < MAX_PLANS and not any(map(self.structure.is_to_history, plan.rules)):
                row.plans[key] = plan
        return plan

    def _make(
        self,
        row: Row,
        chosen: Sequence[Transition],
        mission: str,
        remembered: Callable[[State], Configuration],
        resume: Callable[[State], str | None],
    ) -> Plan:
        structure = self.structure
        rules = structure.without_conflicts(row.configuration, chosen)
        left = structure.exits(row.configuration, rules)
        kept = tuple(name for name in row.configuration if name not in left)
        remembers = structure.remembers(row.configuration, left)
        now = dict(remembers)  # what is left just now is the past of who comes back in the same step
        entered, back = structure.entry_set(
            rules,
            kept,
            mission,
            lambda past: now[past.name] if past.name in now else remembered(past),
            resume,
        )
        exits, configuration = [], list(row.configuration)
        for name in left:
            configuration.remove(name)
            exits.append((structure.chart.states[name], tuple(configuration)))
        entries = []
        for name in entered:
            configuration = sorted([*configuration, name], key=structure.order.__getitem__)
            entries.append((structure.chart.states[name], tuple(configuration)))
        leads_to = self.row(tuple(configuration)) if left or entered else row
        return Plan(rules, tuple(exits), tuple(entries), leads_to, remembers, back)
