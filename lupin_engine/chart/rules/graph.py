"""Strongly connected components of a graph (Tarjan), and cycles in them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

Graph = Mapping[str, Sequence[str]]


@dataclass
class _Search:
    """Tarjan's algorithm, without recursion: a chart may be longer than Python's stack is deep."""

    graph: Graph
    number: dict[str, int] = field(default_factory=dict)
    lowest: dict[str, int] = field(default_factory=dict)
    path: list[str] = field(default_factory=list)
    on_path: set[str] = field(default_factory=set)

    def start(self, root: str) -> Iterator[list[str]]:
        calls = [self._enter(root)]
        while calls:
            node, following = calls[-1]
            child = next(following, None)
            if child is not None:
                if child not in self.number:
                    calls.append(self._enter(child))
                elif child in self.on_path:
                    self.lowest[node] = min(self.lowest[node], self.number[child])
                continue
            calls.pop()
            if calls:
                above = calls[-1][0]
                self.lowest[above] = min(self.lowest[above], self.lowest[node])
            if self.lowest[node] == self.number[node]:
                yield self._leave(node)

    def _enter(self, node: str) -> tuple[str, Iterator[str]]:
        self.number[node] = self.lowest[node] = len(self.number)
        self.path.append(node)
        self.on_path.add(node)
        return node, iter([child for child in self.graph[node] if child in self.graph])

    def _leave(self, node: str) -> list[str]:
        found = [self.path.pop()]
        while found[-1] != node:
            found.append(self.path.pop())
        self.on_path.difference_update(found)
        return found[::-1]


def components(graph: Graph) -> Iterator[list[str]]:
    """Yield the strongly connected parts, each after all that it leads to; only nodes of the graph count."""
    search = _Search(graph)
    for node in graph:
        if node not in search.number:
            yield from search.start(node)


def cycles(graph: Graph, part: Sequence[str], limit: int) -> Iterator[list[str]]:
    """Yield simple cycles within a strongly connected component, up to `limit` steps of the search.

    Each is yielded once, from its first node in the order of `part`.
    """
    order = {node: at for at, node in enumerate(part)}
    for first in part:
        trail, waiting = [first], [iter(graph[first])]
        while waiting and limit > 0:
            limit -= 1
            child = next(waiting[-1], None)
            if child is None:
                waiting.pop()
                trail.pop()
            elif child == first:
                yield list(trail)
            elif order.get(child, -1) > order[first] and child not in trail:
                trail.append(child)
                waiting.append(iter(graph[child]))
