"""Compiles a chart for execution, and caches its configurations and microsteps.

`chart.semantics` and the caller's data (which guards hold, history values) decide which transitions are
taken. The library `transitions` executes them: exit set, entry set and next configuration are its result. A
chart has one `HierarchicalMachine`, with one root state, every transition at machine level under its full
name, and no automatic transitions; `ChartTransition` overrides its resolution where that departs from SCXML.

A `Configuration` follows from the active states alone; a `Microstep` is the result of certain transitions
there. Both are made on demand, cached up to a limit, and shared by all machines of a chart, which run in one
thread.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import lru_cache, partial, reduce
from operator import getitem
from typing import Any, TypeAlias, cast

from transitions.extensions.nesting import (
    HierarchicalMachine,
    NestedEventData,
    NestedState,
    NestedTransition,
    resolve_order,
)

from lupin_engine.chart.model import Chart, Kind, State, Transition
from lupin_engine.chart.records import DECIDING, own
from lupin_engine.chart.semantics import EXECUTION_ERROR, FAULT, Aim, Semantics, matches
from lupin_engine.machine.actions import CompiledAction
from lupin_engine.machine.holds import all_holds, released_by
from lupin_engine.machine.scope import CONFIGURATION, HELD, OPERATIONS, REQUEST, Arguments, Reads
from lupin_engine.machine.step import Moment

ROOT = "chart"
#: The id of the transition that leads to FAULT.
FAULT_RULE = "engine.fault"


class ChartModel:
    """The model that the library moves: where it stands, and which states it left and entered."""

    def __init__(self, state: Any) -> None:
        self.state = state
        self.left: list[str] = []
        self.entered: list[str] = []

    @property
    def leaves(self) -> list[str]:
        """The innermost active states."""
        return [name.removeprefix(ROOT).removeprefix(".") for name in _flat(self.state)]


def _flat(state: Any) -> Iterator[str]:
    """Yield the names in a state of the library, which nests lists for regions."""
    if isinstance(state, str):
        yield state
    else:
        for inner in state:
            yield from _flat(inner)


class ChartState(NestedState):
    """A state of the library that knows its rule; dots separate levels because names may hold `_`.

    Final states are hidden from the library: it fails where a region moves beside one that has ended, and
    `done` is raised by the machine.
    """

    separator = "."

    def __init__(self, rule: State, initial: Any) -> None:
        super().__init__(
            rule.local_name or ROOT,
            on_enter=lambda event_data: event_data.model.entered.append(rule.name),
            on_exit=lambda event_data: event_data.model.left.append(rule.name),
            initial=initial,
        )
        self.rule = rule


def _path(name: str) -> list[str]:
    """Return how the library finds a state: from the root inwards."""
    return [ROOT, *name.split(".")] if name else [ROOT]


class ChartTransition(NestedTransition):
    """A transition of the library that knows its rule, and is resolved as SCXML says.

    The library departs from that in two ways: its exit set is below the innermost active state around the
    target, wherever the source is; and it enters no region but the target's.
    """

    def __init__(self, rule: Transition, source: str, target: str | None) -> None:
        super().__init__(source, cast(str, target))  # the type hints know no transition without one
        self.rule = rule

    def _resolve_transition(self, event_data: NestedEventData) -> Any:
        """Exit all active states below the LCCA; enter from there to the targets that the event data has."""
        machine = event_data.machine
        tree = machine.build_state_tree(cast(ChartModel, event_data.model).state, ChartState.separator)
        domain = self._domain(machine)
        below: dict[str, Any] = reduce(getitem, domain, tree)
        exits = []
        for path in resolve_order(below):
            state = machine.get_state([*domain, *path])
            exits.append(partial(state.scoped_exit, event_data, [*domain, *path[:-1]]))
        ways = [_path(target)[len(domain) :] for target in event_data.kwargs["targets"]]
        entered, entries = self._enter_nested(list(domain), ways, domain, event_data)
        below.clear()
        below.update(entered)
        return tree, exits, entries

    def _domain(self, machine: HierarchicalMachine) -> list[str]:
        """Return the LCCA: the innermost compound state that holds source and target.

        For a target that is a history it is the state around that history, whatever the history value.
        """
        source, target = _path(self.rule.source), _path(self.rule.target or "")
        for depth in range(len(source) - (not self.rule.internal), 0, -1):
            around = source[:depth]
            holds = around == target[:depth] and depth < len(target)
            if holds and not isinstance(machine.get_state(around).initial, list):
                return around
        return target[:-1][:1]

    def _enter_nested(self, root: list[str], dest: Any, prefix_path: list[str], event_data: Any) -> Any:
        """Enter every region of a parallel state; `dest` are ways to targets, of a history perhaps many."""
        ways = [way for way in dest if way]
        if root or not ways:
            return super()._enter_nested(root, ways, prefix_path, event_data)
        initial = event_data.machine.scoped.initial
        below: dict[str, Any] = {name: [] for name in initial} if isinstance(initial, list) else {}
        for name, *way in ways:
            below.setdefault(name, []).append(way)
        states, entries = OrderedDict[str, Any](), []
        for name, inner in below.items():
            # The library enters the one state and asks this method for what is inside it.
            state, more = super()._enter_nested([], [name, *inner], prefix_path, event_data)
            states.update(state)
            entries += more
        return states, entries


class ChartMachine(HierarchicalMachine):
    """The library's machine over our states and transitions."""

    state_cls = ChartState
    transition_cls = ChartTransition


