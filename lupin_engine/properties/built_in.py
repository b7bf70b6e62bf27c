"""Built-in safety properties: monitors that judge every step of every machine.

One interface for exploration, random runs, scenarios and recorded runs:

    seen = glance(machine.memory)                     # before the step
    step = machine.handle(event, now)
    passage = Passage(seen, step, machine.scope)      # its memory is the one after the step
    for each property: state, verdict = property.watch(state, passage)

A built-in property is a pure function of a passage: its state is `()` for ever. An author's may have a state:
a tuple whose first number is the time of the machine's clock at which something is due, `math.inf` where
nothing is; more numbers are the property's own. So states can be compared, hashed, and ordered together with
the memory's deadlines. `due(state)` is when time alone can breach it, and a step should be made then. A
monitor may read only: of `before` the fields of `Glance`; of the memory after the step `held`, `attempts`,
`invocations`, `timers`, `frozen`, `itineraries`, `asked`, `broken`, `mission_id`, `configuration` (and
whatever an author's conditions read); of the step all but its `sequence`.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Collection, Container, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from functools import lru_cache
from typing import NamedTuple, TypeVar

from lupin_engine.chart.model import Chart, Kind, State, Transition
from lupin_engine.chart.rules.walks import closes_in_fault
from lupin_engine.chart.semantics import FAULT
from lupin_engine.chart.strictness import is_dated
from lupin_engine.machine.event import Act, Cancel, Report, Start
from lupin_engine.machine.itineraries import identity_of
from lupin_engine.machine.memory import Attempt, Invocation, Memory, Phase
from lupin_engine.machine.operations import EVERYTHING
from lupin_engine.machine.scope import EvaluationScope
from lupin_engine.machine.step import Step
from lupin_engine.machine.structure import dispatch_table
from lupin_engine.plugin.builtin import BUILTIN
from lupin_engine.plugin.contract import EXECUTION_CODE, INVARIANT_CODE, OWN_HOLDS, OnHold
from lupin_engine.plugin.profile import ANSWER, START, Publish

#: The property that invariants hold.
INVARIANTS = "invariants"
#: The property that a simulation comes to its end; who simulates watches it.
STANDSTILL = "time_goes_on"
#: What a watcher remembers: a time at which something is due, and numbers of its own.
Remembered = tuple[float, ...]
_T = TypeVar("_T")
#: Not more plans are kept (see `WatchPlans`).
_MOST_PLANS = 8192


class Glance(NamedTuple):
    """The part of the memory before a step that properties read; hashable.

    `speaking` are the attempts that a state waits for, `over` the invocations whose operation has ended for
    good, `settled` their states, `closed` the number of visits of mission `mission_id` with an outcome, over
    all passes, `begun` the active itineraries, `unfinished` those that owe results, each with the number of
    targets that it had before it was begun anew, and with the number of results that it owes.
    `configuration`, `history` and `asked` are the names of states.
    """

    held: Collection[str] = ()
    speaking: Container[str] = frozenset()
    over: Container[str] = frozenset()
    settled: Container[str] = frozenset()
    closed: int = 0
    mission_id: str = ""
    begun: tuple[str, ...] = ()
    unfinished: tuple[tuple[str, int, int], ...] = ()
    configuration: tuple[str, ...] = ()
    history: tuple[tuple[str, tuple[str, ...]], ...] = ()
    asked: Container[str] = ()


class Passage(NamedTuple):
    """One step to judge: the glance before it, the step, and the scope with the memory after it.

    `was` makes the scope with the memory before it, where the caller still has that.
    """

    before: Glance
    step: Step
    scope: EvaluationScope
    was: Callable[[], EvaluationScope] | None = None

    @property
    def after(self) -> Memory:
        """The memory after the step."""
        return self.scope.memory

    @property
    def chart(self) -> Chart:
        """The chart that the machine runs."""
        return self.scope.chart


#: What a step is about, as bits: it answers a request, a server reports, something is noted, reported as a
#: code, commanded, or taken, entered or left, the end of an operation is taken; a hold is engaged after it.
#: `ANY` is every step.
ANY, REQUESTED, REPORTED, NOTED, CODED, COMMANDED, MOVED, ENDED, FAILED, HELD = (1 << n for n in range(10))
#: The bits of a step, and the active states after it; None: any.
StepKind = tuple[int, tuple[str, ...] | None]


def kind_of(passage: Passage) -> StepKind:
    """Return what a step is about."""
    _, step, scope, _ = passage
    memory, event = scope.memory, step.event
    bits = ANY | (REPORTED if event.is_attempt_event else REQUESTED if event.is_request else 0)
    bits |= (NOTED if step.notes else 0) | (CODED if step.codes else 0) | (HELD if memory.held else 0)
    if step.commands:
        bits |= COMMANDED
    if step.taken or step.entered or step.exited:
        bits |= MOVED | _ends_taken(scope.chart, step.taken)
    return bits, memory.configuration


class Verdict(NamedTuple):
    """A property's verdict on a step: whether it applies, and the breach, '' for none.

    `about` are the parts of the property that apply, where it has parts.
    """

    relevant: bool
    breach: str = ""
    about: tuple[str, ...] = ()


NOT_ABOUT, HOLDS = Verdict(False), Verdict(True)
_NOT_ABOUT: tuple[Remembered, Verdict] = ((), NOT_ABOUT)
_HOLDS: tuple[Remembered, Verdict] = ((), HOLDS)


@dataclass(frozen=True)
class Property:
    """A property: `says` is the sentence for people.

    `watch` returns the next state and the verdict; `first` is the state before the first step. `end` judges
    pending obligations when a run is over. Without `remembers` the state is `()` for ever. No step
    that changes only live values concerns one without `of_values`, none of which `about` is false another.
    Where `is_asked` is false of the kind of a step, its verdict is `otherwise`, and its state stays.
    """

    name: str
    says: str
    watch: Callable[[Remembered, Passage], tuple[Remembered, Verdict]]
    first: Remembered = ()
    end: Callable[[Remembered, float], Verdict] = field(default=lambda _, __: NOT_ABOUT)
    remembers: bool = True
    of_values: bool = True
    about: Callable[[Passage], bool] | None = None
    is_asked: Callable[[StepKind], bool] = field(default=lambda _: True)
    otherwise: Verdict = NOT_ABOUT


def of_kinds(bits: int) -> Callable[[StepKind], bool]:
    """Return `Property.is_asked` for one that only steps with one of these bits concern."""
    return lambda kind: bool(kind[0] & bits)


def due(state: Remembered) -> float:
    """Return when time alone can breach a property; `math.inf`: never."""
    return state[0] if state else math.inf


def glance(memory: Memory) -> Glance:
    """Return the glance of a memory, to be taken before a step."""
    over = [found for found in memory.invocations.values() if is_over(found, memory)]
    return Glance(
        tuple(memory.held),
        frozenset(name for name in memory.attempts if is_speaking(memory, name)),
        frozenset(found.id for found in over),
        frozenset(found.name for found in over),
        closed(memory),
        memory.mission_id,
        begun(memory),
        unfinished(memory),
        memory.configuration,
        tuple(memory.history.items()),
        tuple(memory.asked),
    )


def touched(entries: Mapping[str, _T]) -> Collection[_T]:
    """Return the entries of a field that a step may have changed: all, or only those it has read.

    A memory that decodes its entries lazily (see `situations.situation`) holds only the latter.
    """
    assert isinstance(entries, dict)
    return dict.values(entries)


def is_speaking(memory: Memory, name: str) -> bool:
    """Return whether a state waits for an attempt."""
    attempt = memory.attempts.get(name)
    if attempt is None or attempt.phase in (Phase.REQUESTED, Phase.ACCEPTED):
        return attempt is not None
    serves = memory.invocations.get(attempt.invocation)
    return serves is not None and serves.cut is not None and serves.cut.attempt == name


def begun(memory: Memory) -> tuple[str, ...]:
    """Return the states with an active itinerary."""
    return tuple(name for name, walk in memory.itineraries.items() if walk.begun)


def unfinished(memory: Memory) -> tuple[tuple[str, int, int], ...]:
    """Return the active itineraries with targets that are to have a result and have none (see `Glance`)."""
    walks = ((name, walk) for name, walk in memory.itineraries.items() if walk.begun and not walk.leaves_open)
    owed = ((name, walk.before, sum(not one.status for one in walk.visits)) for name, walk in walks)
    return tuple(one for one in owed if one[2])


def closed(memory: Memory) -> int:
    """Return the number of visits with an outcome, over all passes."""
    count = 0
    for walk in memory.itineraries.values():
        count += sum(walk.past.values()) if walk.past else 0
        for visit in walk.visits:
            count += bool(visit.status)
    return count


def is_under_way(attempt: Attempt) -> bool:
    """Return whether a server was asked for something, and nobody has taken that back."""
    return attempt.phase in (Phase.REQUESTED, Phase.ACCEPTED)


def is_over(invocation: Invocation, memory: Memory) -> bool:
    """Return whether an operation has ended and will not be retried."""
    if not invocation.begun or invocation.attempt is not None or invocation.cut is not None:
        return False
    timers = (*memory.timers, *memory.frozen)
    return not any(kind == "retry" and owner == invocation.id for _, _, kind, (owner, _) in timers)


@dataclass(frozen=True, eq=False)
class WatchPlan:
    """What is asked after steps of one kind: the properties, by index, and those that hold without asking."""

    asked: tuple[tuple[int, Callable[[Remembered, Passage], tuple[Remembered, Verdict]]], ...]
    hold: tuple[int, ...]


class WatchPlans(dict[StepKind, WatchPlan]):
    """The plans of some properties, by the kind of a step; made when they are first needed."""

    def __init__(self, properties: tuple[Property, ...]) -> None:
        super().__init__()
        self.properties = properties

    def __missing__(self, kind: StepKind) -> WatchPlan:
        if len(self) >= _MOST_PLANS:
            self.clear()
        every = [(index, one, one.is_asked(kind)) for index, one in enumerate(self.properties)]
        asked = tuple((index, one.watch) for index, one, is_asked in every if is_asked)
        hold = tuple(index for index, one, is_asked in every if not is_asked and one.otherwise.relevant)
        found = self[kind] = WatchPlan(asked, hold)
        return found


class Monitor:
    """Watches the steps of one machine: `breaches` has the first breach of each property, with its step.

    Later breaches of the same property are dropped. Machines of one chart may share their `plans`.
    """

    def __init__(self, plans: WatchPlans) -> None:
        self.properties = plans.properties
        self.breaches: dict[str, tuple[Step | None, str]] = {}
        self._plans = plans
        self._before = Glance()
        self._states = [one.first for one in self.properties]
        self._relevant = [0] * len(self.properties)
        #: How many steps had each plan.
        self._steps: Counter[WatchPlan] = Counter()

    def take(self, step: Step, scope: EvaluationScope) -> None:
        """Judge a step that the machine with this scope has just made."""
        passage, states = Passage(self._before, step, scope), self._states
        plan = self._plans[kind_of(passage)]
        self._steps[plan] += 1
        for index, watch in plan.asked:
            states[index], verdict = watch(states[index], passage)
            if verdict.relevant:
                self._relevant[index] += 1
                if verdict.breach:
                    self.breaches.setdefault(self.properties[index].name, (step, verdict.breach))
        self._before = glance(scope.memory)

    @property
    def relevant(self) -> dict[str, int]:
        """The number of steps that each property applied to, without zeros."""
        found = Counter({one.name: n for one, n in zip(self.properties, self._relevant, strict=True) if n})
        for plan, steps in self._steps.items():
            for index in plan.hold:
                found[self.properties[index].name] += steps
        return found

    @property
    def found(self) -> list[tuple[str, str, Step | None]]:
        """Name, text and step of each breach, in order."""
        return [(name, text, step) for name, (step, text) in self.breaches.items()]

    def end(self, now: float) -> None:
        """Judge pending obligations at the end of the run."""
        for one, state in zip(self.properties, self._states, strict=True):
            verdict = one.end(state, now)
            if verdict.breach:
                self.breaches.setdefault(one.name, (None, verdict.breach))


# -- what every chart keeps ------------------------------------------------------------------------------

#: Judges one passage: None: not about it; '': it holds; else how it is broken.
Rule = Callable[[Passage], "str | None"]
_found: list[Property] = []


def _built_in(name: str, says: str, of: int = ANY) -> Callable[[Rule], Rule]:
    def add(rule: Rule) -> Rule:
        def watch(state: Remembered, passage: Passage) -> tuple[Remembered, Verdict]:
            breach = rule(passage)
            return _NOT_ABOUT if breach is None else _HOLDS if not breach else (state, Verdict(True, breach))

        _found.append(Property(name, says, watch, remembers=False, is_asked=of_kinds(of)))
        return rule

    return add


@_built_in("hold_starts_nothing", "While a hold is engaged, nothing that moves the robot is started.", HELD)
def _hold_starts_nothing(passage: Passage) -> str | None:
    held, commands = passage.after.held, passage.step.commands
    if not held:
        return None
    own = next((hold for hold in OWN_HOLDS if hold in held), None) if commands else None
    for command in commands:
        if isinstance(command, Start):
            name = command.operation
            if _moves(passage.chart, name) or (own and name.partition(".")[0] != BUILTIN):
                return f"{name} ({command.attempt}) is started while {own or held[0]} is engaged"
        elif isinstance(command, Act) and _was_held(passage) and action_moves(passage.chart, command.action):
            return f"{command.action} is carried out while {held[0]} is engaged"
    return ""


def _was_held(passage: Passage) -> bool:
    """Return whether one hold was active throughout the step."""
    return not released(passage.step) >= {*passage.before.held} & {*passage.after.held}


def released(step: Step) -> set[str]:
    """Return the holds that were released in a step."""
    noted = (note.removeprefix("hold ").rpartition(" ") for note in step.notes if note.startswith("hold "))
    return {name for name, _, what in noted if what == "released"}


@_built_in(
    "hold_stops_all",
    "While a hold is engaged, everything that moves the robot is cancelled, and every cancel has a deadline.",
    HELD,
)
def _hold_stops_all(passage: Passage) -> str | None:
    memory = passage.after
    if not memory.held:
        return None
    # Those that were all right under a hold still are where the step has not looked at them.
    found = touched(memory.attempts) if passage.before.held else memory.attempts.values()
    moving = [attempt for attempt in found if _moves(passage.chart, attempt.operation)]
    for attempt in moving:
        if attempt.phase in (Phase.REQUESTED, Phase.ACCEPTED, Phase.REPLACED):
            name, phase = f"{attempt.operation} ({attempt.id})", attempt.phase.value
            return f"{name} is {phase} while {memory.held[0]} is engaged"
        deadlines = {owner for _, _, kind, (owner, _) in memory.timers if kind == "cancel"}
        if attempt.phase is Phase.CANCELLING and attempt.id not in deadlines:
            return f"{attempt.operation} ({attempt.id}) is cancelled without a deadline"
    return "" if moving else None


@_built_in("resources_exclude", "An operation begins only when the resource it needs is free.")
def _resources_exclude(passage: Passage) -> str | None:
    attempts = passage.after.attempts
    if not any(found.uses for found in touched(attempts)):
        return None
    claims = [claim for claim in passage.after.claims if claim.uses and not claim.waits]
    if len(claims) < 2:
        return "" if claims else None
    using = [attempts[claim.attempt] for claim in claims]
    begun = {command.operation for command in passage.step.commands if isinstance(command, Start)}
    working = [one for one in using if is_under_way(one)]
    for one in working:
        for other in using:
            shared = [name for name in other.uses if name in one.uses or name == EVERYTHING]
            if other.phase is Phase.REFUSED and one.operation not in begun - _replacing(passage.chart):
                continue  # it was lost when the other one began, or is replaced by that
            if other.phase is Phase.REPLACED and other.invocation == one.invocation:
                continue  # its server takes the other one in place of it
            if other is not one and shared:
                name, beside = f"{one.operation} ({one.id})", f"{other.operation} ({other.id})"
                return (
                    f"{name} is {one.phase.value} while {beside} is {other.phase.value}: both use {shared[0]}"
                )
    return ""


def _replacing(chart: Chart) -> set[str]:
    """Return the operations that may begin beside an earlier one which refuses to end."""
    return {name for name, operation in chart.catalog.operations.items() if operation.replaces}


def _moves(chart: Chart, operation: str) -> bool:
    return operation in _moving(chart)


@_built_in("no_false_start", "No operation is started and cancelled in the same step.", COMMANDED)
def _no_false_start(passage: Passage) -> str | None:
    commands = passage.step.commands
    started = {c.attempt: c.operation for c in commands if isinstance(c, Start)}
    for command in commands if started else ():
        if isinstance(command, Cancel) and command.attempt in started:
            return f"{command.operation} ({command.attempt}) is started and cancelled in the same step"
    return "" if started else None


@_built_in(
    "closed_once", "Each visit of a target is reported exactly once, when it is closed.", COMMANDED | MOVED
)
def _closed_once(passage: Passage) -> str | None:
    memory, published = passage.after, [c for c in passage.step.commands if isinstance(c, Publish)]
    if not published and not (memory.itineraries and passage.step.taken):
        return None
    same = passage.step.event.name != START and passage.before.mission_id == memory.mission_id
    newly = max(0, closed(memory) - (passage.before.closed if same else 0))  # another mission has fewer
    if not published:
        return f"{newly} closed, but none reported" if newly else None
    visits = [(name, v) for name in begun(memory) for v in memory.itineraries[name].visits]
    visits += [(name, v) for name in begun(memory) for v in memory.itineraries[name].earlier.values()]
    visited = {visit.target for name, visit in visits if visit.closed or name in passage.before.begun}
    # What is published outside of a visit is about a target that has none.
    if not sum(1 for command in published if command.target in visited) <= newly <= len(published):
        beside = (
            "; what has a visit is published by closing that, not beside it" if newly < len(published) else ""
        )
        return f"{', '.join(c.target for c in published)} reported, but {newly} closed{beside}"
    return ""


@_built_in(
    "all_closed",
    "When a mission ends, every target has a result, except those left open on purpose.",
    COMMANDED | MOVED,
)
def _all_closed(passage: Passage) -> str | None:
    step, memory, states = passage.step, passage.after, passage.chart.states
    over = passage.chart.profile.stages.over
    reported = any(isinstance(command, Report) for command in step.commands)
    if not reported and not any(states[name].label in over for name in step.entered):
        return None
    if unknown := _asked_for(passage):
        return f"the mission ended, and the engine does not know of {', '.join(unknown)}"
    walks = [walk for walk in memory.itineraries.values() if not walk.leaves_open]
    # One of several sweeps may be cut short: the result of the sweep before is a result.
    visits = [visit for walk in walks if walk.begun for visit in walk.outcomes]
    ahead = {id(visit) for walk in walks for visit in walk.visits}
    visits += [visit for visit in memory.ahead if id(visit) in ahead]
    still = [visit.target for visit in visits if not visit.closed]
    if still and FAULT in memory.configuration and not closes_in_fault(passage.chart):
        still = [] if is_dated("silent-fault") else still
    if still:
        return f"the mission ended without a result for {', '.join(still)}"
    return "" if visits else None


def _asked_for(passage: Passage) -> list[str]:
    """Return the targets of the mission's request, of itineraries outside of the engine."""
    memory, found = passage.after, []
    for state in dispatch_table(passage.chart).walks:
        rule = state.itinerary
        if rule is None or rule.leaves_open or state.mission != memory.mission:
            continue
        if state.name in memory.itineraries:
            continue
        with suppress(Exception):  # of a list that cannot be made nothing is known
            found += [str(identity_of(item)) for item in rule.items.evaluate(passage.scope)]
    return found


