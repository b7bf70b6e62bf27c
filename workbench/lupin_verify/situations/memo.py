"""Results by the values of the slots that they were worked out of, looked up for many situations at once."""

from __future__ import annotations

from array import array
from bisect import bisect_left
from collections.abc import Callable, Iterable, Set

import numpy as np
from numpy.typing import NDArray

from lupin_verify.situations.seen import Marks

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
        nothing = np.zeros(rows.shape[1], np.uint64)
        #: The slots whose marks were worked out last, and these.
        self._last: tuple[frozenset[int], Marks, Marks] = frozenset(), nothing, nothing

    def key(self, slots: frozenset[int], columns: Indices) -> tuple[Marks, Marks]:
        """Return the marks of some slots in some columns."""
        found = self._of_slots.get(slots)
        if found is None:
            if _FEW * len(columns) < self.rows.shape[1]:
                chosen = self._marks_of(slots)[:, np.array(list(slots), np.intp)[:, None], columns]
                low, high = np.bitwise_xor.reduce(chosen, axis=1)
                return low, high
            if len(self._of_slots) * self.rows.shape[1] > _MOST_KEPT:
                self._of_slots.clear()
            found = self._of_slots[slots] = self._key(slots)
        return found[0][columns], found[1][columns]

    def _key(self, slots: frozenset[int]) -> tuple[Marks, Marks]:
        """Return the marks of some slots everywhere, made of the last ones where few slots are others."""
        last, low, high = self._last
        others = slots ^ last
        is_near = len(others) < len(slots)
        others = others if is_near else slots
        change = np.bitwise_xor.reduce(self._marks_of(others)[:, list(others)], axis=1)
        found = (low ^ change[0], high ^ change[1]) if is_near else (change[0], change[1])
        self._last = slots, *found
        return found

    def _marks_of(self, slots: Set[int]) -> NDArray[np.uint64]:
        """Return the marks of all slots, where those of some are certainly filled in."""
        for slot in slots - self._filled:
            self._fill(slot)
        return self._of_slot

    def _fill(self, slot: int) -> None:
        room = len(self.rows)
        values = self.rows[slot] if slot < room else np.minimum(self.rows[slot - room], 1)
        of_values = self._marks[:, slot]
        # With "clip" the marks go where they belong at once: "raise" copies them once more.
        of_values.take(values.astype(np.intp), axis=1, out=self._of_slot[:, slot], mode="clip")
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
        self._getters: dict[frozenset[int], _Getter] = {}

    def results(self, part: LevelPart, columns: Indices, work_out: WorkOut) -> NDArray[np.uint32]:
        """Return the results for some columns of a part."""
        found = np.zeros(len(columns), np.uint32)
        left = np.arange(len(columns))
        for getter in self._getters.values():
            known, results = getter.find(*part.key(getter.slots, columns[left]))
            found[left[known]] = results[known]
            left = left[~known]
            if not len(left):
                return found
        found[left] = self._worked_out(part, columns[left], work_out)
        return found

    def _worked_out(self, part: LevelPart, columns: Indices, work_out: WorkOut) -> NDArray[np.uint32]:
        """Return the results for columns of which none is known."""
        found = np.zeros(len(columns), np.uint32)
        left = np.arange(len(columns))
        keys: dict[frozenset[int], tuple[Marks, Marks]] = {}
        while len(left):
            result, reads = work_out(int(columns[left[0]]))
            same = np.arange(len(left)) == 0
            if self._keeps:
                slots = frozenset(reads)
                if slots not in keys:
                    keys[slots] = part.key(slots, columns)
                low, high = (marks[left] for marks in keys[slots])
                same = (low == low[0]) & (high == high[0])
                getter = self._getters.setdefault(slots, _Getter(slots))
                getter.add(int(low[0]), int(high[0]), result)
            found[left[same]] = result
            left = left[~same]
        return found