def build_machine(chart: Chart) -> ChartMachine:
    """Return the library's machine for `chart`; its only root state is `chart`.

    History states are left out: a transition to one is declared to its parent, and its targets are the
    history value.
    """
    root = chart.states[""]
    top = ChartState(root, _library_initial(chart, root))
    machine = ChartMachine(
        model=None, states=[top], initial=ROOT, auto_transitions=False, queued=True, send_event=True
    )
    _add_children(chart, top)
    _add_transitions(chart, machine)
    return machine


def _add_children(chart: Chart, above: ChartState) -> None:
    """Add the states inside a state.

    `add_states` is not used: it walks through the whole tree for models that do not exist.
    """
    for child in _proper_children(chart, above.rule):
        inner = ChartState(child, _library_initial(chart, child))
        above.states[inner.name] = inner
        if child.children:
            _add_children(chart, inner)


def _proper_children(chart: Chart, state: State) -> list[State]:
    children = [chart.states[name] for name in state.children]
    return [child for child in children if child.kind is not Kind.HISTORY]


def _rules_of(chart: Chart, state: State) -> Iterable[Transition]:
    return state.transitions if state.name else (*state.transitions, *_fault_transition(chart))


def _add_transitions(chart: Chart, machine: ChartMachine) -> None:
    """Add all transitions directly: `add_transition` checks for each one properties that all of ours have."""
    names = {name: f"{ROOT}.{name}" if name else ROOT for name in chart.states}
    # A transition to a history state is declared to its parent.
    targets = {
        state.name: names[(state.parent or "") if state.kind is Kind.HISTORY else state.name]
        for state in chart.states.values()
    }
    events = machine.events
    for state in chart.states.values():
        for rule in _rules_of(chart, state):
            trigger = rule.event or "always"
            if trigger not in events:
                events[trigger] = machine.event_cls(trigger, machine)
            target = None if rule.target is None else targets[rule.target]
            events[trigger].add_transition(ChartTransition(rule, names[state.name], target))


def _fault_transition(chart: Chart) -> tuple[Transition, ...]:
    """Return the implicit transition: an unhandled error leads to FAULT, also while held."""
    if FAULT not in chart.states:
        return ()
    through = frozenset(all_holds(chart))
    return (
        Transition(FAULT_RULE, EXECUTION_ERROR, "", chart.states[""].place, target=FAULT, during=through),
    )


def _library_initial(chart: Chart, state: State) -> str | list[str] | None:
    """Return the initial child, or all regions (the library's hints lack a list); None without children."""
    if not state.children:
        return None
    if state.kind is Kind.PARALLEL:
        return [child.local_name for child in _proper_children(chart, state)]
    if state.initial:
        return chart.states[state.initial].local_name
    return next((child.local_name for child in _proper_children(chart, state)), None)


class LevelRules:
    """The transitions that need no event, for each leaf that has some; `reads` are their dependencies."""

    __slots__ = ("offered", "reads")

    def __init__(self, chart: Chart, offered: tuple[tuple[Transition, ...], ...]) -> None:
        self.offered = offered
        rules = [rule for some in offered for rule in some]
        conditions = [condition for rule in rules for condition in own(rule, DECIDING)]
        self.reads = Reads(chart, conditions, [rule.event for rule in rules if rule.event])
        self.reads.parts |= HELD  # a hold lets through what says so


