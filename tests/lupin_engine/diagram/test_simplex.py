"""The network simplex finds what trying everything finds."""

from __future__ import annotations

import itertools
import random

import pytest

from lupin_engine.diagram.layout.network_simplex import Edge, Effort, solve

ENOUGH = Effort(10**9)


def cost(edges: list[Edge], found: tuple[int, ...] | list[int]) -> int | None:
    """What the numbers cost; None when a edge is too short."""
    slack = [found[edge.head] - found[edge.tail] - edge.length for edge in edges]
    return None if any(s < 0 for s in slack) else sum(s * r.weight for s, r in zip(slack, edges, strict=True))


def some_edges(chance: random.Random, count: int) -> list[Edge]:
    """Ropes without a circle: every one leads to a later thing."""
    return [
        Edge(a, b, chance.randint(0, 2), chance.randint(0, 3))
        for a, b in itertools.combinations(range(count), 2)
        if chance.random() < 0.6
    ]


@pytest.mark.parametrize("seed", range(150))
def test_nothing_is_cheaper(seed: int) -> None:
    """For few things everything can be tried."""
    chance = random.Random(seed)
    count = chance.randint(1, 4)
    edges = some_edges(chance, count)
    costs = (cost(edges, numbers) for numbers in itertools.product(range(7), repeat=count))
    found = solve(count, edges, ENOUGH)
    assert min(found) == 0
    assert cost(edges, found) == min(one for one in costs if one is not None)


@pytest.mark.parametrize("seed", range(20))
def test_no_single_thing_wants_to_move(seed: int) -> None:
    """For many things: no length is broken, and no step of one of them saves anything."""
    chance = random.Random(seed)
    count = chance.randint(20, 60)
    edges = some_edges(chance, count)
    found = solve(count, edges, ENOUGH)
    least = cost(edges, found)
    assert least is not None
    for thing, step in itertools.product(range(count), (-1, 1)):
        moved = [number + (step if index == thing else 0) for index, number in enumerate(found)]
        other = cost(edges, moved)
        assert other is None or other >= least


@pytest.mark.parametrize("effort", [0, 500])
def test_ranks_that_little_is_spent_on_are_far_enough_apart(effort: int) -> None:
    """Who gives up early keeps every length; the edges are longer than they need be."""
    chance = random.Random(effort)
    edges = some_edges(chance, 60)
    given_up, best = solve(60, edges, Effort(effort)), solve(60, edges, ENOUGH)
    dear, cheap = cost(edges, given_up), cost(edges, best)
    assert dear is not None
    assert cheap is not None
    assert dear > cheap


def test_nothing_is_placed_nowhere() -> None:
    """An empty level has no numbers; things without edges begin at the same one."""
    assert solve(0, [], ENOUGH) == []
    assert solve(3, [], ENOUGH) == [0, 0, 0]
