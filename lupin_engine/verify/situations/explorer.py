"""Every situation that a machine can come to, breadth first, so that the first way to one is a shortest one.

What an event does is worked out by the machine itself, once for each value of the slots that the step read;
wherever those are the same, the same changes follow. So few transitions need a step: the others are two
look-ups.
"""

from __future__ import annotations

import math
import pickle
import tempfile
from array import array
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from hashlib import blake2b
from operator import itemgetter
from typing import IO, Any, NamedTuple, cast

from lupin_engine.errors import reason
from lupin_engine.machine.event import Cancel, Report
from lupin_engine.machine.machine import Machine
from lupin_engine.machine.memory import Attempt, Phase
from lupin_engine.machine.scope import World
from lupin_engine.machine.step import Step
from lupin_engine.plugin.contract import OnHold
from lupin_engine.plugin.profile import Publish
from lupin_engine.sim.simulation import label_of
from lupin_engine.verify.properties import (
    BUILT_IN,
    Glance,
    Passage,
    Property,
    Remembered,
    closed,
    over,
    speaking,
)
from lupin_engine.verify.situations.classes import Classes
from lupin_engine.verify.situations.relevance import Relevance, invokes
from lupin_engine.verify.situations.situation import (
    CALM,
    FIRST_NEW,
    RANKS,
    WATCHED,
    Overflow,
    Situation,
    SlotTable,
    TooMany,
    TrackedMemory,
    settle_names,
)
from lupin_engine.verify.situations.worlds import (
    OF_PROPERTY,
    TimerName,
    Watched,
    WorldMoves,
    deadlines_of,
    forget_unwanted,
    in_order,
    ranks_after,
)

#: Room for slots at the beginning.
ROOM = 96
#: So many situations wait in memory before the rest waits on disk.
IN_MEMORY = 200_000
#: What the robot's clock always shows, in POSIX time: six in the morning of 2026-01-01, UTC.
MORNING = 1767247200.0
#: The property that no step raises an exception.
NO_EXCEPTION = "no_exception"
#: Of so many breaches of one property, all after as many moves, the one with the fewest faults is told.
_MOST_BREACHES = 1000
#: Between two looks at the clock and the budget.
_PACE = 512


class Bounds(NamedTuple):
    """How far is looked. `owed`: attempts of one operation that wait for their end beside the current one."""

    targets: int = 2
    owed: int = 0
    restarts: bool = True
    most_values: int = 2000


@dataclass(slots=True)
class Effect:
    """What a move does: the slots that change with what they are then, and what is told of it.

    `progress`: something was told of a target or of the mission. `fresh` are the deadlines that it sets,
    `renamed` the attempts that get another name. One that is `cut` is beyond the bounds.
    """

    delta: tuple[tuple[int, int], ...]
    breaches: tuple[tuple[str, str], ...]
    relevant: frozenset[str]
    taken: tuple[str, ...]
    entered: tuple[str, ...]
    progress: bool
    fresh: frozenset[TimerName] = frozenset()
    renamed: tuple[tuple[str, str], ...] = ()
    cut: bool = False
    told: bool = False


class Breach(NamedTuple):
    """A property that is broken: in which situation by which move, how, and after how many moves."""

    name: str
    situation: int
    move: int
    text: str
    depth: int = 0


@dataclass
class ExplorationProgress:
    """How far an exploration is: `depth` in moves from the beginning, `steps` were made by the machine."""

    situations: int = 0
    transitions: int = 0
    steps: int = 0
    depth: int = 0
    expanded: int = 0
    waiting: int = 0


