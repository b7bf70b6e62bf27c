"""Situations that wait: first in first out, on disk those that are too many for the memory."""

from __future__ import annotations

import numpy as np
import pytest

from lupin_verify.situations import levels
from lupin_verify.situations.seen import Block, BlockQueue
from tests.workbench.lupin_verify.toys import explored, wheels

#: How many slots a situation has here.
SLOTS = 3


def block(depth: int, first: int, size: int) -> Block:
    """Return some situations, each unlike any other."""
    numbers = np.arange(first, first + size)
    rows = np.stack([numbers + slot for slot in range(SLOTS)]).astype(np.uint16)
    return Block(depth, first, rows, numbers.astype(np.uint64), numbers.astype(np.uint64) + np.uint64(2**63))


def same(one: Block, other: Block) -> bool:
    """Say whether two blocks are the same."""
    numbers = (one.depth, one.first) == (other.depth, other.first)
    arrays = ((one.rows, other.rows), (one.low, other.low), (one.high, other.high))
    return numbers and all(np.array_equal(ours, theirs) for ours, theirs in arrays)


def on_disk(line: BlockQueue) -> int:
    """Return how many blocks wait on disk."""
    return sum(not isinstance(one, Block) for one in line._line)


def test_what_waits_on_disk_comes_back_in_its_order() -> None:
    """Memory that is free again is used again, behind what is on disk."""
    line, blocks = BlockQueue(5), [block(n, 10 * n, 3) for n in range(6)]
    for one in blocks[:4]:
        line.put(one)
    assert (line.count, line.depth, on_disk(line)) == (12, 0, 3)
    assert same(line.pop(), blocks[0])
    line.put(blocks[4])
    assert (line.count, line.depth, on_disk(line)) == (12, 1, 3)
    assert same(line.pop(), blocks[1])
    line.put(blocks[5])
    assert (line.count, line.depth, on_disk(line)) == (12, 2, 3)
    assert all(same(line.pop(), one) for one in blocks[2:])
    assert (line.count, line.depth) == (0, None)


def test_an_exploration_that_waits_on_disk_finds_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    """The large levels on disk, the small ones in memory."""
    of = wheels(3, 4)
    usual, written = explored(of, restarts=False), list[int]()

    class Short(BlockQueue):
        """A line with little memory, that counts what it keeps on disk."""

        def __init__(self) -> None:
            super().__init__(8)

        def put(self, one: Block) -> None:
            """Add one at the end."""
            super().put(one)
            written.append(on_disk(self))

    monkeypatch.setattr(levels, "BlockQueue", Short)
    found = explored(of, restarts=False)
    assert set(written) == {0, 1}
    assert found.progress == usual.progress
    assert (found.sources, found.targets, found.by) == (usual.sources, usual.targets, usual.by)
    assert (found.flags, found.breaches) == (usual.flags, usual.breaches)