class Structure(Semantics):
    """SCXML's answers for one chart, and the library's machine, whose transitions are read once."""

    def __init__(self, chart: Chart) -> None:
        super().__init__(chart)
        self.machine = build_machine(chart)
        #: Enters the states in which the chart starts.
        self.start = Transition("", "start", "", chart.states[""].place, target="")
        self._executable = {"": ChartTransition(self.start, ROOT, ROOT)}
        self._rules = self._collect_rules()
        self._slots = [state for state in chart.states.values() if state.slot and self.regions(state.name)]
        self._levels: dict[tuple[tuple[str, ...], ...], LevelRules] = {}

    def _collect_rules(self) -> dict[str, tuple[Transition, ...]]:
        found: dict[str, list[Transition]] = {name: [] for name in self.chart.states}
        for event in self.machine.events.values():
            for transitions in event.transitions.values():
                for transition in transitions:
                    assert isinstance(transition, ChartTransition)
                    found[transition.rule.source].append(transition.rule)
                    self._executable[transition.rule.id] = transition
        return {name: self._in_written_order(name, rules) for name, rules in found.items()}

    def _in_written_order(self, name: str, rules: list[Transition]) -> tuple[Transition, ...]:
        # The library groups by event; between an exact name and a wildcard the author's order decides.
        found, written = tuple(rules), self.chart.states[name].transitions
        if len(found) < 2 or found == written:
            return found
        order = {rule.id: index for index, rule in enumerate(written)}
        return tuple(sorted(found, key=lambda rule: order.get(rule.id, len(order))))

    def rules_of(self, state: str, event: str) -> tuple[Transition, ...]:
        """Return the transitions of one state that listen to `event`, in the order written."""
        return tuple(rule for rule in self._rules[state] if matches(rule.event, event))

    def candidates(self, leaf: str, event: str) -> tuple[Transition, ...]:
        """Return the transitions that may answer `event` while `leaf` is active, in order of preference."""
        return tuple(rule for state in self.lineage[leaf] for rule in self.rules_of(state, event))

    def level_rules(self, leaf: str) -> tuple[Transition, ...]:
        """Return the eventless transitions and those on the level of an input, in order of preference."""
        return tuple(
            rule
            for state in self.lineage[leaf]
            for rule in self._rules[state]
            if rule.event == "" or rule.event.startswith("input.")
        )

    def levels(self, leaves: Iterable[str]) -> LevelRules:
        """Return the transitions that need no event while these leaves are active, equal ones once."""
        offered = tuple(filter(None, map(self.level_rules, leaves)))
        key = tuple(tuple(rule.id for rule in rules) for rules in offered)
        found = self._levels.get(key)
        if found is None:
            found = LevelRules(self.chart, offered)
            if len(self._levels) < MAX_CONFIGURATIONS:
                self._levels[key] = found
        return found

    def carry_out(
        self, leaves: Iterable[str], rules: Sequence[Transition], mission: str, aims: Sequence[Aim]
    ) -> ChartModel:
        """Let the library execute transitions without conflicts, one after the other.

        The result is that of SCXML's common microstep, because their exit and entry sets are disjoint.
        """
        for slot in self._slots:
            inside = self.default_child(slot, mission)
            self.machine.get_state(_path(slot.name)).initial = self.chart.states[inside].local_name
        model = ChartModel([".".join(_path(leaf)) for leaf in leaves])
        for rule, aim in zip(rules, aims, strict=True):
            event = NestedEventData(None, None, self.machine, model, (), {"targets": aim.targets})
            self._executable[rule.id].execute(event)
        return model

    def around(self, leaves: Iterable[str]) -> States:
        """Return the configuration with these leaves."""
        active = {name for leaf in leaves for name in self.lineage[leaf]}
        return tuple(sorted(active, key=self.order.__getitem__))

    @property
    def events(self) -> tuple[str, ...]:
        """The names of the events that some transition listens to, patterns left out, sorted."""
        names = {rule.event for rules in self._rules.values() for rule in rules if rule.event}
        return tuple(sorted(name for name in names if not name.endswith("*")))


#: How many configurations, and how many microsteps of each, are kept. Beyond that they are made anew every
#: time, to the same effect: a chart with many parallel regions has more configurations than memory.
MAX_CONFIGURATIONS = 4096
MAX_MICROSTEPS = 1024

#: The full names of active states, in document order.
States: TypeAlias = tuple[str, ...]


