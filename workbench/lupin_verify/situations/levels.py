"""State-space exploration, breadth first: the situations of one depth are expanded together, as arrays.

A step's effect follows from the slots that it read. So for all situations of a level in one configuration,
effects are looked up together, and the machine makes a step only where none is cached. Where a reduction of
`liveness` turns out to be wrong, the exploration restarts; cached effects stay. The first walk only learns
what is live: it merges nothing, and goes on from one situation of each location and each set of slots that
have a value.
"""

from __future__ import annotations

from array import array
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence, Set
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lupin_verify.situations.explorer import SituationExplorer
from lupin_verify.situations.found import INTERRUPTED, Breach, Effect, ExplorationProgress, Explored
from lupin_verify.situations.liveness import Dead, Liveness, Location
from lupin_verify.situations.memo import Indices, LevelPart, MemoTable, Rows, zobrist_hashes
from lupin_verify.situations.seen import Block, BlockQueue, Hashes, SeenTable
from lupin_verify.situations.situation import RANKS, Overflow
from lupin_verify.situations.worlds import Mover, TimerName

#: The number of situations that are expanded together.
_BLOCK = 1 << 15
#: The most breaches of one property, all at one depth, of which the one with the fewest faults is shown.
_MOST_BREACHES = 1000
#: How many steps of the machine are between two calls of `stop_reason`.
_PACE = 512


def explore(
    explorer: SituationExplorer,
    stop_reason: Callable[[ExplorationProgress], str] = lambda _: "",
    memo: bool = True,
    live: bool = True,
    open_values: bool = True,
) -> Explored:
    """Explore all situations.

    Args:
        explorer: makes the steps.
        goes_on: called now and then; returns why to stop, or nothing.
        memo: whether effects are cached; without, every transition is a step.
        live: whether dead variables are reduced (see `liveness`).
        open_values: whether unconstrained inputs are not stored (see `liveness`).

    Raises:
        TooMany: something grows without end.
    """
    while True:
        try:
            return LevelExploration(explorer, memo, live, open_values).run(stop_reason)
        except Overflow:
            explorer.make_room()


#: Fields of effects that many have in common: equal values are stored once.
_SHARED = ("delta", "relevant", "taken", "entered", "fresh", "deadlines", "renamed", "needs", "sets", "lazy")
#: Instead of a reduced value: the step has written the slot without reading it.
_SET = -1


class Origins(NamedTuple):
    """The sources of moves: slots by situations, with their numbers and hashes.

    The `chosen` slots are of unconstrained inputs, each expanded to one value that a move in `made` reports.
    """

    depth: int
    numbers: Indices
    rows: Rows
    low: Hashes
    high: Hashes
    chosen: frozenset[int] = frozenset()
    made: tuple[int, ...] = ()


class Moved(NamedTuple):
    """Transitions: the columns of their origins, their moves, their effects, and the slots that die."""

    columns: Indices
    moves: NDArray[np.uint16]
    effects: NDArray[np.uint32]
    ends: NDArray[np.uint32]

    def at(self, which: Indices | NDArray[np.bool_]) -> Moved:
        """Return some of them."""
        return Moved(self.columns[which], self.moves[which], self.effects[which], self.ends[which])


class _Stopped(Exception):
    """`stop_reason` stops the exploration; the text is the reason."""


class _LivenessGrew(Exception):
    """A step read a dead slot, or an input is constrained: the exploration restarts."""


def _groups(rows: Rows, slots: tuple[int, ...]) -> tuple[list[tuple[int, ...]], Indices]:
    """Return the different tuples of values of some slots, and each situation's index in them."""
    packed = np.zeros(rows.shape[1], np.uint64)
    for number, slot in enumerate(slots):
        if number >= 4 and number % 2 == 0:  # make room for two more values of 16 bits
            packed = np.unique(packed, return_inverse=True)[1].astype(np.uint64)
        packed = (packed << np.uint64(16)) | rows[slot]
    _, first, of = np.unique(packed, return_index=True, return_inverse=True)
    return [tuple(rows[list(slots), at].tolist()) for at in first], of


