"""The walk through all situations, level by level: those of one depth are expanded together, as arrays.

What a move does in a situation follows from the slots that the step read. So for all situations of a level
that are in the same configuration, effects are looked up together, and the machine makes a step only where
none is known.
"""

from __future__ import annotations

from array import array
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence, Set
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lupin_verify.situations.explorer import SituationExplorer
from lupin_verify.situations.found import Breach, Effect, ExplorationProgress, Explored
from lupin_verify.situations.liveness import Dead, Liveness, Place
from lupin_verify.situations.memo import Indices, LevelPart, MemoTable, Rows, marks_of
from lupin_verify.situations.seen import Block, Marks, SeenTable, WaitingLine
from lupin_verify.situations.situation import RANKS, Overflow
from lupin_verify.situations.worlds import Mover, TimerName

#: So many situations are expanded together.
_TOGETHER = 1 << 15
#: Of so many breaches of one property, all after as many moves, the one with the fewest faults is told.
_MOST_BREACHES = 1000
#: Between two looks at the clock and the budget: so many steps of the machine.
_PACE = 512


def explore(
    explorer: SituationExplorer,
    goes_on: Callable[[ExplorationProgress], str] = lambda _: "",
    memo: bool = True,
    live: bool = True,
    open_values: bool = True,
) -> Explored:
    """Look at all situations.

    Args:
        explorer: makes the steps.
        goes_on: called now and then; returns why to stop, or nothing.
        memo: whether what a move does is remembered; without, every transition is a step.
        live: whether what nothing will read is not told apart (see `liveness`).
        open_values: whether live values are not told apart where they are open (see `liveness`).

    Raises:
        TooMany: something grows without end.
    """
    while True:
        try:
            return LevelWalk(explorer, memo, live, open_values).run(goes_on)
        except Overflow:
            explorer.make_room()


#: What many effects have in common.
_SHARED = ("delta", "relevant", "taken", "entered", "fresh", "deadlines", "renamed", "needs", "sets", "aside")
#: In place of what is left of the value of a slot: a step has set it, whatever it was.
_SET = -1


class Origins(NamedTuple):
    """Situations from which moves are made: slots by situations, with their numbers and marks.

    Of the slots that are `chosen` the value was open; the moves that are `made` have told them.
    """

    depth: int
    numbers: Indices
    rows: Rows
    low: Marks
    high: Marks
    chosen: frozenset[int] = frozenset()
    made: tuple[int, ...] = ()


class Moved(NamedTuple):
    """Transitions: the columns of their origins, their moves, what these do, and which slots end."""

    columns: Indices
    moves: NDArray[np.uint16]
    effects: NDArray[np.uint32]
    ends: NDArray[np.uint32]

    def at(self, which: Indices | NDArray[np.bool_]) -> Moved:
        """Return some of them."""
        return Moved(self.columns[which], self.moves[which], self.effects[which], self.ends[which])


class _Stopped(Exception):
    """It was said that the exploration stops; the text says why."""


class _MoreIsLive(Exception):
    """Something was needed that was not live, or a value is not open: the walk begins anew."""


def _groups(rows: Rows, slots: tuple[int, ...]) -> tuple[list[tuple[int, ...]], Indices]:
    """Return the different values of some slots, and which of them each situation has."""
    packed = np.zeros(rows.shape[1], np.uint64)
    for number, slot in enumerate(slots):
        if number >= 4 and number % 2 == 0:  # make room for two more values of 16 bits
            packed = np.unique(packed, return_inverse=True)[1].astype(np.uint64)
        packed = (packed << np.uint64(16)) | rows[slot]
    _, first, of = np.unique(packed, return_index=True, return_inverse=True)
    return [tuple(rows[list(slots), at].tolist()) for at in first], of


