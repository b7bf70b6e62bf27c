"""Every situation that a machine can come to, breadth first, so that the first way to one is a shortest one.

What an event does is worked out by the machine itself, once for each value of the slots that the step read;
wherever those are the same, the same changes follow. So few transitions need a step; the others are looked
up, those of many situations at once (see `levels`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Container, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple, cast

from lupin_engine.errors import reason
from lupin_engine.machine import (
    RESUMED,
    Act,
    Attempt,
    CompiledAction,
    EvaluationScope,
    ExecutableContent,
    Machine,
    Macrostep,
    Memory,
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
    action_moves,
    begun,
    closed,
    is_over,
    is_speaking,
)
from lupin_engine.sim import label_of
from lupin_verify.situations.classes import Classes
from lupin_verify.situations.found import Does, Effect, Is
from lupin_verify.situations.memo import Rows
from lupin_verify.situations.relevance import Relevance, invokes
from lupin_verify.situations.situation import (
    CALM,
    CLAIMS,
    COMPARED,
    FIRST_NEW,
    RANKS,
    WATCHED,
    Overflow,
    Situation,
    SlotName,
    SlotTable,
    TooMany,
    TrackedMemory,
    settle_names,
)
from lupin_verify.situations.worlds import (
    LOADED,
    OF_PROPERTY,
    Deadlines,
    TimerName,
    Watched,
    WorldMoves,
    deadlines_of,
    forget_unwanted,
    in_order,
    rankable,
    ranks_after,
    settled_claims,
)

#: Room for slots at the beginning.
ROOM = 128
#: What the robot's clock always shows, in POSIX time: six in the morning of 2026-01-01, UTC.
MORNING = 1767247200.0
#: The property that no step raises an exception.
NO_EXCEPTION = "no_exception"


class Bounds(NamedTuple):
    """How far is looked. `owed`: attempts of one operation that wait for their end beside the current one."""

    targets: int = 2
    owed: int = 0
    restarts: bool = True
    most_values: int = 2000


class SituationExplorer:
    """Explores the situations of one chart."""

    def __init__(self, world: World, properties: tuple[Property, ...], bounds: Bounds) -> None:
        """Make an explorer.

        Args:
            world: the chart with its parameters.
            properties: what is watched in every step.
            bounds: how far is looked.
        """
        self.world = world
        self.chart = world.chart
        self.properties = properties
        asked = [one for one in properties if one not in BUILT_IN or one.name in _OF_REQUESTS]
        #: What is watched in a step that changes nothing but live values, and if it answers a request.
        self._quietly = {False: [one for one in asked if one not in BUILT_IN], True: asked}
        self.bounds = bounds
        self.relevance = Relevance(world.chart)
        self.classes = Classes(world, self.relevance, bounds.targets)
        every = (invoke for _, invoke in invokes(world.chart))
        self._moving = {one.name for one in every if one.operation.on_hold is OnHold.CANCEL}
        self._room = ROOM
        self._begin()

    def _begin(self) -> None:
        self.table = SlotTable(self.relevance, self._room, self.bounds.most_values)
        self.moves = WorldMoves(self.table, self.classes, self.bounds.owed, self.bounds.restarts)
        self.table.reported = frozenset(self.moves.told())

    # -- one move -----------------------------------------------------------------------------------------

    def initial(self) -> tuple[Situation, Effect]:
        """Return where every machine of the chart begins."""
        nothing = (0,) * self._room
        memory = TrackedMemory(self.table, nothing)
        machine = _TrackedMachine(self.world, memory)
        effect = self._effect_of(memory, machine, self._start(machine), nothing, None)
        return self._after(nothing, effect), effect

    def _start(self, machine: Machine) -> Step:
        return machine.start(0.0, None if self.world.calendar is None else MORNING)

    def step(self, situation: Situation, number: int) -> Effect:
        """Make the machine's own step.

        Which deadlines come before which others is not in the effect: see `ranks_after`.
        """
        memory = TrackedMemory(self.table, situation)
        effect = self._step(memory, situation, number)
        aside = tuple((self.table.index["context", name], slot) for name, (_, slot) in memory.aside.items())
        effect.needs, effect.aside = memory.reads, aside
        effect.sets = frozenset(memory.written - memory.values)
        return effect

    def _step(self, memory: TrackedMemory, situation: Situation, number: int) -> Effect:
        before = TrackedMemory(self.table, situation)
        before.values, before.presence = memory.values, memory.presence
        move = self.moves.all[number]
        if move.timer[0] == OF_PROPERTY:
            return self._late(memory, situation, move.timer[1])
        machine = _TrackedMachine(self.world, memory)
        if move.timer[0] != "fresh":
            machine.restore_known_false(memory.fetch(self.table.index[CALM]))
        begins_anew = self.chart.profile.stages.begins_anew
        try:
            is_restart = move.event is not None and move.event.name == RESUMED
            if is_restart and label_of(self.chart, memory.configuration) in begins_anew:
                if len(self.properties) == len(BUILT_IN):
                    return Effect()  # it is as at the beginning
                memory.take_over(Memory(), whole=True)
                step: Step | None = self._start(machine)
            elif move.event is LOADED:
                if not is_idle(machine):
                    return Effect()
                memory.take_over(successor(Machine(self.world, memory.plain()), self.world).memory)
                machine = _TrackedMachine(self.world, memory)
                with ExitStack() as unread:
                    for field in COMPARED:
                        unread.enter_context(memory.unread(field, self.table.keys[field]))
                    step = machine.go_on(0.0)
            else:
                step = self.moves.carry_out(machine, memory, move)
            if step is None:
                return Effect(cut=True)
            return self._effect_of(memory, machine, step, situation, before)
        except (Overflow, TooMany):
            raise
        except Exception as problem:  # a defect of the engine, or of a plugin: told like what it breaks
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
        forget_unwanted(memory, self.bounds.owed)
        set_now = {(t[2], *t[3]) for timers in memory.looked_at_timers() for t in timers if t[1] >= FIRST_NEW}
        named = settle_names(memory)
        if any(not self.moves.is_within_bounds(name) for name in named.values()):
            return Effect(cut=True)
        in_order(memory)
        claims = settled_claims(memory) if memory.is_looked_at("attempts") else None
        delta = dict(memory.changes())
        fresh = {(kind, named.get(owner, owner), event) for kind, owner, event in set_now if kind != "at"}
        if len(self.properties) > len(BUILT_IN):
            self._set(delta, memory, WATCHED, watched or None)
        fresh |= self._due_now(situation, watched)
        slots = [self.table.index[name] for name in (("timers", ""), ("frozen", ""), WATCHED)]
        deadlines, was_gone = None, before is not None and step.event.name in _RESTARTS
        if fresh or was_gone or any(slot in delta for slot in slots):
            # What was due while the process was gone comes now, and may be later than what a property allows.
            running = (*memory.timers, *(() if was_gone else deadlines_of(watched)))
            ordered = (tuple(rankable(self.chart, timers)) for timers in (running, memory.frozen))
            deadlines = Deadlines(*ordered)
        self._set(delta, memory, CALM, machine.known_false)
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
        """Return which deadlines come before which others after an effect, by that before it, as numbers."""
        slot = self.table.index[RANKS]
        if effect.deadlines is None:
            return before
        known = self.table.value(slot, before) if before else frozenset()
        ranks = ranks_after(known, effect.deadlines, effect.fresh, dict(effect.renamed))
        try:
            return self.table.number(slot, ranks) if ranks else 0
        except TooMany:  # of so many orders no more are told apart: any deadline may be the next
            return 0

    def _due_now(self, situation: Situation, watched: Watched) -> set[TimerName]:
        """Return the deadlines of properties that are set in a step."""
        before = dict(self.table.get(situation, WATCHED) or ()) if watched else {}
        new = tuple((name, state) for name, state in watched if before.get(name) != state)
        return {(kind, *about) for _, _, kind, about in deadlines_of(new)}

    def _judge(
        self, memory: TrackedMemory, machine: Machine, step: Step, before: TrackedMemory | None
    ) -> tuple[Watched, tuple[tuple[str, str], ...], set[str]]:
        """Return what properties remember, those that a step breaks, each with how, and those it is about."""
        # What always holds of a situation still does where nothing but live values changes.
        quiet = not (step.changed or step.codes or step.event.is_attempt_event)
        seen = Glance() if before is None else cast(Glance, _LazyGlance(before))
        was = None if before is None else partial(EvaluationScope, self.world, before)
        passage = Passage(seen, step, machine.scope, was)
        known: dict[str, Remembered] = {}
        if len(self.properties) > len(BUILT_IN):
            known = dict(memory.fetch(self.table.index[WATCHED]) or ())
        judged = []
        # Where no visit was looked at and nothing told, none was closed.
        left_out: tuple[str, ...] = ()
        if not memory.is_looked_at("itineraries") and not any(isinstance(c, Publish) for c in step.commands):
            left_out = _OF_VISITS
        for one in self._quietly[step.event.is_request] if quiet else self.properties:
            if one.name not in left_out:
                state, verdict = one.watch(known.get(one.name, one.first), passage)
                known[one.name] = state
                judged.append((one.name, verdict))
        breaches = tuple((name, verdict.breach) for name, verdict in judged if verdict.breach)
        watched = tuple(sorted((name, state) for name, state in known.items() if state))
        relevant = {name for name, verdict in judged if verdict.relevant}
        return watched, breaches, relevant.union(*(verdict.about for _, verdict in judged))

    def _late(self, memory: TrackedMemory, situation: Situation, name: str) -> Effect:
        """Let the time of a property pass."""
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
        """Return the situations on a way from the beginning, each with the effect that led to it."""
        found = [self.initial()]
        for number in moves:
            situation = found[-1][0]
            effect = self.step(situation, number)
            found.append((self._after(situation, effect), effect))
        return found

    def without_idle(self, moves: Sequence[int]) -> list[int]:
        """Return moves without those that tell a live value what it is."""
        way = [situation for situation, _ in self.walk(moves)]
        found = zip(moves, way, way[1:], strict=False)
        return [n for n, before, after in found if before != after or not self.moves.all[n].tells_value]

    def _after(self, situation: Situation, effect: Effect) -> Situation:
        found, ranks = list(situation), self.table.index[RANKS]
        for slot, number in effect.delta:
            found[slot] = number
        found[ranks] = self.ranks_after(effect, situation[ranks])
        return tuple(found)

    def make_room(self) -> None:
        """Begin anew, with more room for slots."""
        self._room *= 2
        self._begin()

    # -- what is told of situations -----------------------------------------------------------------------

    def keep(self, rows: Rows) -> None:
        """Take notice of situations that were not seen before; whoever wants to keep them does it here."""

    def flags(self, situation: Situation) -> tuple[int, list[int]]:
        """Return what is known of a situation (see `Is`), and of which slots."""
        table, index = self.table, self.table.index
        slots = [index["attempts", name] for name in table.get(situation, ("attempts", "")) or ()]
        sent = [table.value(slot, situation[slot]) for slot in slots]
        whole = [index[name, ""] for name in ("configuration", "held", "asked", "attempts")]
        return self._look(situation, sent), whole + slots

    def _look(self, situation: Situation, attempts: list[Attempt]) -> int:
        configuration = self.table.get(situation, ("configuration", "")) or ()
        stages, states = self.chart.profile.stages, self.chart.states
        label = label_of(self.chart, configuration)
        waits = self.table.get(situation, ("held", "")) or self.table.get(situation, ("asked", ""))
        waits = waits or any(states[name].paused for name in configuration)
        found = Is.OVER if label in (*stages.ready, *stages.ended) else 0
        if waits or found or label in (*stages.over, *stages.starting):
            found |= Is.TOLD
        if label not in stages.without_mission:
            found |= Is.MISSION
        for attempt in attempts:
            if attempt.operation in self._moving and attempt.phase in (Phase.REQUESTED, Phase.ACCEPTED):
                found |= Is.MOVES
        return found


class _TrackedContent(ExecutableContent):
    """Carries out actions; what only a `set` reads does not count as read yet (see `TrackedMemory.aside`)."""

    __slots__ = ()

    def carry_out(self, action: CompiledAction, state: str, trigger: Trigger, step: Macrostep) -> None:
        """Carry out an action; of a `set` see whether it does so whatever the value is that it reads."""
        carry_out = partial(super().carry_out, action, state, trigger, step)
        if action.call.name != "set":
            carry_out()
            return
        memory, names = self._scope.memory, action.call.arguments
        assert isinstance(memory, TrackedMemory)
        before, aside = frozenset(memory.values), memory.aside.copy()
        were = {name: value for name, value in dict.items(memory.context) if name in names}
        carry_out()
        read = memory.values - before
        slot = min(read, default=-1)
        if not (read == {slot} and slot in memory.table.reported and memory.aside == aside):
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
        except Exception:  # the step with that value tells it, so the value makes a difference
            read.clear()
        carry_out_with(value)
        if memory.values - before == read and memory.aside == aside:
            memory.put_aside(names, slot)


class _TrackedMachine(Machine):
    """A machine of which is known what its steps read."""

    __slots__ = ()
    content = _TrackedContent


class _LazyGlance:
    """What was before a step, looked up when a property asks for it."""

    def __init__(self, memory: TrackedMemory) -> None:
        self._memory = memory

    @property
    def speaking(self) -> Container[str]:
        return _Those(lambda name: is_speaking(self._memory, name))

    @property
    def over(self) -> Container[str]:
        return _Those(lambda name: self._is_over(name))

    def _is_over(self, name: str) -> bool:
        found = self._memory.invocations.get(name.removeprefix("i:"))
        return found is not None and found.id == name and is_over(found, self._memory)

    def __getattr__(self, name: str) -> Any:
        memory = self._memory
        work_out = {"closed": closed, "begun": begun}.get(name)
        found = work_out(memory) if work_out is not None else getattr(memory, name)
        found = tuple(found) if isinstance(found, list) else found
        setattr(self, name, found)
        return found


@dataclass(frozen=True)
class _Those:
    """Those about which something can be said, which is worked out of each that is asked for."""

    is_one: Callable[[str], bool]

    def __contains__(self, name: object) -> bool:
        return self.is_one(str(name))


#: The first steps of a process that goes on, and of one that begins anew.
_RESTARTS = (RESUMED, "start")
_OF_VISITS = ("closed_once",)
_OF_REQUESTS = ("refusals_have_reasons",)