class _Effects:
    """All effects by number, with arrays of the fields that the exploration needs."""

    def __init__(self, explorer: SituationExplorer, hashes: NDArray[np.uint64]) -> None:
        self._explorer = explorer
        self.all: list[Effect] = []
        #: Fields of effects, each value once.
        self._shared: dict[Any, Any] = {}
        self._hashes = hashes
        self._does, self._cut, self._breaks = (bytearray() for _ in range(3))
        self._low, self._high = array("Q"), array("Q")
        self._starts, self._slots, self._values = array("I", [0]), array("H"), array("H")
        self._before = array("H")
        #: The slot and the value of an effect that changes only this one, as one number; 0: it does more.
        self._only = array("I")
        self._without: dict[tuple[int, tuple[tuple[int, int], ...]], int] = {}
        #: The number of each effect's change of deadlines; 0: none.
        self._timing = array("I")
        self._timings: dict[Any, int] = {None: 0}
        #: Sets of deadlines, and for each effect the index of the set that it sets.
        self.deadlines: list[frozenset[TimerName]] = [frozenset()]
        self._places: dict[frozenset[TimerName], int] = {frozenset(): 0}
        self._fresh = array("H")
        #: Pairs of such a number and the ranks before; by their numbers, the ranks after.
        self._pairs = SeenTable()
        self._ranks_after = array("H")

    def add(self, effect: Effect, situation: Mapping[int, int]) -> int:
        """Add an effect; return its number.

        For slots that the step has read, the hash changes by the same bits in every situation. For those that
        it `sets` without reading, the caller removes the hash of the value before.
        """
        for name in _SHARED:
            value = getattr(effect, name)
            setattr(effect, name, self._shared.setdefault(value, value))
        self.all.append(effect)
        low = high = 0
        for slot, value in effect.delta:
            for number in (value,) if slot in effect.sets else (situation[slot], value):
                low ^= self._hashes.item(0, slot, number)
                high ^= self._hashes.item(1, slot, number)
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
        """Return the number of an effect with the values of dead slots reduced."""
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
        """Return the slots that an effect changes, with their values before it."""
        begin, end = self._starts[number], self._starts[number + 1]
        return dict(zip(self._slots[begin:end], self._before[begin:end], strict=True))

    def ranks_after(self, before: NDArray[np.uint16], effects: NDArray[np.uint32]) -> NDArray[np.uint16]:
        """Return the order of deadlines after transitions, as numbers, given the one before."""
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
        """Return the slot and value of effects that change only one (see `only`); 0 for others."""
        return np.frombuffer(self._only, np.uint32)[effects]

    def does(self, effects: NDArray[np.uint32]) -> NDArray[np.uint8]:
        """Return the `Does` flags of effects."""
        return np.frombuffer(self._does, np.uint8)[effects]

    def setting(self, effects: NDArray[np.uint32]) -> NDArray[np.uint16]:
        """Return the indices of the sets of deadlines that effects set."""
        return np.frombuffer(self._fresh, np.uint16)[effects]

    def cut(self, effects: NDArray[np.uint32]) -> int:
        return int(np.frombuffer(self._cut, np.bool_)[effects].sum())

    def breaking(self, effects: NDArray[np.uint32]) -> NDArray[np.bool_]:
        return np.frombuffer(self._breaks, np.bool_)[effects]

    def hashes(self, effects: NDArray[np.uint32]) -> tuple[Hashes, Hashes]:
        return np.frombuffer(self._low, np.uint64)[effects], np.frombuffer(self._high, np.uint64)[effects]

    def apply(self, rows: Rows, effects: NDArray[np.uint32]) -> None:
        """Apply one effect to each situation, in place."""
        starts = np.frombuffer(self._starts, np.uint32).astype(np.intp)
        sizes = starts[effects + np.uint32(1)] - starts[effects]
        ends = np.cumsum(sizes)
        flat = np.arange(ends[-1] if len(ends) else 0) + np.repeat(starts[effects] - ends + sizes, sizes)
        columns = np.repeat(np.arange(len(effects)), sizes)
        slots, values = np.frombuffer(self._slots, np.uint16), np.frombuffer(self._values, np.uint16)
        rows[slots[flat], columns] = values[flat]