@dataclass
class Explored:
    """What was found: the graph of situations by number, with what is known of each.

    `sources`, `targets` and `by` (moves) are the transitions that change something, `advances` says whether
    they tell something of a target or of the mission; `flags` of a situation are from `Is`, `parents` and
    `parent_moves` lead back to the beginning. `breaches` are those of each property after the fewest moves.
    `relevant` counts the steps that properties are about, `cut` what is beyond the bounds. One that is not
    `complete` was `stopped` for a reason.
    """

    moves: WorldMoves
    progress: ExplorationProgress = field(default_factory=ExplorationProgress)
    sources: array[int] = field(default_factory=lambda: array("I"))
    targets: array[int] = field(default_factory=lambda: array("I"))
    by: array[int] = field(default_factory=lambda: array("H"))
    advances: bytearray = field(default_factory=bytearray)
    flags: bytearray = field(default_factory=bytearray)
    parents: array[int] = field(default_factory=lambda: array("I"))
    parent_moves: array[int] = field(default_factory=lambda: array("h"))
    cut: int = 0
    breaches: dict[str, list[Breach]] = field(default_factory=dict)
    relevant: dict[str, int] = field(default_factory=dict)
    taken: set[str] = field(default_factory=set)
    entered: set[str] = field(default_factory=set)
    complete: bool = False
    stopped: str = ""


#: What picks the slots that were read out of a situation, the effects by what they were, and the slots.
_Remembered = tuple[Callable[[Situation], Any], dict[Any, Effect], frozenset[int]]


class Is:
    """What is known of a situation, as bits."""

    OVER = 1  #: ready or done: a mission could begin
    TOLD = 2  #: somebody knows: held, paused, asked, over, or in a fault
    MOVES = 4  #: an operation that moves is under way
    MISSION = 8  #: a mission is under way


