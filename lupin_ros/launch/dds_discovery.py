"""Detects the end of DDS discovery: every participant that holds a port of the domain has been seen.

Discovery gives no sign of being complete: on a busy machine the first nodes appear at once and the last a
second later, and a launcher that looks too early starts a second robot. The kernel's table of ports gives
the number of participants on this machine.
"""

from __future__ import annotations

import time
from typing import Protocol, TypeVar

from lupin_ros.adapter.dds.ports import participants
from lupin_ros.launch.environment import current_domain, is_local_only

_T = TypeVar("_T", covariant=True)

#: The network is looked at until nothing new has appeared for this long; other machines get this long to
#: appear; and no look takes longer than this. In seconds.
QUIET_S, LOOK_S, LIMIT_S = 0.3, 2.0, 6.0
#: So many looks in a row without anything new are quiet as well: a process that was not let work for a while
#: sees at its first look what it saw before, however long that was.
QUIET_LOOKS = 6


class NetworkView(Protocol[_T]):
    """A node that observes the graph."""

    def spin(self) -> None:
        """Spin it for a moment."""

    def look(self) -> _T:
        """Return a snapshot of the graph."""

    def strangers(self) -> int:
        """Return the number of participants besides its own."""


def settled(onlooker: NetworkView[_T]) -> _T:
    """Spin until all participants of this machine are known and nothing new appears, at most `LIMIT_S`.

    Return the last snapshot.
    """
    begin = changed = time.monotonic()
    seen, looks = onlooker.look(), 0
    while (now := time.monotonic()) - begin < LIMIT_S:
        quiet = now - changed >= QUIET_S and looks >= QUIET_LOOKS
        if quiet and _all_known(onlooker.strangers(), now - begin):
            break
        onlooker.spin()
        found, looks = onlooker.look(), looks + 1
        if found != seen:
            seen, changed, looks = found, now, 0
    return seen


def _all_known(strangers: int, looked: float) -> bool:
    """Whether discovery has had enough time and found as many participants as this machine has."""
    there = participants(current_domain())
    if there is None:
        return looked >= LOOK_S
    # Our own participant is among them.
    return strangers >= there - 1 and (is_local_only() or looked >= LOOK_S)
