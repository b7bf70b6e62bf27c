"""One level of a picture: the boxes within one box, in layers from top to bottom, and the lines between them.

Every line runs from a higher layer to a lower one; a way back is drawn against its direction. It gets a slot of
its own in each layer that it passes, and its label is such a slot, as wide as the text: so no line runs through
a box, and no text lies on another. A line that leaves the level ends at a port in the first or the last layer,
where the level around it goes on.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property

from lupin_engine.diagram.channel import Jog, tracks
from lupin_engine.diagram.simplex import Rope, solve

#: Between a level's border and what is in it.
MARGIN = 18
#: Between two boxes beside each other, a box and a line, two lines.
_APART = 28
_BESIDE = 16
_LANE = 12
#: From a line to the label on its right.
_TO_LABEL = 6
#: Between two layers: the least, with arrow heads, and for each level piece of a line.
_GAP = 9
_ARROW_GAP = 17
_TRACK = 9
#: How far a low box hangs in a high layer.
_HANG = 28
#: How far from a corner of a box a line may end.
_CORNER = 14
_ROUNDS = 10
#: What a slanted line costs by the kind of its ends, and what the width of the level costs.
_STRAIGHT = {0: 2, 1: 4, 2: 16}
_WALL = 1
_FIRM = 64

TOP, BOTTOM = -1, -2


@dataclass
class Cell:
    """A box of the level: its size, and where lines that come from within it cross its border.

    `above` is room for the mark of the initial state, part of the height; lines end below it. `beside` is room
    for the way of a box to itself, part of the width; no line ends there.
    """

    width: int
    height: int
    above: int = 0
    beside: int = 0
    ports: dict[tuple[int, bool], int] = field(default_factory=dict)


@dataclass(frozen=True)
class Strand:
    """The part of a link in this level, from `upper` to `lower`: cells, or TOP and BOTTOM for the border.

    `label` is the size of its text, if that stands in this level; `falls` says that the link runs downwards.
    """

    link: int
    upper: int
    lower: int
    falls: bool
    label: tuple[int, int] | None = None


@dataclass
class _Slot:
    """A place in a layer: of a cell, of a line that passes, of a label (beside its line), of the heading."""

    layer: int
    width: int
    height: int = 0
    cell: int | None = None
    label: int | None = None
    heading: bool = False
    x: int = 0

    @property
    def is_line(self) -> bool:
        return self.cell is None and not self.heading


@dataclass
class _Piece:
    """A piece of a strand between two layers that follow each other.

    `spans` say how far from the left of its slots it may end, above and below; `x` where it does.
    """

    strand: int
    upper: int
    lower: int
    spans: list[tuple[int, int]] = field(default_factory=lambda: [(0, 0), (0, 0)])
    x: tuple[int, int] = (0, 0)

    def end(self, lower: bool) -> int:
        return self.lower if lower else self.upper


@dataclass
class Drawn:
    """A level with places: its size, the cells' corners, the strands' corners, the labels, and the ports."""

    width: int
    height: int
    cells: list[tuple[int, int]]
    lines: dict[int, list[tuple[int, int]]]
    labels: dict[int, tuple[int, int]]
    ports: dict[tuple[int, bool], int]
    #: (cell, link, at its lower side) -> where the line goes from there.
    heads_for: dict[tuple[int, int, bool], int]


def draw_level(
    cells: Sequence[Cell],
    ranks: Sequence[int],
    strands: Sequence[Strand],
    heading: tuple[int, int],
    row: bool = False,
    hints: dict[tuple[int, bool], int] | None = None,
) -> Drawn:
    """Place the cells of a level and route its strands.

    Args:
        cells: The boxes.
        ranks: The layer of each, from 0.
        strands: The lines.
        heading: Size of what stands above the boxes at the left, (0, 0) for nothing.
        row: The boxes touch each other and the border: they are regions.
        hints: Where the lines through (link, at the lower border) go outside, from an earlier try.
    """
    return _Level(cells, ranks, strands, heading, row, hints or {}).drawn()


class _Level:
    def __init__(
        self,
        cells: Sequence[Cell],
        ranks: Sequence[int],
        strands: Sequence[Strand],
        heading: tuple[int, int],
        row: bool,
        hints: dict[tuple[int, bool], int],
    ) -> None:
        self._cells = cells
        self._strands = strands
        self._row = row
        self._hints = hints
        self._slots: list[_Slot] = []
        self._pieces: list[_Piece] = []
        self._chains: list[list[int]] = []
        self._last = 2 * max(ranks, default=0) + 4
        if heading[0]:
            self._slot(_Slot(0, heading[0], heading[1], heading=True))
        self._at_cell = [
            self._slot(_Slot(2 * rank + 2, cell.width, cell.height, cell=index))
            for index, (cell, rank) in enumerate(zip(cells, ranks, strict=True))
        ]
        for index, strand in enumerate(strands):
            self._chains.append(self._chain(index, strand))
        self._drop_idle_layers()
        for index, chain in enumerate(self._chains):
            self._pieces += [_Piece(index, *ends) for ends in zip(chain, chain[1:])]
        self._layers: list[list[int]] = [[] for _ in range(self._last + 1)]
        for number, slot in enumerate(self._slots):
            self._layers[slot.layer].append(number)

    # -- slots ------------------------------------------------------------------------------------------

    def _slot(self, slot: _Slot) -> int:
        self._slots.append(slot)
        return len(self._slots) - 1

    def _chain(self, index: int, strand: Strand) -> list[int]:
        """Return the slots of a strand from top to bottom; it gets one in each layer between its ends."""
        first = 0 if strand.upper == TOP else self._slots[self._at_cell[strand.upper]].layer + 1
        last = self._last if strand.lower == BOTTOM else self._slots[self._at_cell[strand.lower]].layer - 1
        labelled = self._label_layer(strand, first, last)
        between = []
        for layer in range(first, last + 1):
            if layer == labelled and strand.label is not None:
                size = strand.label
                between.append(self._slot(_Slot(layer, size[0] + _TO_LABEL, size[1], label=index)))
            else:
                between.append(self._slot(_Slot(layer, 0)))
        upper = [] if strand.upper == TOP else [self._at_cell[strand.upper]]
        lower = [] if strand.lower == BOTTOM else [self._at_cell[strand.lower]]
        return [*upper, *between, *lower]

    @staticmethod
    def _label_layer(strand: Strand, first: int, last: int) -> int:
        """Return the layer for a label: the one next to where the link begins."""
        odd = [layer for layer in range(first, last + 1) if layer % 2]
        return odd[0] if strand.falls else odd[-1]

    def _drop_idle_layers(self) -> None:
        """Take out the layers that are there for labels and have none."""
        busy = {slot.layer for slot in self._slots if not slot.is_line or slot.label is not None}
        kept = [layer for layer in range(self._last + 1) if layer in busy or layer in (0, self._last)]
        renamed = {old: new for new, old in enumerate(kept)}
        stays = {number: slot for number, slot in enumerate(self._slots) if slot.layer in renamed}
        numbers = {old: new for new, old in enumerate(stays)}
        for slot in stays.values():
            slot.layer = renamed[slot.layer]
        self._slots = list(stays.values())
        self._at_cell = [numbers[number] for number in self._at_cell]
        self._chains = [[numbers[n] for n in chain if n in numbers] for chain in self._chains]
        self._last = len(kept) - 1

    # -- order in the layers ----------------------------------------------------------------------------

    @cached_property
    def _between(self) -> list[list[_Piece]]:
        """The pieces below each layer."""
        found: list[list[_Piece]] = [[] for _ in self._layers]
        for piece in self._pieces:
            found[self._slots[piece.upper].layer].append(piece)
        return found

    def _share(self, piece: _Piece, lower: bool) -> float:
        """Return where in its slot a piece ends, from 0 to 1."""
        slot = self._slots[piece.end(lower)]
        if slot.cell is None or not slot.width:
            return 0.0
        port = self._cells[slot.cell].ports.get((self._strands[piece.strand].link, not lower))
        return 0.5 if port is None else port / slot.width

    def _arrange(self) -> None:
        """Order the slots of all layers so that few lines cross."""
        self._shares = {id(p): (self._share(p, False), self._share(p, True)) for p in self._pieces}
        self._sort_ports()
        best, least = [list(layer) for layer in self._layers], self._crossings()
        for turn in range(_ROUNDS):
            downwards = turn % 2 == 0
            for layer in range(1, self._last + 1) if downwards else range(self._last - 1, -1, -1):
                self._sort_layer(layer, downwards)
            self._swap_neighbours()
            found = self._crossings()
            if found < least:
                best, least = [list(layer) for layer in self._layers], found
            if not least:
                break
        self._layers = best

    def _is_fixed(self, layer: int) -> bool:
        return bool(self._hints) and layer in (0, self._last)

    def _sort_ports(self) -> None:
        if not self._hints:
            return
        for layer, lower in ((0, False), (self._last, True)):
            keys = {}
            for chain, strand in zip(self._chains, self._strands, strict=True):
                number = chain[-1 if lower else 0]
                keys[number] = self._hints.get((strand.link, lower), 0)
            self._layers[layer].sort(key=lambda n: (not self._slots[n].heading, keys.get(n, 0)))

    def _sort_layer(self, layer: int, downwards: bool) -> None:
        """Order one layer by where the lines from the one before come from."""
        if self._is_fixed(layer):
            return
        pieces = self._between[layer - 1] if downwards else self._between[layer]
        place = {n: i for i, n in enumerate(self._layers[layer - 1 if downwards else layer + 1])}
        reached: dict[int, list[float]] = {}
        for piece in pieces:
            other = place[piece.end(not downwards)] + self._shares[id(piece)][not downwards]
            own = (
                self._shares[id(piece)][downwards] - 0.5
                if self._slots[piece.end(downwards)].cell is not None
                else 0
            )
            reached.setdefault(piece.end(downwards), []).append(other - own)
        now = self._layers[layer]
        wished = {n: sum(reached[n]) / len(reached[n]) for n in now if n in reached}
        ranked = iter(sorted(wished, key=lambda n: (wished[n], now.index(n))))
        free = [next(ranked) if n in wished else n for n in now]
        free.sort(key=lambda n: not self._slots[n].heading)
        self._layers[layer] = free

    def _crossings(self) -> int:
        return sum(self._crossings_below(layer) for layer in range(self._last))

    def _crossings_below(self, layer: int) -> int:
        above = {n: i for i, n in enumerate(self._layers[layer])}
        below = {n: i for i, n in enumerate(self._layers[layer + 1])}
        ends = []
        for piece in self._between[layer]:
            upper, lower = self._shares[id(piece)]
            ends.append((above[piece.upper] + upper, below[piece.lower] + lower))
        count = 0
        for i, (a, b) in enumerate(ends):
            for c, d in ends[i + 1 :]:
                count += (a < c and b > d) or (a > c and b < d)
        return count

    def _swap_neighbours(self) -> None:
        for layer in range(self._last + 1):
            if self._is_fixed(layer):
                continue
            row = self._layers[layer]
            for i in range(len(row) - 1):
                if self._slots[row[i]].heading:
                    continue
                before = self._near(layer)
                row[i], row[i + 1] = row[i + 1], row[i]
                if self._near(layer) >= before:
                    row[i], row[i + 1] = row[i + 1], row[i]

    def _near(self, layer: int) -> int:
        around = (self._crossings_below(layer - 1) if layer else 0, 0)
        return around[0] + (self._crossings_below(layer) if layer < self._last else 0)

    # -- where lines meet boxes -------------------------------------------------------------------------

    def _attach(self) -> None:
        """Say where every piece may end at its boxes: at the port of a line from within, else in free room."""
        place = {n: i for layer in self._layers for i, n in enumerate(layer)}
        for number in self._at_cell:
            for below in (False, True):
                mine = [p for p in self._pieces if p.end(not below) == number]
                mine.sort(key=lambda p: place[p.end(below)] + self._shares[id(p)][below])
                self._spread(number, mine, below)

    def _spread(self, number: int, pieces: list[_Piece], below: bool) -> None:
        slot = self._slots[number]
        assert slot.cell is not None
        cell = self._cells[slot.cell]
        fixed = [cell.ports.get((self._strands[p.strand].link, below)) for p in pieces]
        taken = {port for (_, side), port in cell.ports.items() if side is below}
        start = 0
        while start < len(pieces):
            end = next((i for i in range(start, len(pieces)) if fixed[i] is not None), len(pieces))
            left = fixed[start - 1] if start else None
            right = fixed[end] if end < len(pieces) else None
            rooms = _rooms(slot.width - cell.beside, sorted(taken), left, right, end - start)
            for piece, room in zip(pieces[start:end], rooms, strict=True):
                piece.spans[not below] = room
            if right is not None:
                pieces[end].spans[not below] = right, right
            start = end + 1

    # -- places -----------------------------------------------------------------------------------------

    def _place(self) -> int:
        """Give every slot its x; return the width."""
        count = len(self._slots)
        left, right = count, count + 1
        margin = 0 if self._row else MARGIN
        ropes = [Rope(left, right, 0, _WALL)]
        for layer in self._layers:
            for a, b in zip(layer, layer[1:]):
                ropes.append(Rope(a, b, self._slots[a].width + self._apart(a, b), 0))
            if layer:
                first, last = self._slots[layer[0]], self._slots[layer[-1]]
                ropes.append(
                    Rope(left, layer[0], margin if not first.heading else 12, _FIRM if first.heading else 0)
                )
                ropes.append(Rope(layer[-1], right, last.width + margin, 0))
        if self._row:
            ropes += [Rope(left, self._layers[1][0], 0, _FIRM)]
        for index, piece in enumerate(self._pieces):
            ropes += self._pull(piece, right + 1 + 2 * index)
        found = solve(right + 1 + 2 * len(self._pieces), ropes)
        for number, slot in enumerate(self._slots):
            slot.x = found[number] - found[left]
        for piece in self._pieces:
            piece.x = self._ends(piece)
        return found[right] - found[left]

    def _pull(self, piece: _Piece, knot: int) -> Iterator[Rope]:
        """Yield what makes a piece straight, or costs as much as it is slanted.

        A knot is no further than either of its ropes lets it be, so it costs by how much one end lies beyond
        the other: the first for the upper end too far to the right, the second for the lower.
        """
        lines = self._slots[piece.upper].is_line + self._slots[piece.lower].is_line
        weight = _STRAIGHT[lines]
        (low, high), (low_below, high_below) = piece.spans
        for far, near, a, b in (
            (piece.upper, piece.lower, low, high_below),
            (piece.lower, piece.upper, low_below, high),
        ):
            most = max(a, b)
            yield Rope(knot, far, most - a, weight)
            yield Rope(knot, near, most - b, 0)
            knot += 1

    def _ends(self, piece: _Piece) -> tuple[int, int]:
        """Return where a piece ends, now that its slots have places: straight if it can be."""
        upper, lower = self._slots[piece.upper].x, self._slots[piece.lower].x
        (a, b), (c, d) = (
            (x + span[0], x + span[1]) for x, span in zip((upper, lower), piece.spans, strict=True)
        )
        if b < c:
            return b, c
        if d < a:
            return a, d
        middle = (max(a, c) + min(b, d)) // 2
        return middle, middle

    def _apart(self, left: int, right: int) -> int:
        a, b = self._slots[left], self._slots[right]
        if a.cell is not None and b.cell is not None:
            return 0 if self._row else _APART
        if a.is_line and b.is_line:
            return _LANE + (4 if a.label is not None else 0)
        return _BESIDE

    # -- the whole --------------------------------------------------------------------------------------

    def drawn(self) -> Drawn:
        self._arrange()
        self._attach()
        width = self._place()
        tops, bends = self._heights()
        cells = []
        for number in self._at_cell:
            slot = self._slots[number]
            room = tops[slot.layer][1] - slot.height
            cells.append((slot.x, tops[slot.layer][0] + (0 if self._row else min(room // 2, _HANG))))
        lines = {s.link: self._corners(i, cells, tops, bends) for i, s in enumerate(self._strands)}
        labels = {
            self._strands[slot.label].link: (
                slot.x + _TO_LABEL,
                tops[slot.layer][0] + (tops[slot.layer][1] - slot.height) // 2,
            )
            for slot in self._slots
            if slot.label is not None
        }
        height = tops[-1][0] + tops[-1][1]
        return Drawn(width, height, cells, lines, labels, self._ports(), self._heads())

    def _ports(self) -> dict[tuple[int, bool], int]:
        found = {}
        for chain, strand in zip(self._chains, self._strands, strict=True):
            if strand.upper == TOP:
                found[strand.link, False] = self._slots[chain[0]].x
            if strand.lower == BOTTOM:
                found[strand.link, True] = self._slots[chain[-1]].x
        return found

    def _heads(self) -> dict[tuple[int, int, bool], int]:
        found = {}
        for piece in self._pieces:
            for lower_side in (False, True):
                slot = self._slots[piece.end(not lower_side)]
                if slot.cell is not None:
                    found[slot.cell, self._strands[piece.strand].link, lower_side] = piece.x[lower_side]
        return found

    def _heights(self) -> tuple[list[tuple[int, int]], dict[int, int]]:
        """Return top and height of each layer, and the y of each piece that has a bend, by its number."""
        tops: list[tuple[int, int]] = []
        bends: dict[int, int] = {}
        y = 0
        numbers = {id(piece): number for number, piece in enumerate(self._pieces)}
        for index, layer in enumerate(self._layers):
            height = max((self._slots[n].height for n in layer), default=0)
            tops.append((y, height))
            y += height
            if index == self._last:
                break
            pieces = self._between[index]
            jogs = [Jog(*piece.x) for piece in pieces]
            found = tracks(jogs)
            high = max((t for t in found if t is not None), default=-1) + 1
            gap = self._gap(index, bool(high))
            for piece, track in zip(pieces, found, strict=True):
                if track is not None:
                    bends[numbers[id(piece)]] = y + gap[0] + track * _TRACK
            y += gap[0] + gap[1] + max(0, high - 1) * _TRACK
        return tops, bends

    def _gap(self, above: int, bends: bool) -> tuple[int, int]:
        """Return the room above and below the bends between a layer and the next."""
        if self._row and not bends:
            return 0, 0
        if above == 0 and not self._between[0]:
            return (4, 4) if self._layers[0] else (MARGIN // 2, MARGIN // 2)
        if not self._between[above]:
            return MARGIN // 2, MARGIN // 2
        upper, lower = self._has_cells(above), self._has_cells(above + 1)
        return (_ARROW_GAP if upper and self._rises(above) else _GAP), (_ARROW_GAP if lower else _GAP)

    def _rises(self, above: int) -> bool:
        return any(not self._strands[p.strand].falls for p in self._between[above])

    def _has_cells(self, layer: int) -> bool:
        return any(self._slots[n].cell is not None for n in self._layers[layer])

    def _corners(
        self, index: int, cells: list[tuple[int, int]], tops: list[tuple[int, int]], bends: dict[int, int]
    ) -> list[tuple[int, int]]:
        """Return the corners of a strand from top to bottom."""
        strand = self._strands[index]
        mine = [(n, p) for n, p in enumerate(self._pieces) if p.strand == index]
        if not mine:
            x = self._slots[self._chains[index][0]].x
            return [(x, 0), (x, tops[-1][0] + tops[-1][1])]
        first, last = mine[0][1], mine[-1][1]
        start = 0
        if strand.upper != TOP:
            start = cells[strand.upper][1] + self._foot(strand, tops)
        corners = [(first.x[0], start)]
        for number, piece in mine:
            if number in bends:
                corners += [(piece.x[0], bends[number]), (piece.x[1], bends[number])]
        end = tops[-1][0] + tops[-1][1]
        if strand.lower != BOTTOM:
            end = cells[strand.lower][1] + self._cells[strand.lower].above
        return [*corners, (last.x[1], end)]

    def _foot(self, strand: Strand, tops: list[tuple[int, int]]) -> int:
        """Return how far below the top of its upper cell a strand begins; regions are as high as their layer."""
        cell = self._cells[strand.upper]
        whole = self._row and (strand.link, True) not in cell.ports and not cell.beside
        return tops[self._slots[self._at_cell[strand.upper]].layer][1] if whole else cell.height


def _rooms(
    width: int, taken: list[int], left: int | None, right: int | None, count: int
) -> list[tuple[int, int]]:
    """Return room for some lines in the gap after `left` or before `right`, else in the widest one."""
    gaps = list(zip([0, *taken], [*taken, width], strict=True))
    beside = [gap for gap in gaps if left is not None and gap[0] == left]
    beside += [gap for gap in gaps if right is not None and gap[1] == right]
    low, high = beside[0] if beside else max(gaps, key=lambda gap: gap[1] - gap[0])
    share = (high - low) / max(count, 1)
    side = min(_CORNER, share / 2.5)
    return [(round(low + i * share + side), round(low + (i + 1) * share - side)) for i in range(count)]


def ranks(
    count: int, ways: Iterable[tuple[int, int]], pulls: Iterable[tuple[int, bool]], first: int | None
) -> list[int]:
    """Return the layer of each box so that ways run downwards and are short.

    Args:
        count: How many boxes.
        ways: From box to box, without circles.
        pulls: Boxes that a line leads to from the border, from the lower one where the second is true.
        first: The box to begin with.
    """
    top, bottom = count, count + 1
    ropes = [Rope(top, box, 0, 0) for box in range(count)] + [Rope(box, bottom, 0, 0) for box in range(count)]
    ropes += [Rope(box, bottom, 0, 1) if low else Rope(top, box, 0, 1) for box, low in pulls]
    ropes += [Rope(a, b, 1, 2) for a, b in ways]
    if first is not None:
        ropes.append(Rope(top, first, 0, 3))
    found = solve(count + 2, ropes)
    used = sorted(set(found[:count]))
    return [used.index(rank) for rank in found[:count]]
