"""Where everything of a picture stands: levels within levels, lines that cross their borders, in pixels.

First, from the outside in, every line learns whether it runs down or up. Then, from the inside out, every
level is drawn by itself; a line that leaves it gives its box a port. That is done again knowing where the
lines of the ports go outside, for as long as that helps.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

from lupin_engine.diagram.grid import BOTTOM, TOP, Cell, Strand
from lupin_engine.diagram.level import Drawn, Point, draw_level
from lupin_engine.diagram.ranking import onwards, ranks

#: How often everything is drawn at most.
_TRIES = 4
#: A step to the side that looks like a mistake.
_TWITCH = 3


@dataclass
class Block:
    """A box to be placed: its own size, or with children the size of its heading.

    `above` is room over it, `beside` at its right; both are not part of the size. The children of a `row` are
    regions.
    """

    name: str
    width: int
    height: int
    children: list[Block] = field(default_factory=list)
    above: int = 0
    beside: int = 0
    row: bool = False
    first: str | None = None


@dataclass(frozen=True)
class Link:
    """A line to be routed, with the size of its label. Its ends are blocks, neither within the other."""

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
class Layout:
    """What came of it: the rectangles of blocks, corners of links from source to target, places of labels."""

    width: int
    height: int
    rects: dict[str, Rect]
    lines: list[list[Point]]
    labels: list[Point | None]


def lay_out(root: Block, links: Sequence[Link]) -> Layout:
    """Place the blocks within `root`, which itself is not shown, and route the links."""
    return _Layouter(root, links).best()


class _Layouter:
    def __init__(self, root: Block, links: Sequence[Link]) -> None:
        self._root = root
        self._links = links
        self._above: dict[str, Block | None] = {}
        self._blocks: dict[str, Block] = {}
        self._note(root, None)
        self._paths = [self._path(link) for link in links]
        self._falls = [True] * len(links)
        self._ranks: dict[str, list[int]] = {}
        self._rank(root)
        self._strands = {name: list(self._strands_in(block)) for name, block in self._blocks.items()}

    def _note(self, block: Block, above: Block | None) -> None:
        self._blocks[block.name], self._above[block.name] = block, above
        for child in block.children:
            self._note(child, block)

    # -- down or up -------------------------------------------------------------------------------------

    def _chain(self, name: str) -> list[str]:
        """Return a block and all around it, outermost first."""
        found = [name]
        above = self._above[name]
        while above is not None:
            found.insert(0, above.name)
            above = self._above[above.name]
        return found

    def _path(self, link: Link) -> tuple[list[str], list[str]]:
        """Return both ends with what is around them, from the innermost block around both on."""
        one, other = self._chain(link.source), self._chain(link.target)
        common = sum(1 for a, b in zip(one, other, strict=False) if a == b)
        return one[common - 1 :], other[common - 1 :]

    def _rank(self, block: Block) -> None:
        """Give the children of a block their layers; whether lines from outside fall is known by then."""
        numbers = {child.name: number for number, child in enumerate(block.children)}
        within, pulls = [], []
        for index, (source, target) in enumerate(self._paths):
            if source[0] == block.name:
                within.append((index, numbers[source[1]], numbers[target[1]]))
                continue
            for path, is_source in ((source, True), (target, False)):
                if block.name in path[:-1]:
                    inner = path[path.index(block.name) + 1]
                    pulls.append((numbers[inner], self._falls[index] == is_source))
        first = numbers.get(block.first or "")
        forward = onwards(len(numbers), [(a, b) for _, a, b in within], first)
        ways = [(a, b) if ahead else (b, a) for (_, a, b), ahead in zip(within, forward, strict=True)]
        flat = [0] * len(numbers)
        self._ranks[block.name] = flat if block.row else ranks(len(numbers), ways, pulls, first)
        for (index, _, _), ahead in zip(within, forward, strict=True):
            self._falls[index] = ahead
        for child in block.children:
            self._rank(child)

    def _strands_in(self, block: Block) -> Iterator[Strand]:
        numbers = {child.name: number for number, child in enumerate(block.children)}
        for index, (source, target) in enumerate(self._paths):
            falls = self._falls[index]
            label = self._links[index].label
            if source[0] == block.name:
                ends = numbers[source[1]], numbers[target[1]]
            elif block.name in source[1:-1]:
                ends = numbers[source[source.index(block.name) + 1]], BOTTOM if falls else TOP
            elif block.name in target[1:-1]:
                ends = TOP if falls else BOTTOM, numbers[target[target.index(block.name) + 1]]
            else:
                continue
            upper, lower = ends if falls else ends[::-1]
            yield Strand(index, upper, lower, falls, label if self._home(index) == block.name else None)

    def _home(self, index: int) -> str:
        """Return the block with the label of a link: the one around its source, but none between regions."""
        around = self._paths[index][0][:-1]
        return around[-2] if self._blocks[around[-1]].row and len(around) > 1 else around[-1]

    # -- drawing ----------------------------------------------------------------------------------------

    def best(self) -> Layout:
        """Draw, and draw anew knowing more for as long as that helps; return the best."""
        hints: dict[str, dict[tuple[int, bool], int]] = {}
        best: Layout | None = None
        least = 0
        for _ in range(_TRIES):
            drawn: dict[str, Drawn] = {}
            self._draw(self._root, hints, drawn)
            layout = self._assemble(drawn)
            found = _ugliness(layout)
            if best is not None and found >= least:
                break
            best, least = layout, found
            if not any(level.ports for level in drawn.values()):
                break
            hints = self._hints(drawn, layout)
        assert best is not None
        return best

    def _draw(
        self, block: Block, hints: dict[str, dict[tuple[int, bool], int]], drawn: dict[str, Drawn]
    ) -> Cell:
        """Draw a block from the inside out, and return what it is for the level around it."""
        if not block.children:
            return Cell(block.width + block.beside, block.height + block.above, block.above, block.beside)
        cells = [self._draw(child, hints, drawn) for child in block.children]
        level = draw_level(
            cells,
            self._ranks[block.name],
            self._strands[block.name],
            (block.width, block.height),
            block.row,
            hints.get(block.name),
        )
        drawn[block.name] = level
        height = level.height + block.above
        return Cell(level.width, height, block.above, 0, level.ports)

    def _assemble(self, drawn: dict[str, Drawn]) -> Layout:
        rects: dict[str, Rect] = {}
        self._settle(self._root, Rect(0, 0, self._root.width, self._root.height), drawn, rects)
        lines = [self._line(index, drawn, rects) for index in range(len(self._links))]
        labels = [self._label(index, drawn, rects) for index in range(len(self._links))]
        whole = rects[self._root.name]
        return Layout(whole.width, whole.height, rects, lines, labels)

    def _settle(self, block: Block, cell: Rect, drawn: dict[str, Drawn], rects: dict[str, Rect]) -> None:
        """Note where a block stands, and all within it, given its cell."""
        level = drawn.get(block.name)
        width, height = cell.width - block.beside, cell.height - block.above
        if level is not None:
            width, height = level.width, max(level.height, height)
        rect = rects[block.name] = Rect(cell.x, cell.y + block.above, width, height)
        if level is None:
            return
        for child, (x, y), size in zip(block.children, level.cells, level.sizes, strict=True):
            self._settle(child, Rect(rect.x + x, rect.y + y, *size), drawn, rects)

    def _line(self, index: int, drawn: dict[str, Drawn], rects: dict[str, Rect]) -> list[Point]:
        """Return the corners of a link from its source to its target."""
        source, target = self._paths[index]
        falls = self._falls[index]
        corners: list[Point] = []
        for name in [*source[-2:0:-1], source[0], *target[1:-1]]:
            rect = rects[name]
            piece = [(rect.x + x, rect.y + y) for x, y in drawn[name].lines[index]]
            corners += piece if falls else piece[::-1]
        return _simple(_without_twitches(_simple(corners)))

    def _label(self, index: int, drawn: dict[str, Drawn], rects: dict[str, Rect]) -> Point | None:
        name = self._home(index)
        place = drawn[name].labels.get(index)
        return None if place is None else (rects[name].x + place[0], rects[name].y + place[1])

    def _hints(self, drawn: dict[str, Drawn], layout: Layout) -> dict[str, dict[tuple[int, bool], int]]:
        """Return where the lines through each block's border go outside of it."""
        found: dict[str, dict[tuple[int, bool], int]] = {}
        for name, level in drawn.items():
            block = self._blocks[name]
            for (cell, link, lower), x in level.goals.items():
                child = block.children[cell].name
                if child in drawn:
                    found.setdefault(child, {})[link, lower] = layout.rects[name].x + x
        return found


