"""The rank of each node: back edges are reversed, then the network simplex assigns ranks."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from lupin_engine.diagram.layout.network_simplex import Edge, Effort, solve


def forward_edges(count: int, edges: Sequence[tuple[int, int]], first: int | None) -> list[bool]:
    """Say of each edge whether it leads forward; the back edges of a depth-first search do not.

    Args:
        count: Number of nodes.
        edges: Source and target of each edge.
        first: The node to start the search from; the others follow in their order.
    """
    found = [True] * len(edges)
    left, open_ = set(range(count)), set()

    def visit(node: int) -> None:
        left.discard(node)
        open_.add(node)
        for index, (source, target) in enumerate(edges):
            if source == node and target in open_:
                found[index] = False
            elif source == node and target in left:
                visit(target)
        open_.discard(node)

    for start in ([] if first is None else [first]) + list(range(count)):
        if start in left:
            visit(start)
    return found


def ranks(
    count: int,
    edges: Iterable[tuple[int, int]],
    border: Iterable[tuple[int, bool]],
    first: int | None,
    effort: Effort,
) -> list[int]:
    """Return the rank of each node, so that edges lead downwards and are short.

    Args:
        count: Number of nodes.
        edges: Source and target of each edge; they form no cycle.
        border: Nodes with an edge to the border of the cluster; the second is true for the lower border.
        first: The node that is entered first.
        effort: What short edges may cost.
    """
    top, bottom = count, count + 1
    network = [Edge(top, node, 0, 0) for node in range(count)]
    network += [Edge(node, bottom, 0, 0) for node in range(count)]
    network += [Edge(node, bottom, 0, 1) if lower else Edge(top, node, 0, 1) for node, lower in border]
    network += [Edge(source, target, 1, 2) for source, target in edges]
    if first is not None:
        network.append(Edge(top, first, 0, 3))
    found = solve(count + 2, network, effort)[:count]
    used = sorted(set(found))
    return [used.index(rank) for rank in found]