@_built_in(
    "former_attempts", "A server's message about an attempt that was given up changes nothing.", REPORTED
)
def _former_attempts(passage: Passage) -> str | None:
    event = passage.step.event
    if event.name not in ("attempt.done", "attempt.failed", "attempt.cancelled"):
        return None
    if event.data.get("attempt") in passage.before.speaking:
        return None
    for rule in taken(passage):
        if rule.event in ("done", "error"):
            return f"{event.name} of {event.data.get('attempt')}, which nobody waits for, leads to {rule.id}"
    codes = [code.code for code in passage.step.codes if code.code == event.data.get("code")]
    return f"{event.name} that nobody waits for reports {codes[0]}" if codes else ""


@_built_in(
    "no_execution_error",
    "No expression or action fails, and every step comes to an end.",
    CODED | COMMANDED | MOVED,
)
def _no_execution_error(passage: Passage) -> str | None:
    found = [code.detail for code in passage.step.codes if code.code == EXECUTION_CODE]
    return found[0] if found else "" if passage.step.changed else None


@_built_in(INVARIANTS, "No invariant is broken.")
def _invariants(passage: Passage) -> str | None:
    if not passage.chart.invariants:
        return None
    found = [code.detail for code in passage.step.codes if code.code == INVARIANT_CODE]
    new = passage.step.broken
    return found[0] if found else f"invariant {new[0]} does not hold" if new else ""


