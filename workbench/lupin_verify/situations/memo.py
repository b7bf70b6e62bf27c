"""A memo table keyed by read sets: a result is reused where all slots that were read for it are equal.

Many situations are looked up at once. Values are compared by their 128-bit Zobrist hashes only.
"""

from __future__ import annotations

from array import array
from bisect import bisect_left
from collections.abc import Callable, Iterable, Set

import numpy as np
from numpy.typing import NDArray

from lupin_verify.situations.seen import Hashes

Rows = NDArray[np.uint16]
Indices = NDArray[np.intp]

#: Hashes are computed for a whole part, unless so many times fewer are asked for; how many are cached.
_FEW = 8
_MOST_KEPT = 1 << 22


def zobrist_hashes(room: int, most: int) -> NDArray[np.uint64]:
    """Return 128 random bits for each value of each slot and its presence; an empty slot has 0.

    Shape: (2, 2 * slots, values).
    """
    hashes = np.random.default_rng(18).integers(0, 2**64, (2, 2 * room, most + 2), np.uint64)
    hashes[:, :, 0] = 0
    return hashes


class LevelPart:
    """Situations, slots by situations, with the Zobrist hashes of sets of slots, computed on demand.

    Beyond the slots there is the presence of each, as `TrackedMemory.reads` numbers them.
    """

    def __init__(self, rows: Rows, hashes: NDArray[np.uint64]) -> None:
        self.rows = rows
        self._hashes = hashes
        #: The hash of each slot of each situation, for the slots in `_filled`.
        self._of_slot = np.empty((2, 2 * len(rows), rows.shape[1]), np.uint64)
        self._filled: set[int] = set()
        self._of_slots: dict[frozenset[int], tuple[Hashes, Hashes]] = {}
        nothing = np.zeros(rows.shape[1], np.uint64)
        #: The last set of slots and its hashes.
        self._last: tuple[frozenset[int], Hashes, Hashes] = frozenset(), nothing, nothing

    def key(self, slots: frozenset[int], columns: Indices) -> tuple[Hashes, Hashes]:
        """Return the hashes of a set of slots in some columns."""
        found = self._of_slots.get(slots)
        if found is None:
            if _FEW * len(columns) < self.rows.shape[1]:
                chosen = self._hashes_of(slots)[:, np.array(list(slots), np.intp)[:, None], columns]
                low, high = np.bitwise_xor.reduce(chosen, axis=1)
                return low, high
            if len(self._of_slots) * self.rows.shape[1] > _MOST_KEPT:
                self._of_slots.clear()
            found = self._of_slots[slots] = self._key(slots)
        return found[0][columns], found[1][columns]

    def _key(self, slots: frozenset[int]) -> tuple[Hashes, Hashes]:
        """Return the hashes of a set of slots in all columns, from those of the last set if it is near."""
        last, low, high = self._last
        others = slots ^ last
        is_near = len(others) < len(slots)
        others = others if is_near else slots
        change = np.bitwise_xor.reduce(self._hashes_of(others)[:, list(others)], axis=1)
        found = (low ^ change[0], high ^ change[1]) if is_near else (change[0], change[1])
        self._last = slots, *found
        return found

    def _hashes_of(self, slots: Set[int]) -> NDArray[np.uint64]:
        """Return the hashes of all slots, of which those of `slots` are computed."""
        for slot in slots - self._filled:
            self._fill(slot)
        return self._of_slot

    def _fill(self, slot: int) -> None:
        room = len(self.rows)
        values = self.rows[slot] if slot < room else np.minimum(self.rows[slot - room], 1)
        of_values = self._hashes[:, slot]
        # With "clip" the hashes are written in place: "raise" would copy them once more.
        of_values.take(values.astype(np.intp), axis=1, out=self._of_slot[:, slot], mode="clip")
        self._filled.add(slot)


class _ResultIndex:
    """Results of one read set, sorted by the lower halves of the hashes."""

    __slots__ = ("high", "low", "results", "slots")

    def __init__(self, slots: frozenset[int]) -> None:
        self.slots = slots
        self.low, self.high, self.results = array("Q"), array("Q"), array("I")

    def add(self, low: int, high: int, result: int) -> None:
        at = bisect_left(self.low, low)
        self.low.insert(at, low)
        self.high.insert(at, high)
        self.results.insert(at, result)

    def find(self, low: Hashes, high: Hashes) -> tuple[NDArray[np.bool_], NDArray[np.uint32]]:
        """Return the mask of known results, and the results."""
        keys = np.frombuffer(self.low, np.uint64)
        at = np.searchsorted(keys, low)
        at[at == len(keys)] = 0
        known = (keys[at] == low) & (np.frombuffer(self.high, np.uint64)[at] == high)
        return known, np.frombuffer(self.results, np.uint32)[at]


#: Computes the result for the situation in a column, and returns the slots that it read.
Compute = Callable[[int], tuple[int, Iterable[int]]]


class MemoTable:
    """Results of one kind by their read sets; correct only if a result depends on nothing but its reads."""

    def __init__(self, keeps: bool = True) -> None:
        """Make an empty table; one that does not keep results computes each."""
        self._keeps = keeps
        self._getters: dict[frozenset[int], _ResultIndex] = {}

    def results(self, part: LevelPart, columns: Indices, compute: Compute) -> NDArray[np.uint32]:
        """Return the results for some columns of a part; compute and keep unknown ones."""
        found = np.zeros(len(columns), np.uint32)
        left = np.arange(len(columns))
        for getter in self._getters.values():
            known, results = getter.find(*part.key(getter.slots, columns[left]))
            found[left[known]] = results[known]
            left = left[~known]
            if not len(left):
                return found
        found[left] = self._computed(part, columns[left], compute)
        return found

    def _computed(self, part: LevelPart, columns: Indices, compute: Compute) -> NDArray[np.uint32]:
        """Return the results for columns without known ones."""
        found = np.zeros(len(columns), np.uint32)
        left = np.arange(len(columns))
        keys: dict[frozenset[int], tuple[Hashes, Hashes]] = {}
        while len(left):
            result, reads = compute(int(columns[left[0]]))
            same = np.arange(len(left)) == 0
            if self._keeps:
                slots = frozenset(reads)
                if slots not in keys:
                    keys[slots] = part.key(slots, columns)
                low, high = (hashes[left] for hashes in keys[slots])
                same = (low == low[0]) & (high == high[0])
                getter = self._getters.setdefault(slots, _ResultIndex(slots))
                getter.add(int(low[0]), int(high[0]), result)
            found[left[same]] = result
            left = left[~same]
        return found