class _Effects:
    """All effects, by number, as far as the walk needs them in arrays."""

    def __init__(self, explorer: SituationExplorer, marks: NDArray[np.uint64]) -> None:
        self._explorer = explorer
        self.all: list[Effect] = []
        #: What effects have, each once, as many have the same.
        self._shared: dict[Any, Any] = {}
        self._marks = marks
        self._does, self._cut, self._breaks = (bytearray() for _ in range(3))
        self._low, self._high = array("Q"), array("Q")
        self._starts, self._slots, self._values = array("I", [0]), array("H"), array("H")
        self._before = array("H")
        #: The slot and the value of an effect that does nothing else, as one number; 0: there is none.
        self._only = array("I")
        self._without: dict[tuple[int, tuple[tuple[int, int], ...]], int] = {}
        #: Of each effect the number of what it does to deadlines; 0: nothing.
        self._timing = array("I")
        self._timings: dict[Any, int] = {None: 0}
        #: Sets of deadlines, and of each effect the place of those that it sets.
        self.deadlines: list[frozenset[TimerName]] = [frozenset()]
        self._places: dict[frozenset[TimerName], int] = {frozenset(): 0}
        self._fresh = array("H")
        #: Pairs of such a number and the ranks before; by their numbers, the ranks after.
        self._pairs = SeenTable()
        self._ranks_after = array("H")

    def add(self, effect: Effect, situation: Mapping[int, int]) -> int:
        """Keep an effect.

        Of the slots that the step has read, marks change alike wherever it is taken; of those that it `sets`
        whatever they were the marks before are left to who takes it.
        """
        for name in _SHARED:
            value = getattr(effect, name)
            setattr(effect, name, self._shared.setdefault(value, value))
        self.all.append(effect)
        low = high = 0
        for slot, value in effect.delta:
            for number in (value,) if slot in effect.sets else (situation[slot], value):
                low ^= self._marks.item(0, slot, number)
                high ^= self._marks.item(1, slot, number)
            self._slots.append(slot)
            self._values.append(value)
            self._before.append(situation[slot])
        self._low.append(low)
        self._high.append(high)
        self._starts.append(len(self._slots))
        self._does.append(effect.does)
        self._cut.append(effect.cut)
        self._breaks.append(bool(effect.breaches))
        timing = None if effect.deadlines is None else (effect.deadlines, effect.fresh, effect.renamed)
        self._timing.append(self._timings.setdefault(timing, len(self._timings)))
        place = self._places.setdefault(effect.fresh, len(self.deadlines))
        if place == len(self.deadlines):
            self.deadlines.append(effect.fresh)
        self._fresh.append(place)
        more = effect.breaches or effect.cut or effect.deadlines or len(effect.delta) != 1
        self._only.append(0 if more else self.only(*effect.delta[0]))
        return len(self.all) - 1

    def without(self, number: int, dead: Dead) -> int:
        """Return the number of an effect after which some slots do not matter."""
        effect = self.all[number]
        delta = tuple((slot, dead.left(slot, value)) for slot, value in effect.delta)
        if delta == effect.delta:
            return number
        found = self._without.get((number, delta))
        if found is None:
            before = self._values_before(number)
            kept = tuple(
                (slot, value) for slot, value in delta if value != before[slot] or slot in effect.sets
            )
            found = self._without[number, delta] = self.add(replace(effect, delta=kept), before)
        return found

    def _values_before(self, number: int) -> dict[int, int]:
        """Return the slots that an effect changes, with what they were."""
        begin, end = self._starts[number], self._starts[number + 1]
        return dict(zip(self._slots[begin:end], self._before[begin:end], strict=True))

    def ranks_after(self, before: NDArray[np.uint16], effects: NDArray[np.uint32]) -> NDArray[np.uint16]:
        """Return which deadlines come before which others after transitions, by what that was before."""
        timing = np.frombuffer(self._timing, np.uint32)[effects]
        timed = np.flatnonzero(timing)
        at, new = self._pairs.of_pairs(timing[timed].astype(np.uint64), before[timed].astype(np.uint64))
        for column in timed[new].tolist():
            after = self._explorer.ranks_after(self.all[effects[column]], int(before[column]))
            self._ranks_after.append(after)
        found = before.copy()
        found[timed] = np.frombuffer(self._ranks_after, np.uint16)[at]
        return found

    @staticmethod
    def only(slot: int, value: int) -> int:
        """Return a slot and its value as one number."""
        return slot << 16 | value

    def changing_only(self, effects: NDArray[np.uint32]) -> NDArray[np.uint32]:
        """Return which slot effects set to which value if that is all they do (see `only`); 0 otherwise."""
        return np.frombuffer(self._only, np.uint32)[effects]

    def does(self, effects: NDArray[np.uint32]) -> NDArray[np.uint8]:
        """Return what effects do, from `Does`."""
        return np.frombuffer(self._does, np.uint8)[effects]

    def setting(self, effects: NDArray[np.uint32]) -> NDArray[np.uint16]:
        """Return the places of the deadlines that effects set."""
        return np.frombuffer(self._fresh, np.uint16)[effects]

    def cut(self, effects: NDArray[np.uint32]) -> int:
        return int(np.frombuffer(self._cut, np.bool_)[effects].sum())

    def breaking(self, effects: NDArray[np.uint32]) -> NDArray[np.bool_]:
        return np.frombuffer(self._breaks, np.bool_)[effects]

    def marks(self, effects: NDArray[np.uint32]) -> tuple[Marks, Marks]:
        return np.frombuffer(self._low, np.uint64)[effects], np.frombuffer(self._high, np.uint64)[effects]

    def apply(self, rows: Rows, effects: NDArray[np.uint32]) -> None:
        """Change situations by one effect each."""
        starts = np.frombuffer(self._starts, np.uint32).astype(np.intp)
        sizes = starts[effects + np.uint32(1)] - starts[effects]
        ends = np.cumsum(sizes)
        flat = np.arange(ends[-1] if len(ends) else 0) + np.repeat(starts[effects] - ends + sizes, sizes)
        columns = np.repeat(np.arange(len(effects)), sizes)
        slots, values = np.frombuffer(self._slots, np.uint16), np.frombuffer(self._values, np.uint16)
        rows[slots[flat], columns] = values[flat]


