"""Delays the answers to wrong tokens and codes: exponential backoff for each address.

Right ones are never delayed, also from an address that has sent wrong ones, so no user is locked out.
"""

from __future__ import annotations

#: Seconds that the first wrong one takes; each further one takes twice as long, up to the longest.
FIRST_S, LONGEST_S = 0.5, 8.0
#: Seconds without a wrong one after which an address begins anew, and how many are remembered.
FORGOTTEN_S, MOST_ADDRESSES = 600.0, 1_000


class WrongAttempts:
    """Counts wrong attempts of each address; times are in seconds of a clock that never goes back.

    Beyond `MOST_ADDRESSES` the one that was silent for longest is dropped.
    """

    def __init__(self) -> None:
        self._last: dict[str, tuple[int, float]] = {}

    def count(self, address: str, now: float) -> int:
        """Count one more; return the number of recent ones."""
        times, at = self._last.pop(address, (0, now))
        if now - at >= FORGOTTEN_S:
            times = 0
        while len(self._last) >= MOST_ADDRESSES:
            del self._last[next(iter(self._last))]  # the one that was silent for longest
        self._last[address] = times + 1, now
        return times + 1


def delay(times: int) -> float:
    """Return how many seconds the answer to the n-th wrong attempt waits."""
    return float(min(LONGEST_S, FIRST_S * 2 ** min(times - 1, 10)))


def is_written_down(times: int) -> bool:
    """Return whether the n-th wrong attempt is logged: 1, 2, 4, 8 ..., so that the log is not flooded."""
    return times & (times - 1) == 0
