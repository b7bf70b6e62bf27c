"""Statechart semantics without data, by SCXML's algorithm (W3C SCXML 1.0, appendix D).

* The exit set are the active states below the transition's domain (the LCCA), children before parents,
  last first.
* Of transitions whose exit sets meet one is taken: whose source lies deeper, else the first.
* Beyond SCXML: where a history of limited depth would restore a state with an embedded mission in it, it
  restores the active direct child of the innermost such mission, even below the history's depth.

Checker and machine choose by the same rules. The caller supplies guards and history values. The entry set is
computed where transitions are executed (`machine.structure`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

from lupin_engine.chart.model import Chart, Kind, State, Transition

#: The top-level state that an unhandled error leads to, if the lifecycle has it.
FAULT = "FAULT"
EXECUTION_ERROR = "error.execution"
#: The shortest time between two ticks of an `every`, in seconds.
MIN_PERIOD = 0.1
#: Beginnings of the events of a state's timers.
TIMERS = ("after.", "every.", "at.")
#: First words of the events that the engine makes for one state.
ENGINE_EVENTS = frozenset({"done", "error", "after", "every", "at", "budget"})

#: The variables of a chart with a `before_divert`: the divert that waits, and whether it waits no longer.
DIVERT, DIVERT_DUE = "divert", "divert_due"
#: First words of what people ask for.
REQUESTS = frozenset({"operator", "answer", "mission"})


def matches(pattern: str, event: str) -> bool:
    """Say whether an event pattern (`a.b`, `a.*`, `*`) covers an event's name, or all that a pattern covers.

    `*` covers no events of the engine, no levels of inputs, and no requests: a request to abort must not have
    another effect.
    """
    if pattern == event:
        return True
    if pattern == "*":
        first, dot, _ = event.partition(".")
        return (
            bool(event)
            and first not in ENGINE_EVENTS
            and first != "input"
            and not (dot and first in REQUESTS)
        )
    return pattern.endswith(".*") and event.startswith(pattern[:-1])


class Aim(NamedTuple):
    """The states that a transition leads to, and those that history brings back with them."""

    targets: tuple[str, ...]
    back: frozenset[str] = frozenset()


#: Of a transition without a target.
NOWHERE = Aim(())


class Semantics:
    """SCXML's answers for one chart."""

    def __init__(self, chart: Chart) -> None:
        self.chart = chart
        #: Document order.
        self.order: dict[str, int] = {name: index for index, name in enumerate(chart.states)}
        self.lineage = chart.lineage

    def leaves(self, configuration: Iterable[str]) -> tuple[str, ...]:
        """Return the active states without active children, in document order."""
        active = set(configuration)
        parents = {self.chart.states[name].parent for name in active}
        return tuple(sorted((name for name in active if name not in parents), key=self.order.__getitem__))

    def is_below(self, name: str, ancestor: str) -> bool:
        """Say whether `name` is a proper descendant of `ancestor`."""
        return ancestor in self.lineage[name][1:]

    def is_to_history(self, rule: Transition) -> bool:
        """Say whether where a transition leads depends on the past."""
        return rule.target is not None and self.chart.states[rule.target].kind is Kind.HISTORY

    def domain(self, rule: Transition, target: str) -> str:
        """Return the LCCA: the innermost compound state that holds source and target and is itself not left.

        A history state counts as itself, a child of its parent: the exit set must not depend on the history
        value.
        """
        source = self.chart.states[rule.source]
        if rule.internal and source.kind is Kind.COMPOUND and self.is_below(target, rule.source):
            return rule.source
        for ancestor in self.lineage[rule.source][1:]:
            compound = self.chart.states[ancestor].kind is Kind.COMPOUND
            if compound and self.is_below(target, ancestor):
                return ancestor
        return ""

    def exits(self, configuration: tuple[str, ...], rules: Iterable[Transition]) -> tuple[str, ...]:
        """Return the states left, children before parents, later siblings first."""
        left: set[str] = set()
        for rule in rules:
            if rule.target is None:
                continue
            domain = self.domain(rule, rule.target)
            left.update(name for name in configuration if self.is_below(name, domain))
        return tuple(sorted(left, key=self.order.__getitem__, reverse=True))

    def aim(
        self,
        rule: Transition,
        mission: str,
        remembered: Callable[[State], tuple[str, ...]],
        resume: Callable[[State], str | None],
    ) -> Aim:
        """Return the states that a transition leads to, for one to a history state by its value.

        Args:
            rule: a transition that is taken.
            mission: the default child of the slot is its mission's.
            remembered: returns the value of a history state; none: its parent is entered anew.
            resume: returns the child to enter in a state restored from history; None: the remembered one.
        """
        if rule.target is None:
            return NOWHERE
        target = self.chart.states[rule.target]
        if target.kind is not Kind.HISTORY:
            return Aim((target.name,))
        found = dict(self._brought_back(target, state, resume) for state in remembered(target))
        if found:
            back = {name for state in found.values() for name in self.lineage[state]}
            return Aim(tuple(found), frozenset(back))
        if target.initial is not None:
            return Aim((target.initial,))
        parent = self.chart.states[target.parent or ""]
        is_left = parent.name != self.domain(rule, target.name)
        return Aim((parent.name if is_left else self.default_child(parent, mission),))

    def _brought_back(
        self, history: State, name: str, resume: Callable[[State], str | None]
    ) -> tuple[str, str]:
        """Return the target for a remembered state, and the state that resumes there.

        That is the outermost one, from the history's parent inwards, of which a `resume_at` holds; else the
        remembered state as a whole.
        """
        lineage = self.lineage[name]
        for around in reversed(lineage[: lineage.index(history.parent or "") + 1]):
            state = self.chart.states[around]
            chosen = resume(state) if state.kind is Kind.COMPOUND else None
            if chosen is not None:
                return chosen, around
        return name, name

    def default_child(self, state: State, mission: str) -> str:
        """Return the child that a compound state begins with; the slot with the branch of its mission."""
        if state.slot and mission:
            return self.chart.missions[mission].state
        return state.initial or state.children[0]

    def remembers(
        self, configuration: tuple[str, ...], exits: Iterable[str]
    ) -> tuple[tuple[str, tuple[str, ...]], ...]:
        """Return the new values of the history states in the exit set."""
        leaving = set(exits)
        return tuple(
            (child, self._descendants(configuration, name, self.chart.states[child].depth, leaving))
            for name in leaving
            for child in self.chart.states[name].children
            if self.chart.states[child].kind is Kind.HISTORY
        )

    def _descendants(
        self, configuration: tuple[str, ...], name: str, depth: int | None, among: set[str]
    ) -> tuple[str, ...]:
        """Return the active descendants `depth` levels down, or atomic ones above (None: the atomic ones).

        An embedded mission among them is replaced by its active direct child.
        """
        leaves = set(self.leaves(among))
        base = len(self.lineage[name]) - 1
        found = [
            state
            for state in configuration
            if state in among
            and self.is_below(state, name)
            and (state in leaves if depth is None else self._at_depth(state, base + depth, leaves))
        ]
        return tuple(inner for state in found for inner in self._in_missions(configuration, state))

    def _in_missions(self, configuration: tuple[str, ...], name: str) -> list[str]:
        """Return the active children of the innermost missions that are used in a state, else the state."""
        states = self.chart.states
        used = [n for n in configuration if states[n].use is not None and name in self.lineage[n]]
        inner = [n for n in used if not any(self.is_below(other, n) for other in used)]
        return [n for n in configuration if states[n].parent in inner] or [name]

    def _at_depth(self, state: str, depth: int, leaves: set[str]) -> bool:
        level = len(self.lineage[state]) - 1
        return level == depth or (level < depth and state in leaves)

    def regions(self, name: str) -> list[str]:
        """Return the children of a state that can be active."""
        children = self.chart.states[name].children
        return [child for child in children if self.chart.states[child].kind is not Kind.HISTORY]

    def without_conflicts(
        self, configuration: tuple[str, ...], chosen: Sequence[Transition]
    ) -> tuple[Transition, ...]:
        """Drop transitions whose exit set meets that of an earlier or deeper one (SCXML: preemption)."""
        kept: list[Transition] = []
        for rule in {rule.id: rule for rule in chosen}.values():
            leaving = self.exits(configuration, [rule])
            clashing = [k for k in kept if set(leaving) & set(self.exits(configuration, [k]))]
            if any(not self.is_below(rule.source, k.source) for k in clashing):
                continue
            kept = [k for k in kept if k not in clashing]
            kept.append(rule)
        return tuple(kept)