class Leads:
    """What effects do where something is not live after them; `used` are those certainly met."""

    def __init__(self, live: Liveness, effects: _Effects) -> None:
        self._live = live
        self._effects = effects
        #: Whether all that steps needed so far was live, and all values were open that were taken to be.
        self.certain = True
        self.used: set[int] = set()
        #: Places, each with the slots whose value was chosen there.
        self._places: dict[tuple[Place, frozenset[int]], int] = {}
        #: Pairs of a place and an effect; by their numbers four each: what the effect is there, which slots
        #: end with it, which are asked for, and whether what is aside makes a difference.
        self._pairs = SeenTable()
        self._found = array("I")
        self._dead: dict[Place, Dead] = {}
        #: Slots that are set or end together, each with what is left of its value; the first are none.
        self._ends: dict[tuple[tuple[int, int], ...], int] = {(): 0}
        #: Slots of values that are open before effects and make a difference to them, or after them.
        self._asked: dict[frozenset[int], int] = {frozenset(): 0}

    def first(self, rows: Rows) -> Rows:
        """Return the first situation without what is not live in it."""
        place = self._live.place(rows[list(self._live.of_place), 0].tolist())
        dead = self._dead_at(place)
        for slot in dead.slots:
            rows[slot] = dead.left(slot, int(rows[slot, 0]))
        return rows

    def settle(self, origins: Origins, columns: Indices, effects: NDArray[np.uint32]) -> NDArray[np.uint32]:
        """Return what is told of effects at places, for each transition. Shape: (4, transitions).

        What they do, the numbers of the slots that end, and of those that are asked for, and whether what is
        aside makes a difference.
        """
        every, of = _groups(origins.rows, self._live.of_place)
        places = [(self._live.place(values), origins.chosen) for values in every]
        numbers = np.array([self._places.setdefault(p, len(self._places)) for p in places], np.uint64)
        placed: Marks = numbers[of[columns]]
        at, new = self._pairs.of_pairs(placed, effects.astype(np.uint64))
        names = dict(zip(numbers.tolist(), places, strict=True))
        for number, effect in zip(placed[new].tolist(), effects[new].tolist(), strict=True):
            place, chosen = names[number]
            self._found.extend(self._work_out(place, chosen, effect))
        if self.certain:
            self.used.update(effects[new].tolist())
        return np.frombuffer(self._found, np.uint32).reshape(-1, 4)[at].T

    def close(self, rows: Rows, columns: Indices, slots: Set[int]) -> None:
        """Take notice that the values of these are not open at places like those of some situations."""
        held, configuration = (rows[slot, columns].astype(np.uint32) for slot in self._live.of_head)
        for head in np.unique(held << 16 | configuration).tolist():
            self.certain = self._live.close(divmod(head, 1 << 16), slots) and self.certain

    def unchosen(self, asked: NDArray[np.uint32], chosen: frozenset[int]) -> Iterator[tuple[int, Indices]]:
        """Yield slots whose values are to be chosen first, each with the transitions that ask for it."""
        first = np.array([min(slots - chosen, default=-1) for slots in self._asked], np.intp)[asked]
        for slot in np.unique(first[first >= 0]).tolist():
            yield slot, np.flatnonzero(first == slot)

    def leaves_aside(self, situation: Sequence[int], effect: Effect) -> bool:
        """Say whether what is aside in an effect makes no difference after it."""
        place = self._live.place(situation[slot] for slot in self._live.of_place)
        return self._dead_at(self._after(place, effect)).slots >= {slot for slot, _ in effect.aside}

    def _after(self, place: Place, effect: Effect) -> Place:
        delta, kept = dict(effect.delta), zip(self._live.of_place, place, strict=True)
        return self._live.place(delta.get(slot, value) for slot, value in kept)

    def _work_out(self, place: Place, chosen: frozenset[int], number: int) -> tuple[int, int, int, bool]:
        effect = self._effects.all[number]
        delta, to = dict(effect.delta), self._after(place, effect)
        self.certain = self._live.takes(place, effect, to) and self.certain
        for slot in self._live.told.keys() & delta.keys():
            if delta[slot] and delta[slot] not in self._live.told[slot]:
                self.certain = self._live.close(None, {slot}) and self.certain
        dead, before = self._dead_at(to), self._dead_at(place)
        open_ = self._live.open(place)
        asked = frozenset(effect.needs & open_ | (open_ - dead.slots - delta.keys()))
        were = before.slots - asked - chosen
        ending = sorted((dead.slots - were | dead.gone - before.gone) - delta.keys())
        ends = [(slot, _SET) for slot in sorted(effect.sets & delta.keys())]
        ends += [(slot, dead.left(slot, 1)) for slot in ending]
        return (
            self._effects.without(number, dead),
            self._ends.setdefault(tuple(ends), len(self._ends)),
            self._asked.setdefault(asked, len(self._asked)),
            not dead.slots >= {slot for slot, _ in effect.aside},
        )

    def _dead_at(self, place: Place) -> Dead:
        found = self._dead.get(place)
        if found is None:
            found = self._dead[place] = self._live.dead(place)
        return found

    def ended(
        self, rows: Rows, columns: Indices, ends: NDArray[np.uint32]
    ) -> Iterator[tuple[int, int, Indices, NDArray[np.uint16]]]:
        """Yield slots that are set or end: what is left, in which transitions, and the values before."""
        order = np.argsort(ends, kind="stable")
        edges = np.searchsorted(ends[order], np.arange(len(self._ends) + 1))
        for slots, begin, end in zip(self._ends, edges, edges[1:], strict=False):
            at = order[begin:end]
            for slot, left in slots if len(at) else ():
                values = rows[slot, columns[at]]
                there = values > max(left, 0)
                yield slot, left, at[there], values[there]


