"""Computes the steps of an exploration: runs the machine itself on a tracked memory of a situation.

The result is an `Effect` with the step's read set. A step is deterministic, so the effect holds wherever
those slots are equal; `levels` caches it. An exception in a step is a breach of `no_exception`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Container, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, NamedTuple, cast

from lupin_engine.chart import DIVERT, Level
from lupin_engine.errors import reason
from lupin_engine.machine import (
    CLOCK,
    RESUMED,
    Act,
    Attempt,
    CompiledAction,
    EvaluationScope,
    ExecutableContent,
    Inputs,
    Invocation,
    Machine,
    Macrostep,
    Memory,
    Operations,
    Phase,
    Report,
    Reported,
    Step,
    Trigger,
    World,
    is_idle,
    successor,
)
from lupin_engine.plugin import OnHold, Publish
from lupin_engine.properties import (
    BUILT_IN,
    Glance,
    Passage,
    Property,
    Remembered,
    WatchPlans,
    action_moves,
    begun,
    closed,
    is_over,
    is_speaking,
    kind_of,
    unfinished,
)
from lupin_engine.sim import label_of
from lupin_verify.situations.classes import MORNING, Classes
from lupin_verify.situations.found import Does, Effect, Is
from lupin_verify.situations.memo import Rows
from lupin_verify.situations.relevance import Relevance, invokes
from lupin_verify.situations.situation import (
    CLAIMS,
    FIRST_NEW,
    KNOWN_FALSE,
    RANKS,
    RECOMPUTED,
    WATCHED,
    Overflow,
    Situation,
    SlotName,
    SlotTable,
    TooMany,
    TrackedMemory,
    canonical_names,
)
from lupin_verify.situations.worlds import (
    AWAY,
    LOADED,
    OF_PROPERTY,
    Deadlines,
    TimerName,
    Watched,
    WorldMoves,
    canonical_claims,
    deadlines_of,
    differences_after,
    drop_abandoned,
    in_order,
    rankable,
    ranks_after,
)

#: The initial room for slots.
ROOM = 128
#: The property that no step raises an exception.
NO_EXCEPTION = "no_exception"


class Bounds(NamedTuple):
    """The bounds of a proof.

    `owed`: how many abandoned attempts of one operation may still be answered. `deferred`: how many events of
    one name, and how many times of day, wait during a hold.
    """

    targets: int = 2
    owed: int = 0
    restarts: bool = True
    most_values: int = 2000
    deferred: int = 2


class SituationExplorer:
    """Makes the steps of one chart in its situations."""

    def __init__(self, world: World, properties: tuple[Property, ...], bounds: Bounds) -> None:
        """Make an explorer.

        Args:
            world: the chart with its parameters.
            properties: the monitors of every step.
            bounds: the bounds of the proof.
        """
        self.world = world
        self.chart = world.chart
        self.properties = properties
        asked = [one for one in properties if one not in BUILT_IN or one.name in _OF_REQUESTS]
        #: The properties to watch in a step that changes only live values, by whether it answers a request.
        self._quietly = {False: [o for o in asked if o not in BUILT_IN and o.of_values], True: asked}
        #: The properties to watch in any other step.
        self._plans = WatchPlans(properties)
        self._remembers = any(one.remembers for one in properties)
        self.bounds = bounds
        self.relevance = Relevance(world.chart)
        self.classes = Classes(world, self.relevance, bounds.targets)
        every = (invoke for _, invoke in invokes(world.chart))
        self._moving = {one.name for one in every if one.operation.on_hold is OnHold.CANCEL}
        self._room = ROOM
        #: Whether difference bounds of all deadlines are stored: fewer orders of them, more situations.
        self.differences = False
        self._begin()

    def _begin(self) -> None:
        self.table = SlotTable(self.relevance, self._room, self.bounds.most_values)
        bounds = self.bounds
        self.moves = WorldMoves(self.table, self.classes, bounds.owed, bounds.restarts, bounds.deferred)
        unconstrained = self.moves.unconstrained_values()
        self.table.reported = frozenset(s for s in unconstrained if self.table.names[s][0] == "inputs")
        self.table.may_be_dead |= unconstrained.keys()

    # -- one move -----------------------------------------------------------------------------------------

    def initial(self) -> tuple[Situation, Effect]:
        """Return the initial situation, and the effect that leads to it."""
        nothing = (0,) * self._room
        memory = TrackedMemory(self.table, nothing)
        machine = _TrackedMachine(self.world, memory)
        effect = self._effect_of(memory, machine, self._start(machine), nothing, None)
        return self._after(nothing, effect), effect

    def _start(self, machine: Machine) -> Step:
        return machine.start(0.0, None if self.world.calendar is None else MORNING)

    def step(self, situation: Situation, number: int) -> Effect:
        """Make the machine's step of a move; `ranks_after` gives the order of deadlines after it."""
        memory = TrackedMemory(self.table, situation)
        effect = self._step(memory, situation, number)
        lazy = tuple((self.table.index["context", name], slot) for name, (_, slot) in memory.lazy.items())
        effect.needs, effect.lazy = memory.reads, lazy
        effect.sets = frozenset(memory.written - memory.values)
        return effect

    def _step(self, memory: TrackedMemory, situation: Situation, number: int) -> Effect:
        before = TrackedMemory(self.table, situation)
        before.values, before.presence = memory.values, memory.presence
        move = self.moves.all[number]
        if move.timer[0] == OF_PROPERTY:
            return self._late(memory, situation, move.timer[1])
        if move.event is not None and move.event.name == CLOCK:  # no step: time passes without an event
            return Effect(tuple(memory.change(self.table.index["wall", ""], move.event.data["ahead"])))
        machine = _TrackedMachine(self.world, memory)
        if move.timer[0] != "fresh":
            machine.restore_known_false(memory.fetch(self.table.index[KNOWN_FALSE]))
        begins_anew = self.chart.profile.stages.begins_anew
        machine.updates.changes = not move.unchanged
        try:
            is_restart = move.event is not None and move.event.name == RESUMED
            if is_restart and label_of(self.chart, memory.configuration) in begins_anew:
                if not self._remembers:
                    return Effect()  # it equals the initial situation
                memory.assign(Memory(), whole=True)
                step: Step | None = self._start(machine)
            elif move.event is LOADED:
                if not is_idle(machine):
                    return Effect()
                memory.assign(successor(Machine(self.world, memory.plain()), self.world).memory)
                machine = _ReloadedMachine(self.world, memory)
                with ExitStack() as unread:
                    for field in RECOMPUTED:
                        unread.enter_context(memory.unread(field, self.table.keys[field]))
                    step = machine.go_on(0.0)
            else:
                step = self.moves.carry_out(machine, memory, move)
            if step is None:
                return Effect(cut=True)
            effect = self._effect_of(memory, machine, step, situation, before)
            if self.differences and effect.deadlines is not None:
                fired = AWAY if step.event.name in _RESTARTS else move.timer
                effect = replace(effect, deadlines=effect.deadlines._replace(fired=fired))
            return effect
        except (Overflow, TooMany):
            raise
        except Exception as problem:  # a defect of the engine or of a plugin is a breach
            told = f"{type(problem).__name__}: {reason(problem)}"
            return Effect(breaches=((NO_EXCEPTION, told),))

    def _effect_of(
        self,
        memory: TrackedMemory,
        machine: Machine,
        step: Step,
        situation: Situation,
        before: TrackedMemory | None,
    ) -> Effect:
        watched, breaches, relevant = self._judge(memory, machine, step, before)
        drop_abandoned(memory, self.bounds.owed)
        set_now = {(t[2], *t[3]) for timers in memory.accessed_timers() for t in timers if t[1] >= FIRST_NEW}
        named = canonical_names(memory)
        if any(not self.moves.is_within_bounds(name) for name in named.values()):
            return Effect(cut=True)
        in_order(memory)
        claims = canonical_claims(memory) if memory.is_accessed("attempts") else None
        delta = dict(memory.changes())
        fresh = {(kind, named.get(owner, owner), event) for kind, owner, event in set_now if kind != "at"}
        if watched is not None:
            self._set(delta, memory, WATCHED, watched or None)
        fresh |= self._due_now(situation, watched or ())
        slots = [self.table.index[name] for name in (("timers", ""), ("frozen", ""), WATCHED)]
        deadlines, was_gone = None, before is not None and step.event.name in _RESTARTS
        if fresh or was_gone or any(slot in delta for slot in slots):
            # Deadlines that were due while the process was gone fire now, perhaps too late for a property.
            running = (*memory.timers, *(() if was_gone else deadlines_of(watched or ())))
            armed, frozen = (tuple(rankable(self.chart, timers)) for timers in (running, memory.frozen))
            deadlines = Deadlines(armed, frozen)
        self._set(delta, memory, KNOWN_FALSE, machine.known_false)
        if claims is not None:
            self._set(delta, memory, CLAIMS, claims or None)
        does = Does.ADVANCES * any(isinstance(command, (Publish, Report)) for command in step.commands)
        acts = (command.action for command in step.commands if isinstance(command, Act))
        does |= Does.MOVES * any(action_moves(self.chart, action) for action in acts)
        does |= Does.ANSWERS * bool(step.taken and step.event.is_attempt_event)
        renamed = tuple((old, new) for old, new in named.items() if "#" in new)
        return Effect(
            tuple(delta.items()),
            breaches,
            frozenset(relevant),
            step.taken,
            step.entered,
            does,
            frozenset(fresh),
            deadlines,
            renamed,
        )

    def ranks_after(self, effect: Effect, before: int) -> int:
        """Return the number of the order of deadlines after an effect, given the number of the one before.

        It is 0, no order, where there would be too many: then any deadline may be the next.
        """
        slot = self.table.index[RANKS]
        if effect.deadlines is None:
            return before
        known = self.table.value(slot, before) if before else frozenset()
        after = differences_after if self.differences else ranks_after
        ranks = after(known, effect.deadlines, effect.fresh, dict(effect.renamed))
        try:
            return self.table.number(slot, ranks) if ranks else 0
        except TooMany:
            return 0

    def _due_now(self, situation: Situation, watched: Watched) -> set[TimerName]:
        """Return the deadlines of properties that are set in a step."""
        before = dict(self.table.get(situation, WATCHED) or ()) if watched else {}
        new = tuple((name, state) for name, state in watched if before.get(name) != state)
        return {(kind, *about) for _, _, kind, about in deadlines_of(new)}

    def _judge(
        self, memory: TrackedMemory, machine: Machine, step: Step, before: TrackedMemory | None
    ) -> tuple[Watched | None, tuple[tuple[str, str], ...], set[str]]:
        """Return the monitors' states after a step, its breaches, and the properties that it is about.

        The states are None where the step concerns none that remembers something.
        """
        # Invariants of situations still hold where only live values change.
        quiet = not (step.changed or step.codes or step.event.is_attempt_event)
        seen = Glance() if before is None else cast(Glance, _LazyGlance(before))
        was = None if before is None else partial(EvaluationScope, self.world, before)
        passage = Passage(seen, step, machine.scope, was)
        asked, relevant = self._asked(passage, quiet)
        known: dict[str, Remembered] | None = None
        if any(one.remembers for one in asked):
            known = dict(memory.fetch(self.table.index[WATCHED]) or ())
        judged = []
        # Where no visit was read and no outcome published, none was closed.
        left_out: tuple[str, ...] = ()
        if not memory.is_accessed("itineraries") and not any(isinstance(c, Publish) for c in step.commands):
            left_out = _OF_VISITS
        for one in asked:
            if one.name not in left_out:
                remembered = one.first if known is None else known.get(one.name, one.first)
                state, verdict = one.watch(remembered, passage)
                if known is not None:
                    known[one.name] = state
                judged.append((one.name, verdict))
        breaches = tuple((name, verdict.breach) for name, verdict in judged if verdict.breach)
        watched = None if known is None else tuple(sorted((n, state) for n, state in known.items() if state))
        relevant.update(name for name, verdict in judged if verdict.relevant)
        return watched, breaches, relevant.union(*(verdict.about for _, verdict in judged))

    def _asked(self, passage: Passage, quiet: bool) -> tuple[list[Property], set[str]]:
        """Return the properties to watch in a step, and the names of those that surely hold in it."""
        if quiet:
            asked, hold = self._quietly[passage.step.event.is_request], set[str]()
        else:
            plan = self._plans[kind_of(passage)]
            asked = [self.properties[index] for index, _ in plan.asked]
            hold = {self.properties[index].name for index in plan.hold}
        return [one for one in asked if one.about is None or one.about(passage)], hold

    def _late(self, memory: TrackedMemory, situation: Situation, name: str) -> Effect:
        """Let the deadline of a property pass."""
        one = next(each for each in self.properties if each.name == name)
        known = dict(memory.fetch(self.table.index[WATCHED]) or ())
        verdict = one.end(known[name], math.inf)
        known[name] = (math.inf,)
        delta: dict[int, int] = {}
        self._set(delta, memory, WATCHED, tuple(sorted(known.items())))
        breaches = ((name, verdict.breach),) if verdict.breach else ()
        return Effect(tuple(delta.items()), breaches, frozenset({name}))

    def _set(self, delta: dict[int, int], memory: TrackedMemory, name: SlotName, value: Any) -> None:
        delta.update(memory.change(self.table.index[name], value))

    def walk(self, moves: Sequence[int]) -> list[tuple[Situation, Effect]]:
        """Return the situations of a path from the initial one, each with the effect that led to it."""
        found = [self.initial()]
        for number in moves:
            situation = found[-1][0]
            effect = self.step(situation, number)
            found.append((self._after(situation, effect), effect))
        return found

    def without_idle(self, moves: Sequence[int]) -> list[int]:
        """Return moves without reports of live values that change nothing."""
        way = [situation for situation, _ in self.walk(moves)]
        found = zip(moves, way, way[1:], strict=False)
        return [n for n, before, after in found if before != after or not self.moves.all[n].reports_value]

    def _after(self, situation: Situation, effect: Effect) -> Situation:
        found, ranks = list(situation), self.table.index[RANKS]
        for slot, number in effect.delta:
            found[slot] = number
        found[ranks] = self.ranks_after(effect, situation[ranks])
        return tuple(found)

    def make_room(self) -> None:
        """Discard everything, and double the room for slots."""
        self._room *= 2
        self._begin()

    # -- situations ---------------------------------------------------------------------------------------

    def keep(self, rows: Rows) -> None:
        """Called with new situations; a hook for subclasses."""

    def flags(self, situation: Situation) -> tuple[int, list[int]]:
        """Return the `Is` flags of a situation, and the slots that they depend on."""
        table, index = self.table, self.table.index
        slots = [index["attempts", name] for name in table.get(situation, ("attempts", "")) or ()]
        sent = [table.value(slot, situation[slot]) for slot in slots]
        whole = [index[name, ""] for name in ("configuration", "held", "asked", "attempts")]
        walks = [index["itineraries", name] for name in self._endless(situation)]
        divert = [index["context", DIVERT]] if DIVERT in self.chart.context else []
        return self._look(situation, sent), whole + slots + walks + divert

    def _endless(self, situation: Situation) -> Iterator[str]:
        """Yield the active states whose itinerary may have sweeps without end."""
        for name in self.table.get(situation, ("configuration", "")) or ():
            rule = self.chart.states[name].itinerary
            if rule is not None and rule.sweeps is not None:
                yield name

    def _look(self, situation: Situation, attempts: list[Attempt]) -> int:
        configuration = self.table.get(situation, ("configuration", "")) or ()
        stages, states = self.chart.profile.stages, self.chart.states
        label = label_of(self.chart, configuration)
        waits = self.table.get(situation, ("held", "")) or self.table.get(situation, ("asked", ""))
        rests = bool(waits)
        waits = rests or any(states[name].paused for name in configuration)
        found = Is.OVER if label in (*stages.ready, *stages.ended) else 0
        if waits or found or label in (*stages.over, *stages.starting):
            found |= Is.REPORTED
        if label not in stages.without_mission:
            found |= Is.MISSION
            found |= 0 if rests or self._divert_waits(situation) else self._stage(configuration)
        walks = (self.table.get(situation, ("itineraries", name)) for name in self._endless(situation))
        if any(walk is not None and walk.sweeps == 0 for walk in walks):
            found |= Is.ENDLESS
        for attempt in attempts:
            if attempt.operation in self._moving and attempt.phase in _UNDER_WAY:
                found |= Is.MOVES
        return found

    def _divert_waits(self, situation: Situation) -> bool:
        return DIVERT in self.chart.context and bool(self.table.get(situation, ("context", DIVERT)))

    def _stage(self, configuration: Iterable[str]) -> int:
        """Return whether a mission goes on by itself, or waits elsewhere for a person."""
        states = self.chart.states
        paused = [name for name in configuration if states[name].paused]
        if any(states[name].slot for name in configuration):
            return 0 if paused else Is.WORKS
        return Is.AWAY if paused else 0


