"""No box lies on another, no text on a text or a box, no line runs through a box: for any chart."""

from __future__ import annotations

import random
from itertools import combinations, pairwise
from typing import Any

import pytest

from lupin_engine.chart.model import Chart
from lupin_engine.diagram.layout import compound
from lupin_engine.diagram.layout.compound import CompoundEdge, CompoundNode, GraphLayout, Rect, lay_out
from lupin_engine.diagram.layout.network_simplex import Effort
from lupin_engine.diagram.layout.ranking import forward_edges, ranks
from lupin_engine.diagram.layout.routing import ChannelNet, tracks
from lupin_engine.diagram.outline import outline
from lupin_engine.diagram.svg import plan
from tests.lupin_engine.diagram import pictured
from tests.lupin_engine.machine.charts import chart

EVENTS = ("go", "operator.skip_current", "battery.is.low.and.falling", "x")


def overlap(one: Rect, other: Rect) -> bool:
    """Whether two rectangles share more than a border."""
    return (
        one.x < other.x + other.width
        and other.x < one.x + one.width
        and one.y < other.y + other.height
        and other.y < one.y + one.height
    )


def flat(block: CompoundNode) -> list[CompoundNode]:
    """A block and all within it."""
    return [block, *(inner for child in block.children for inner in flat(child))]


def check(root: CompoundNode, links: list[CompoundEdge], layout: GraphLayout) -> None:
    """Raise when a layout is not one that can be read."""
    blocks = flat(root)
    for block in blocks:
        around = layout.rects[block.name]
        for child in block.children:
            inner = layout.rects[child.name]
            assert inner.x >= around.x
            assert inner.y >= around.y
            assert inner.x + inner.width <= around.x + around.width
            assert inner.y + inner.height <= around.y + around.height
        for one, other in combinations(block.children, 2):
            assert not overlap(layout.rects[one.name], layout.rects[other.name]), (one.name, other.name)
    leaves = [layout.rects[block.name] for block in blocks if not block.children and block.name]
    labels = [
        Rect(*place, *link.label)
        for place, link in zip(layout.labels, links, strict=True)
        if place is not None and link.label is not None
    ]
    assert len(labels) == sum(link.label is not None for link in links)
    assert not any(overlap(one, other) for one, other in combinations(labels, 2))
    assert not any(overlap(label, leaf) for label in labels for leaf in leaves)
    for link, line in zip(links, layout.lines, strict=True):
        check_line(line, layout.rects[link.source], layout.rects[link.target], leaves)


def check_line(line: list[tuple[int, int]], source: Rect, target: Rect, leaves: list[Rect]) -> None:
    """Raise when a line is slanted, ends beside its boxes or runs through one."""
    for rect, (x, y) in ((source, line[0]), (target, line[-1])):
        assert rect.x <= x <= rect.x + rect.width
        assert y in (rect.y, rect.y + rect.height)
    for (a, b), (c, d) in pairwise(line):
        assert (a == c) != (b == d), "every piece is level or plumb, and leads somewhere"
        piece = Rect(min(a, c), min(b, d), abs(a - c), abs(b - d))
        thick = Rect(piece.x, piece.y, max(piece.width, 1), max(piece.height, 1))
        for leaf in leaves:
            shrunk = Rect(leaf.x + 1, leaf.y + 1, leaf.width - 2, leaf.height - 2)
            assert not overlap(thick, shrunk)


def some_chart(seed: int) -> Chart:
    """A chart with nested and parallel states, and ways from anywhere to anywhere."""
    chance = random.Random(seed)
    names: list[str] = []

    def states(depth: int, prefix: str) -> dict[str, Any]:
        found: dict[str, Any] = {}
        for number in range(chance.randint(2, 4)):
            name = f"{prefix}{number}"
            found[name] = {}
            names.append(name)
            if depth and chance.random() < 0.45:
                found[name]["states"] = states(depth - 1, name)
                if chance.random() < 0.35:
                    found[name]["kind"] = "parallel"
        return found

    tree = states(2, "S")
    paths = {}

    def walk(level: dict[str, Any], prefix: str) -> None:
        for name, inner in level.items():
            paths[name] = f"{prefix}{name}"
            walk(inner.get("states", {}), f"{prefix}{name}.")
            rules = {event: paths_of(name) for event in EVENTS if chance.random() < 0.4}
            inner["on"] = rules

    def paths_of(_: str) -> str:
        return full[chance.choice(names)]

    full: dict[str, str] = {}

    def collect(level: dict[str, Any], prefix: str) -> None:
        for name, inner in level.items():
            full[name] = f"{prefix}{name}"
            collect(inner.get("states", {}), f"{prefix}{name}.")

    collect(tree, "")
    walk(tree, "")
    return chart(tree)


@pytest.mark.parametrize("name", pictured.NAMES)
def test_a_chart_can_be_read(name: str) -> None:
    """The shipped ones and the good ones."""
    root, links, layout = plan(outline(pictured.chart(name)))
    check(root, links, layout)


@pytest.mark.parametrize("seed", range(12))
def test_any_chart_can_be_read(seed: int) -> None:
    """However confused."""
    root, links, layout = plan(outline(some_chart(seed)))
    check(root, links, layout)


def test_a_layout_is_always_the_same() -> None:
    """Two of one chart have the same numbers."""
    assert plan(outline(pictured.chart("words")))[2] == plan(outline(pictured.chart("words")))[2]


def test_nothing_takes_no_room() -> None:
    """A picture without boxes is one."""
    assert lay_out(CompoundNode("", 0, 0), []).lines == []


def test_ways_run_downwards_and_back_ones_up() -> None:
    """What leads back to where one came from is turned round for the layers."""
    ways = [(0, 1), (1, 2), (2, 0), (1, 1)]
    assert forward_edges(3, ways, None) == [True, True, False, False]
    assert ranks(3, [(0, 1), (1, 2)], [], 0, Effort(100)) == [0, 1, 2]
    # A box that a line leads to from below stands low.
    assert ranks(3, [(0, 1)], [(2, True)], 0, Effort(100)) == [0, 1, 1]
    assert ranks(3, [(0, 1)], [(2, False)], 0, Effort(100)) == [0, 1, 0]


def test_lines_that_move_sideways_share_a_height_only_apart() -> None:
    """One that is crossed by another's way down stands so that it is not, where that can be."""
    assert tracks([ChannelNet(0, 0), ChannelNet(10, 50), ChannelNet(100, 60)]) == [None, 0, 0]
    assert tracks([ChannelNet(10, 50), ChannelNet(30, 70)]) == [1, 0]
    assert tracks([ChannelNet(50, 10), ChannelNet(70, 30)]) == [0, 1]


@pytest.mark.slow
def test_many_states_that_lead_across_can_be_read(monkeypatch: pytest.MonkeyPatch) -> None:
    """Groups with a way from each state into another group: what straight lines may cost is soon spent."""
    monkeypatch.setattr(compound, "_MOST_EFFORT", 100_000)
    chance = random.Random(1)
    groups = [
        CompoundNode(name, 80, 24, [CompoundNode(f"{name}.{state}", 60, 30) for state in range(9)])
        for name in map(str, range(16))
    ]
    leaves = [state.name for group in groups for state in group.children]
    links = [CompoundEdge(one, other, (50, 14)) for one, other in pairwise(leaves)]
    across = [(leaf, chance.choice(leaves)) for leaf in leaves]
    links += [CompoundEdge(one, other, (50, 14)) for one, other in across if one != other]
    root = CompoundNode("", 0, 0, groups)
    check(root, links, lay_out(root, links))
