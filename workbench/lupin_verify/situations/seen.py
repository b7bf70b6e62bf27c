"""The visited set and the frontier of an exploration, as arrays.

A situation is known by its 128-bit Zobrist hash alone: two with one hash are taken for one, which is so
improbable (see docs/proof-method.md) that it is not checked.
"""

from __future__ import annotations

import tempfile
import weakref
from collections import deque
from typing import IO, NamedTuple

import numpy as np
from numpy.typing import NDArray

Hashes = NDArray[np.uint64]

#: The number of waiting situations in memory; the rest waits in a temporary file.
IN_MEMORY = 400_000
#: The highest load of the table.
_FULL = 0.6
#: Odd numbers that spread pairs over a table.
_MIXES = np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F], np.uint64)


class SeenTable:
    """Numbers by hashes: open addressing, by the lower 64 bits."""

    def __init__(self, size: int = 1 << 16) -> None:
        self.count = 0
        self._low: Hashes = np.zeros(size, np.uint64)
        self._high: Hashes = np.zeros(size, np.uint64)
        #: The number plus 1; 0: the entry is empty.
        self._owner: NDArray[np.uint32] = np.zeros(size, np.uint32)

    def numbers(self, low: Hashes, high: Hashes) -> tuple[NDArray[np.uint32], NDArray[np.intp]]:
        """Return the numbers of some hashes, and the indices of those that are new, each where it is first.

        New ones are numbered in their order.
        """
        while self.count + len(low) > _FULL * len(self._owner):
            self._grow()
        found, places = self._put(low, high, np.arange(self.count, self.count + len(low), dtype=np.uint32))
        # A new one got the number of its index in this batch, so numbers are not dense yet.
        new = np.flatnonzero(found == np.arange(self.count, self.count + len(low)))
        dense = np.zeros(len(low), np.uint32)
        dense[new] = np.arange(self.count, self.count + len(new))
        self._owner[places[new]] = dense[new] + np.uint32(1)
        fresh = found >= self.count
        found[fresh] = dense[found[fresh] - np.uint32(self.count)]
        self.count += len(new)
        return found, new

    def of_pairs(self, one: Hashes, other: Hashes) -> tuple[NDArray[np.uint32], NDArray[np.intp]]:
        """Return the same as `numbers` for pairs of numbers below 2**32."""
        mixed = one * _MIXES[0] ^ other * _MIXES[1]
        return self.numbers(mixed ^ (mixed >> np.uint64(32)), (one << np.uint64(32)) | other)

    def _put(
        self, low: Hashes, high: Hashes, numbers: NDArray[np.uint32]
    ) -> tuple[NDArray[np.uint32], NDArray[np.intp]]:
        """Insert hashes that are not there, with these numbers; return the stored numbers and indices."""
        mask = np.uint64(len(self._owner) - 1)
        found = np.zeros(len(low), np.uint32)
        places = (low & mask).astype(np.intp)
        left = np.arange(len(low))
        while len(left):
            at = places[left]
            empty = self._owner[at] == 0
            if empty.any():
                # Of those with the same index the first gets it: the last write stays, so they are reversed.
                first, where = left[empty][::-1], at[empty][::-1]
                self._owner[where] = numbers[first] + np.uint32(1)
                won = self._owner[where] == numbers[first] + np.uint32(1)
                self._low[where[won]], self._high[where[won]] = low[first[won]], high[first[won]]
            same = (self._low[at] == low[left]) & (self._high[at] == high[left])
            found[left[same]] = self._owner[at[same]] - np.uint32(1)
            left = left[~same]
            places[left] = (places[left] + 1) & int(mask)
        return found, places

    def _grow(self) -> None:
        kept = np.flatnonzero(self._owner)
        low, high, owner = self._low[kept], self._high[kept], self._owner[kept]
        size = 2 * len(self._owner)
        self._low, self._high = np.zeros(size, np.uint64), np.zeros(size, np.uint64)
        self._owner = np.zeros(size, np.uint32)
        self._put(low, high, owner - np.uint32(1))


class Block(NamedTuple):
    """Waiting situations of one depth: slots by situations, with hashes. `first` is the first number."""

    depth: int
    first: int
    rows: NDArray[np.uint16]
    low: Hashes
    high: Hashes


class BlockQueue:
    """A first-in, first-out queue of blocks; beyond `in_memory` situations they wait in a temporary file."""

    def __init__(self, in_memory: int = IN_MEMORY) -> None:
        self._in_memory = in_memory
        self._held = 0
        self._file: IO[bytes] | None = None
        self._line: deque[Block | tuple[int, int]] = deque()
        self.count = 0

    def put(self, block: Block) -> None:
        """Append a block."""
        size = block.rows.shape[1]
        self.count += size
        if self._held + size <= self._in_memory:
            self._held += size
            self._line.append(block)
            return
        if self._file is None:
            self._file = tempfile.TemporaryFile()  # noqa: SIM115 - lives as long as this
            weakref.finalize(self, self._file.close)
        offset = self._file.seek(0, 2)
        for array in (np.array([block.depth, block.first]), block.rows, block.low, block.high):
            np.save(self._file, array, allow_pickle=False)
        self._line.append((offset, block.depth))

    @property
    def depth(self) -> int | None:
        """The depth of the first block; None where there is none."""
        if not self._line:
            return None
        first = self._line[0]
        return first.depth if isinstance(first, Block) else first[1]

    def pop(self) -> Block:
        """Remove and return the first block."""
        first = self._line.popleft()
        if isinstance(first, Block):
            self._held -= first.rows.shape[1]
            block = first
        else:
            block = self._read(first[0])
        self.count -= block.rows.shape[1]
        return block

    def _read(self, offset: int) -> Block:
        assert self._file is not None
        self._file.seek(offset)
        (depth, number), rows, low, high = (np.load(self._file) for _ in range(4))
        return Block(int(depth), int(number), rows, low, high)
