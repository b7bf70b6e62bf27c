"""One level of a picture with places: `grid` makes the layers, this stacks them and bends the lines."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from lupin_engine.diagram.channel import Jog, tracks
from lupin_engine.diagram.grid import BOTTOM, TO_LABEL, TOP, Cell, Grid, Piece, Strand
from lupin_engine.diagram.ordering import arrange
from lupin_engine.diagram.placing import MARGIN, place

Point = tuple[int, int]
#: Between two layers: the least, with arrow heads, and for each further bend.
_GAP = 9
_ARROW_GAP = 17
_TRACK = 9
_AFTER_HEADING = 8
#: How far a low box hangs in a high layer.
_HANG = 28


@dataclass(frozen=True)
class Drawn:
    """A level with places: corners of the cells, of the lines by link, of the labels by link.

    `sizes` are those of the cells: regions are as high as the highest of them. `ports` say where lines cross
    the border of the level, by link and by whether at the lower one; `goals` where the lines of a (cell,
    link, at its lower side) go from there.
    """

    width: int
    height: int
    cells: Sequence[Point]
    sizes: Sequence[Point]
    lines: Mapping[int, Sequence[Point]]
    labels: Mapping[int, Point]
    ports: Mapping[tuple[int, bool], int]
    goals: Mapping[tuple[int, int, bool], int]


def draw_level(
    cells: Sequence[Cell],
    ranks: Sequence[int],
    strands: Sequence[Strand],
    heading: tuple[int, int],
    row: bool = False,
    hints: Mapping[tuple[int, bool], int] | None = None,
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
    grid = Grid(cells, ranks, strands, heading, row)
    arrange(grid, hints or {})
    return _Stack(grid, place(grid)).drawn()


class _Stack:
    """The layers of a grid from top to bottom."""

    def __init__(self, grid: Grid, width: int) -> None:
        self._grid = grid
        self._width = width
        #: Top and height of each layer; the height at which a piece runs sideways.
        self._layers: list[tuple[int, int]] = []
        self._bends: dict[Piece, int] = {}
        self._height = self._stack()

    def drawn(self) -> Drawn:
        grid = self._grid
        cells = [self._corner(number) for number in grid.at_cell]
        lines = {strand.link: self._line(index, cells) for index, strand in enumerate(grid.strands)}
        sizes = [self._size(number) for number in grid.at_cell]
        labels, ports, goals = self._labels(), self._ports(), self._goals()
        return Drawn(self._width, self._height, cells, sizes, lines, labels, ports, goals)

    def _stack(self) -> int:
        """Give every layer its place, and every bend its height; return the height of all."""
        grid = self._grid
        y = 0
        for index, layer in enumerate(grid.layers):
            height = max((grid.slots[number].height for number in layer), default=0)
            self._layers.append((y, height))
            y += height
            if index < grid.last:
                y += self._channel(index, y)
        return y

    def _channel(self, above: int, y: int) -> int:
        """Bend the pieces below a layer, from `y` on; return the room that this takes."""
        pieces = self._grid.below[above]
        found = tracks([Jog(*piece.x) for piece in pieces])
        bends = [track for track in found if track is not None]
        before, after = self._gaps(above, bool(bends))
        for piece, track in zip(pieces, found, strict=True):
            if track is not None:
                self._bends[piece] = y + before + track * _TRACK
        return before + after + max(bends, default=0) * _TRACK

    def _gaps(self, above: int, bends: bool) -> tuple[int, int]:
        """Return the room before and after the bends between a layer and the next."""
        grid, pieces = self._grid, self._grid.below[above]
        if grid.row and not bends:
            return 0, 0
        if not pieces:
            return (0, _AFTER_HEADING) if above == 0 and grid.layers[0] else (0, MARGIN)
        rising = any(not grid.strands[piece.strand].falls for piece in pieces)
        before = _ARROW_GAP if rising and self._has_cells(above) else _GAP
        return before, _ARROW_GAP if self._has_cells(above + 1) else _GAP

    def _has_cells(self, layer: int) -> bool:
        return any(self._grid.slots[number].cell is not None for number in self._grid.layers[layer])

    # -- places -----------------------------------------------------------------------------------------

    def _corner(self, number: int) -> Point:
        slot = self._grid.slots[number]
        y, height = self._layers[slot.layer]
        return slot.x, y + (0 if self._grid.row else min((height - slot.height) // 2, _HANG))

    def _size(self, number: int) -> Point:
        """Return the size of a cell; a region fills its layer, but what is beside regions does not."""
        slot = self._grid.slots[number]
        assert slot.cell is not None
        fills = self._grid.row and not self._grid.cells[slot.cell].beside
        return slot.width, self._layers[slot.layer][1] if fills else slot.height

    def _line(self, index: int, cells: Sequence[Point]) -> list[Point]:
        """Return the corners of a strand from top to bottom."""
        grid, strand = self._grid, self._grid.strands[index]
        pieces = [piece for piece in grid.pieces if piece.strand == index]
        start = 0 if strand.upper == TOP else cells[strand.upper][1] + self._foot(strand)
        end = self._height
        if strand.lower != BOTTOM:
            end = cells[strand.lower][1] + grid.cells[strand.lower].above
        corners = [(pieces[0].x[0], start)]
        for piece in pieces:
            if piece in self._bends:
                corners += [(x, self._bends[piece]) for x in piece.x]
        return [*corners, (pieces[-1].x[1], end)]

    def _foot(self, strand: Strand) -> int:
        """Return how far below the top of its upper cell a strand begins."""
        cell = self._grid.cells[strand.upper]
        own = (strand.link, True) not in cell.ports
        return self._size(self._grid.at_cell[strand.upper])[1] if own else cell.height

    def _labels(self) -> dict[int, Point]:
        found = {}
        for slot in self._grid.slots:
            if slot.label is not None:
                y, height = self._layers[slot.layer]
                corner = slot.x + TO_LABEL, y + (height - slot.height) // 2
                found[self._grid.strands[slot.label].link] = corner
        return found

    def _ports(self) -> dict[tuple[int, bool], int]:
        grid, found = self._grid, {}
        for chain, strand in zip(grid.chains, grid.strands, strict=True):
            if strand.upper == TOP:
                found[strand.link, False] = grid.slots[chain[0]].x
            if strand.lower == BOTTOM:
                found[strand.link, True] = grid.slots[chain[-1]].x
        return found

    def _goals(self) -> dict[tuple[int, int, bool], int]:
        found = {}
        for piece in self._grid.pieces:
            for end in (0, 1):
                cell = self._grid.slots[piece.ends[end]].cell
                if cell is not None:
                    found[cell, self._grid.strands[piece.strand].link, end == 0] = piece.x[1 - end]
        return found