class ReducedEffects:
    """Applies the reductions of `liveness` to effects; `used` are those of transitions that surely exist."""

    def __init__(self, live: Liveness, effects: _Effects) -> None:
        self._live = live
        self._effects = effects
        #: Whether no step so far read a dead slot, and no assumption of an unconstrained input failed.
        self.is_exact = True
        self.used: set[int] = set()
        #: Places, each with the slots whose value was chosen there.
        self._locations: dict[tuple[Location, frozenset[int]], int] = {}
        #: Pairs of a location and an effect; by their numbers the four rows of `resolve`.
        self._pairs = SeenTable()
        self._found = array("I")
        self._dead: dict[Location, Dead] = {}
        #: Sets of slots that are written unread or die, each with its reduced value; the first set is empty.
        self._ends: dict[tuple[tuple[int, int], ...], int] = {(): 0}
        #: Sets of unconstrained inputs that an effect reads, or whose value is stored after it.
        self._asked: dict[frozenset[int], int] = {frozenset(): 0}

    def first(self, rows: Rows) -> Rows:
        """Return the initial situation with its dead slots reduced."""
        location = self._live.location(rows[list(self._live.location_slots), 0].tolist())
        dead = self._dead_at(location)
        for slot in dead.slots:
            rows[slot] = dead.left(slot, int(rows[slot, 0]))
        return rows

    def resolve(self, origins: Origins, columns: Indices, effects: NDArray[np.uint32]) -> NDArray[np.uint32]:
        """Return the reduced effects of transitions at their locations. Shape: (4, transitions).

        The rows are the effects, the sets of slots that die, the sets of inputs to expand, and whether a lazy
        read is live.
        """
        every, of = _groups(origins.rows, self._live.location_slots)
        locations = [(self._live.location(values), origins.chosen) for values in every]
        numbers = np.array(
            [self._locations.setdefault(p, len(self._locations)) for p in locations], np.uint64
        )
        located: Hashes = numbers[of[columns]]
        at, new = self._pairs.of_pairs(located, effects.astype(np.uint64))
        names = dict(zip(numbers.tolist(), locations, strict=True))
        for number, effect in zip(located[new].tolist(), effects[new].tolist(), strict=True):
            location, chosen = names[number]
            self._found.extend(self._compute(location, chosen, effect))
        if self.is_exact:
            self.used.update(effects[new].tolist())
        return np.frombuffer(self._found, np.uint32).reshape(-1, 4)[at].T

    def constrain(self, rows: Rows, columns: Indices, slots: Set[int]) -> None:
        """Mark inputs as constrained at the locations of some situations."""
        held, configuration = (rows[slot, columns].astype(np.uint32) for slot in self._live.head_slots)
        for head in np.unique(held << 16 | configuration).tolist():
            self.is_exact = self._live.constrain(divmod(head, 1 << 16), slots) and self.is_exact

    def unexpanded(self, asked: NDArray[np.uint32], chosen: frozenset[int]) -> Iterator[tuple[int, Indices]]:
        """Yield inputs that must be expanded next, each with the transitions that read it."""
        first = np.array([min(slots - chosen, default=-1) for slots in self._asked], np.intp)[asked]
        for slot in np.unique(first[first >= 0]).tolist():
            yield slot, np.flatnonzero(first == slot)

    def drops_lazy(self, situation: Sequence[int], effect: Effect) -> bool:
        """Return whether all variables of lazy reads are dead after an effect."""
        location = self._live.location(situation[slot] for slot in self._live.location_slots)
        return self._live.learns or self._dead_at(self._after(location, effect)).slots >= {
            slot for slot, _ in effect.lazy
        }

    def _after(self, location: Location, effect: Effect) -> Location:
        delta, kept = dict(effect.delta), zip(self._live.location_slots, location, strict=True)
        return self._live.location(delta.get(slot, value) for slot, value in kept)

    def _compute(self, location: Location, chosen: frozenset[int], number: int) -> tuple[int, int, int, bool]:
        effect = self._effects.all[number]
        delta, to = dict(effect.delta), self._after(location, effect)
        self.is_exact = self._live.add_step(location, effect, to) and self.is_exact
        for slot in self._live.input_values.keys() & delta.keys():
            if delta[slot] and delta[slot] not in self._live.input_values[slot]:
                self.is_exact = self._live.constrain(None, {slot}) and self.is_exact
        dead, before = self._dead_at(to), self._dead_at(location)
        unconstrained = self._live.unconstrained(location)
        asked = frozenset(effect.needs & unconstrained | (unconstrained - dead.slots - delta.keys()))
        were = before.slots - asked - chosen
        ending = sorted((dead.slots - were | dead.absent - before.absent) - delta.keys())
        ends = [(slot, _SET) for slot in sorted(effect.sets & delta.keys())]
        ends += [(slot, dead.left(slot, 1)) for slot in ending]
        return (
            self._effects.without(number, dead),
            self._ends.setdefault(tuple(ends), len(self._ends)),
            self._asked.setdefault(asked, len(self._asked)),
            not (self._live.learns or dead.slots >= {slot for slot, _ in effect.lazy}),
        )

    def _dead_at(self, location: Location) -> Dead:
        found = self._dead.get(location)
        if found is None:
            found = self._dead[location] = self._live.dead(location)
        return found

    def ended(
        self, rows: Rows, columns: Indices, ends: NDArray[np.uint32]
    ) -> Iterator[tuple[int, int, Indices, NDArray[np.uint16]]]:
        """Yield slots that are written unread or die: reduced value, transitions, values before."""
        order = np.argsort(ends, kind="stable")
        edges = np.searchsorted(ends[order], np.arange(len(self._ends) + 1))
        for slots, begin, end in zip(self._ends, edges, edges[1:], strict=False):
            at = order[begin:end]
            for slot, left in slots if len(at) else ():
                values = rows[slot, columns[at]]
                there = values > max(left, 0)
                yield slot, left, at[there], values[there]


