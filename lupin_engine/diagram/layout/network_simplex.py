"""Integer ranks with the least total weighted edge length, by the network simplex.

Gansner, Koutsofios, North and Vo, "A technique for drawing directed graphs" (1993), section 2.3. Used twice:
for the ranks of nodes, and, on the auxiliary graph of section 4.2, for x coordinates.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from heapq import heappop, heappush

#: Pivots after which the result is taken as it is; missions need some dozens.
_MAX_PIVOTS = 4000

#: A heap of edges by their slack: of those that lead out of the tree, and of those that lead into it.
_LeadingOut = tuple[list[tuple[int, int]], list[tuple[int, int]]]


@dataclass
class Effort:
    """A budget for better ranks, in edges looked at: counted, not timed, so deterministic."""

    left: int


@dataclass(frozen=True)
class Edge:
    """Requires rank(head) - rank(tail) >= length; each further unit of length costs `weight`."""

    tail: int
    head: int
    length: int = 1
    weight: int = 1


def solve(count: int, edges: Iterable[Edge], effort: Effort) -> list[int]:
    """Return an optimal rank for each of `count` nodes; the least rank is 0.

    The edges must be acyclic. A component without connection to the rest begins at 0. When the effort is
    spent, the present ranks are returned: feasible, but edges may be longer than needed.
    """
    return _Network(count, list(edges)).solve(effort) if count else []


class _Network:
    def __init__(self, count: int, edges: list[Edge]) -> None:
        self._edges = [*edges, *self._connectors(count, edges)]
        # Columns of the edges as lists: the inner loops read them a million times for one picture.
        self._tails = [edge.tail for edge in self._edges]
        self._heads = [edge.head for edge in self._edges]
        self._lengths = [edge.length for edge in self._edges]
        #: The incident edges of each node, each with the node at its other end.
        self._incident: list[list[tuple[int, int]]] = [[] for _ in range(count)]
        for index, edge in enumerate(self._edges):
            self._incident[edge.tail].append((index, edge.head))
            self._incident[edge.head].append((index, edge.tail))
        self._rank = self._initial_ranks(count)
        self._in_tree = [False] * len(self._edges)
        #: Of the spanning tree with root 0: the edge to the parent; low and lim of the preorder numbering.
        self._parent_edge = [-1] * count
        self._low = [0] * count
        self._lim = [0] * count
        self._cut_values = [0] * len(self._edges)

    @staticmethod
    def _connectors(count: int, edges: list[Edge]) -> list[Edge]:
        """Return edges without weight that connect the components."""
        group = list(range(count))

        def leader(node: int) -> int:
            while group[node] != node:
                group[node] = group[group[node]]
                node = group[node]
            return node

        for edge in edges:
            group[leader(edge.tail)] = leader(edge.head)
        leaders = sorted({leader(node) for node in range(count)})
        members = {first: min(t for t in range(count) if leader(t) == first) for first in leaders}
        firsts = sorted(members.values())
        return [Edge(firsts[0], other, 0, 0) for other in firsts[1:]]

    def _initial_ranks(self, count: int) -> list[int]:
        """Return a feasible ranking: every node has the least rank that its edges allow."""
        waits = [0] * count
        for edge in self._edges:
            waits[edge.head] += 1
        ready = deque(node for node in range(count) if not waits[node])
        rank = [0] * count
        while ready:
            node = ready.popleft()
            for index, head in self._incident[node]:
                if self._tails[index] == node:
                    rank[head] = max(rank[head], rank[node] + self._lengths[index])
                    waits[head] -= 1
                    if not waits[head]:
                        ready.append(head)
        return rank

    def solve(self, effort: Effort) -> list[int]:
        self._tight_tree()
        self._init_cut_values()
        start = 0
        for _ in range(_MAX_PIVOTS):
            leaving = self._leaving_edge(start) if effort.left > 0 else None
            if leaving is None:
                break
            effort.left -= len(self._edges)
            self._pivot(leaving, self._entering_edge(leaving))
            start = leaving + 1
        least = min(self._rank)
        return [rank - least for rank in self._rank]

    def _slack(self, index: int) -> int:
        return self._rank[self._heads[index]] - self._rank[self._tails[index]] - self._lengths[index]

    # -- a feasible tight tree ---------------------------------------------------------------------------

    def _push_leading_out(self, node: int, inside: list[bool], leading_out: _LeadingOut) -> None:
        for index, other in self._incident[node]:
            if not inside[other]:
                heappush(leading_out[self._heads[index] == node], (self._slack(index), index))

    def _tight_tree(self) -> None:
        """Make a spanning tree of tight edges: the tree moves as a whole until one more edge is tight.

        `moved` is by how much. Until the end the ranks of its nodes are without it, and so is the slack
        by which the edges that lead out of it wait: those that the tree has the tail of, and the others.
        """
        inside = [False] * len(self._rank)
        leading_out: _LeadingOut = ([], [])
        moved, joined = 0, self._reach(0, inside)
        reached = len(joined)
        while True:
            for node in joined:
                self._rank[node] -= moved
            for node in joined:
                self._push_leading_out(node, inside, leading_out)
            if reached == len(self._rank):
                break
            slack, index, is_tail = self._tightest(leading_out, inside, moved)
            moved += slack if is_tail else -slack
            self._in_tree[index] = True
            joined = self._reach(self._heads[index] if is_tail else self._tails[index], inside)
            reached += len(joined)
        self._rank = [rank + moved for rank in self._rank]

    def _tightest(
        self, leading_out: Sequence[list[tuple[int, int]]], inside: Sequence[bool], moved: int
    ) -> tuple[int, int, bool]:
        """Return of the tightest edge out of the tree: its slack, the edge, whether the tree has its tail."""
        found = []
        sides = (self._heads, -moved), (self._tails, moved)
        for waiting, (outer, shift) in zip(leading_out, sides, strict=True):
            while waiting and inside[outer[waiting[0][1]]]:
                heappop(waiting)
            if waiting:
                found.append((waiting[0][0] + shift, waiting[0][1], outer is self._heads))
        return min(found)

    def _reach(self, first: int, inside: list[bool]) -> list[int]:
        """Add the nodes that tight edges reach to the tree, and return them."""
        inside[first] = True
        reached = [first]
        for node in reached:
            for index, other in self._incident[node]:
                if not inside[other] and not self._slack(index):
                    inside[other] = self._in_tree[index] = True
                    reached.append(other)
        return reached

    def _init_cut_values(self) -> None:
        """Number the tree from node 0 and compute the cut value of each of its edges, leaves first."""
        for node in reversed(self._number(0, -1, 0)):
            if self._parent_edge[node] >= 0:
                self._cut_values[self._parent_edge[node]] = self._cut_value(node)

    def _number(self, root: int, up: int, low: int) -> list[int]:
        """Number a subtree in preorder from `low` on; return its nodes in that order."""
        self._parent_edge[root] = up
        order: list[int] = []
        waiting = [root]
        while waiting:
            node = waiting.pop()
            self._low[node] = self._lim[node] = low + len(order)
            order.append(node)
            above = self._parent_edge[node]
            for index, other in self._incident[node]:
                if self._in_tree[index] and index != above:
                    self._parent_edge[other] = index
                    waiting.append(other)
        for node in reversed(order[1:]):
            over = self._parent(node)
            self._lim[over] = max(self._lim[over], self._lim[node])
        return order

    def _parent(self, node: int) -> int:
        """Return the parent of a node in the tree."""
        index = self._parent_edge[node]
        return self._heads[index] if self._tails[index] == node else self._tails[index]

    def _cut_value(self, node: int) -> int:
        """Return the cut value of the edge from a node to its parent; those of its children are known."""
        above = self._edges[self._parent_edge[node]]
        total = above.weight
        for index, _ in self._incident[node]:
            if index == self._parent_edge[node]:
                continue
            edge = self._edges[index]
            along = (edge.tail == node) == (above.tail == node)
            gain = edge.weight if along else -edge.weight
            if self._in_tree[index]:
                gain += -self._cut_values[index] if along else self._cut_values[index]
            total += gain
        return total

    # -- pivots -----------------------------------------------------------------------------------------

    def _leaving_edge(self, start: int) -> int | None:
        """Return a tree edge with a negative cut value, searching cyclically from `start`; None: optimal."""
        size = len(self._edges)
        for step in range(size):
            index = (start + step) % size
            if self._in_tree[index] and self._cut_values[index] < 0:
                return index
        return None

    def _is_in_subtree(self, node: int, root: int) -> bool:
        return self._low[root] <= self._low[node] <= self._lim[root]

    def _entering_edge(self, leaving: int) -> int:
        """Return the edge of least slack that connects head and tail component in the opposite direction."""
        tail = self._tails[leaving]
        root = tail if self._parent_edge[tail] == leaving else self._heads[leaving]
        outward = root == tail
        low, high = self._low[root], self._lim[root]
        below = [low <= number <= high for number in self._low]
        ends = zip(self._tails, self._heads, self._in_tree, strict=True)
        joining = (
            index
            for index, (tail, head, in_tree) in enumerate(ends)
            if below[head] is outward and below[tail] is not outward and not in_tree
        )
        # There always is one: otherwise the cut value of the leaving edge would not be negative.
        return min(joining, key=self._slack)

    def _pivot(self, leaving: int, entering: int) -> None:
        slack, tail = self._slack(entering), self._tails[leaving]
        root = tail if self._parent_edge[tail] == leaving else self._heads[leaving]
        tail, head = self._tails[entering], self._heads[entering]
        shift = -slack if self._is_in_subtree(head, root) else slack
        if shift:
            for node in range(len(self._rank)):
                if self._is_in_subtree(node, root):
                    self._rank[node] += shift
        saved = self._cut_values[leaving]
        ancestor = self._update_cut_values(tail, head, saved)
        self._update_cut_values(head, tail, -saved)
        self._cut_values[leaving], self._cut_values[entering] = 0, -saved
        self._in_tree[leaving], self._in_tree[entering] = False, True
        self._number(ancestor, self._parent_edge[ancestor], self._low[ancestor])

    def _update_cut_values(self, node: int, other: int, saved: int) -> int:
        """Update the cut values from a node up to its lowest common ancestor with another; return that."""
        while not self._is_in_subtree(other, node):
            index = self._parent_edge[node]
            self._cut_values[index] += saved if self._tails[index] == node else -saved
            node = self._parent(node)
        return node
