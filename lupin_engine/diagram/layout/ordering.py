"""Crossing reduction: the order of the vertices in each rank, by barycenter sweeps and transpositions.

Sugiyama, Tagawa and Toda (1981); the transpose step is that of Gansner et al. (1993), section 3.
"""

from __future__ import annotations

from bisect import bisect_right, insort
from collections.abc import Mapping

from lupin_engine.diagram.layout.layered_graph import LayeredGraph

#: Number of sweeps, downwards and upwards in turn.
_SWEEPS = 10


def reduce_crossings(graph: LayeredGraph, hints: Mapping[tuple[int, bool], int]) -> None:
    """Order the vertices of each rank; with hints, the ports in the first and last rank keep their order."""
    _CrossingReduction(graph, hints).reduce_crossings()


class _CrossingReduction:
    def __init__(self, graph: LayeredGraph, hints: Mapping[tuple[int, bool], int]) -> None:
        self._graph = graph
        self._hints = hints

    def reduce_crossings(self) -> None:
        graph = self._graph
        if self._hints:
            self._sort_ports(0)
            self._sort_ports(graph.last)
        best, least = [list(layer) for layer in graph.layers], self._crossings()
        for sweep in range(_SWEEPS):
            if not least:
                break
            down = sweep % 2 == 0
            for layer in range(1, graph.last + 1) if down else range(graph.last - 1, -1, -1):
                self._sort_by_barycenter(layer, down)
            self._transpose()
            found = self._crossings()
            if found < least:
                best, least = [list(layer) for layer in graph.layers], found
        graph.layers = best

    def _fixed(self, layer: int) -> bool:
        return bool(self._hints) and layer in (0, self._graph.last)

    def _sort_ports(self, layer: int) -> None:
        graph, lower = self._graph, layer == self._graph.last
        wished = {
            chain[-1 if lower else 0]: self._hints.get((edge.edge_id, lower), 0)
            for chain, edge in zip(graph.chains, graph.edges, strict=True)
        }
        graph.layers[layer].sort(key=lambda n: (not graph.vertices[n].heading, wished.get(n, 0)))

    def _sort_by_barycenter(self, layer: int, down: bool) -> None:
        """Order one rank by the barycenters of the adjacent rank; the heading stays first."""
        if self._fixed(layer):
            return
        graph = self._graph
        place = {n: i for i, n in enumerate(graph.layers[layer - 1 if down else layer + 1])}
        reached: dict[int, list[float]] = {}
        for segment in graph.below[layer - 1 if down else layer]:
            mine, other = segment.ends[down], segment.ends[not down]
            aside = segment.shares[down] - 0.5 if graph.vertices[mine].shape is not None else 0.0
            reached.setdefault(mine, []).append(place[other] + segment.shares[not down] - aside)
        now = graph.layers[layer]
        wished = {n: sum(reached[n]) / len(reached[n]) for n in now if n in reached}
        ranked = iter(sorted(wished, key=lambda n: (wished[n], now.index(n))))
        # Vertices without edges keep their positions.
        order = [next(ranked) if n in wished else n for n in now]
        graph.layers[layer] = sorted(order, key=lambda n: not graph.vertices[n].heading)

    def _transpose(self) -> None:
        """Exchange adjacent vertices where that saves crossings."""
        for layer, row in enumerate(self._graph.layers):
            if self._fixed(layer):
                continue
            edge_ends = self._edge_ends(layer)
            for i in range(len(row) - 1):
                left, right = row[i], row[i + 1]
                if self._graph.vertices[left].heading:
                    continue
                one, other = edge_ends[left], edge_ends[right]
                if _crossing_number(other, one) < _crossing_number(one, other):
                    row[i], row[i + 1] = right, left

    def _edge_ends(self, layer: int) -> dict[int, _EdgeEnds]:
        """Return the edge ends of each vertex, upwards and downwards: share and position of the other end."""
        graph = self._graph
        found: dict[int, _EdgeEnds] = {n: ([], []) for n in graph.layers[layer]}
        for down in (False, True):
            if layer == (graph.last if down else 0):
                continue
            place = {n: i for i, n in enumerate(graph.layers[layer + 1 if down else layer - 1])}
            for segment in graph.below[layer if down else layer - 1]:
                mine, other = segment.ends[not down], segment.ends[down]
                found[mine][down].append((segment.shares[not down], place[other] + segment.shares[down]))
        return found

    def _crossings(self) -> int:
        return sum(self._crossings_below(layer) for layer in range(self._graph.last))

    def _crossings_below(self, layer: int) -> int:
        upper = {n: i for i, n in enumerate(self._graph.layers[layer])}
        lower = {n: i for i, n in enumerate(self._graph.layers[layer + 1])}
        ends = sorted(
            (upper[segment.ends[0]] + segment.shares[0], lower[segment.ends[1]] + segment.shares[1])
            for segment in self._graph.below[layer]
        )
        # Of two edges that cross, the one that begins farther left ends farther right.
        passed: list[float] = []
        found = 0
        for _, end in ends:
            found += len(passed) - bisect_right(passed, end)
            insort(passed, end)
        return found


#: The edge ends of a vertex upwards and downwards: share of the vertex, and position of the other end.
_EdgeEnds = tuple[list[tuple[float, float]], list[tuple[float, float]]]


def _crossing_number(left: _EdgeEnds, right: _EdgeEnds) -> int:
    """Return how often edges of two adjacent vertices cross, the one standing left of the other."""
    return sum(
        (a < c + 1 and b > d) or (a > c + 1 and b < d)
        for mine, others in zip(left, right, strict=True)
        for a, b in mine
        for c, d in others
    )
