"""The chart as a `transitions.HierarchicalMachine`, and SCXML's questions answered from its objects.

The library's machine holds the states, the transitions and their guards: one machine per chart, one root
state, every transition at machine level under its full name, no automatic transitions. That layout avoids
what the library does differently from SCXML when transitions are declared inside a parallel state. What it
answers differently in any layout, this module decides, by SCXML's algorithm (W3C SCXML 1.0, appendix D):

* an event is offered to every active leaf, in document order, from the leaf outwards; the first transition
  whose guard holds is taken; one that would leave a region which a chosen one already leaves is dropped,
  unless its source lies deeper;
* the states left are the active ones below the transition's domain, children before parents, last first;
* the states entered are those between the domain and the target, parents first, with the default
  children of whatever is entered and not named.

Nothing here depends on data: which guards hold is asked of the caller.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any

from transitions.extensions.nesting import HierarchicalMachine, NestedState, NestedTransition

from lupin_engine.chart.model import Chart, Kind, State, Transition

ROOT = "chart"
#: The top-level state that an unhandled error leads to, if the lifecycle has it.
FAULT = "FAULT"
EXECUTION_ERROR = "error.execution"
#: The id of the transition that leads there.
FAULT_RULE = "engine.fault"


class ChartState(NestedState):
    """A state of the library that knows its rule; dots separate levels because names may hold `_`."""

    separator = "."

    def __init__(self, *args: Any, rule: State, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.rule = rule


class ChartTransition(NestedTransition):
    """A transition of the library that knows its rule."""

    def __init__(self, *args: Any, rule: Transition, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.rule = rule


class ChartMachine(HierarchicalMachine):
    """The library's machine over our states and transitions."""

    state_cls = ChartState
    transition_cls = ChartTransition


def build_machine(chart: Chart) -> ChartMachine:
    """Return the library's machine for `chart`; its only root state is `chart`.

    History is no state of the library: whoever targets it gets the remembered states, so it stays out and
    a transition to it is declared to its parent.
    """
    machine = ChartMachine(
        model=None,
        states=[_describe(chart, "")],
        initial=ROOT,
        auto_transitions=False,
        queued=True,
        send_event=True,
    )
    for state in chart.states.values():
        for rule in (*state.transitions, *_fault_transition(chart, state)):
            machine.add_transition(
                rule.event or "always",
                _library_name(rule.source),
                _library_target(chart, rule),
                conditions=_condition(rule),
                rule=rule,
            )
    return machine


def _fault_transition(chart: Chart, state: State) -> tuple[Transition, ...]:
    """Return the one transition that no author writes: an error nobody handles leads to FAULT."""
    if state.name != "" or FAULT not in chart.states:
        return ()
    return (Transition(FAULT_RULE, EXECUTION_ERROR, "", state.place, target=FAULT),)


def _describe(chart: Chart, name: str) -> dict[str, Any]:
    state = chart.states[name]
    children = [child for child in state.children if chart.states[child].kind is not Kind.HISTORY]
    described: dict[str, Any] = {"name": state.local_name or ROOT, "rule": state}
    if state.kind is Kind.FINAL:
        described["final"] = True
    if children:
        described["children"] = [_describe(chart, child) for child in children]
        described["initial"] = _library_initial(chart, state, children)
    return described


def _library_initial(chart: Chart, state: State, children: Sequence[str]) -> str | list[str]:
    if state.kind is Kind.PARALLEL:
        return [chart.states[child].local_name for child in children]
    return chart.states[state.initial or children[0]].local_name


def _library_name(name: str) -> str:
    return f"{ROOT}.{name}" if name else ROOT


def _library_target(chart: Chart, rule: Transition) -> str | None:
    if rule.target is None:
        return None
    target = chart.states[rule.target]
    return _library_name((target.parent or "") if target.kind is Kind.HISTORY else target.name)


def _condition(rule: Transition) -> list[str | Callable[..., bool | None]]:
    """Let the stock machine ask the same guard; it finds the environment in the event's keywords."""
    guard = rule.guard
    if guard is None:
        return []
    return [lambda event_data: bool(guard.evaluate(event_data.kwargs["environment"]))]