class LevelWalk:
    """One exploration."""

    def __init__(self, explorer: SituationExplorer, memo: bool, live: bool, open_values: bool = True) -> None:
        self._explorer = explorer
        self._memo_on = memo
        table = explorer.table
        self._marks = marks_of(table.room, explorer.bounds.most_values)
        self._configuration, self._ranks = table.index["configuration", ""], table.index[RANKS]
        self._effects = _Effects(explorer, self._marks)
        self._memo: dict[tuple[int, int, bool], MemoTable] = {}
        self._flags = MemoTable()
        #: Of each move whether it is a deadline.
        self._deadlines = np.zeros(0, np.bool_)
        told = explorer.moves.told() if open_values else {}
        self.live = Liveness(explorer.chart, table, told, live)
        self._goes_on: Callable[[ExplorationProgress], str] = lambda _: ""
        self._steps = 0
        self._begin()

    def _begin(self) -> None:
        """Have seen nothing; what was worked out stays."""
        self._seen = SeenTable()
        self._waiting = WaitingLine()
        self._found = Explored(self._explorer.moves, deadlines=self._effects.deadlines)
        self._found.progress.steps = self._steps
        self._looked_at = 0
        self.live.begin()
        self._leads = Leads(self.live, self._effects)

    def run(self, goes_on: Callable[[ExplorationProgress], str]) -> Explored:
        """Look at everything; what is returned of a walk that is stopped is certain."""
        self._goes_on = goes_on
        farthest = self._run()
        while not (farthest.complete or farthest.stopped):
            self._begin()
            found = self._run()
            if found.complete or farthest.progress.situations < found.progress.situations:
                farthest = found
            farthest.stopped = found.stopped
        return farthest

    def _run(self) -> Explored:
        """Look at everything, or until something is needed that is not live."""
        situation, self._first = self._explorer.initial()
        self._found.breaches = {name: [Breach(name, 0, -1, text)] for name, text in self._first.breaches}
        rows = self._leads.first(np.array([situation], np.uint16).T)
        every = frozenset(range(len(situation)))
        low, high = LevelPart(rows, self._marks).key(every, np.arange(1))
        self._seen.numbers(low, high)
        self._add(0, rows, low, high, [0], [-1])
        found = self._found
        try:
            self._count()
            while self._waiting.count:
                self._look()
                self._expand(self._together())
            found.complete = True
        except _MoreIsLive:
            pass
        except _Stopped as why:
            found.stopped = str(why)
        except KeyboardInterrupt:
            found.stopped = "interrupted"
        for one in (self._first, *(self._effects.all[number] for number in self._leads.used)):
            found.take_in(one)
        return found

    def _look(self) -> None:
        why = self._goes_on(self._found.progress)
        if why:
            raise _Stopped(why)

    def _together(self) -> Block:
        """Take situations of one depth out of the line."""
        blocks = [self._waiting.pop()]
        size = blocks[0].rows.shape[1]
        while self._waiting.depth == blocks[0].depth and size < _TOGETHER:
            blocks.append(self._waiting.pop())
            size += blocks[-1].rows.shape[1]
        if len(blocks) == 1:
            return blocks[0]
        parts = [np.concatenate([block[field] for block in blocks], -1) for field in (2, 3, 4)]
        return Block(blocks[0].depth, blocks[0].first, *parts)

    def _expand(self, block: Block) -> None:
        order = np.argsort(block.rows[self._configuration], kind="stable")
        numbers = block.first + order
        rows, low, high = block.rows[:, order], block.low[order], block.high[order]
        origins = Origins(block.depth, numbers, rows, low, high)
        every: list[tuple[Indices, NDArray[np.uint32], int]] = []
        for begin, part in self._parts(rows):
            for move, columns in self._possible(part):
                every.append((columns + begin, self._follow(part, columns, move), move))
        columns = np.concatenate([each[0] for each in every])
        effects = np.concatenate([each[1] for each in every])
        moves = np.repeat(np.array([each[2] for each in every], np.uint16), [len(each[0]) for each in every])
        self._found.progress.expanded += len(numbers)
        self._go(origins, columns, moves, effects)

    def _parts(self, rows: Rows) -> Iterator[tuple[int, LevelPart]]:
        """Yield the parts with one configuration each, with their places; such situations are neighbours."""
        edges = np.flatnonzero(np.diff(rows[self._configuration])) + 1
        for begin, end in zip([0, *edges], [*edges, rows.shape[1]], strict=True):
            yield begin, LevelPart(rows[:, begin:end], self._marks)

    def _choose(self, origins: Origins, columns: Indices, moves: NDArray[np.uint16], slot: int) -> None:
        """Make some moves anew for each value of a slot that is open and asked for, where there is any."""
        there = origins.rows[slot, columns] > 0
        for value, tell in ((0, ()), *((value, (move,)) for value, move in self.live.told[slot].items())):
            at = np.flatnonzero(there == (value > 0))
            if not len(at):
                continue
            kept, of = np.unique(columns[at], return_inverse=True)
            rows = origins.rows[:, kept]
            change = self._marks[:, slot, rows[slot]] ^ self._marks[:, slot, value][:, None]
            rows[slot] = value
            low, high = origins.low[kept] ^ change[0], origins.high[kept] ^ change[1]
            chosen, made = origins.chosen | {slot}, (*origins.made, *tell)
            those = Origins(origins.depth, origins.numbers[kept], rows, low, high, chosen, made)
            self._go(those, of, moves[at], self._effects_of(those, of, moves[at]))

    def _effects_of(
        self, origins: Origins, columns: Indices, moves: NDArray[np.uint16], whole: bool = False
    ) -> NDArray[np.uint32]:
        """Return the effects of moves, each in the situation of a column."""
        effects = np.zeros(len(columns), np.uint32)
        for begin, part in self._parts(origins.rows):
            inside = np.flatnonzero((columns >= begin) & (columns < begin + part.rows.shape[1]))
            for move in np.unique(moves[inside]):
                at = inside[moves[inside] == move]
                effects[at] = self._follow(part, columns[at] - begin, int(move), whole)
        return effects

    def _go(
        self, origins: Origins, columns: Indices, moves: NDArray[np.uint16], effects: NDArray[np.uint32]
    ) -> None:
        """Take in where some moves lead; `columns` are those of the situations."""
        self._close(origins.rows, columns, moves, effects)
        effects, ends, asked = self._settle(origins, columns, moves, effects)
        done = np.ones(len(columns), np.bool_)
        for slot, at in self._leads.unchosen(asked, origins.chosen):
            done[at] = False
            self._choose(origins, columns[at], moves[at], slot)
        moves = self._told_before(origins, moves[done])
        every = Moved(columns[done], moves, effects[done], ends[done])
        self._found.cut += self._effects.cut(every.effects)
        self._note_breaches(origins.depth, origins.numbers[every.columns], moves, every.effects)
        self._take_in(origins, every)

    def _settle(
        self, origins: Origins, columns: Indices, moves: NDArray[np.uint16], effects: NDArray[np.uint32]
    ) -> NDArray[np.uint32]:
        """Return what moves do, the slots that end, and those that are asked for. Shape: (3, moves).

        Raises:
            _MoreIsLive: not everything is live that they need, or open that was taken to be.
        """
        settled = self._leads.settle(origins, columns, effects)
        partly = np.flatnonzero(settled[3])
        if len(partly):
            effects = self._effects_of(origins, columns[partly], moves[partly], whole=True)
            settled[:, partly] = self._leads.settle(origins, columns[partly], effects)
        if not self._leads.certain:
            raise _MoreIsLive
        return settled[:3]

    def _told_before(self, origins: Origins, moves: NDArray[np.uint16]) -> NDArray[np.uint16]:
        """Return moves with those that told values before them."""
        if not origins.made:
            return moves
        every, of = np.unique(moves, return_inverse=True)
        told = [self._explorer.moves.told_before(origins.made, int(move)) for move in every]
        return np.array(told, np.uint16)[of]

    def _take_in(self, origins: Origins, every: Moved) -> None:
        """Take in the transitions that matter, and the situations to which they are the first.

        What changes nothing matters if it is a deadline, or does something.
        """
        ranks = self._effects.ranks_after(origins.rows[self._ranks, every.columns], every.effects)
        low, high = self._change(origins.rows, every, ranks)
        matters = (low | high) != 0
        matters |= self._is_deadline(every.moves) | (self._effects.does(every.effects) != 0)
        every, ranks = every.at(matters), ranks[matters]
        low, high = low[matters] ^ origins.low[every.columns], high[matters] ^ origins.high[every.columns]
        targets, new = self._seen.numbers(low, high)
        numbers = origins.numbers[every.columns].astype(np.uint32)
        found, progress, does = self._found, self._found.progress, self._effects.does(every.effects)
        # With values that were told before, another one may be what changes.
        kept = (targets != numbers) | self._is_deadline(every.moves) | (does != 0)
        found.sources.frombytes(numbers[kept].tobytes())
        found.targets.frombytes(targets[kept].tobytes())
        found.by.frombytes(every.moves[kept].tobytes())
        found.sets.frombytes(self._effects.setting(every.effects[kept]).tobytes())
        found.does += does[kept].tobytes()
        progress.transitions += self._looked_at
        progress.depth = origins.depth
        self._looked_at = 0
        if len(new):
            first = every.at(new)
            rows = self._rows_after(origins.rows, first, ranks[new])
            self._add(
                origins.depth + 1, rows, low[new], high[new], numbers[new].tolist(), first.moves.tolist()
            )
        progress.waiting = self._waiting.count

    def _is_deadline(self, moves: NDArray[np.uint16]) -> NDArray[np.bool_]:
        every = self._explorer.moves.all
        if len(self._deadlines) < len(every):
            self._deadlines = np.array([bool(move.side & Mover.TIMER) for move in every], np.bool_)
        found: NDArray[np.bool_] = self._deadlines[moves]
        return found

    def _change(self, rows: Rows, every: Moved, ranks: NDArray[np.uint16]) -> tuple[Marks, Marks]:
        """Return what transitions change of the marks of their origins."""
        low, high = self._effects.marks(every.effects)
        of_ranks, before = self._marks[:, self._ranks], rows[self._ranks, every.columns]
        low ^= of_ranks[0, before] ^ of_ranks[0, ranks]
        high ^= of_ranks[1, before] ^ of_ranks[1, ranks]
        for slot, left, at, values in self._leads.ended(rows, every.columns, every.ends):
            for side, marks in enumerate((low, high)):
                of = self._marks[side, slot]
                marks[at] ^= of[values] ^ of[max(left, 0)]  # nothing has 0
        return low, high

    def _rows_after(self, origins: Rows, every: Moved, ranks: NDArray[np.uint16]) -> Rows:
        """Return the situations after transitions."""
        rows = origins[:, every.columns]
        self._effects.apply(rows, every.effects)
        rows[self._ranks] = ranks
        for slot, left, at, _ in self._leads.ended(origins, every.columns, every.ends):
            if left != _SET:
                rows[slot, at] = left
        return rows

    def _close(
        self, rows: Rows, columns: Indices, moves: NDArray[np.uint16], effects: NDArray[np.uint32]
    ) -> None:
        """Take notice of values that are not open: what is told does not change them, or more than them."""
        for slot, values in self.live.told.items():
            for value, move in values.items():
                at = np.flatnonzero(moves == move)
                more = self._effects.changing_only(effects[at]) != self._effects.only(slot, value)
                self._leads.close(rows, columns[at[more]], {slot})

    def _add(
        self, depth: int, rows: Rows, low: Marks, high: Marks, parents: list[int], moves: list[int]
    ) -> None:
        """Let new situations wait."""
        explorer, found = self._explorer, self._found

        def look(column: int) -> tuple[int, Iterable[int]]:
            return explorer.flags(tuple(rows[:, column].tolist()))

        flags = self._flags.results(LevelPart(rows, self._marks), np.arange(rows.shape[1]), look)
        found.flags += flags.astype(np.uint8).tobytes()
        found.timers.frombytes(rows[explorer.moves.slots_of_timers[0]].astype(np.uint16).tobytes())
        found.parents.extend(parents)
        found.parent_moves.extend(moves)
        self._waiting.put(Block(depth, found.progress.situations, rows, low, high))
        found.progress.situations += rows.shape[1]
        levels = found.progress.levels
        levels += [0] * (depth + 1 - len(levels))
        levels[depth] += rows.shape[1]
        found.progress.waiting = self._waiting.count
        explorer.keep(rows)

    # -- what is possible, and what it does ---------------------------------------------------------------

    def _possible(self, part: LevelPart) -> Iterator[tuple[int, Indices]]:
        """Yield the moves that are possible, each with the columns of the situations in which it is."""
        moves, rows = self._explorer.moves, part.rows
        sets, of = _groups(rows, moves.slots_of_timers)
        due = [moves.due(numbers) for numbers in sets]
        at_once = np.array([one.at_once for one in due], np.bool_)[of]
        if at_once.any():  # then nothing can be told
            self._leads.close(rows, np.flatnonzero(at_once), self.live.told.keys())
        later = np.flatnonzero(~at_once)
        if len(later):
            yield from ((move, later) for move in moves.everywhere)
        for move in dict.fromkeys(move for one in due for move in one.moves):
            has = np.array([move in one.moves for one in due], np.bool_)[of]
            yield move, np.flatnonzero(has)
        yield from self._answers(part, later)

    def _answers(self, part: LevelPart, later: Indices) -> Iterator[tuple[int, Indices]]:
        """Yield what servers may say of attempts."""
        moves, rows = self._explorer.moves, part.rows
        found: dict[int, list[Indices]] = {}
        order = rows[moves.slot_of_order][later]
        for number in np.unique(order):
            columns = later[order == number]
            for slot in moves.attempts(int(number)):
                values = rows[slot][columns]
                for value in np.unique(values):
                    these = columns[values == value]
                    for move in moves.answers(slot, int(value)):
                        found.setdefault(move, []).append(these)
        for move, parts in found.items():
            yield move, np.sort(np.concatenate(parts))

    def _follow(
        self, part: LevelPart, columns: Indices, move: int, whole: bool = False
    ) -> NDArray[np.uint32]:
        """Return the effects of a move in some situations, with what is aside in them or as a `whole`."""
        self._looked_at += 0 if whole else len(columns)
        place = move, int(part.rows[self._configuration, 0]), whole
        known = self._memo.get(place)
        if known is None:
            known = self._memo[place] = MemoTable(self._memo_on)

        def step(column: int) -> tuple[int, Iterable[int]]:
            situation = tuple(part.rows[:, column].tolist())
            effect = self._explorer.step(situation, move)
            self._count()
            if effect.aside and (whole or not self._leads.leaves_aside(situation, effect)):
                effect = effect.whole
            return self._effects.add(effect, dict(enumerate(situation))), effect.needs

        return known.results(part, columns, step)

    def _count(self) -> None:
        """Take notice of a step of the machine."""
        self._steps += 1
        self._found.progress.steps = self._steps
        if self._steps % _PACE == 0:
            self._look()

    def _note_breaches(
        self, depth: int, numbers: Indices, moves: NDArray[np.uint16], effects: NDArray[np.uint32]
    ) -> None:
        """Keep of each property the breaches after the fewest moves."""
        breaking = np.flatnonzero(self._effects.breaking(effects))
        if not len(breaking):
            return
        breaking = breaking[np.argsort(numbers[breaking], kind="stable")]
        told: dict[str, dict[int, str]] = {}
        for effect in np.unique(effects[breaking]).tolist():
            for name, text in self._effects.all[effect].breaches:
                told.setdefault(name, {})[effect] = text
        for name, texts in told.items():
            known = self._found.breaches.setdefault(name, [])
            if known and known[0].depth != depth:
                continue
            those = breaking[np.isin(effects[breaking], list(texts))]
            for at in those[: _MOST_BREACHES - len(known)].tolist():
                text = texts[int(effects[at])]
                known.append(Breach(name, int(numbers[at]), int(moves[at]), text, depth))