class LevelExploration:
    """One exploration of a chart; restarts until no reduction was wrong, keeping cached effects."""

    def __init__(self, explorer: SituationExplorer, memo: bool, live: bool, open_values: bool = True) -> None:
        self._explorer = explorer
        self._memo_on = memo
        table = explorer.table
        self._hashes = zobrist_hashes(table.room, explorer.bounds.most_values)
        self._configuration, self._ranks = table.index["configuration", ""], table.index[RANKS]
        self._effects = _Effects(explorer, self._hashes)
        self._memo: dict[tuple[int, int, bool], MemoTable] = {}
        self._flags = MemoTable()
        #: Whether each move is a deadline.
        self._deadlines = np.zeros(0, np.bool_)
        values = explorer.moves.unconstrained_values() if open_values else {}
        self.live = Liveness(explorer.chart, table, values, live)
        self._stop_reason: Callable[[ExplorationProgress], str] = lambda _: ""
        self._steps = 0
        self._begin()

    def _begin(self) -> None:
        """Empty the visited set and the frontier; cached effects and learnt liveness stay."""
        self._seen = SeenTable()
        self._waiting = BlockQueue()
        self._found = Explored(self._explorer.moves, deadlines=self._effects.deadlines)
        self._found.progress.steps = self._steps
        self._considered = 0
        self.live.begin()
        self._found.progress.learns = self.live.learns
        self._reduced = ReducedEffects(self.live, self._effects)

    def run(self, stop_reason: Callable[[ExplorationProgress], str]) -> Explored:
        """Explore until complete or stopped; a stopped one returns the largest part without a wrong step."""
        self._stop_reason = stop_reason
        largest = self._run()
        try:
            while not (largest.complete or largest.stopped):
                self.live.end_learning()
                self._begin()
                found = self._run()
                if found.complete or largest.progress.situations < found.progress.situations:
                    largest = found
                largest.stopped = found.stopped
        except KeyboardInterrupt:  # between two runs
            largest.stopped = INTERRUPTED
        return largest

    def _run(self) -> Explored:
        """Explore until everything is visited, it is stopped, or a reduction turns out to be wrong."""
        situation, self._first = self._explorer.initial()
        self._found.breaches = {name: [Breach(name, 0, -1, text)] for name, text in self._first.breaches}
        rows = self._reduced.first(np.array([situation], np.uint16).T)
        every = frozenset(range(len(situation)))
        low, high = LevelPart(rows, self._hashes).key(every, np.arange(1))
        self._seen.numbers(low, high)
        self._enqueue(0, rows, low, high, [0], [-1])
        found = self._found
        try:
            self._count()
            while self._waiting.count:
                self._check_stop()
                self._expand(self._next_block())
            found.complete = not self.live.learns
        except _LivenessGrew:
            pass
        except _Stopped as why:
            found.stopped = str(why)
        except KeyboardInterrupt:
            found.stopped = INTERRUPTED
        for one in (self._first, *(self._effects.all[number] for number in self._reduced.used)):
            found.add_coverage(one)
        return found

    def _check_stop(self) -> None:
        why = self._stop_reason(self._found.progress)
        if why:
            raise _Stopped(why)

    def _next_block(self) -> Block:
        """Remove blocks of one depth from the frontier, up to `_BLOCK` situations and a block more."""
        blocks = [self._waiting.pop()]
        size = blocks[0].rows.shape[1]
        while self._waiting.depth == blocks[0].depth and size < _BLOCK:
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
        self._add_moves(origins, columns, moves, effects)

    def _parts(self, rows: Rows) -> Iterator[tuple[int, LevelPart]]:
        """Yield the parts with one configuration each, with their first columns; rows are sorted by it."""
        edges = np.flatnonzero(np.diff(rows[self._configuration])) + 1
        for begin, end in zip([0, *edges], [*edges, rows.shape[1]], strict=True):
            yield begin, LevelPart(rows[:, begin:end], self._hashes)

    def _expand_values(
        self, origins: Origins, columns: Indices, moves: NDArray[np.uint16], slot: int
    ) -> None:
        """Make moves again for each value of an unconstrained input that they read, where it has a value."""
        there = origins.rows[slot, columns] > 0
        for value, report in (
            (0, ()),
            *((value, (move,)) for value, move in self.live.input_values[slot].items()),
        ):
            at = np.flatnonzero(there == (value > 0))
            if not len(at):
                continue
            kept, of = np.unique(columns[at], return_inverse=True)
            rows = origins.rows[:, kept]
            change = self._hashes[:, slot, rows[slot]] ^ self._hashes[:, slot, value][:, None]
            rows[slot] = value
            low, high = origins.low[kept] ^ change[0], origins.high[kept] ^ change[1]
            chosen, made = origins.chosen | {slot}, (*origins.made, *report)
            those = Origins(origins.depth, origins.numbers[kept], rows, low, high, chosen, made)
            self._add_moves(those, of, moves[at], self._effects_of(those, of, moves[at]))

    def _effects_of(
        self, origins: Origins, columns: Indices, moves: NDArray[np.uint16], whole: bool = False
    ) -> NDArray[np.uint32]:
        """Return the effects of moves, each in the situation of its column."""
        effects = np.zeros(len(columns), np.uint32)
        for begin, part in self._parts(origins.rows):
            inside = np.flatnonzero((columns >= begin) & (columns < begin + part.rows.shape[1]))
            for move in np.unique(moves[inside]):
                at = inside[moves[inside] == move]
                effects[at] = self._follow(part, columns[at] - begin, int(move), whole)
        return effects

    def _add_moves(
        self, origins: Origins, columns: Indices, moves: NDArray[np.uint16], effects: NDArray[np.uint32]
    ) -> None:
        """Add the transitions of some moves; `columns` are those of their sources."""
        self._constrain(origins.rows, columns, moves, effects)
        effects, ends, asked = self._resolve(origins, columns, moves, effects)
        done = np.ones(len(columns), np.bool_)
        for slot, at in self._reduced.unexpanded(asked, origins.chosen):
            done[at] = False
            self._expand_values(origins, columns[at], moves[at], slot)
        moves = self._preceded_by(origins, moves[done])
        every = Moved(columns[done], moves, effects[done], ends[done])
        self._found.cut += self._effects.cut(every.effects)
        self._record_breaches(origins.depth, origins.numbers[every.columns], moves, every.effects)
        self._add_transitions(origins, every)

    def _resolve(
        self, origins: Origins, columns: Indices, moves: NDArray[np.uint16], effects: NDArray[np.uint32]
    ) -> NDArray[np.uint32]:
        """Return the effects, the slots that die and the inputs to expand. Shape: (3, moves).

        Raises:
            _LivenessGrew: a step read a dead slot, or an input is constrained.
        """
        settled = self._reduced.resolve(origins, columns, effects)
        partly = np.flatnonzero(settled[3])
        if len(partly):
            effects = self._effects_of(origins, columns[partly], moves[partly], whole=True)
            settled[:, partly] = self._reduced.resolve(origins, columns[partly], effects)
        if not self._reduced.is_exact:
            raise _LivenessGrew
        return settled[:3]

    def _preceded_by(self, origins: Origins, moves: NDArray[np.uint16]) -> NDArray[np.uint16]:
        """Return moves, combined with the reports of values before them."""
        if not origins.made:
            return moves
        every, of = np.unique(moves, return_inverse=True)
        preceded = [self._explorer.moves.preceded_by(origins.made, int(move)) for move in every]
        return np.array(preceded, np.uint16)[of]

    def _add_transitions(self, origins: Origins, every: Moved) -> None:
        """Add transitions to the graph, and their new targets to the frontier.

        A transition that changes nothing is added only if it is a deadline, or does something.
        """
        ranks = self._effects.ranks_after(origins.rows[self._ranks, every.columns], every.effects)
        low, high = self._change(origins.rows, every, ranks)
        matters = (low | high) != 0
        matters |= self._is_deadline(every.moves) | (self._effects.does(every.effects) != 0)
        every, ranks = every.at(matters), ranks[matters]
        low, high = low[matters] ^ origins.low[every.columns], high[matters] ^ origins.high[every.columns]
        keys = self._keys_to_learn(origins.rows, every) if self.live.learns else (low, high)
        targets, new = self._seen.numbers(*keys)
        numbers = origins.numbers[every.columns].astype(np.uint32)
        found, progress, does = self._found, self._found.progress, self._effects.does(every.effects)
        # With reports of values before it, a transition may lead back to its source.
        kept = (targets != numbers) | self._is_deadline(every.moves) | (does != 0)
        kept &= not self.live.learns  # there a target stands for others
        found.sources.frombytes(numbers[kept].tobytes())
        found.targets.frombytes(targets[kept].tobytes())
        found.by.frombytes(every.moves[kept].tobytes())
        found.sets.frombytes(self._effects.setting(every.effects[kept]).tobytes())
        found.does += does[kept].tobytes()
        progress.transitions += self._considered
        progress.depth = origins.depth
        self._considered = 0
        if len(new):
            first = every.at(new)
            rows = self._rows_after(origins.rows, first, ranks[new])
            self._enqueue(
                origins.depth + 1, rows, low[new], high[new], numbers[new].tolist(), first.moves.tolist()
            )
        progress.waiting = self._waiting.count

    def _keys_to_learn(self, origins: Rows, every: Moved) -> tuple[Hashes, Hashes]:
        """Return hashes of the locations after transitions, with the presence of every slot."""
        rows = origins[:, every.columns]
        self._effects.apply(rows, every.effects)
        low, high = np.zeros((2, rows.shape[1]), np.uint64)
        there, whole = np.minimum(rows, 1), self.live.location_slots
        for slot, values in (*enumerate(there, len(rows)), *((slot, rows[slot]) for slot in whole)):
            low ^= self._hashes[0, slot, values]
            high ^= self._hashes[1, slot, values]
        return low, high

    def _is_deadline(self, moves: NDArray[np.uint16]) -> NDArray[np.bool_]:
        every = self._explorer.moves.all
        if len(self._deadlines) < len(every):
            self._deadlines = np.array([bool(move.side & Mover.TIMER) for move in every], np.bool_)
        found: NDArray[np.bool_] = self._deadlines[moves]
        return found

    def _change(self, rows: Rows, every: Moved, ranks: NDArray[np.uint16]) -> tuple[Hashes, Hashes]:
        """Return the change of the hashes of the origins by transitions."""
        low, high = self._effects.hashes(every.effects)
        of_ranks, before = self._hashes[:, self._ranks], rows[self._ranks, every.columns]
        low ^= of_ranks[0, before] ^ of_ranks[0, ranks]
        high ^= of_ranks[1, before] ^ of_ranks[1, ranks]
        for slot, left, at, values in self._reduced.ended(rows, every.columns, every.ends):
            for side, hashes in enumerate((low, high)):
                of = self._hashes[side, slot]
                hashes[at] ^= of[values] ^ of[max(left, 0)]  # an empty slot has hash 0
        return low, high

    def _rows_after(self, origins: Rows, every: Moved, ranks: NDArray[np.uint16]) -> Rows:
        """Return the situations after transitions."""
        rows = origins[:, every.columns]
        self._effects.apply(rows, every.effects)
        rows[self._ranks] = ranks
        for slot, left, at, _ in self._reduced.ended(origins, every.columns, every.ends):
            if left != _SET:
                rows[slot, at] = left
        return rows

    def _constrain(
        self, rows: Rows, columns: Indices, moves: NDArray[np.uint16], effects: NDArray[np.uint32]
    ) -> None:
        """Mark inputs as constrained whose report does not change them, or changes more than them."""
        for slot, values in self.live.input_values.items():
            for value, move in values.items():
                at = np.flatnonzero(moves == move)
                more = self._effects.changing_only(effects[at]) != self._effects.only(slot, value)
                self._reduced.constrain(rows, columns[at[more]], {slot})

    def _enqueue(
        self, depth: int, rows: Rows, low: Hashes, high: Hashes, parents: list[int], moves: list[int]
    ) -> None:
        """Number new situations and add them to the frontier."""
        explorer, found = self._explorer, self._found

        def look(column: int) -> tuple[int, Iterable[int]]:
            return explorer.flags(tuple(rows[:, column].tolist()))

        flags = self._flags.results(LevelPart(rows, self._hashes), np.arange(rows.shape[1]), look)
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

    # -- moves and their effects --------------------------------------------------------------------------

    def _possible(self, part: LevelPart) -> Iterator[tuple[int, Indices]]:
        """Yield the enabled moves, each with the columns of the situations in which it is enabled."""
        moves, rows = self._explorer.moves, part.rows
        sets, of = _groups(rows, moves.slots_of_timers)
        due = [moves.due(numbers) for numbers in sets]
        at_once = np.array([one.at_once for one in due], np.bool_)[of]
        if at_once.any():  # no value can be reported before such a deadline
            self._reduced.constrain(rows, np.flatnonzero(at_once), self.live.input_values.keys())
        later = np.flatnonzero(~at_once)
        if len(later):
            yield from ((move, later) for move in moves.everywhere)
        for move in dict.fromkeys(move for one in due for move in one.moves):
            has = np.array([move in one.moves for one in due], np.bool_)[of]
            yield move, np.flatnonzero(has)
        yield from self._answers(part, later)

    def _answers(self, part: LevelPart, later: Indices) -> Iterator[tuple[int, Indices]]:
        """Yield the answers of servers to attempts, with their columns."""
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
        """Return the effects of a move in some situations; `whole` ones count lazy reads as reads."""
        self._considered += 0 if whole else len(columns)
        place = move, int(part.rows[self._configuration, 0]), whole
        known = self._memo.get(place)
        if known is None:
            known = self._memo[place] = MemoTable(self._memo_on)

        def step(column: int) -> tuple[int, Iterable[int]]:
            situation = tuple(part.rows[:, column].tolist())
            effect = self._explorer.step(situation, move)
            self._count()
            if effect.lazy and (whole or not self._reduced.drops_lazy(situation, effect)):
                effect = effect.whole
            return self._effects.add(effect, dict(enumerate(situation))), effect.needs

        return known.results(part, columns, step)

    def _count(self) -> None:
        """Count a step of the machine; ask for a reason to stop every `_PACE` steps."""
        self._steps += 1
        self._found.progress.steps = self._steps
        if self._steps % _PACE == 0:
            self._check_stop()

    def _record_breaches(
        self, depth: int, numbers: Indices, moves: NDArray[np.uint16], effects: NDArray[np.uint32]
    ) -> None:
        """Record each property's breaches at its least depth, up to `_MOST_BREACHES`."""
        breaking = np.flatnonzero(self._effects.breaking(effects))
        if not len(breaking):
            return
        breaking = breaking[np.argsort(numbers[breaking], kind="stable")]
        breaches: dict[str, dict[int, str]] = {}
        for effect in np.unique(effects[breaking]).tolist():
            for name, text in self._effects.all[effect].breaches:
                breaches.setdefault(name, {})[effect] = text
        for name, texts in breaches.items():
            known = self._found.breaches.setdefault(name, [])
            if known and known[0].depth != depth:
                continue
            those = breaking[np.isin(effects[breaking], list(texts))]
            for at in those[: _MOST_BREACHES - len(known)].tolist():
                text = texts[int(effects[at])]
                known.append(Breach(name, int(numbers[at]), int(moves[at]), text, depth))