class Structure:
    """SCXML's answers for one chart, read once from the library's machine."""

    def __init__(self, chart: Chart) -> None:
        self.chart = chart
        self.machine = build_machine(chart)
        self.order: dict[str, int] = {name: index for index, name in enumerate(chart.states)}
        self._lineage: dict[str, tuple[str, ...]] = {
            name: (name, *chart.ancestors(name)) for name in chart.states
        }
        self._rules = self._collect_rules()
        self._candidates: dict[tuple[tuple[str, ...], str], tuple[tuple[Transition, ...], ...]] = {}

    def _collect_rules(self) -> dict[str, tuple[Transition, ...]]:
        found: dict[str, list[Transition]] = {name: [] for name in self.chart.states}
        for event in self.machine.events.values():
            for transitions in event.transitions.values():
                for transition in transitions:
                    assert isinstance(transition, ChartTransition)
                    found[transition.rule.source].append(transition.rule)
        return {name: self._in_written_order(name, rules) for name, rules in found.items()}

    def _in_written_order(self, name: str, rules: list[Transition]) -> tuple[Transition, ...]:
        # The library groups by event; between an exact name and a wildcard the author's order decides.
        written = {rule.id: index for index, rule in enumerate(self.chart.states[name].transitions)}
        return tuple(sorted(rules, key=lambda rule: written.get(rule.id, len(written))))

    # -- which transitions ------------------------------------------------------------------------------

    def rules_of(self, state: str, event: str) -> tuple[Transition, ...]:
        """Return the transitions of one state that listen to `event`, in the order written."""
        return tuple(rule for rule in self._rules[state] if matches(rule.event, event))

    def candidates(self, configuration: tuple[str, ...], event: str) -> tuple[tuple[Transition, ...], ...]:
        """Return for each active leaf the transitions that may answer `event`, in order of preference."""
        key = (configuration, event)
        if key not in self._candidates:
            self._candidates[key] = tuple(
                tuple(rule for state in self._lineage[leaf] for rule in self.rules_of(state, event))
                for leaf in self.leaves(configuration)
            )
        return self._candidates[key]

    def level_candidates(self, configuration: tuple[str, ...]) -> tuple[tuple[Transition, ...], ...]:
        """Return for each active leaf its eventless transitions and those on the level of an input."""
        key = (configuration, "always")
        if key not in self._candidates:
            self._candidates[key] = tuple(
                tuple(
                    rule
                    for state in self._lineage[leaf]
                    for rule in self._rules[state]
                    if rule.event == "" or rule.event.startswith("input.")
                )
                for leaf in self.leaves(configuration)
            )
        return self._candidates[key]

    def leaves(self, configuration: Iterable[str]) -> tuple[str, ...]:
        """Return the active states without active children, in document order."""
        active = set(configuration)
        parents = {self.chart.states[name].parent for name in active}
        return tuple(sorted((name for name in active if name not in parents), key=self.order.__getitem__))

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

    # -- which states -----------------------------------------------------------------------------------

    def is_below(self, name: str, ancestor: str) -> bool:
        """Say whether `name` is a proper descendant of `ancestor`."""
        return ancestor in self._lineage[name][1:]

    def domain(self, rule: Transition, target: str) -> str:
        """Return the innermost compound state that holds source and target and is itself not left.

        A history state counts as itself, a child of the state whose past it is: what is left must not depend
        on what is remembered.
        """
        source = self.chart.states[rule.source]
        if rule.internal and source.kind is Kind.COMPOUND and self.is_below(target, rule.source):
            return rule.source
        for ancestor in self._lineage[rule.source][1:]:
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

    def _anew(self, target: State, domain: str, child: Callable[[State], str | None]) -> tuple[str, ...]:
        """Return the target, or for a history state without memory what its parent begins with."""
        if target.kind is not Kind.HISTORY:
            return (target.name,)
        parent = target.parent or ""
        first = child(self.chart.states[parent]) if parent == domain else parent
        return (first,) if first is not None else ()

    def entries(
        self,
        rule: Transition,
        remembered: Callable[[State], tuple[str, ...]],
        child: Callable[[State], str | None],
        resume: Callable[[State], str | None],
    ) -> tuple[str, ...]:
        """Return the states entered by `rule`, parents before children, in document order.

        Args:
            rule: a transition with a target.
            remembered: the states that a history state stands for; none: its parent is entered anew.
            child: the default child of a compound state (the slot's depends on the mission).
            resume: the child to enter when a state comes back by history; None: its default child.
        """
        if rule.target is None:
            return ()
        entered: dict[str, None] = {}
        target = self.chart.states[rule.target]
        back = remembered(target) if target.kind is Kind.HISTORY else ()
        domain = self.domain(rule, rule.target)
        targets = back or self._anew(target, domain, child)
        for name in targets:
            self._enter(name, domain, targets, entered, child, resume if back else None)
        return tuple(sorted(entered, key=self.order.__getitem__))

    def _enter(
        self,
        name: str,
        domain: str,
        targets: Sequence[str],
        entered: dict[str, None],
        child: Callable[[State], str | None],
        resume: Callable[[State], str | None] | None,
    ) -> None:
        self._enter_defaults(name, entered, child, resume)
        for ancestor in self._lineage[name][1:]:
            if ancestor == domain:
                break
            entered[ancestor] = None
            if self.chart.states[ancestor].kind is Kind.PARALLEL:
                for region in self._regions(ancestor):
                    named = any(target == region or self.is_below(target, region) for target in targets)
                    if not named and region not in entered:
                        self._enter_defaults(region, entered, child, None)

    def _enter_defaults(
        self,
        name: str,
        entered: dict[str, None],
        child: Callable[[State], str | None],
        resume: Callable[[State], str | None] | None,
    ) -> None:
        entered[name] = None
        state = self.chart.states[name]
        if state.kind is Kind.PARALLEL:
            for region in self._regions(name):
                self._enter_defaults(region, entered, child, None)
        elif state.kind is Kind.COMPOUND:
            chosen = (resume(state) if resume else None) or child(state)
            if chosen is not None:
                self._enter(chosen, name, (chosen,), entered, child, None)

    def _regions(self, name: str) -> list[str]:
        children = self.chart.states[name].children
        return [child for child in children if self.chart.states[child].kind is not Kind.HISTORY]


def matches(pattern: str, event: str) -> bool:
    """Say whether a transition's event pattern (`a.b`, `a.*`, `*`) covers an event's name."""
    if pattern == event:
        return True
    if pattern == "*":
        return bool(event) and not event.startswith(("done", "error", "after."))
    return pattern.endswith(".*") and event.startswith(pattern[:-1])
