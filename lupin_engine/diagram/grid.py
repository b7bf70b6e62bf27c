"""One level of a picture, as layers of slots: the boxes within one box, and the lines between them.

Every line runs from a higher layer to a lower one; a way back is drawn against its direction. It gets a slot
of its own in each layer that it passes, and its label is such a slot, as wide as the text: so no line runs
through a box, and no text lies on another. A line that leaves the level ends at a port in the first or the
last layer, where the level around it goes on.

Layers of boxes alternate with layers for labels; those that stay without a label are taken out again.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

#: From a line to the label on its right.
TO_LABEL = 6
#: Ends of a strand that are no cell: the border above and below.
TOP, BOTTOM = -1, -2


@dataclass
class Cell:
    """A box of the level: its size, and where lines that come from within it cross its border.

    `above` is room for the mark of the initial state, part of the height; lines end below it. `beside` is
    room for the way of a box to itself, part of the width; no line ends there. A port is found by its link
    and by whether it is in the lower side.
    """

    width: int
    height: int
    above: int = 0
    beside: int = 0
    ports: Mapping[tuple[int, bool], int] = field(default_factory=dict)


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
class Slot:
    """A place in a layer: of a cell, of a line, of a line with the label of a strand, or of the heading."""

    layer: int
    width: int = 0
    height: int = 0
    cell: int | None = None
    label: int | None = None
    heading: bool = False
    x: int = 0

    @property
    def is_line(self) -> bool:
        """Whether a line passes here."""
        return self.cell is None and not self.heading


@dataclass(eq=False)
class Piece:
    """A piece of a strand between two layers that follow each other; `ends` are its slots, above and below.

    `shares` say where in its slots it ends as far as that is known, from 0 to 1; `spans` how far from their
    left borders it may end, and `x` where it does.
    """

    strand: int
    ends: tuple[int, int]
    shares: tuple[float, float] = (0.0, 0.0)
    spans: list[tuple[int, int]] = field(default_factory=lambda: [(0, 0), (0, 0)])
    x: tuple[int, int] = (0, 0)


class Grid:
    """The slots of a level in their layers, and the pieces of its lines between them.

    `row` says that the boxes touch each other and the border: they are regions.
    """

    def __init__(
        self,
        cells: Sequence[Cell],
        ranks: Sequence[int],
        strands: Sequence[Strand],
        heading: tuple[int, int],
        row: bool,
    ) -> None:
        self.cells = cells
        self.strands = strands
        self.row = row
        self.slots: list[Slot] = []
        self.last = 2 * max(ranks, default=0) + 4
        if heading[0]:
            self._add(Slot(0, *heading, heading=True))
        #: The slot of each cell, and those of each strand from top to bottom.
        self.at_cell = [
            self._add(Slot(2 * rank + 2, cell.width, cell.height, cell=index))
            for index, (cell, rank) in enumerate(zip(cells, ranks, strict=True))
        ]
        self.chains = [self._chain(index, strand) for index, strand in enumerate(strands)]
        self._drop_idle_layers()
        self.pieces = [Piece(i, ends) for i, chain in enumerate(self.chains) for ends in pairwise(chain)]
        self.layers: list[list[int]] = [[] for _ in range(self.last + 1)]
        for number, slot in enumerate(self.slots):
            self.layers[slot.layer].append(number)
        #: The pieces below each layer.
        self.below: list[list[Piece]] = [[] for _ in self.layers]
        for piece in self.pieces:
            piece.shares = self._share(piece, 0), self._share(piece, 1)
            self.below[self.slots[piece.ends[0]].layer].append(piece)

    def _add(self, slot: Slot) -> int:
        self.slots.append(slot)
        return len(self.slots) - 1

    def _chain(self, index: int, strand: Strand) -> list[int]:
        """Make the slots of a strand: one in each layer between its ends, and at the border."""
        upper = [] if strand.upper == TOP else [self.at_cell[strand.upper]]
        lower = [] if strand.lower == BOTTOM else [self.at_cell[strand.lower]]
        first = self.slots[upper[0]].layer + 1 if upper else 0
        last = self.slots[lower[0]].layer - 1 if lower else self.last
        passed = range(first, last + 1)
        odd = [layer for layer in passed if layer % 2]
        # Next to where the link begins.
        labelled = odd[0 if strand.falls else -1] if strand.label is not None else None
        return [*upper, *(self._add(self._passing(index, n, n == labelled)) for n in passed), *lower]

    def _passing(self, index: int, layer: int, labelled: bool) -> Slot:
        size = self.strands[index].label
        if size is None or not labelled:
            return Slot(layer)
        return Slot(layer, size[0] + TO_LABEL, size[1], label=index)

    def _drop_idle_layers(self) -> None:
        busy = {slot.layer for slot in self.slots if not slot.is_line or slot.label is not None}
        kept = sorted(busy | {0, self.last})
        numbers: dict[int, int] = {}
        slots: list[Slot] = []
        for number, slot in enumerate(self.slots):
            if slot.layer in kept:
                numbers[number] = len(slots)
                slots.append(slot)
        for slot in slots:
            slot.layer = kept.index(slot.layer)
        self.slots = slots
        self.at_cell = [numbers[number] for number in self.at_cell]
        self.chains = [[numbers[n] for n in chain if n in numbers] for chain in self.chains]
        self.last = len(kept) - 1

    def port(self, piece: Piece, end: int) -> int | None:
        """Return the port of the cell at an end of a piece; None when it may end where there is room."""
        cell = self.slots[piece.ends[end]].cell
        if cell is None:
            return None
        return self.cells[cell].ports.get((self.strands[piece.strand].link, end == 0))

    def _share(self, piece: Piece, end: int) -> float:
        slot, port = self.slots[piece.ends[end]], self.port(piece, end)
        if slot.cell is None:
            return 0.0
        return 0.5 if port is None else port / max(slot.width, 1)
