"""Results by the values of the slots that they were worked out of, looked up for many situations at once."""

from __future__ import annotations

from array import array
from bisect import bisect_left
from collections.abc import Callable, Iterable

import numpy as np
from numpy.typing import NDArray

from lupin_engine.verify.situations.seen import Marks

Rows = NDArray[np.uint16]
Indices = NDArray[np.intp]

#: Marks are worked out for a whole part, unless so many times fewer are asked for. So many are kept.
_FEW = 8
_MOST_KEPT = 1 << 22


def marks_of(room: int, most: int) -> NDArray[np.uint64]:
    """Return 128 bits by chance for each value of each slot and its presence. Nothing has 0.

    Shape: (2, 2 * slots, values).
    """
    marks = np.random.default_rng(18).integers(0, 2**64, (2, 2 * room, most + 2), np.uint64)
    marks[:, :, 0] = 0
    return marks


class LevelPart:
    """Some situations, slots by situations, with the marks of parts of them as far as somebody asks.

    Beyond the slots there is the presence of each, as `TrackedMemory.reads` numbers them.
    """

    def __init__(self, rows: Rows, marks: NDArray[np.uint64]) -> None:
        self.rows = rows
        self._marks = marks
        #: The marks of each slot of each situation, of those slots that are in `_filled`.
        self._of_slot = np.empty((2, 2 * len(rows), rows.shape[1]), np.uint64)
        self._filled: set[int] = set()
        self._of_slots: dict[frozenset[int], tuple[Marks, Marks]] = {}

    def key(self, slots: frozenset[int], columns: Indices) -> tuple[Marks, Marks]:
        """Return the marks of some slots in some columns."""
        found = self._of_slots.get(slots)
        if found is None:
            for slot in slots - self._filled:
                self._fill(slot)
            if _FEW * len(columns) < self.rows.shape[1]:
                chosen = self._of_slot[:, np.array(list(slots), np.intp)[:, None], columns]
                low, high = np.bitwise_xor.reduce(chosen, axis=1)
                return low, high
            low, high = np.bitwise_xor.reduce(self._of_slot[:, list(slots)], axis=1)
            if len(self._of_slots) * len(low) > _MOST_KEPT:
                self._of_slots.clear()
            found = self._of_slots[slots] = low, high
        return found[0][columns], found[1][columns]

    def _fill(self, slot: int) -> None:
        room = len(self.rows)
        values = self.rows[slot] if slot < room else np.minimum(self.rows[slot - room], 1)
        self._of_slot[:, slot] = self._marks[:, slot, values]
        self._filled.add(slot)


class _Getter:
    """What follows from the values of the same slots: sorted by the lower marks of these."""

    __slots__ = ("high", "low", "results", "slots")

    def __init__(self, slots: frozenset[int]) -> None:
        self.slots = slots
        self.low, self.high, self.results = array("Q"), array("Q"), array("I")

    def add(self, low: int, high: int, result: int) -> None:
        at = bisect_left(self.low, low)
        self.low.insert(at, low)
        self.high.insert(at, high)
        self.results.insert(at, result)

    def find(self, low: Marks, high: Marks) -> tuple[NDArray[np.bool_], NDArray[np.uint32]]:
        """Return where something is known, and what."""
        keys = np.frombuffer(self.low, np.uint64)
        at = np.searchsorted(keys, low)
        at[at == len(keys)] = 0
        known = (keys[at] == low) & (np.frombuffer(self.high, np.uint64)[at] == high)
        return known, np.frombuffer(self.results, np.uint32)[at]


#: Works out the result for the situation in a column, and says what was read for that.
WorkOut = Callable[[int], tuple[int, Iterable[int]]]


class MemoTable:
    """Results of one kind by what was read for them."""

    def __init__(self, keeps: bool = True) -> None:
        """Make one that knows nothing; one that does not keep anything works everything out anew."""
        self._keeps = keeps
        self._getters: list[_Getter] = []

    def results(self, part: LevelPart, columns: Indices, work_out: WorkOut) -> NDArray[np.uint32]:
        """Return the results for some columns of a part."""
        found = np.zeros(len(columns), np.uint32)
        left = np.arange(len(columns))
        for getter in self._getters:
            known, results = getter.find(*part.key(getter.slots, columns[left]))
            found[left[known]] = results[known]
            left = left[~known]
            if not len(left):
                return found
        while len(left):
            first = int(columns[left[0]])
            result, reads = work_out(first)
            same = np.arange(len(left)) == 0
            if self._keeps:
                slots = frozenset(reads)
                low, high = part.key(slots, columns[left])
                same = (low == low[0]) & (high == high[0])
                self._getter(slots).add(int(low[0]), int(high[0]), result)
            found[left[same]] = result
            left = left[~same]
        return found

    def _getter(self, slots: frozenset[int]) -> _Getter:
        for getter in self._getters:
            if getter.slots == slots:
                return getter
        self._getters.append(_Getter(slots))
        return self._getters[-1]
