"""Layout of a compound graph: nested clusters, and edges that cross their borders, in pixels.

From the outside in, every edge gets its direction and every cluster its ranks. From the inside out, every
cluster is drawn by itself; an edge that leaves it becomes a port of its node. The drawing is repeated with
the positions where the edges continue outside of the ports as hints, as long as that reduces its cost.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

from lupin_engine.diagram.layout.cluster import ClusterLayout, Point, draw_cluster
from lupin_engine.diagram.layout.layered_graph import BOTTOM, TOP, ClusterEdge, LayeredGraph, NodeShape
from lupin_engine.diagram.layout.network_simplex import Effort
from lupin_engine.diagram.layout.ranking import forward_edges, ranks

#: Most iterations.
_MAX_ITERATIONS = 4
#: What short and straight edges may cost in all, see `Effort`: seconds. A usual mission takes a hundredth.
_MOST_EFFORT = 20_000_000
#: Horizontal steps up to this length are removed.
_SHORT_STEP = 3


@dataclass
class CompoundNode:
    """A node: its own size, or with children the size of its heading.

    `above` is room over it, `beside` at its right; both are not part of the size. The children of a `row` are
    regions.
    """

    name: str
    width: int
    height: int
    children: list[CompoundNode] = field(default_factory=list)
    above: int = 0
    beside: int = 0
    row: bool = False
    first: str | None = None


@dataclass(frozen=True)
class CompoundEdge:
    """An edge, with the size of its label. Its ends are nodes of which neither contains the other."""

    source: str
    target: str
    label: tuple[int, int] | None = None


@dataclass(frozen=True)
class Rect:
    """A rectangle, by its upper left corner."""

    x: int
    y: int
    width: int
    height: int


@dataclass
class GraphLayout:
    """The rectangles of nodes, bend points of edges from source to target, corners of labels."""

    width: int
    height: int
    rects: dict[str, Rect]
    lines: list[list[Point]]
    labels: list[Point | None]


def lay_out(root: CompoundNode, edges: Sequence[CompoundEdge]) -> GraphLayout:
    """Return the layout of the nodes within `root`, which itself is not shown, and of their edges."""
    return _Layouter(root, edges).best()


class _Layouter:
    def __init__(self, root: CompoundNode, edges: Sequence[CompoundEdge]) -> None:
        self._root = root
        self._links = edges
        self._effort = Effort(_MOST_EFFORT)
        self._above: dict[str, CompoundNode | None] = {}
        self._nodes: dict[str, CompoundNode] = {}
        self._note(root, None)
        self._paths = [self._path(edge) for edge in edges]
        self._downward = [True] * len(edges)
        self._ranks: dict[str, list[int]] = {}
        self._rank(root)
        self._edges = {name: list(self._edges_in(node)) for name, node in self._nodes.items()}

    def _note(self, node: CompoundNode, above: CompoundNode | None) -> None:
        self._nodes[node.name], self._above[node.name] = node, above
        for child in node.children:
            self._note(child, node)

    # -- ranks --------

    def _chain(self, name: str) -> list[str]:
        """Return a node and its ancestors, outermost first."""
        found = [name]
        above = self._above[name]
        while above is not None:
            found.insert(0, above.name)
            above = self._above[above.name]
        return found

    def _path(self, edge: CompoundEdge) -> tuple[list[str], list[str]]:
        """Return both ends with their ancestors, from their lowest common ancestor on."""
        one, other = self._chain(edge.source), self._chain(edge.target)
        common = sum(1 for a, b in zip(one, other, strict=False) if a == b)
        return one[common - 1 :], other[common - 1 :]

    def _rank(self, node: CompoundNode) -> None:
        """Assign ranks to the children of a node; the directions of edges from outside are known by then."""
        numbers = {child.name: number for number, child in enumerate(node.children)}
        within, pulls = [], []
        for index, (source, target) in enumerate(self._paths):
            if source[0] == node.name:
                within.append((index, numbers[source[1]], numbers[target[1]]))
                continue
            for path, is_source in ((source, True), (target, False)):
                if node.name in path[:-1]:
                    inner = path[path.index(node.name) + 1]
                    pulls.append((numbers[inner], self._downward[index] == is_source))
        first = numbers.get(node.first or "")
        forward = forward_edges(len(numbers), [(a, b) for _, a, b in within], first)
        oriented = [(a, b) if ahead else (b, a) for (_, a, b), ahead in zip(within, forward, strict=True)]
        flat = [0] * len(numbers)
        self._ranks[node.name] = (
            flat if node.row else ranks(len(numbers), oriented, pulls, first, self._effort)
        )
        for (index, _, _), ahead in zip(within, forward, strict=True):
            self._downward[index] = ahead
        for child in node.children:
            self._rank(child)

    def _edges_in(self, node: CompoundNode) -> Iterator[ClusterEdge]:
        numbers = {child.name: number for number, child in enumerate(node.children)}
        for index, (source, target) in enumerate(self._paths):
            downward = self._downward[index]
            label = self._links[index].label
            if source[0] == node.name:
                ends = numbers[source[1]], numbers[target[1]]
            elif node.name in source[1:-1]:
                ends = numbers[source[source.index(node.name) + 1]], BOTTOM if downward else TOP
            elif node.name in target[1:-1]:
                ends = TOP if downward else BOTTOM, numbers[target[target.index(node.name) + 1]]
            else:
                continue
            upper, lower = ends if downward else ends[::-1]
            yield ClusterEdge(
                index, upper, lower, downward, label if self._home(index) == node.name else None
            )

    def _home(self, index: int) -> str:
        """Return the node that holds the label of an edge: parent of its source, never between regions."""
        around = self._paths[index][0][:-1]
        return around[-2] if self._nodes[around[-1]].row and len(around) > 1 else around[-1]

    # -- drawing ----------------------------------------------------------------------------------------

    def best(self) -> GraphLayout:
        """Draw repeatedly, with the hints of the previous iteration, and return the layout of least cost."""
        hints: dict[str, dict[tuple[int, bool], int]] = {}
        best: GraphLayout | None = None
        least = 0
        for _ in range(_MAX_ITERATIONS):
            drawn: dict[str, ClusterLayout] = {}
            self._draw(self._root, hints, drawn)
            layout = self._assemble(drawn)
            found = _cost(layout)
            if best is not None and found >= least:
                break
            best, least = layout, found
            if not any(cluster.ports for cluster in drawn.values()):
                break
            hints = self._hints(drawn, layout)
        assert best is not None
        return best

    def _draw(
        self,
        node: CompoundNode,
        hints: dict[str, dict[tuple[int, bool], int]],
        drawn: dict[str, ClusterLayout],
    ) -> NodeShape:
        """Draw a node from the inside out, and return its shape for the enclosing cluster."""
        if not node.children:
            return NodeShape(node.width + node.beside, node.height + node.above, node.above, node.beside)
        shapes = [self._draw(child, hints, drawn) for child in node.children]
        graph = LayeredGraph(
            shapes,
            self._ranks[node.name],
            self._edges[node.name],
            (node.width, node.height),
            node.row,
        )
        cluster = draw_cluster(graph, hints.get(node.name, {}), self._effort)
        drawn[node.name] = cluster
        height = cluster.height + node.above
        return NodeShape(cluster.width, height, node.above, 0, cluster.ports)

    def _assemble(self, drawn: dict[str, ClusterLayout]) -> GraphLayout:
        rects: dict[str, Rect] = {}
        self._place(self._root, Rect(0, 0, self._root.width, self._root.height), drawn, rects)
        lines = [self._line(index, drawn, rects) for index in range(len(self._links))]
        labels = [self._label(index, drawn, rects) for index in range(len(self._links))]
        whole = rects[self._root.name]
        return GraphLayout(whole.width, whole.height, rects, lines, labels)

    def _place(
        self, node: CompoundNode, shape: Rect, drawn: dict[str, ClusterLayout], rects: dict[str, Rect]
    ) -> None:
        """Record the rectangles of a node and its descendants, given the rectangle of its shape."""
        cluster = drawn.get(node.name)
        width, height = shape.width - node.beside, shape.height - node.above
        if cluster is not None:
            width, height = cluster.width, max(cluster.height, height)
        rect = rects[node.name] = Rect(shape.x, shape.y + node.above, width, height)
        if cluster is None:
            return
        for child, (x, y), size in zip(node.children, cluster.shapes, cluster.sizes, strict=True):
            self._place(child, Rect(rect.x + x, rect.y + y, *size), drawn, rects)

    def _line(self, index: int, drawn: dict[str, ClusterLayout], rects: dict[str, Rect]) -> list[Point]:
        """Return the bend points of an edge from its source to its target."""
        source, target = self._paths[index]
        downward = self._downward[index]
        corners: list[Point] = []
        for name in [*source[-2:0:-1], source[0], *target[1:-1]]:
            rect = rects[name]
            segment = [(rect.x + x, rect.y + y) for x, y in drawn[name].lines[index]]
            corners += segment if downward else segment[::-1]
        return _simple(_without_short_steps(_simple(corners)))

    def _label(self, index: int, drawn: dict[str, ClusterLayout], rects: dict[str, Rect]) -> Point | None:
        """Return the place of an arrow's label; None where it has none."""
        name = self._home(index)
        place = drawn[name].labels.get(index)
        return None if place is None else (rects[name].x + place[0], rects[name].y + place[1])

    def _hints(
        self, drawn: dict[str, ClusterLayout], layout: GraphLayout
    ) -> dict[str, dict[tuple[int, bool], int]]:
        """Return the x at which edges through the border of each cluster continue outside of it."""
        found: dict[str, dict[tuple[int, bool], int]] = {}
        for name, cluster in drawn.items():
            node = self._nodes[name]
            for (shape, edge, lower), x in cluster.port_hints.items():
                child = node.children[shape].name
                if child in drawn:
                    found.setdefault(child, {})[edge, lower] = layout.rects[name].x + x
        return found


