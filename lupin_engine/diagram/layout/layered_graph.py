"""The proper layered graph of one cluster: its nodes and the edges between them, rank by rank.

Ranks are numbered from the top. Every edge leads downwards, to a greater rank; a back edge is reversed. A
long edge gets a dummy vertex in each rank that it passes, and its label is such a vertex, as wide as the
text: no edge crosses a node, and no label lies on another. An edge that leaves the cluster ends at a port in
the first or last rank, where the enclosing cluster continues it.

Ranks of nodes alternate with ranks for labels; a label rank that stays empty is removed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

#: Distance from an edge to the label at its right.
TO_LABEL = 6
#: Ends of an edge at the upper and lower border of the cluster instead of a node.
TOP, BOTTOM = -1, -2


@dataclass
class NodeShape:
    """The size of a node of the cluster, and where edges from within it cross its border.

    `above` is room for the mark of the initial state, part of the height; edges end below it. `beside` is
    room for a self-loop, part of the width; no edge ends there. A port is found by the edge's number and by
    whether it is in the lower side.
    """

    width: int
    height: int
    above: int = 0
    beside: int = 0
    ports: Mapping[tuple[int, bool], int] = field(default_factory=dict)


@dataclass(frozen=True)
class ClusterEdge:
    """The part of an edge in this cluster, from `upper` to `lower`: nodes, or TOP and BOTTOM for the border.

    `label` is the size of its text, if that stands in this cluster; `downward`: the edge is not reversed.
    """

    edge_id: int
    upper: int
    lower: int
    downward: bool
    label: tuple[int, int] | None = None


@dataclass
class Vertex:
    """A vertex of a rank: a node, the heading, or a dummy of an edge, perhaps with its label."""

    layer: int
    width: int = 0
    height: int = 0
    shape: int | None = None
    label: int | None = None
    heading: bool = False
    x: int = 0

    @property
    def is_dummy(self) -> bool:
        """Whether this is the dummy vertex of an edge."""
        return self.shape is None and not self.heading


@dataclass(eq=False)
class Segment:
    """The part of an edge between two adjacent ranks; `ends` are its vertices, above and below.

    `shares` say where on its vertices it ends as far as that is known, from 0 to 1; `spans` the interval,
    from their left borders, in which it may end, and `x` where it does.
    """

    edge: int
    ends: tuple[int, int]
    shares: tuple[float, float] = (0.0, 0.0)
    spans: list[tuple[int, int]] = field(default_factory=lambda: [(0, 0), (0, 0)])
    x: tuple[int, int] = (0, 0)


class LayeredGraph:
    """The vertices of a cluster, rank by rank, and the segments of its edges between them.

    `row` says that the nodes touch each other and the border: they are regions.
    """

    def __init__(
        self,
        shapes: Sequence[NodeShape],
        ranks: Sequence[int],
        edges: Sequence[ClusterEdge],
        heading: tuple[int, int],
        row: bool,
    ) -> None:
        self.shapes = shapes
        self.edges = edges
        self.row = row
        self.vertices: list[Vertex] = []
        self.last = 2 * max(ranks, default=0) + 4
        if heading[0]:
            self._add(Vertex(0, *heading, heading=True))
        #: The vertex of each node, and those of each edge from top to bottom.
        self.vertex_of = [
            self._add(Vertex(2 * rank + 2, shape.width, shape.height, shape=index))
            for index, (shape, rank) in enumerate(zip(shapes, ranks, strict=True))
        ]
        self.chains = [self._chain(index, edge) for index, edge in enumerate(edges)]
        self._drop_empty_layers()
        self.segments = [Segment(i, ends) for i, chain in enumerate(self.chains) for ends in pairwise(chain)]
        self.layers: list[list[int]] = [[] for _ in range(self.last + 1)]
        for number, vertex in enumerate(self.vertices):
            self.layers[vertex.layer].append(number)
        #: The segments below each rank.
        self.below: list[list[Segment]] = [[] for _ in self.layers]
        for segment in self.segments:
            segment.shares = self._share(segment, 0), self._share(segment, 1)
            self.below[self.vertices[segment.ends[0]].layer].append(segment)

    def _add(self, vertex: Vertex) -> int:
        self.vertices.append(vertex)
        return len(self.vertices) - 1

    def _chain(self, index: int, edge: ClusterEdge) -> list[int]:
        """Make the dummy vertices of an edge: one in each rank between its ends, and at the border."""
        upper = [] if edge.upper == TOP else [self.vertex_of[edge.upper]]
        lower = [] if edge.lower == BOTTOM else [self.vertex_of[edge.lower]]
        first = self.vertices[upper[0]].layer + 1 if upper else 0
        last = self.vertices[lower[0]].layer - 1 if lower else self.last
        passed = range(first, last + 1)
        odd = [layer for layer in passed if layer % 2]
        # Next to the source.
        labelled = odd[0 if edge.downward else -1] if edge.label is not None else None
        return [*upper, *(self._add(self._passing(index, n, n == labelled)) for n in passed), *lower]

    def _passing(self, index: int, layer: int, labelled: bool) -> Vertex:
        size = self.edges[index].label
        if size is None or not labelled:
            return Vertex(layer)
        return Vertex(layer, size[0] + TO_LABEL, size[1], label=index)

    def _drop_empty_layers(self) -> None:
        busy = {vertex.layer for vertex in self.vertices if not vertex.is_dummy or vertex.label is not None}
        kept = sorted(busy | {0, self.last})
        numbers: dict[int, int] = {}
        vertices: list[Vertex] = []
        for number, vertex in enumerate(self.vertices):
            if vertex.layer in kept:
                numbers[number] = len(vertices)
                vertices.append(vertex)
        for vertex in vertices:
            vertex.layer = kept.index(vertex.layer)
        self.vertices = vertices
        self.vertex_of = [numbers[number] for number in self.vertex_of]
        self.chains = [[numbers[n] for n in chain if n in numbers] for chain in self.chains]
        self.last = len(kept) - 1

    def port(self, segment: Segment, end: int) -> int | None:
        """Return the port of the node at an end of a segment; None when the end is free."""
        shape = self.vertices[segment.ends[end]].shape
        if shape is None:
            return None
        return self.shapes[shape].ports.get((self.edges[segment.edge].edge_id, end == 0))

    def _share(self, segment: Segment, end: int) -> float:
        vertex, port = self.vertices[segment.ends[end]], self.port(segment, end)
        if vertex.shape is None:
            return 0.0
        return 0.5 if port is None else port / max(vertex.width, 1)
