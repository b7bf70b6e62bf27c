"""The walk through all situations, level by level: those of one depth are expanded together, as arrays.

What a move does in a situation follows from the slots that the step read. So for all situations of a level
that are in the same configuration, effects are looked up together, and the machine makes a step only where
none is known.
"""

from __future__ import annotations

from array import array
from collections.abc import Callable, Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from lupin_engine.verify.situations.explorer import SituationExplorer
from lupin_engine.verify.situations.found import Breach, Effect, ExplorationProgress, Explored
from lupin_engine.verify.situations.memo import Indices, LevelPart, MemoTable, Rows, marks_of
from lupin_engine.verify.situations.seen import Block, Marks, SeenTable, WaitingLine
from lupin_engine.verify.situations.situation import Overflow

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
) -> Explored:
    """Look at all situations.

    Args:
        explorer: makes the steps.
        goes_on: called now and then; returns why to stop, or nothing.
        memo: whether what a move does is remembered; without, every transition is a step.

    Raises:
        TooMany: something grows without end.
    """
    while True:
        try:
            return LevelWalk(explorer, memo).run(goes_on)
        except Overflow:
            explorer.make_room()


class _Stopped(Exception):
    """It was said that the exploration stops; the text says why."""


class _Effects:
    """All effects, by number, as far as the walk needs them in arrays."""

    def __init__(self, marks: NDArray[np.uint64]) -> None:
        self.all: list[Effect] = []
        self._marks = marks
        self._changes, self._progress, self._cut, self._breaks = (bytearray() for _ in range(4))
        self._low, self._high = array("Q"), array("Q")
        self._starts, self._slots, self._values = array("I", [0]), array("H"), array("H")

    def add(self, effect: Effect, situation: tuple[int, ...]) -> int:
        """Keep an effect. The step has read what it changes, so marks change alike wherever it is taken."""
        self.all.append(effect)
        low, high = np.uint64(0), np.uint64(0)
        for slot, value in effect.delta:
            for number in (situation[slot], value):
                low ^= self._marks[0, slot, number]
                high ^= self._marks[1, slot, number]
            self._slots.append(slot)
            self._values.append(value)
        self._low.append(int(low))
        self._high.append(int(high))
        self._starts.append(len(self._slots))
        self._changes.append(bool(effect.delta))
        self._progress.append(effect.progress)
        self._cut.append(effect.cut)
        self._breaks.append(bool(effect.breaches))
        return len(self.all) - 1

    def changing(self, effects: NDArray[np.uint32]) -> NDArray[np.bool_]:
        return np.frombuffer(self._changes, np.bool_)[effects]

    def progressing(self, effects: NDArray[np.uint32]) -> NDArray[np.bool_]:
        return np.frombuffer(self._progress, np.bool_)[effects]

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


