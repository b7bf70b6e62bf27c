"""X coordinates of the vertices and segment ends, by the network simplex on an auxiliary graph.

Gansner et al. (1993), section 4.2: minimum distances are edges without weight, and each segment gets two
auxiliary nodes that cost as much as the segment is slanted.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

from lupin_engine.diagram.layout.layered_graph import LayeredGraph, Segment
from lupin_engine.diagram.layout.network_simplex import Edge, Effort, solve

#: Between the border of a cluster and its content, and its heading.
MARGIN = 18
_HEADING_MARGIN = 12
#: Between two nodes, a node and a dummy, two dummies; what a label adds.
_NODE_GAP = 28
_NODE_DUMMY_GAP = 16
_DUMMY_GAP = 12
_LABEL_GAP = 4
#: Least distance of a segment end from the corner of a node.
_CORNER = 12
#: Cost of slant by the number of dummies among the ends, as in the paper, and of the width of the cluster.
_SLANT_WEIGHT = (2, 4, 16)
_WIDTH_WEIGHT = 1
_FIXED_WEIGHT = 64


def assign_coordinates(graph: LayeredGraph, effort: Effort) -> int:
    """Assign every vertex its x and every segment its ends; return the width of the cluster.

    Straight lines cost effort: with none left they have more bends.
    """
    _assign_ports(graph)
    left, right = len(graph.vertices), len(graph.vertices) + 1
    edges = [Edge(left, right, 0, _WIDTH_WEIGHT), *_separation(graph, left, right)]
    for index, segment in enumerate(graph.segments):
        edges += _straightness(graph, segment, right + 1 + 2 * index)
    found = solve(right + 1 + 2 * len(graph.segments), edges, effort)
    for number, vertex in enumerate(graph.vertices):
        vertex.x = found[number] - found[left]
    for segment in graph.segments:
        segment.x = _ends(graph, segment)
    return found[right] - found[left]


# -- ports ----------------------------------------------------------------------------------------------


def _assign_ports(graph: LayeredGraph) -> None:
    """Assign every segment end its interval: the port of an edge from within, else free room."""
    position = {n: i for layer in graph.layers for i, n in enumerate(layer)}
    for number in graph.vertex_of:
        for end in (0, 1):
            mine = [segment for segment in graph.segments if segment.ends[end] == number]
            mine.sort(key=lambda segment: position[segment.ends[1 - end]] + segment.shares[1 - end])
            _distribute_ends(graph, number, mine, end)


def _distribute_ends(graph: LayeredGraph, number: int, segments: list[Segment], end: int) -> None:
    """Divide one side of a node among the segments that end there, from left to right."""
    vertex = graph.vertices[number]
    assert vertex.shape is not None
    shape = graph.shapes[vertex.shape]
    ports = [graph.port(segment, end) for segment in segments]
    taken = sorted({port for (_, lower), port in shape.ports.items() if lower == (end == 0)})
    start = 0
    while start < len(segments):
        stop = next((i for i in range(start, len(segments)) if ports[i] is not None), len(segments))
        left = ports[start - 1] if start else None
        right = ports[stop] if stop < len(segments) else None
        intervals = _intervals(vertex.width - shape.beside, taken, left, right, stop - start)
        for segment, interval in zip(segments[start:stop], intervals, strict=True):
            segment.spans[end] = interval
        if right is not None:
            segments[stop].spans[end] = right, right
        start = stop + 1


def _intervals(
    width: int, taken: list[int], left: int | None, right: int | None, count: int
) -> list[tuple[int, int]]:
    """Return intervals for `count` ends in the gap after `left` or before `right`, else in the widest gap."""
    gaps = list(pairwise([0, *taken, width]))
    beside = [gap for gap in gaps if left is not None and gap[0] == left]
    beside += [gap for gap in gaps if right is not None and gap[1] == right]
    low, high = beside[0] if beside else max(gaps, key=lambda gap: gap[1] - gap[0])
    share = (high - low) / max(count, 1)
    side = min(_CORNER, share / 2.5)
    return [(round(low + i * share + side), round(low + (i + 1) * share - side)) for i in range(count)]


# -- the auxiliary graph ---------------------------------------------------------------------------------


def _separation(graph: LayeredGraph, left: int, right: int) -> Iterator[Edge]:
    """Yield the minimum distances between the vertices of each rank and to the borders."""
    margin = 0 if graph.row else MARGIN
    for layer in graph.layers:
        for one, other in pairwise(layer):
            yield Edge(one, other, graph.vertices[one].width + _distance(graph, one, other), 0)
        if not layer:
            continue
        if graph.vertices[layer[0]].heading:
            yield Edge(left, layer[0], _HEADING_MARGIN, _FIXED_WEIGHT)
        else:
            first_region = graph.row and graph.vertices[layer[0]].shape is not None
            yield Edge(left, layer[0], margin, _FIXED_WEIGHT if first_region else 0)
        yield Edge(layer[-1], right, graph.vertices[layer[-1]].width + margin, 0)


def _distance(graph: LayeredGraph, left: int, right: int) -> int:
    one, other = graph.vertices[left], graph.vertices[right]
    if one.shape is not None and other.shape is not None:
        return 0 if graph.row else _NODE_GAP
    if one.is_dummy and other.is_dummy:
        return _DUMMY_GAP + (0 if one.label is None else _LABEL_GAP)
    return _NODE_DUMMY_GAP


def _straightness(graph: LayeredGraph, segment: Segment, auxiliary: int) -> Iterator[Edge]:
    """Yield the edges of the two auxiliary nodes of a segment.

    `auxiliary` is the first of them; it costs by how far the upper end lies to the right of the lower one,
    the second by how far it lies to the left.
    """
    upper, lower = segment.ends
    weight = _SLANT_WEIGHT[graph.vertices[upper].is_dummy + graph.vertices[lower].is_dummy]
    (low, high), (low_below, high_below) = segment.spans
    for far, near, a, b in ((upper, lower, low, high_below), (lower, upper, low_below, high)):
        yield Edge(auxiliary, far, max(a, b) - a, weight)
        yield Edge(auxiliary, near, max(a, b) - b, 0)
        auxiliary += 1


def _ends(graph: LayeredGraph, segment: Segment) -> tuple[int, int]:
    """Return the ends of a segment, after its vertices have their coordinates."""
    upper, lower = (graph.vertices[number].x for number in segment.ends)
    (a, b), (c, d) = segment.spans
    a, b, c, d = upper + a, upper + b, lower + c, lower + d
    if b < c:
        return b, c
    if d < a:
        return a, d
    middle = (max(a, c) + min(b, d)) // 2
    return middle, middle
