"""Statechart semantics without data, by SCXML's algorithm (W3C SCXML 1.0, appendix D).

* The states left are the active ones below the transition's domain, children before parents, last first.
* The states entered are those between the domain and the target, parents first, with the default children
  of whatever is entered and not named.
* Of transitions that would leave the same state one is taken: whose source lies deeper, else the first.
* What SCXML lacks: a history that remembers some levels goes back into a mission that is used as a part, to
  the state of it that was left, however deep that mission stands.

Checker and machine use the same rules. Which guards hold and what history remembers is asked of the caller.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

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

#: First words of what people ask for.
REQUESTS = frozenset({"operator", "answer", "mission"})


def matches(pattern: str, event: str) -> bool:
    """Say whether an event pattern (`a.b`, `a.*`, `*`) covers an event's name, or all that a pattern covers.

    `*` means no events of the engine, no levels of inputs, and no requests: who asks to abort must not get
    something else.
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
        """Return the innermost compound state that holds source and target and is itself not left.

        A history state counts as itself, a child of the state whose past it is: what is left must not depend
        on what is remembered.
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

    def entry_set(
        self,
        rules: Iterable[Transition],
        kept: Iterable[str],
        mission: str,
        remembered: Callable[[State], tuple[str, ...]],
        resume: Callable[[State], str | None],
    ) -> tuple[tuple[str, ...], frozenset[str]]:
        """Return the states entered, parents before children, in document order; and those that history
        brings back.

        Args:
            rules: transitions that are taken together.
            kept: what stays active.
            mission: the default child of the slot is its mission's.
            remembered: the states that a history state stands for; none: its parent is entered anew.
            resume: the child to enter when a state comes back by history; None: what is remembered.
        """
        entry = _EntrySet(self, mission, resume)
        for rule in rules:
            if rule.target is not None:
                entry.follow(rule, rule.target, remembered)
        entered = set(entry.entered).difference(kept)
        return tuple(sorted(entered, key=self.order.__getitem__)), frozenset(entry.back)

    def default_child(self, state: State, mission: str) -> str:
        """Return the child that a compound state begins with; the slot with the branch of its mission."""
        if state.slot and mission:
            return self.chart.missions[mission].state
        return state.initial or state.children[0]

    def remembers(
        self, configuration: tuple[str, ...], exits: Iterable[str]
    ) -> tuple[tuple[str, tuple[str, ...]], ...]:
        """Return what the history states of the states left will stand for."""
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
        """Return the active descendants `depth` levels down (None: the leaves), or leaves above that.

        In place of one with a mission that is used stands what is active of that mission.
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
        """Drop transitions that would leave what an earlier or deeper one leaves (SCXML: preemption)."""
        kept: list[Transition] = []
        for rule in {rule.id: rule for rule in chosen}.values():
            leaving = self.exits(configuration, [rule])
            clashing = [k for k in kept if set(leaving) & set(self.exits(configuration, [k]))]
            if any(not self.is_below(rule.source, k.source) for k in clashing):
                continue
            kept = [k for k in kept if k not in clashing]
            kept.append(rule)
        return tuple(kept)


class _EntrySet:
    """SCXML's computeEntrySet: collects what is entered together."""

    def __init__(self, semantics: Semantics, mission: str, resume: Callable[[State], str | None]) -> None:
        self._semantics = semantics
        self._mission = mission
        self._resume = resume
        self.entered: dict[str, None] = {}
        self.back: set[str] = set()

    def follow(self, rule: Transition, name: str, remembered: Callable[[State], tuple[str, ...]]) -> None:
        """Enter the target of a transition, or what its history state stands for."""
        target = self._semantics.chart.states[name]
        past = remembered(target) if target.kind is Kind.HISTORY else ()
        domain = self._semantics.domain(rule, name)
        found = dict(self._brought_back(target, state) for state in past)
        targets = tuple(found) or self._anew(target, domain)
        for state in targets:
            self._enter(state, domain, targets)
        for state in found.values():
            self.back.update(self._semantics.lineage[state])

    def _brought_back(self, history: State, name: str) -> tuple[str, str]:
        """Return where to go on for a remembered state, and which state goes on there.

        That is the outermost one, from the history's parent inwards, of which a `resume_at` holds; else the
        remembered state as a whole.
        """
        lineage = self._semantics.lineage[name]
        for around in reversed(lineage[: lineage.index(history.parent or "") + 1]):
            state = self._semantics.chart.states[around]
            chosen = self._resume(state) if state.kind is Kind.COMPOUND else None
            if chosen is not None:
                return chosen, around
        return name, name

    def _anew(self, target: State, domain: str) -> tuple[str, ...]:
        """Return the target; for a history without memory what it says, else what its parent begins with."""
        if target.kind is not Kind.HISTORY:
            return (target.name,)
        if target.initial is not None:
            return (target.initial,)
        parent = target.parent or ""
        return (self._child(self._semantics.chart.states[parent]) if parent == domain else parent,)

    def _child(self, state: State) -> str:
        return self._semantics.default_child(state, self._mission)

    def _enter(self, name: str, domain: str, targets: Sequence[str]) -> None:
        """Enter a state, what it begins with, and what lies between the domain and it."""
        self._enter_defaults(name)
        for ancestor in self._semantics.lineage[name][1:]:
            if ancestor == domain:
                break
            self.entered[ancestor] = None
            if self._semantics.chart.states[ancestor].kind is Kind.PARALLEL:
                for region in self._semantics.regions(ancestor):
                    named = any(t == region or self._semantics.is_below(t, region) for t in targets)
                    if not named and region not in self.entered:
                        self._enter_defaults(region)

    def _enter_defaults(self, name: str) -> None:
        self.entered[name] = None
        state = self._semantics.chart.states[name]
        if state.kind is Kind.PARALLEL:
            for region in self._semantics.regions(name):
                self._enter_defaults(region)
        elif state.kind is Kind.COMPOUND:
            chosen = self._child(state)
            self._enter(chosen, name, (chosen,))