class Configuration:
    """A configuration and its derived data.

    `label` and `phase` are published. `levels` are the transitions that need no event. `working` are the
    states with an operation, `work` the dependencies of beginning one. With `passing` it is not published,
    because a final state is active, or a helper (named in lower case). `known` are the names of plugin events
    that came here before.
    """

    __slots__ = (
        "_candidates",
        "_structure",
        "known",
        "label",
        "leaves",
        "levels",
        "microsteps",
        "moment",
        "passing",
        "phase",
        "states",
        "trail",
        "work",
        "working",
    )

    def __init__(self, structure: Structure, active: States) -> None:
        states = [structure.chart.states[name] for name in active]
        self._structure = structure
        self.states = active
        self.known: set[str] = set()
        self.leaves = structure.leaves(active)
        self.label = next((state.label for state in states if state.label), "")
        self.phase = next((state.phase for state in reversed(states) if state.phase), "")
        self.moment = Moment(self.label, self.phase, "")
        self.trail = (self.moment,)
        self.levels = structure.levels(self.leaves)
        self.working = tuple(state for state in states if state.invoke or state.for_each)
        self.work = _reads_of_work(structure.chart, self.working)
        self.passing = self.label.islower() or any(state.kind is Kind.FINAL for state in states)
        #: By mission and chosen transitions; where one leads to a history, also by where that leads now.
        self.microsteps: dict[tuple[Any, ...], Microstep] = {}
        self._candidates: dict[str | tuple[str, str], tuple[tuple[Transition, ...], ...]] = {}

    def candidates(self, event: str) -> tuple[tuple[Transition, ...], ...]:
        """Return for each active leaf the transitions that may answer `event`, in order of preference."""
        found = self._candidates.get(event)
        if found is None:
            found = self._keep(event, tuple(self._structure.candidates(leaf, event) for leaf in self.leaves))
        return found

    def rules_of(self, state: str, event: str) -> tuple[tuple[Transition, ...], ...]:
        """Return the transitions of one active state alone that answer `event`."""
        found = self._candidates.get((state, event))
        if found is None:
            found = self._keep((state, event), (self._structure.rules_of(state, event),))
        return found

    def _keep(
        self, key: str | tuple[str, str], found: tuple[tuple[Transition, ...], ...]
    ) -> tuple[tuple[Transition, ...], ...]:
        if len(self._candidates) < MAX_MICROSTEPS:
            self._candidates[key] = found
        return found


def _reads_of_work(chart: Chart, working: Iterable[State]) -> Reads:
    collections = [state.for_each for state in working if state.for_each is not None]
    reads = Reads(chart, [value for rule in collections for value in own(rule, DECIDING)])
    reads.parts |= OPERATIONS | CONFIGURATION | HELD | REQUEST
    return reads


class Microstep:
    """Transitions taken together from one configuration: SCXML's microstep without its data.

    `exited` and `entered` are the exit and entry sets; `exits` and `entries` those states of them that have
    work to do, with the configuration before the exit and after the entry. `between` is the configuration
    after all exits, `active_rules` are the transitions with actions or a code, `releases` the holds that are
    released afterwards. `remembers` are the history values to store. `back` are the entered states that were
    restored from history.
    """

    __slots__ = (
        "active_rules",
        "back",
        "between",
        "entered",
        "entries",
        "exited",
        "exits",
        "leads_to",
        "moves",
        "releases",
        "remembers",
        "rules",
        "taken",
    )

    def __init__(
        self,
        rules: tuple[Transition, ...],
        exits: tuple[tuple[State, States], ...],
        entries: tuple[tuple[State, States], ...],
        between: States,
        leads_to: Configuration,
    ) -> None:
        self.rules = rules
        self.active_rules = tuple(rule for rule in rules if rule.actions or rule.code is not None)
        self.releases = tuple(dict.fromkeys(hold for rule in rules for hold in released_by(rule)))
        self.exits = tuple(left for left in exits if _has_work_at_exit(left[0]))
        self.entries = tuple(entered for entered in entries if _has_work_at_entry(entered[0]))
        self.between = between
        self.leads_to = leads_to
        self.remembers: tuple[tuple[str, States], ...] = ()
        self.back: frozenset[str] = frozenset()
        self.taken = tuple(rule.id for rule in rules if rule.id)
        self.exited = tuple(state.name for state, _ in exits)
        self.entered = tuple(state.name for state, _ in entries)
        self.moves = bool(exits or entries)


def _has_work_at_exit(state: State) -> bool:
    lasting = state.invoke or state.for_each or state.timers or state.budget or state.ask
    return bool(state.exit or (state.use and state.use.exit) or lasting)


def _has_work_at_entry(state: State) -> bool:
    lasting = state.itinerary or state.invoke or state.timers or state.budget or state.ask
    return bool(state.entry or state.use or lasting or state.kind is Kind.FINAL)