class SituationExplorer:
    """Explores the situations of one chart."""

    def __init__(
        self, world: World, properties: tuple[Property, ...], bounds: Bounds, memo: bool = True
    ) -> None:
        """Make an explorer.

        Args:
            world: the chart with its parameters.
            properties: what is watched in every step.
            bounds: how far is looked.
            memo: whether what a move does is remembered; without, every transition is a step.
        """
        self.world = world
        self.chart = world.chart
        self.properties = properties
        self.bounds = bounds
        self.relevance = Relevance(world.chart)
        self.classes = Classes(world, self.relevance, bounds.targets)
        self._memo_on = memo
        every = (invoke for _, invoke in invokes(world.chart))
        self._moving = {one.name for one in every if one.operation.on_hold is OnHold.CANCEL}
        self._room = ROOM
        self._begin()

    def _begin(self) -> None:
        self.table = SlotTable(self.relevance, self._room, self.bounds.most_values)
        self.moves = WorldMoves(self.table, self.classes, self.bounds.owed, self.bounds.restarts)
        self._configuration = self.table.index["configuration", ""]
        self._memo: dict[tuple[int, int], list[_Remembered]] = {}
        self._looks: dict[tuple[int, ...], int] = {}
        self._marks: list[dict[int, int]] = [{} for _ in range(self._room)]

    # -- one move -----------------------------------------------------------------------------------------

    def initial(self) -> tuple[Situation, Effect]:
        """Return where every machine of the chart begins."""
        nothing = (0,) * self._room
        memory = TrackedMemory(self.table, nothing)
        machine = Machine(self.world, memory)
        step = machine.start(0.0, None if self.world.calendar is None else MORNING)
        effect = self._effect_of(memory, machine, step, nothing, None)
        return _changed(nothing, effect.delta), effect

    def effect(self, situation: Situation, number: int) -> Effect:
        """Return what a move does in a situation."""
        place = number, situation[self._configuration]
        known = self._memo.get(place)
        if known is None:
            known = self._memo[place] = []
        else:
            for getter, table, _ in known:
                found = table.get(getter(situation))
                if found is not None:
                    return found
        effect, reads = self.step(situation, number)
        if self._memo_on:
            _remember(known, situation, reads, effect)
        return effect

    def step(self, situation: Situation, number: int) -> tuple[Effect, set[int]]:
        """Make the machine's own step, and return what it read."""
        memory = TrackedMemory(self.table, situation)
        before = TrackedMemory(self.table, situation)
        before.reads = memory.reads
        move = self.moves.all[number]
        if move.timer[0] == OF_PROPERTY:
            return self._late(memory, situation, move.timer[1]), memory.reads
        machine = Machine(self.world, memory)
        if move.timer[0] != "fresh":
            machine.trust(memory.fetch(self.table.index[CALM]))
        try:
            step = self.moves.carry_out(machine, memory, move)
            effect = _CUT if step is None else self._effect_of(memory, machine, step, situation, before)
        except (Overflow, TooMany):
            raise
        except Exception as problem:  # a defect of the engine, or of a plugin: told like what it breaks
            told = f"{type(problem).__name__}: {reason(problem)}"
            effect = Effect((), ((NO_EXCEPTION, told),), frozenset(), (), (), progress=False)
        return effect, memory.reads

    def _effect_of(
        self,
        memory: TrackedMemory,
        machine: Machine,
        step: Step,
        situation: Situation,
        before: TrackedMemory | None,
    ) -> Effect:
        watched, breaches, relevant = self._judge(memory, machine, step, before)
        if step.event.name == "timer.cancel" or any(isinstance(c, Cancel) for c in step.commands):
            forget_unwanted(memory, self.bounds.owed)
        set_now = {(t[2], *t[3]) for timers in memory.looked_at_timers() for t in timers if t[1] >= FIRST_NEW}
        named = settle_names(memory)
        if any(not self.moves.is_within_bounds(name) for name in named.values()):
            return _CUT
        in_order(memory)
        delta = dict(memory.changes())
        fresh = {(kind, named.get(owner, owner), event) for kind, owner, event in set_now if kind != "at"}
        self._set(delta, situation, WATCHED, watched or None)
        fresh |= self._due_now(situation, watched)
        slots = [self.table.index[name] for name in (("timers", ""), ("frozen", ""), WATCHED)]
        if fresh or any(slot in delta for slot in slots):
            known = memory.fetch(self.table.index[RANKS]) or frozenset()
            due = [*memory.timers, *deadlines_of(watched)]
            self._set(delta, situation, RANKS, ranks_after(known, due, memory.frozen, fresh) or None)
        self._set(delta, situation, CALM, machine.calm)
        progress = any(isinstance(command, (Publish, Report)) for command in step.commands)
        renamed = tuple((old, new) for old, new in named.items() if "#" in new)
        return Effect(
            tuple(delta.items()),
            breaches,
            relevant,
            step.taken,
            step.entered,
            progress,
            frozenset(fresh),
            renamed,
        )

    def _due_now(self, situation: Situation, watched: Watched) -> set[TimerName]:
        """Return the deadlines of properties that are set in a step."""
        before = dict(self.table.get(situation, WATCHED) or ()) if watched else {}
        new = tuple((name, state) for name, state in watched if before.get(name) != state)
        return {(kind, *about) for _, _, kind, about in deadlines_of(new)}

    def _judge(
        self, memory: TrackedMemory, machine: Machine, step: Step, before: TrackedMemory | None
    ) -> tuple[Watched, tuple[tuple[str, str], ...], frozenset[str]]:
        """Return what properties remember, those that a step breaks, each with how, and those it is about."""
        # What always holds of a situation still does where nothing but live values changes.
        quiet = not (step.changed or step.codes or step.event.is_attempt_event)
        seen = Glance() if before is None else cast(Glance, _LazyGlance(before))
        passage = Passage(seen, step, machine.scope)
        known: dict[str, Remembered] = {}
        if len(self.properties) > len(BUILT_IN):
            known = dict(memory.fetch(self.table.index[WATCHED]) or ())
        judged = []
        for one in self.properties:
            if not quiet or one not in BUILT_IN or (step.accepted is not None and one.name in _OF_REQUESTS):
                state, verdict = one.watch(known.get(one.name, one.first), passage)
                known[one.name] = state
                judged.append((one.name, verdict))
        breaches = tuple((name, verdict.breach) for name, verdict in judged if verdict.breach)
        watched = tuple(sorted((name, state) for name, state in known.items() if state))
        return watched, breaches, frozenset(name for name, verdict in judged if verdict.relevant)

    def _late(self, memory: TrackedMemory, situation: Situation, name: str) -> Effect:
        """Let the time of a property pass."""
        one = next(each for each in self.properties if each.name == name)
        known = dict(memory.fetch(self.table.index[WATCHED]) or ())
        verdict = one.end(known[name], math.inf)
        known[name] = (math.inf,)
        delta: dict[int, int] = {}
        self._set(delta, situation, WATCHED, tuple(sorted(known.items())))
        breaches = ((name, verdict.breach),) if verdict.breach else ()
        return Effect(tuple(delta.items()), breaches, frozenset({name}), (), (), progress=False)

    def _set(self, delta: dict[int, int], situation: Situation, name: tuple[str, str], value: Any) -> None:
        slot = self.table.index[name]
        number = 0 if value is None else self.table.number(slot, value)
        if number != situation[slot]:
            delta[slot] = number

    def walk(self, moves: Sequence[int]) -> list[tuple[Situation, Effect]]:
        """Return the situations on a way from the beginning, each with the effect that led to it."""
        found = [self.initial()]
        for number in moves:
            situation = found[-1][0]
            effect, _ = self.step(situation, number)
            found.append((_changed(situation, effect.delta), effect))
        return found

    # -- all of them --------------------------------------------------------------------------------------

    def explore(self, goes_on: Callable[[ExplorationProgress], str] = lambda _: "") -> Explored:
        """Look at all situations.

        Args:
            goes_on: called now and then; returns why to stop, or nothing.

        Raises:
            TooMany: something grows without end.
        """
        while True:
            try:
                return _BreadthFirst(self).run(goes_on)
            except Overflow:
                self._room *= 2
                self._begin()

    def flags(self, situation: Situation) -> int:
        """Return what is known of a situation (see `Is`)."""
        table, index = self.table, self.table.index
        attempts = table.get(situation, ("attempts", "")) or ()
        slots = [index["attempts", name] for name in attempts]
        key = tuple(situation[index[name, ""]] for name in ("configuration", "held", "asked"))
        key += tuple(n for slot in slots for n in (slot, situation[slot]))
        found = self._looks.get(key)
        if found is None:
            sent = [table.value(slot, situation[slot]) for slot in slots]
            found = self._looks[key] = self._look(situation, sent)
        return found

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

    def mark(self, slot: int, number: int) -> int:
        """Return 120 bits by chance for a value of a slot; all of a situation, xored, tell it from others."""
        marks = self._marks[slot]
        found = marks.get(number)
        if found is None:
            digest = blake2b(b"%d %d" % (slot, number), digest_size=15).digest()
            found = marks[number] = int.from_bytes(digest, "big")
        return found