@_built_in("ends_are_handled", "Every end of an operation, and every error, is handled by a transition.")
def _ends_are_handled(passage: Passage) -> str | None:
    unheard = [note for note in passage.step.notes if note.startswith("nobody handles the error")]
    memory = passage.after
    if unheard:
        is_wait = FAULT in memory.configuration and is_dated("wait-in-fault")
        return "" if is_wait else unheard[0]
    ended = [i for i in touched(memory.invocations) if is_over(i, memory) and i.id not in passage.before.over]
    for invocation in ended:
        rules = [rule for rule in taken(passage) if rule.event in ("done", "error")]
        if not any(rule.source == invocation.state for rule in rules):
            return f"no transition handles the end of the operation of {invocation.state}"
    return "" if ended or _ends_something(passage.step) else None


def _ends_something(step: Step) -> bool:
    return step.event.name in ("attempt.done", "attempt.failed", "attempt.cancelled", "timer.timeout")


@_built_in("no_deaf_wait", "A running mission never waits for something that cannot come.")
def _no_deaf_wait(passage: Passage) -> str | None:
    memory, chart = passage.after, passage.chart
    if memory.held or memory.asked or not _is_on_its_way(chart, memory.configuration):
        return None
    if memory.attempts or any(kind not in ("fresh", "cancel") for _, _, kind, _ in memory.timers):
        return ""
    if _hears(chart, memory.configuration):
        return ""
    return f"nothing is under way in {memory.configuration[-1]}, and nothing it listens to comes by itself"


