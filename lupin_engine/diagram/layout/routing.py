"""Orthogonal routing between two ranks: every horizontal segment gets a track (channel routing)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

#: Horizontal segments closer than this look like one.
CLOSE = 7
#: Cost of an overlap, in crossings.
_OVERLAP = 100


@dataclass(frozen=True)
class ChannelNet:
    """A net with two terminals: it enters the channel from above at `upper` and leaves it at `lower`."""

    upper: int
    lower: int

    @property
    def straight(self) -> bool:
        """Whether it has no horizontal segment."""
        return self.upper == self.lower

    @cached_property
    def span(self) -> tuple[int, int]:
        """Its left and right end."""
        return min(self.upper, self.lower), max(self.upper, self.lower)


def tracks(nets: Sequence[ChannelNet]) -> list[int | None]:
    """Return the track of each net, 0 the highest; None for a straight net."""
    moving = [index for index, net in enumerate(nets) if not net.straight]
    order = _order(nets, moving)
    found: list[int | None] = [None] * len(nets)
    for position, index in enumerate(order):
        above = [found[other] for other in order[:position] if _conflict(nets[index], nets[other])]
        found[index] = max((track + 1 for track in above if track is not None), default=0)
    return found


def _conflict(one: ChannelNet, other: ChannelNet) -> bool:
    """Whether two nets need different tracks."""
    (a, b), (c, d) = one.span, other.span
    return a - CLOSE < d and c - CLOSE < b


def _cost(upper: ChannelNet, lower: ChannelNet) -> int:
    """Return the crossings and overlaps when one runs above the other."""
    left, right = upper.span
    cost = int(left < lower.upper < right)
    cost += _OVERLAP * (abs(upper.lower - lower.upper) < CLOSE)
    left, right = lower.span
    return cost + int(left < upper.lower < right)


def _order(nets: Sequence[ChannelNet], moving: Sequence[int]) -> list[int]:
    """Order the nets from the highest track down: greedily the one that costs least above all others left."""
    left = list(moving)
    regrets = {i: sum(_regret(nets[i], nets[j]) for j in left if j != i) for i in left}
    order = []
    while left:
        best = min(left, key=lambda i: (regrets[i], nets[i].span, i))
        left.remove(best)
        order.append(best)
        for i in left:
            regrets[i] -= _regret(nets[i], nets[best])
    return order


def _regret(upper: ChannelNet, lower: ChannelNet) -> int:
    """Return the cost of running one above the other, less that of the opposite."""
    if not _conflict(upper, lower):
        return 0
    return _cost(upper, lower) - _cost(lower, upper)