class _TrackedContent(ExecutableContent):
    """Executes actions; an input that only a `set` reads is read lazily (see `TrackedMemory`)."""

    __slots__ = ()

    def carry_out(self, action: CompiledAction, state: str, trigger: Trigger, step: Macrostep) -> None:
        """Execute an action; make the read of a `set` lazy if it succeeds for every value of its input."""
        carry_out = partial(super().carry_out, action, state, trigger, step)
        if action.call.name != "set":
            carry_out()
            return
        memory, names = self._scope.memory, action.call.arguments
        assert isinstance(memory, TrackedMemory)
        before, lazy = frozenset(memory.values), memory.lazy.copy()
        were = {name: value for name, value in dict.items(memory.context) if name in names}
        carry_out()
        read = memory.values - before
        slot = min(read, default=-1)
        if not (read == {slot} and slot in memory.table.reported and memory.lazy == lazy):
            return
        name = memory.table.names[slot][1]
        value = memory.inputs[name]

        def carry_out_with(other: Reported) -> None:
            for variable in names:
                dict.pop(memory.context, variable, None)
            dict.update(memory.context, were)
            dict.__setitem__(memory.inputs, name, other)
            carry_out()

        try:
            for other in memory.table.values(slot):
                carry_out_with(other)
        except Exception:  # this value breaks the step, so the value matters
            read.clear()
        carry_out_with(value)
        if memory.values - before == read and memory.lazy == lazy:
            memory.read_lazily(names, slot)


