"""The order of the slots in each layer of a grid, so that few lines cross: sweeps and swaps (Sugiyama)."""

from __future__ import annotations

from collections.abc import Mapping

from lupin_engine.diagram.grid import Grid

#: Sweeps down and up in all.
_SWEEPS = 10


def arrange(grid: Grid, hints: Mapping[tuple[int, bool], int]) -> None:
    """Order the layers of a grid; with hints, the ports in the first and last one stand in their order."""
    _Order(grid, hints).arrange()


class _Order:
    def __init__(self, grid: Grid, hints: Mapping[tuple[int, bool], int]) -> None:
        self._grid = grid
        self._hints = hints

    def arrange(self) -> None:
        grid = self._grid
        if self._hints:
            self._sort_ports(0)
            self._sort_ports(grid.last)
        best, least = [list(layer) for layer in grid.layers], self._crossings()
        for sweep in range(_SWEEPS):
            if not least:
                break
            down = sweep % 2 == 0
            for layer in range(1, grid.last + 1) if down else range(grid.last - 1, -1, -1):
                self._sort(layer, down)
            self._swap()
            found = self._crossings()
            if found < least:
                best, least = [list(layer) for layer in grid.layers], found
        grid.layers = best

    def _fixed(self, layer: int) -> bool:
        return bool(self._hints) and layer in (0, self._grid.last)

    def _sort_ports(self, layer: int) -> None:
        grid, lower = self._grid, layer == self._grid.last
        wished = {
            chain[-1 if lower else 0]: self._hints.get((strand.link, lower), 0)
            for chain, strand in zip(grid.chains, grid.strands, strict=True)
        }
        grid.layers[layer].sort(key=lambda n: (not grid.slots[n].heading, wished.get(n, 0)))

    def _sort(self, layer: int, down: bool) -> None:
        """Order one layer by where the lines from the one before come from; the heading stays first."""
        if self._fixed(layer):
            return
        grid = self._grid
        place = {n: i for i, n in enumerate(grid.layers[layer - 1 if down else layer + 1])}
        reached: dict[int, list[float]] = {}
        for piece in grid.below[layer - 1 if down else layer]:
            mine, other = piece.ends[down], piece.ends[not down]
            aside = piece.shares[down] - 0.5 if grid.slots[mine].cell is not None else 0.0
            reached.setdefault(mine, []).append(place[other] + piece.shares[not down] - aside)
        now = grid.layers[layer]
        wished = {n: sum(reached[n]) / len(reached[n]) for n in now if n in reached}
        ranked = iter(sorted(wished, key=lambda n: (wished[n], now.index(n))))
        # Those without lines keep their places.
        order = [next(ranked) if n in wished else n for n in now]
        grid.layers[layer] = sorted(order, key=lambda n: not grid.slots[n].heading)

    def _swap(self) -> None:
        """Swap neighbours wherever that saves crossings, which can only be those of their own lines."""
        for layer, row in enumerate(self._grid.layers):
            if self._fixed(layer):
                continue
            lines = self._lines(layer)
            for i in range(len(row) - 1):
                left, right = row[i], row[i + 1]
                if self._grid.slots[left].heading:
                    continue
                if _crossing(lines[right], lines[left]) < _crossing(lines[left], lines[right]):
                    row[i], row[i + 1] = right, left

    def _lines(self, layer: int) -> dict[int, _Lines]:
        """Return the lines of each slot, upwards and downwards: its share, and the place of the other end."""
        grid = self._grid
        found: dict[int, _Lines] = {n: ([], []) for n in grid.layers[layer]}
        for down in (False, True):
            if layer == (grid.last if down else 0):
                continue
            place = {n: i for i, n in enumerate(grid.layers[layer + 1 if down else layer - 1])}
            for piece in grid.below[layer if down else layer - 1]:
                mine, other = piece.ends[not down], piece.ends[down]
                found[mine][down].append((piece.shares[not down], place[other] + piece.shares[down]))
        return found

    def _crossings(self) -> int:
        return sum(self._crossings_below(layer) for layer in range(self._grid.last))

    def _crossings_below(self, layer: int) -> int:
        upper = {n: i for i, n in enumerate(self._grid.layers[layer])}
        lower = {n: i for i, n in enumerate(self._grid.layers[layer + 1])}
        ends = [
            (upper[piece.ends[0]] + piece.shares[0], lower[piece.ends[1]] + piece.shares[1])
            for piece in self._grid.below[layer]
        ]
        return sum(
            (a < c and b > d) or (a > c and b < d) for i, (a, b) in enumerate(ends) for c, d in ends[i + 1 :]
        )


#: The lines of a slot upwards, and those downwards: share of the slot, and place of the other end.
_Lines = tuple[list[tuple[float, float]], list[tuple[float, float]]]


def _crossing(left: _Lines, right: _Lines) -> int:
    """Return how often lines of two neighbours cross, the one standing left of the other."""
    return sum(
        (a < c + 1 and b > d) or (a > c + 1 and b < d)
        for mine, others in zip(left, right, strict=True)
        for a, b in mine
        for c, d in others
    )