@_built_in("refusals_have_reasons", "Every request is accepted, or refused with a reason.", REQUESTED)
def _refusals_have_reasons(passage: Passage) -> str | None:
    step = passage.step
    if not step.event.is_request:
        return None
    if step.accepted is None:
        return f"{step.event.name} is not answered"
    if step.accepted:
        return ""
    is_reasoned = step.refusal is not None and step.refusal.code.strip() and step.refusal.text.strip()
    return "" if is_reasoned else f"{step.event.name} is refused without a reason"


#: All of them, in the order of reports.
BUILT_IN: tuple[Property, ...] = tuple(_found)


# -- what is asked of a chart ----------------------------------------------------------------------------


@lru_cache(maxsize=32)
def _rules(chart: Chart) -> Mapping[str, Transition]:
    return {rule.id: rule for state in chart.states.values() for rule in state.transitions}


@lru_cache(maxsize=4096)
def _ends_taken(chart: Chart, taken: tuple[str, ...]) -> int:
    """Return whether transitions of a step take a good end (`ENDED`) or an error (`FAILED`), as bits."""
    events = {_rules(chart)[name].event for name in taken if name in _rules(chart)}
    return (ENDED if "done" in events else 0) | (FAILED if "error" in events else 0)


@lru_cache(maxsize=32)
def _moving(chart: Chart) -> frozenset[str]:
    """Return the motion operations of a chart."""
    states = chart.states.values()
    invokes = [state.invoke for state in states if state.invoke is not None]
    invokes += [state.for_each.invoke for state in states if state.for_each is not None]
    return frozenset(one.name for one in invokes if one.operation.on_hold is OnHold.CANCEL)