class ChosenUpdates(Operations):
    """The operations of a machine of which the caller chooses whether an update finds new arguments."""

    __slots__ = ("changes",)

    def __init__(self, *of_machine: Any) -> None:
        super().__init__(*of_machine)
        self.changes = True

    def new_arguments(
        self, invocation: Invocation, attempt: Attempt, step: Macrostep
    ) -> Mapping[str, Any] | None:
        """Return the same arguments as if they were new, or None, as was chosen."""
        return attempt.arguments if self.changes else None


class ChosenMachine(Machine):
    """A machine with such operations."""

    __slots__ = ()
    operations = ChosenUpdates

    @property
    def updates(self) -> ChosenUpdates:
        """Its operations."""
        return cast(ChosenUpdates, self._operations)


class _TrackedMachine(ChosenMachine):
    """A machine on a tracked memory."""

    __slots__ = ()
    content = _TrackedContent


class _SameInputs(Inputs):
    """Live values after a reload of the same missions: a known level stays as it is.

    Of an input that is read by its levels alone, a situation has some value, on either side of a bound.
    """

    def is_reached(self, level: Level, name: str, value: float, step: Macrostep) -> bool:
        """Return a level as it was; compare only where it is not known."""
        known: bool | None = self._scope.memory.levels.get(name)
        return super().is_reached(level, name, value, step) if known is None else known