class _LazyGlance:
    """What was before a step, looked up when a property asks for it."""

    def __init__(self, memory: TrackedMemory) -> None:
        self._memory = memory

    def __getattr__(self, name: str) -> Any:
        memory = self._memory
        work_out = {"speaking": speaking, "over": over, "closed": closed}.get(name)
        found = work_out(memory) if work_out is not None else getattr(memory, name)
        found = tuple(found) if isinstance(found, list) else found
        setattr(self, name, found)
        return found


_OF_REQUESTS = ("refusals_have_reasons",)
_CUT = Effect((), (), frozenset(), (), (), progress=False, cut=True, told=True)


def _changed(situation: Situation, delta: tuple[tuple[int, int], ...]) -> Situation:
    found = list(situation)
    for slot, number in delta:
        found[slot] = number
    return tuple(found)


def _remember(
    known: list[_Remembered],
    situation: Situation,
    reads: set[int],
    effect: Effect,
) -> None:
    """Keep an effect under the values of what was read."""
    slots = frozenset(reads)
    for getter, table, these in known:
        if these == slots:
            table[getter(situation)] = effect
            return
    getter = itemgetter(*sorted(slots))
    known.append((getter, {getter(situation): effect}, slots))


class _BreadthFirst:
    """One exploration."""

    def __init__(self, explorer: SituationExplorer) -> None:
        self._explorer = explorer
        self._seen: dict[int, int] = {}
        self._waiting = WaitingLine()
        self._found = Explored(explorer.moves)
        self._ends_level = 0

    def run(self, goes_on: Callable[[ExplorationProgress], str]) -> Explored:
        explorer, found = self._explorer, self._found
        situation, effect = explorer.initial()
        mark = 0
        for slot, number in enumerate(situation):
            if number:
                mark ^= explorer.mark(slot, number)
        self._take_in(0, -1, effect)
        self._add(situation, mark, 0, -1)
        try:
            while self._waiting:
                if found.progress.expanded % _PACE == 0:
                    found.stopped = goes_on(found.progress)
                    if found.stopped:
                        return found
                self._expand(*self._waiting.pop())
        except KeyboardInterrupt:
            found.stopped = "interrupted"
            return found
        found.complete = True
        return found

    def _add(self, situation: Situation, mark: int, parent: int, move: int) -> int:
        found, number = self._found, len(self._seen)
        self._seen[mark] = number
        found.parents.append(parent)
        found.parent_moves.append(move)
        found.flags.append(self._explorer.flags(situation))
        self._waiting.put((number, mark, situation))
        found.progress.situations = number + 1
        found.progress.waiting = len(self._waiting)
        return number

    def _expand(self, number: int, mark: int, situation: Situation) -> None:
        explorer, found, seen, progress = self._explorer, self._found, self._seen, self._found.progress
        progress.expanded += 1
        if number > self._ends_level:  # the first of those that are one move further away
            progress.depth += 1
            self._ends_level = len(seen) - 1
        moves = explorer.moves.possible(situation)
        progress.transitions += len(moves)
        for move in moves:
            effect = explorer.effect(situation, move)
            if not effect.told:
                self._take_in(number, move, effect)
            elif effect.breaches:
                self._note_breaches(number, move, effect)
            delta = effect.delta
            if not delta:
                found.cut += effect.cut
                continue
            then = mark
            for slot, value in delta:
                old = situation[slot]
                if old:
                    then ^= explorer.mark(slot, old)
                if value:
                    then ^= explorer.mark(slot, value)
            to = seen.get(then)
            if to is None:
                to = self._add(_changed(situation, delta), then, number, move)
            found.sources.append(number)
            found.targets.append(to)
            found.by.append(move)
            found.advances.append(effect.progress)

    def _take_in(self, number: int, move: int, effect: Effect) -> None:
        """Keep what an effect tells that was not seen before."""
        effect.told = True
        found = self._found
        found.progress.steps += 1
        found.taken.update(effect.taken)
        found.entered.update(effect.entered)
        for name in effect.relevant:
            found.relevant[name] = found.relevant.get(name, 0) + 1
        self._note_breaches(number, move, effect)

    def _note_breaches(self, number: int, move: int, effect: Effect) -> None:
        depth = self._found.progress.depth
        for name, text in effect.breaches:
            known = self._found.breaches.setdefault(name, [])
            if not known or (known[0].depth == depth and len(known) < _MOST_BREACHES):
                known.append(Breach(name, number, move, text, depth))


