"""Wrong tokens and codes: each is answered later than the one before it, by address.

A right one is never late, also from an address that shows wrong ones: so nobody is locked out by others.
"""

from __future__ import annotations

#: Seconds that the first wrong one takes; each further one takes twice as long, up to the longest.
FIRST_S, LONGEST_S = 0.5, 8.0
#: Seconds without a wrong one after which an address begins anew, and how many are remembered.
FORGOTTEN_S, MOST_ADDRESSES = 600.0, 1_000


class WrongAttempts:
    """How many wrong ones came from each address; times are in seconds of a clock that never goes back."""

    def __init__(self) -> None:
        self._last: dict[str, tuple[int, float]] = {}

    def count(self, address: str, now: float) -> int:
        """Take notice of one more, and return how many there were lately."""
        times, at = self._last.pop(address, (0, now))
        if now - at >= FORGOTTEN_S:
            times = 0
        while len(self._last) >= MOST_ADDRESSES:
            del self._last[next(iter(self._last))]  # the one that was silent for longest
        self._last[address] = times + 1, now
        return times + 1


def delay(times: int) -> float:
    """Return how many seconds the answer to the wrong one of this number waits."""
    return float(min(LONGEST_S, FIRST_S * 2 ** min(times - 1, 10)))


def is_written_down(times: int) -> bool:
    """Say whether the wrong one of this number gets a line: 1, 2, 4, 8 ... so that a log is not filled."""
    return times & (times - 1) == 0