class _ReloadedMachine(_TrackedMachine):
    """A machine after a reload of the same missions."""

    __slots__ = ()
    inputs = _SameInputs


class _LazyGlance:
    """The memory before a step, read only where a property asks for it."""

    def __init__(self, memory: TrackedMemory) -> None:
        self._memory = memory

    @property
    def speaking(self) -> Container[str]:
        return _Those(lambda name: is_speaking(self._memory, name))

    @property
    def over(self) -> Container[str]:
        return _Those(lambda name: name.startswith("i:") and self._is_over(name.removeprefix("i:")))

    @property
    def settled(self) -> Container[str]:
        return _Those(self._is_over)

    def _is_over(self, name: str) -> bool:
        found = self._memory.invocations.get(name)
        return found is not None and found.id == f"i:{name}" and is_over(found, self._memory)

    def __getattr__(self, name: str) -> Any:
        memory = self._memory
        compute = _COMPUTED.get(name)
        found = compute(memory) if compute is not None else getattr(memory, name)
        found = tuple(found) if isinstance(found, list) else found
        setattr(self, name, found)
        return found


@dataclass(frozen=True)
class _Those:
    """A container given by a predicate."""

    is_one: Callable[[str], bool]

    def __contains__(self, name: object) -> bool:
        return self.is_one(str(name))


#: What of a glance is computed from the memory.
_COMPUTED: Mapping[str, Callable[[Memory], Any]] = {
    "closed": closed,
    "begun": begun,
    "unfinished": unfinished,
    "history": lambda memory: tuple(memory.history.items()),
}
#: The phases of attempts that may move the robot, and that nobody has cancelled.
_UNDER_WAY = (Phase.REQUESTED, Phase.ACCEPTED, Phase.REPLACED)
#: The first events of a resumed process, and of a new one.
_RESTARTS = (RESUMED, "start")
_OF_VISITS = ("closed_once",)
_OF_REQUESTS = ("refusals_have_reasons",)
