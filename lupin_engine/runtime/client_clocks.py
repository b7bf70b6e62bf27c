"""The age of a request, judged by its client's own clock, because computers' clocks may differ by an hour."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

#: Seconds after which a request is not carried out: whoever sent it has given up.
STALE_AFTER_S = 5.0
#: The code of a command that is refused for that.
STALE = "stale"
#: How long a difference counts, in seconds, and of how many clients how many are remembered.
REMEMBERED_S, MAX_CLIENTS, MAX_DIFFERENCES = 300.0, 200, 500
#: Two old requests that came so many seconds apart with the same difference are believed. What has waited for
#: a broken link comes together, or with another difference.
APART_S, SAME_S = 2.0, 0.5
#: Of so many seconds one difference is kept, the smallest.
_EACH_S = 10.0


@dataclass
class _ClientClock:
    """Differences of one client's requests, each with when it came; that of an old request is in doubt."""

    believed: deque[tuple[float, float]] = field(default_factory=lambda: deque(maxlen=MAX_DIFFERENCES))
    doubted: tuple[float, float] | None = None

    def forget(self, before: float) -> None:
        while self.believed and self.believed[0][0] < before:
            self.believed.popleft()
        if self.doubted is not None and self.doubted[0] < before:
            self.doubted = None

    def smallest(self, difference: float) -> float | None:
        """Return the smallest difference of the same clock; None for a clock that was not heard before."""
        found: float | None = None
        for known in sorted(
            (known for _, known in self.believed if known <= difference + SAME_S), reverse=True
        ):
            if found is not None and found - known > STALE_AFTER_S:
                break  # another one's: those without a name are one client
            found = known
        return found

    def believe(self, now: float, difference: float) -> None:
        self.doubted = None
        for number, (at, known) in enumerate(self.believed):
            if now - at < _EACH_S and abs(known - difference) <= STALE_AFTER_S:
                self.believed[number] = at, min(known, difference)
                return
        self.believed.append((now, difference))

    def is_steady(self, now: float, difference: float) -> bool:
        """Say whether an old request shows the same difference as one before, at least `APART_S` ago."""
        if self.doubted is None or abs(difference - self.doubted[1]) > SAME_S:
            self.doubted = now, difference
        return now - self.doubted[0] >= APART_S


class ClientClocks:
    """Estimates the age of requests from the minimum offset of each client's clock, by name.

    The offset, arrival by this process's steady clock less sending by the client's, is constant for one
    clock, plus the time in transit. So the age is the offset less the smallest one of the last five minutes.
    For a clock without history the wall clocks decide: a request that is old by them is old, until another
    one shows the same offset. Requests without a name count as one client with several clocks.
    """

    def __init__(self) -> None:
        self._clients: dict[str, _ClientClock] = {}

    def age(self, client: str, sent: float, wall: float, now: float) -> float:
        """Return the age of a request in seconds: above `STALE_AFTER_S` only if it counts as stale.

        Args:
            client: its name, or ''.
            sent: when it was sent, by the client's clock, in POSIX time.
            wall: when it came, in POSIX time.
            now: when it came, by the steady clock of this process, in seconds.
        """
        clock = self._clients.pop(client) if client in self._clients else _ClientClock()
        self._clients[client] = clock
        if len(self._clients) > MAX_CLIENTS:
            del self._clients[next(iter(self._clients))]  # the one not heard for longest
        clock.forget(now - REMEMBERED_S)
        difference = now - sent
        smallest = clock.smallest(difference)
        age = wall - sent if smallest is None else difference - smallest
        if age > STALE_AFTER_S and not clock.is_steady(now, difference):
            return age
        clock.believe(now, difference)
        return min(age, STALE_AFTER_S)