def _is_asked(chart: Chart, state: State) -> bool:
    """Say whether a state walks a list that depends on nothing but the request."""
    if state.itinerary is None or not state.mission:
        return False
    reads = Reads(chart, [state.itinerary.items])
    uses = [use for name in chart.lineage[state.name] if (use := chart.states[name].use) is not None]
    given = Reads(chart, [field.default for use in uses for field in use.request.values() if field.default])
    return reads.certain and reads.parts == REQUEST and given.certain and given.parts in (0, REQUEST)


@lru_cache(maxsize=32)
def dispatch_table(chart: Chart) -> DispatchTable:
    """Return the dispatch table that all machines of a chart share."""
    return DispatchTable(Structure(chart))


class DispatchTable:
    """Makes and keeps the configurations and microsteps of one chart."""

    def __init__(self, structure: Structure) -> None:
        self.structure = structure
        self._known: dict[States, Configuration] = {}
        #: Of the actions and invokes that were carried out, by id: the chart keeps them as long as it lives.
        self.actions: dict[int, CompiledAction] = {}
        self.arguments: dict[int, Arguments] = {}
        levels = [hold.engage for hold in structure.chart.holds.values() if hold.engage.startswith("input.")]
        self.hold_reads = Reads(structure.chart, (), levels)
        self.hold_reads.parts |= HELD
        #: The states that walk what the request of their mission alone says, in document order.
        self.walks = tuple(
            state for state in structure.chart.states.values() if _is_asked(structure.chart, state)
        )
        self._beginning: Microstep | None = None

    def configuration(self, states: States) -> Configuration:
        """Return the configuration of some active states, given in document order."""
        found = self._known.get(states)
        if found is None:
            found = Configuration(self.structure, states)
            if len(self._known) < MAX_CONFIGURATIONS:
                self._known[states] = found
        return found

    def beginning(self) -> Microstep:
        """Return the microstep that enters the states in which the chart starts."""
        if self._beginning is None:
            start = self.structure.start
            self._beginning = self._make(self.configuration(()), (start,), "", (Aim(("",)),))
        return self._beginning

    def microstep(
        self,
        active: Configuration,
        chosen: Sequence[Transition],
        mission: str,
        remembered: Callable[[State], States],
        resume: Callable[[State], str | None],
    ) -> Microstep:
        """Return the microstep of the chosen transitions; of conflicting ones only the preferred are taken.

        Args:
            active: the configuration that they are taken from.
            chosen: the first enabled one of each leaf, in document order of the leaves.
            mission: chooses the branch of the slot.
            remembered: returns the value of a history state.
            resume: returns the child in which a state resumes that is restored from history.
        """
        key: tuple[Any, ...] = (mission, *[rule.id for rule in chosen])
        found = active.microsteps.get(key)
        if found is not None:
            return found
        structure = self.structure
        rules = structure.without_conflicts(active.states, chosen)

        def past(history: State) -> States:
            # What is left just now is the past of who comes back in the same step.
            now = dict(structure.remembers(active.states, structure.exits(active.states, rules)))
            return now[history.name] if history.name in now else remembered(history)

        aims = tuple(structure.aim(rule, mission, past, resume) for rule in rules)
        if any(map(structure.is_to_history, rules)):
            key = (*key, aims)
            found = active.microsteps.get(key)
        if found is None:
            found = self._make(active, rules, mission, aims)
            if len(active.microsteps) < MAX_MICROSTEPS:
                active.microsteps[key] = found
        return found

    def _make(
        self, active: Configuration, rules: tuple[Transition, ...], mission: str, aims: Sequence[Aim]
    ) -> Microstep:
        structure, states = self.structure, self.structure.chart.states
        model = structure.carry_out(active.leaves, rules, mission, aims)
        left = sorted(model.left, key=structure.order.__getitem__, reverse=True)
        exits, configuration = [], list(active.states)
        for name in left:
            exits.append((states[name], tuple(configuration)))
            configuration.remove(name)
        between, entries = tuple(configuration), []
        for name in sorted(model.entered, key=structure.order.__getitem__):
            configuration = sorted([*configuration, name], key=structure.order.__getitem__)
            entries.append((states[name], tuple(configuration)))
        after = structure.around(model.leaves)
        leads_to = self.configuration(after) if entries or exits else active
        found = Microstep(rules, tuple(exits), tuple(entries), between, leads_to)
        found.remembers = structure.remembers(active.states, left)
        found.back = frozenset[str]().union(*(aim.back for aim in aims))
        return found