def action_moves(chart: Chart, action: str) -> bool:
    """Return whether an action moves the robot."""
    found = chart.catalog.actions.get(action)
    return found is not None and found.moves


def is_moving(passage: Passage) -> bool:
    """Return whether something that moves the robot is under way after a step."""
    moving = _moving(passage.chart)
    return any(one.operation in moving and is_under_way(one) for one in passage.after.attempts.values())


def is_waiting(passage: Passage) -> bool:
    """Return whether a robot shows after a step that it waits: held, paused, asking, or without a mission."""
    memory, chart = passage.after, passage.chart
    states = (chart.states[name] for name in memory.configuration)
    without = chart.profile.stages.without_mission
    return bool(memory.held or memory.asked) or any(one.paused or one.label in without for one in states)


def taken(passage: Passage) -> Iterator[Transition]:
    """Yield the chart's own transitions of a step."""
    known = _rules(passage.chart)
    return (known[name] for name in passage.step.taken if name in known)


@lru_cache(maxsize=4096)
def _is_on_its_way(chart: Chart, configuration: tuple[str, ...]) -> bool:
    """Return whether a mission is active and does not wait for its operator."""
    states = [chart.states[name] for name in configuration]
    label = next((state.label for state in states if state.label), "")
    if label in chart.profile.stages.without_mission or any(state.paused for state in states):
        return False
    rules = [rule for state in states for rule in state.transitions if rule.event == START]
    return not any(rule.refuse is None for rule in rules)  # where a mission can be started none is under way


@lru_cache(maxsize=4096)
def _hears(chart: Chart, configuration: tuple[str, ...]) -> bool:
    """Return whether an active state can react to an event that may still come, the lifecycle's left out.

    A person counts only where an atomic state itself waits for one.
    """
    states = [chart.states[name] for name in configuration]
    if any(_listens(state) for state in states if state.parent is not None and not state.slot):
        return True
    leaves = [state for state in states if not state.children]
    rules = [rule for state in leaves for rule in state.transitions if rule.refuse is None]
    return any(rule.event.startswith(("operator.", ANSWER)) for rule in rules)


def _listens(state: State) -> bool:
    """Return whether a state reacts to events that come without people."""
    if state.for_each is not None or state.kind is Kind.FINAL:
        return True
    return any(rule.event.partition(".")[0] not in _NOT_BY_ITSELF for rule in state.transitions)


#: First words of events that people cause, or the state's own operation and clocks.
_NOT_BY_ITSELF = frozenset(
    {"done", "error", "after", "every", "at", "budget", "operator"}
    | {START.partition(".")[0], ANSWER.partition(".")[0]}
)
