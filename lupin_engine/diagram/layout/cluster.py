"""Draws one cluster of a layered graph.

The nodes of each rank are ordered for few crossings, then get their x; then the ranks are stacked, and the
horizontal parts of edges get tracks between them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from lupin_engine.diagram.layout.coordinates import MARGIN, assign_coordinates
from lupin_engine.diagram.layout.layered_graph import (
    BOTTOM,
    TO_LABEL,
    TOP,
    ClusterEdge,
    LayeredGraph,
    Segment,
)
from lupin_engine.diagram.layout.network_simplex import Effort
from lupin_engine.diagram.layout.ordering import reduce_crossings
from lupin_engine.diagram.layout.routing import ChannelNet, tracks

Point = tuple[int, int]
#: Distance of two ranks: the least, with arrow heads, and for each further track.
_GAP = 9
_ARROW_GAP = 17
_TRACK = 9
_AFTER_HEADING = 8
#: Greatest distance of a low node from the top of a high rank.
_HANG = 28


@dataclass(frozen=True)
class ClusterLayout:
    """The drawing of a cluster: corners of the nodes, routes and label corners by edge.

    `sizes` are those of the nodes: regions are as high as the highest of them. `ports` are the x of edges
    that cross the border, by edge and by whether at the lower border; `port_hints` the x of the next vertex
    of an edge that ends at a (node, edge, at its lower side).
    """

    width: int
    height: int
    shapes: Sequence[Point]
    sizes: Sequence[Point]
    lines: Mapping[int, Sequence[Point]]
    labels: Mapping[int, Point]
    ports: Mapping[tuple[int, bool], int]
    port_hints: Mapping[tuple[int, int, bool], int]


def draw_cluster(graph: LayeredGraph, hints: Mapping[tuple[int, bool], int], effort: Effort) -> ClusterLayout:
    """Draw a cluster.

    Args:
        graph: Its nodes and edges, rank by rank; it is reordered in place.
        hints: The x outside of ports, by (edge, at the lower border), from an earlier iteration.
        effort: A budget that all clusters share; when it is spent the lines are less straight.
    """
    reduce_crossings(graph, hints)
    return _RankStack(graph, assign_coordinates(graph, effort)).drawn()


class _RankStack:
    """The ranks of a layered graph from top to bottom."""

    def __init__(self, graph: LayeredGraph, width: int) -> None:
        self._graph = graph
        self._width = width
        #: Top and height of each rank; the y of the horizontal part of a segment.
        self._layers: list[tuple[int, int]] = []
        self._bends: dict[Segment, int] = {}
        self._height = self._stack()

    def drawn(self) -> ClusterLayout:
        graph = self._graph
        shapes = [self._corner(number) for number in graph.vertex_of]
        lines = {edge.edge_id: self._line(index, shapes) for index, edge in enumerate(graph.edges)}
        sizes = [self._size(number) for number in graph.vertex_of]
        labels, ports, port_hints = self._labels(), self._ports(), self._port_hints()
        return ClusterLayout(self._width, self._height, shapes, sizes, lines, labels, ports, port_hints)

    def _stack(self) -> int:
        """Assign every rank and every horizontal segment its y; return the height of the cluster."""
        graph = self._graph
        y = 0
        for index, layer in enumerate(graph.layers):
            height = max((graph.vertices[number].height for number in layer), default=0)
            self._layers.append((y, height))
            y += height
            if index < graph.last:
                y += self._channel(index, y)
        return y

    def _channel(self, above: int, y: int) -> int:
        """Assign the segments below a rank to tracks, from `y` on; return the height of the channel."""
        segments = self._graph.below[above]
        found = tracks([ChannelNet(*segment.x) for segment in segments])
        bends = [track for track in found if track is not None]
        before, after = self._gaps(above, bool(bends))
        for segment, track in zip(segments, found, strict=True):
            if track is not None:
                self._bends[segment] = y + before + track * _TRACK
        return before + after + max(bends, default=0) * _TRACK

    def _gaps(self, above: int, bends: bool) -> tuple[int, int]:
        """Return the distances of the tracks from the rank above and the rank below."""
        graph, segments = self._graph, self._graph.below[above]
        if graph.row and not bends:
            return 0, 0
        if not segments:
            return (0, _AFTER_HEADING) if above == 0 and graph.layers[0] else (0, MARGIN)
        rising = any(not graph.edges[segment.edge].downward for segment in segments)
        before = _ARROW_GAP if rising and self._has_shapes(above) else _GAP
        return before, _ARROW_GAP if self._has_shapes(above + 1) else _GAP

    def _has_shapes(self, layer: int) -> bool:
        return any(self._graph.vertices[number].shape is not None for number in self._graph.layers[layer])

    # -- places -----------------------------------------------------------------------------------------

    def _corner(self, number: int) -> Point:
        vertex = self._graph.vertices[number]
        y, height = self._layers[vertex.layer]
        return vertex.x, y + (0 if self._graph.row else min((height - vertex.height) // 2, _HANG))

    def _size(self, number: int) -> Point:
        """Return the size of a node; a region fills its rank, but what is beside regions does not."""
        vertex = self._graph.vertices[number]
        assert vertex.shape is not None
        fills = self._graph.row and not self._graph.shapes[vertex.shape].beside
        return vertex.width, self._layers[vertex.layer][1] if fills else vertex.height

    def _line(self, index: int, shapes: Sequence[Point]) -> list[Point]:
        """Return the bend points of an edge from top to bottom."""
        graph, edge = self._graph, self._graph.edges[index]
        segments = [segment for segment in graph.segments if segment.edge == index]
        start = 0 if edge.upper == TOP else shapes[edge.upper][1] + self._foot(edge)
        end = self._height
        if edge.lower != BOTTOM:
            end = shapes[edge.lower][1] + graph.shapes[edge.lower].above
        corners = [(segments[0].x[0], start)]
        for segment in segments:
            if segment in self._bends:
                corners += [(x, self._bends[segment]) for x in segment.x]
        return [*corners, (segments[-1].x[1], end)]

    def _foot(self, edge: ClusterEdge) -> int:
        """Return how far below the top of its upper node an edge begins."""
        shape = self._graph.shapes[edge.upper]
        own = (edge.edge_id, True) not in shape.ports
        return self._size(self._graph.vertex_of[edge.upper])[1] if own else shape.height

    def _labels(self) -> dict[int, Point]:
        found = {}
        for vertex in self._graph.vertices:
            if vertex.label is not None:
                y, height = self._layers[vertex.layer]
                corner = vertex.x + TO_LABEL, y + (height - vertex.height) // 2
                found[self._graph.edges[vertex.label].edge_id] = corner
        return found

    def _ports(self) -> dict[tuple[int, bool], int]:
        graph, found = self._graph, {}
        for chain, edge in zip(graph.chains, graph.edges, strict=True):
            if edge.upper == TOP:
                found[edge.edge_id, False] = graph.vertices[chain[0]].x
            if edge.lower == BOTTOM:
                found[edge.edge_id, True] = graph.vertices[chain[-1]].x
        return found

    def _port_hints(self) -> dict[tuple[int, int, bool], int]:
        found = {}
        for segment in self._graph.segments:
            for end in (0, 1):
                shape = self._graph.vertices[segment.ends[end]].shape
                if shape is not None:
                    found[shape, self._graph.edges[segment.edge].edge_id, end == 0] = segment.x[1 - end]
        return found