class WaitingLine:
    """Situations that wait, first in first out; those that are too many for the memory wait on disk."""

    def __init__(self, in_memory: int = IN_MEMORY) -> None:
        self._in_memory = in_memory
        self._head: deque[Any] = deque()
        self._tail: list[Any] = []
        self._file: IO[bytes] | None = None
        self._chunks: deque[tuple[int, int]] = deque()
        self._count = 0

    def __len__(self) -> int:
        return self._count

    def put(self, entry: Any) -> None:
        """Add one at the end."""
        self._count += 1
        self._tail.append(entry)
        if len(self._tail) >= self._in_memory:
            self._write()

    def pop(self) -> Any:
        """Take the first one."""
        if not self._head:
            self._refill()
        self._count -= 1
        return self._head.popleft()

    def _write(self) -> None:
        if self._file is None:
            self._file = tempfile.TemporaryFile()  # noqa: SIM115 - lives as long as this
        kept = pickle.dumps(self._tail, -1)
        self._chunks.append((self._file.seek(0, 2), len(kept)))
        self._file.write(kept)
        self._tail.clear()

    def _refill(self) -> None:
        if self._chunks and self._file is not None:
            offset, size = self._chunks.popleft()
            self._file.seek(offset)
            self._head.extend(pickle.loads(self._file.read(size)))
        else:
            self._head.extend(self._tail)
            self._tail.clear()
