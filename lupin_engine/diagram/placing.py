"""Where the slots of a grid stand from left to right, and where lines meet boxes: straight if they can be."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

from lupin_engine.diagram.grid import Grid, Piece
from lupin_engine.diagram.simplex import Rope, solve

#: Between a level's border and what is in it, and its heading.
MARGIN = 18
_HEADING_MARGIN = 12
#: Between two boxes beside each other, a box and a line, two lines; what a label adds.
_APART = 28
_BESIDE = 16
_LANE = 12
_AFTER_LABEL = 4
#: How far from a corner of a box a line may end.
_CORNER = 12
#: What a slanted line costs, by how many of its ends are lines, and what the width of the level costs.
_STRAIGHT = (2, 4, 16)
_WALL = 1
_FIRM = 64


def place(grid: Grid) -> int:
    """Give every slot its x, and every piece its ends; return the width of the level."""
    _attach(grid)
    left, right = len(grid.slots), len(grid.slots) + 1
    ropes = [Rope(left, right, 0, _WALL), *_apart(grid, left, right)]
    for index, piece in enumerate(grid.pieces):
        ropes += _pull(grid, piece, right + 1 + 2 * index)
    found = solve(right + 1 + 2 * len(grid.pieces), ropes)
    for number, slot in enumerate(grid.slots):
        slot.x = found[number] - found[left]
    for piece in grid.pieces:
        piece.x = _ends(grid, piece)
    return found[right] - found[left]


# -- where lines may meet boxes -------------------------------------------------------------------------


def _attach(grid: Grid) -> None:
    """Say where every piece may end at its boxes: at the port of a line from within, else in free room."""
    place = {n: i for layer in grid.layers for i, n in enumerate(layer)}
    for number in grid.at_cell:
        for end in (0, 1):
            mine = [piece for piece in grid.pieces if piece.ends[end] == number]
            mine.sort(key=lambda piece: place[piece.ends[1 - end]] + piece.shares[1 - end])
            _spread(grid, number, mine, end)


def _spread(grid: Grid, number: int, pieces: list[Piece], end: int) -> None:
    """Divide one side of a cell among the pieces that end there, from left to right."""
    slot = grid.slots[number]
    assert slot.cell is not None
    cell = grid.cells[slot.cell]
    ports = [grid.port(piece, end) for piece in pieces]
    taken = sorted({port for (_, lower), port in cell.ports.items() if lower == (end == 0)})
    start = 0
    while start < len(pieces):
        stop = next((i for i in range(start, len(pieces)) if ports[i] is not None), len(pieces))
        left = ports[start - 1] if start else None
        right = ports[stop] if stop < len(pieces) else None
        rooms = _rooms(slot.width - cell.beside, taken, left, right, stop - start)
        for piece, room in zip(pieces[start:stop], rooms, strict=True):
            piece.spans[end] = room
        if right is not None:
            pieces[stop].spans[end] = right, right
        start = stop + 1


def _rooms(
    width: int, taken: list[int], left: int | None, right: int | None, count: int
) -> list[tuple[int, int]]:
    """Return room for some lines in the gap after `left` or before `right`, else in the widest one."""
    gaps = list(pairwise([0, *taken, width]))
    beside = [gap for gap in gaps if left is not None and gap[0] == left]
    beside += [gap for gap in gaps if right is not None and gap[1] == right]
    low, high = beside[0] if beside else max(gaps, key=lambda gap: gap[1] - gap[0])
    share = (high - low) / max(count, 1)
    side = min(_CORNER, share / 2.5)
    return [(round(low + i * share + side), round(low + (i + 1) * share - side)) for i in range(count)]


# -- what keeps apart, and what pulls together ----------------------------------------------------------


def _apart(grid: Grid, left: int, right: int) -> Iterator[Rope]:
    """Yield what keeps the slots of each layer apart from each other and from the borders."""
    margin = 0 if grid.row else MARGIN
    for layer in grid.layers:
        for one, other in pairwise(layer):
            yield Rope(one, other, grid.slots[one].width + _distance(grid, one, other), 0)
        if not layer:
            continue
        if grid.slots[layer[0]].heading:
            yield Rope(left, layer[0], _HEADING_MARGIN, _FIRM)
        else:
            first_region = grid.row and grid.slots[layer[0]].cell is not None
            yield Rope(left, layer[0], margin, _FIRM if first_region else 0)
        yield Rope(layer[-1], right, grid.slots[layer[-1]].width + margin, 0)


def _distance(grid: Grid, left: int, right: int) -> int:
    one, other = grid.slots[left], grid.slots[right]
    if one.cell is not None and other.cell is not None:
        return 0 if grid.row else _APART
    if one.is_line and other.is_line:
        return _LANE + (0 if one.label is None else _AFTER_LABEL)
    return _BESIDE


def _pull(grid: Grid, piece: Piece, knot: int) -> Iterator[Rope]:
    """Yield what makes a piece straight, or costs as much as it is slanted.

    A knot is no further than either of its ropes lets it be, so it costs by how much one end lies beyond the
    other: the first knot for the upper end too far to the right, the second for the lower one.
    """
    upper, lower = piece.ends
    weight = _STRAIGHT[grid.slots[upper].is_line + grid.slots[lower].is_line]
    (low, high), (low_below, high_below) = piece.spans
    for far, near, a, b in ((upper, lower, low, high_below), (lower, upper, low_below, high)):
        yield Rope(knot, far, max(a, b) - a, weight)
        yield Rope(knot, near, max(a, b) - b, 0)
        knot += 1


def _ends(grid: Grid, piece: Piece) -> tuple[int, int]:
    """Return where a piece ends, now that its slots have places."""
    upper, lower = (grid.slots[number].x for number in piece.ends)
    (a, b), (c, d) = piece.spans
    a, b, c, d = upper + a, upper + b, lower + c, lower + d
    if b < c:
        return b, c
    if d < a:
        return a, d
    middle = (max(a, c) + min(b, d)) // 2
    return middle, middle