def _simple(corners: Sequence[Point]) -> list[Point]:
    """Return corners without those where nothing turns."""
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


def _without_twitches(corners: Sequence[Point]) -> list[Point]:
    """Return corners of a line that goes straight on where it would move sideways by hardly anything."""
    found = list(corners)
    for i in range(len(found) - 3, 0, -1):
        step = found[i : i + 3]
        if len(step) == 3 and step[0][1] == step[1][1] and abs(step[0][0] - step[1][0]) <= _TWITCH:
            found[i : i + 3] = [(step[0][0], step[2][1])]
    return found


def _ugliness(layout: Layout) -> int:
    """Return a number that is larger the more lines cross, turn and wander."""
    pieces = [
        (index, *one, *other) for index, line in enumerate(layout.lines) for one, other in pairwise(line)
    ]
    flat = [p for p in pieces if p[2] == p[4]]
    steep = [p for p in pieces if p[1] == p[3]]
    crossings = sum(
        min(a, c) < x < max(a, c) and min(y0, y1) < b < max(y0, y1)
        for i, a, b, c, _ in flat
        for j, x, y0, _, y1 in steep
        if i != j
    )
    length = sum(abs(p[1] - p[3]) + abs(p[2] - p[4]) for p in pieces)
    return 300 * crossings + 30 * len(pieces) + length + layout.width + layout.height
