"""Whole numbers for things that must keep apart, as close together as they can be: the network simplex.

Gansner, Koutsofios, North and Vo, "A technique for drawing directed graphs" (1993), section 2.3. It gives the
layers of a picture their ranks and the boxes in the layers their places.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

#: Exchanges after which a result is good enough; pictures of missions need some dozens.
_PATIENCE = 4000


@dataclass(frozen=True)
class Rope:
    """`head` must be at least `length` beyond `tail`; each further step costs `weight`."""

    tail: int
    head: int
    length: int = 1
    weight: int = 1


def solve(count: int, ropes: Iterable[Rope]) -> list[int]:
    """Return a number for each of `count` things, the smallest 0, with the least cost in all.

    The ropes must not form a circle. Things that no rope ties to the rest begin at 0.
    """
    return _Network(count, list(ropes)).solve() if count else []


class _Network:
    def __init__(self, count: int, ropes: list[Rope]) -> None:
        self._ropes = [*ropes, *self._ties(count, ropes)]
        # What is asked for again and again, in lists: a picture asks a million times.
        self._tails = [rope.tail for rope in self._ropes]
        self._heads = [rope.head for rope in self._ropes]
        self._lengths = [rope.length for rope in self._ropes]
        #: The ropes at each thing, each with the thing at its other end.
        self._at: list[list[tuple[int, int]]] = [[] for _ in range(count)]
        for index, rope in enumerate(self._ropes):
            self._at[rope.tail].append((index, rope.head))
            self._at[rope.head].append((index, rope.tail))
        self._rank = self._first(count)
        self._in_tree = [False] * len(self._ropes)
        #: The tree hangs from thing 0: each one's rope towards it, its number, and the last number below it.
        self._up = [-1] * count
        self._low = [0] * count
        self._high = [0] * count
        self._cut = [0] * len(self._ropes)

    @staticmethod
    def _ties(count: int, ropes: list[Rope]) -> list[Rope]:
        """Return weightless ropes that make one piece of all."""
        group = list(range(count))

        def leader(thing: int) -> int:
            while group[thing] != thing:
                group[thing] = group[group[thing]]
                thing = group[thing]
            return thing

        for rope in ropes:
            group[leader(rope.tail)] = leader(rope.head)
        leaders = sorted({leader(thing) for thing in range(count)})
        members = {first: min(t for t in range(count) if leader(t) == first) for first in leaders}
        firsts = sorted(members.values())
        return [Rope(firsts[0], other, 0, 0) for other in firsts[1:]]

    def _first(self, count: int) -> list[int]:
        """Return ranks that keep all lengths: every thing as early as it may be."""
        waits = [0] * count
        for rope in self._ropes:
            waits[rope.head] += 1
        ready = deque(thing for thing in range(count) if not waits[thing])
        rank = [0] * count
        while ready:
            thing = ready.popleft()
            for index, head in self._at[thing]:
                if self._tails[index] == thing:
                    rank[head] = max(rank[head], rank[thing] + self._lengths[index])
                    waits[head] -= 1
                    if not waits[head]:
                        ready.append(head)
        return rank

    def solve(self) -> list[int]:
        self._grow_tree()
        self._hang()
        start = 0
        for _ in range(_PATIENCE):
            leaving = self._leaving(start)
            if leaving is None:
                break
            self._exchange(leaving, self._entering(leaving))
            start = leaving + 1
        least = min(self._rank)
        return [rank - least for rank in self._rank]

    def _slack(self, index: int) -> int:
        return self._rank[self._heads[index]] - self._rank[self._tails[index]] - self._lengths[index]

    # -- a first tree of tight ropes --------------------------------------------------------------------

    def _grow_tree(self) -> None:
        inside = [False] * len(self._rank)
        reached = self._reach(0, inside)
        outside: Sequence[int] = range(len(self._ropes))
        while len(reached) < len(self._rank):
            outside = [i for i in outside if not (inside[self._tails[i]] and inside[self._heads[i]])]
            leading_out = (i for i in outside if inside[self._tails[i]] or inside[self._heads[i]])
            index = min(leading_out, key=self._slack)
            tail, head = self._tails[index], self._heads[index]
            shift = self._slack(index) if inside[tail] else -self._slack(index)
            for thing in reached:
                self._rank[thing] += shift
            self._in_tree[index] = True
            reached += self._reach(head if inside[tail] else tail, inside)

    def _reach(self, first: int, inside: list[bool]) -> list[int]:
        """Take what tight ropes lead to into the tree."""
        inside[first] = True
        reached = [first]
        for thing in reached:
            for index, other in self._at[thing]:
                if not inside[other] and not self._slack(index):
                    inside[other] = self._in_tree[index] = True
                    reached.append(other)
        return reached

    def _hang(self) -> None:
        """Number the tree from thing 0, and work out what cutting each of its ropes would save."""
        for thing in reversed(self._number(0, -1, 0)):
            if self._up[thing] >= 0:
                self._cut[self._up[thing]] = self._cut_value(thing)

    def _number(self, root: int, up: int, low: int) -> list[int]:
        """Number a branch, those above before those below, from `low` on; return it in that order."""
        self._up[root] = up
        order: list[int] = []
        waiting = [root]
        while waiting:
            thing = waiting.pop()
            self._low[thing] = self._high[thing] = low + len(order)
            order.append(thing)
            above = self._up[thing]
            for index, other in self._at[thing]:
                if self._in_tree[index] and index != above:
                    self._up[other] = index
                    waiting.append(other)
        for thing in reversed(order[1:]):
            over = self._over(thing)
            self._high[over] = max(self._high[over], self._high[thing])
        return order

    def _over(self, thing: int) -> int:
        """Return what a thing of the tree hangs from."""
        index = self._up[thing]
        return self._heads[index] if self._tails[index] == thing else self._tails[index]

    def _cut_value(self, thing: int) -> int:
        """Return what lengthening the rope above a thing would cost; all below it are worked out."""
        above = self._ropes[self._up[thing]]
        total = above.weight
        for index, _ in self._at[thing]:
            if index == self._up[thing]:
                continue
            rope = self._ropes[index]
            along = (rope.tail == thing) == (above.tail == thing)
            gain = rope.weight if along else -rope.weight
            if self._in_tree[index]:
                gain += -self._cut[index] if along else self._cut[index]
            total += gain
        return total

    # -- one exchange -----------------------------------------------------------------------------------

    def _leaving(self, start: int) -> int | None:
        """Return a rope of the tree that is better longer, looking round from `start`."""
        size = len(self._ropes)
        for step in range(size):
            index = (start + step) % size
            if self._in_tree[index] and self._cut[index] < 0:
                return index
        return None

    def _below(self, thing: int, root: int) -> bool:
        return self._low[root] <= self._low[thing] <= self._high[root]

    def _entering(self, leaving: int) -> int:
        """Return the tightest rope that joins the two halves the other way round."""
        tail = self._tails[leaving]
        root = tail if self._up[tail] == leaving else self._heads[leaving]
        outward = root == tail
        low, high = self._low[root], self._high[root]
        below = [low <= number <= high for number in self._low]
        ends = zip(self._tails, self._heads, self._in_tree, strict=True)
        joining = (
            index
            for index, (tail, head, in_tree) in enumerate(ends)
            if below[head] is outward and below[tail] is not outward and not in_tree
        )
        # There is one: a rope that is better longer, and could be as long as it likes, would cost nothing.
        return min(joining, key=self._slack)

    def _exchange(self, leaving: int, entering: int) -> None:
        slack, tail = self._slack(entering), self._tails[leaving]
        root = tail if self._up[tail] == leaving else self._heads[leaving]
        tail, head = self._tails[entering], self._heads[entering]
        shift = -slack if self._below(head, root) else slack
        if shift:
            for thing in range(len(self._rank)):
                if self._below(thing, root):
                    self._rank[thing] += shift
        saved = self._cut[leaving]
        meeting = self._climb(tail, head, saved)
        self._climb(head, tail, -saved)
        self._cut[leaving], self._cut[entering] = 0, -saved
        self._in_tree[leaving], self._in_tree[entering] = False, True
        self._number(meeting, self._up[meeting], self._low[meeting])

    def _climb(self, thing: int, other: int, saved: int) -> int:
        """Correct the cuts from a thing up to what it has above it in common with another; return that."""
        while not self._below(other, thing):
            index = self._up[thing]
            self._cut[index] += saved if self._tails[index] == thing else -saved
            thing = self._over(thing)
        return thing
