"""In which layer each box of a level stands."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from lupin_engine.diagram.simplex import Rope, solve


def onwards(count: int, ways: Sequence[tuple[int, int]], first: int | None) -> list[bool]:
    """Say of each way whether it leads onwards; the others lead back, to where one has been already.

    Args:
        count: How many boxes.
        ways: From box to box.
        first: The box to begin with; without it, and for what it does not lead to, the order counts.
    """
    found = [True] * len(ways)
    left, open_ = set(range(count)), set()

    def visit(box: int) -> None:
        left.discard(box)
        open_.add(box)
        for index, (source, target) in enumerate(ways):
            if source == box and target in open_:
                found[index] = False
            elif source == box and target in left:
                visit(target)
        open_.discard(box)

    for start in ([] if first is None else [first]) + list(range(count)):
        if start in left:
            visit(start)
    return found


def ranks(
    count: int, ways: Iterable[tuple[int, int]], pulls: Iterable[tuple[int, bool]], first: int | None
) -> list[int]:
    """Return the layer of each box, so that ways run downwards and are short.

    Args:
        count: How many boxes.
        ways: From box to box, without circles.
        pulls: Boxes that a line leads to from the border; from the lower one where the second is true.
        first: The box to begin with.
    """
    top, bottom = count, count + 1
    ropes = [Rope(top, box, 0, 0) for box in range(count)]
    ropes += [Rope(box, bottom, 0, 0) for box in range(count)]
    ropes += [Rope(box, bottom, 0, 1) if lower else Rope(top, box, 0, 1) for box, lower in pulls]
    ropes += [Rope(source, target, 1, 2) for source, target in ways]
    if first is not None:
        ropes.append(Rope(top, first, 0, 3))
    found = solve(count + 2, ropes)[:count]
    used = sorted(set(found))
    return [used.index(rank) for rank in found]