def _simple(corners: Sequence[Point]) -> list[Point]:
    """Return bend points without those at which nothing turns."""
    found: list[Point] = []
    for corner in corners:
        if found and found[-1] == corner:
            continue
        if len(found) > 1 and (
            found[-2][0] == found[-1][0] == corner[0] or found[-2][1] == found[-1][1] == corner[1]
        ):
            found.pop()
        found.append(corner)
    return found


def _without_short_steps(corners: Sequence[Point]) -> list[Point]:
    """Return bend points without horizontal steps that are too short to be meant."""
    found = list(corners)
    for i in range(len(found) - 3, 0, -1):
        step = found[i : i + 3]
        if len(step) == 3 and step[0][1] == step[1][1] and abs(step[0][0] - step[1][0]) <= _SHORT_STEP:
            found[i : i + 3] = [(step[0][0], step[2][1])]
    return found


def _cost(layout: GraphLayout) -> int:
    """Return the cost of a layout: crossings, bends, length of edges, size."""
    segments = [
        (index, *one, *other) for index, line in enumerate(layout.lines) for one, other in pairwise(line)
    ]
    flat = [p for p in segments if p[2] == p[4]]
    steep = sorted((x, min(y0, y1), max(y0, y1), index) for index, x, y0, c, y1 in segments if x == c)
    columns = [line[0] for line in steep]
    crossings = sum(
        top < b < bottom and index != i
        for i, a, b, c, _ in flat
        for _, top, bottom, index in steep[bisect_right(columns, min(a, c)) : bisect_left(columns, max(a, c))]
    )
    length = sum(abs(p[1] - p[3]) + abs(p[2] - p[4]) for p in segments)
    return 300 * crossings + 30 * len(segments) + length + layout.width + layout.height