class LevelWalk:
    """One exploration."""

    def __init__(self, explorer: SituationExplorer, memo: bool) -> None:
        self._explorer = explorer
        self._memo_on = memo
        table = explorer.table
        self._marks = marks_of(table.room, explorer.bounds.most_values)
        self._configuration = table.index["configuration", ""]
        self._effects = _Effects(self._marks)
        self._memo: dict[tuple[int, int], MemoTable] = {}
        self._flags = MemoTable()
        self._seen = SeenTable()
        self._waiting = WaitingLine()
        self._found = Explored(explorer.moves)
        self._looked_at = 0
        self._goes_on: Callable[[ExplorationProgress], str] = lambda _: ""

    def run(self, goes_on: Callable[[ExplorationProgress], str]) -> Explored:
        """Look at everything."""
        self._goes_on = goes_on
        situation, effect = self._explorer.initial()
        self._take_in(0, -1, effect)
        self._found.breaches = {name: [Breach(name, 0, -1, text)] for name, text in effect.breaches}
        rows = np.array([situation], np.uint16).T
        low, high = LevelPart(rows, self._marks).key(frozenset(range(len(situation))))
        self._seen.numbers(low, high)
        self._add(0, rows, low, high, [0], [-1])
        try:
            while self._waiting.count:
                self._look()
                self._expand(self._together())
        except _Stopped as why:
            self._found.stopped = str(why)
        except KeyboardInterrupt:
            self._found.stopped = "interrupted"
        self._found.complete = not self._found.stopped
        return self._found

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
        rows = block.rows[:, order]
        edges = np.flatnonzero(np.diff(rows[self._configuration])) + 1
        every: list[tuple[Indices, NDArray[np.uint32], int]] = []
        for begin, end in zip([0, *edges], [*edges, rows.shape[1]], strict=True):
            part = LevelPart(rows[:, begin:end], self._marks)
            numbers = block.first + order[begin:end]
            for move, columns in self._possible(part):
                every.append((columns + begin, self._follow(part, columns, move, numbers), move))
        columns = np.concatenate([each[0] for each in every])
        effects = np.concatenate([each[1] for each in every])
        moves = np.repeat(np.array([each[2] for each in every], np.uint16), [len(each[0]) for each in every])
        self._go(block, order[columns], moves, effects)

    def _go(
        self, block: Block, columns: Indices, moves: NDArray[np.uint16], effects: NDArray[np.uint32]
    ) -> None:
        """Take in where some moves lead; `columns` are those of the situations in the block."""
        found, known = self._found, self._effects
        found.cut += known.cut(effects)
        self._note_breaches(block.depth, block.first + columns, moves, effects)
        changing = known.changing(effects)
        columns, moves, effects = columns[changing], moves[changing], effects[changing]
        low, high = known.marks(effects)
        low, high = low ^ block.low[columns], high ^ block.high[columns]
        targets, new = self._seen.numbers(low, high)
        found.sources.frombytes((block.first + columns).astype(np.uint32).tobytes())
        found.targets.frombytes(targets.tobytes())
        found.by.frombytes(moves.tobytes())
        found.advances += known.progressing(effects).tobytes()
        progress = found.progress
        progress.transitions += self._looked_at
        progress.expanded += block.rows.shape[1]
        progress.depth = block.depth
        self._looked_at = 0
        if len(new):
            rows = block.rows[:, columns[new]]
            known.apply(rows, effects[new])
            self._add(
                block.depth + 1,
                rows,
                low[new],
                high[new],
                (block.first + columns[new]).tolist(),
                moves[new].tolist(),
            )
        progress.waiting = self._waiting.count

    def _add(
        self, depth: int, rows: Rows, low: Marks, high: Marks, parents: list[int], moves: list[int]
    ) -> None:
        """Let new situations wait."""
        explorer, found = self._explorer, self._found

        def look(column: int) -> tuple[int, Iterable[int]]:
            return explorer.flags(tuple(rows[:, column].tolist()))

        flags = self._flags.results(LevelPart(rows, self._marks), np.arange(rows.shape[1]), look)
        found.flags += flags.astype(np.uint8).tobytes()
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
        sets, of = self._groups(rows, moves.slots_of_timers)
        due = [moves.due(numbers) for numbers in sets]
        at_once = np.array([one.at_once for one in due], np.bool_)[of]
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

    @staticmethod
    def _groups(rows: Rows, slots: tuple[int, ...]) -> tuple[list[tuple[int, ...]], Indices]:
        """Return the different values of some slots, and which of them each situation has."""
        packed = np.zeros(rows.shape[1], np.uint64)
        for slot in slots:
            packed = (packed << np.uint64(16)) | rows[slot]
        _, first, of = np.unique(packed, return_index=True, return_inverse=True)
        return [tuple(rows[list(slots), at].tolist()) for at in first], of

    def _follow(self, part: LevelPart, columns: Indices, move: int, numbers: Indices) -> NDArray[np.uint32]:
        """Return the effects of a move in some situations."""
        self._looked_at += len(columns)
        place = move, int(part.rows[self._configuration, 0])
        known = self._memo.get(place)
        if known is None:
            known = self._memo[place] = MemoTable(self._memo_on)

        def step(column: int) -> tuple[int, Iterable[int]]:
            situation = tuple(part.rows[:, column].tolist())
            effect, reads = self._explorer.step(situation, move)
            self._take_in(int(numbers[column]), move, effect)
            return self._effects.add(effect, situation), reads

        return known.results(part, columns, step)

    def _take_in(self, number: int, move: int, effect: Effect) -> None:
        """Keep what an effect tells that was not seen before."""
        found = self._found
        found.progress.steps += 1
        found.taken.update(effect.taken)
        found.entered.update(effect.entered)
        for name in effect.relevant:
            found.relevant[name] = found.relevant.get(name, 0) + 1
        if found.progress.steps % _PACE == 0:
            self._look()

    def _note_breaches(
        self, depth: int, numbers: Indices, moves: NDArray[np.uint16], effects: NDArray[np.uint32]
    ) -> None:
        """Keep of each property the breaches after the fewest moves."""
        breaking = np.flatnonzero(self._effects.breaking(effects))
        if not len(breaking):
            return
        breaking = breaking[np.argsort(numbers[breaking], kind="stable")]
        for at in breaking[: _MOST_BREACHES * len(self._explorer.properties)]:
            for name, text in self._effects.all[effects[at]].breaches:
                known = self._found.breaches.setdefault(name, [])
                if not known or (known[0].depth == depth and len(known) < _MOST_BREACHES):
                    known.append(Breach(name, int(numbers[at]), int(moves[at]), text, depth))
