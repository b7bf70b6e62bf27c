"""The room between two layers: every line that moves sideways there does so at a height of its own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

#: Lines closer than this look like one.
CLOSE = 7
#: What lines on top of each other cost, in crossings.
_OVERLAP = 100


@dataclass(frozen=True)
class Jog:
    """A line that comes from above at `upper` and goes on downwards at `lower`."""

    upper: int
    lower: int

    @property
    def straight(self) -> bool:
        """Whether it does not move sideways at all."""
        return self.upper == self.lower

    @property
    def span(self) -> tuple[int, int]:
        """Its left and right end."""
        return min(self.upper, self.lower), max(self.upper, self.lower)


def tracks(jogs: Sequence[Jog]) -> list[int | None]:
    """Return the track of each jog, 0 the highest; None for a straight one."""
    moving = [index for index, jog in enumerate(jogs) if not jog.straight]
    order = _order(jogs, moving)
    found: list[int | None] = [None] * len(jogs)
    for position, index in enumerate(order):
        above = [found[other] for other in order[:position] if _meet(jogs[index], jogs[other])]
        found[index] = max((track + 1 for track in above if track is not None), default=0)
    return found


def _meet(one: Jog, other: Jog) -> bool:
    """Whether two jogs need tracks of their own."""
    (a, b), (c, d) = one.span, other.span
    return a - CLOSE < d and c - CLOSE < b


def _cost(upper: Jog, lower: Jog) -> int:
    """Return the crossings and overlaps when one runs above the other."""
    left, right = upper.span
    cost = int(left < lower.upper < right)
    cost += _OVERLAP * (abs(upper.lower - lower.upper) < CLOSE)
    left, right = lower.span
    return cost + int(left < upper.lower < right)


def _order(jogs: Sequence[Jog], moving: Sequence[int]) -> list[int]:
    """Order the jogs from the highest down: always take the one that costs least above all that are left."""
    left = list(moving)
    order = []
    while left:
        best = min(left, key=lambda i: (_regret(jogs, i, left), jogs[i].span, i))
        left.remove(best)
        order.append(best)
    return order


def _regret(jogs: Sequence[Jog], index: int, others: Sequence[int]) -> int:
    mine = jogs[index]
    met = [jogs[i] for i in others if i != index and _meet(mine, jogs[i])]
    return sum(_cost(mine, other) - _cost(other, mine) for other in met)
